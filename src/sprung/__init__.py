"""Sprung: suspension monitoring from sensors on the body."""

__version__ = "0.1.0"
