"""Reports: results as self-contained pages of sentences, tables and figures."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
