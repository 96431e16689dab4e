"""Calibration: a vehicle file from a data sheet, completed from healthy drives."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
