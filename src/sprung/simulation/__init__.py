"""Simulated recordings with known truth: linear and nonlinear vehicles, and imperfect sensors."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
