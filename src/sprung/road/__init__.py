"""The road under a vehicle: its profile, International Roughness Index, classes of ISO 8608, potholes."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
