"""How a vehicle is, as one value: pages, reports, messages, commands, interface and exports render it."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
