"""Vehicles: description in a file, structure of masses and springs, matrices, exact modes and correlations."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
