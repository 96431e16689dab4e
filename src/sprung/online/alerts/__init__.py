"""Alerts with hold-off, hysteresis, acknowledgement and shelving, and senders of notifications."""

from sprung._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
