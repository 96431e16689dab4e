"""Streams of a fleet on Spark: frames of vehicles as windows, assessed batch by batch."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
