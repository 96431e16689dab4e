"""Archives of a fleet on Spark: the analyses of one window or vehicle, applied to all of them."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
