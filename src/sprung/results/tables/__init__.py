"""Results as tables and sentences, for the command line, reports and pages."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
