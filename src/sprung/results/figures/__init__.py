"""Figures: one function for each, from values to a matplotlib figure."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
