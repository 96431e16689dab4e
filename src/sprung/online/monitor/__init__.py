"""The online monitor: vehicles in, modes, diagnoses and alerts out, for months."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
