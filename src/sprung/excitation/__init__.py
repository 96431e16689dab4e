"""Excitation of a vehicle: random forces, hammer blows, base motions, roads, tracks, roller rigs, harmonics."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
