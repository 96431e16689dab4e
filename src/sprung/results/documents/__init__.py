"""Published JSON documents, `sprung.*/1`: models of all of them, their files and their JSON Schemas."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
