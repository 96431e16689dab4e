"""Whittle likelihood of a vehicle on its road: springs, dampers and tyres of every corner from the body's motion."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
