"""The errors that sprung raises for its users, each with one sentence: what, where, what to do."""


class SprungError(Exception):
    """Base of all errors that sprung raises on purpose."""


class ParameterError(SprungError, ValueError):
    """An argument, option or setting that cannot be used."""


class FormatError(SprungError, ValueError):
    """A file that cannot be read as what it claims to be; the message names file and position."""


class DataError(SprungError):
    """Data that is well formed but not good enough: too short, dead, full of gaps."""


class IdentificationError(SprungError):
    """An identification that gave no answer on good data."""


class MissingPackageError(SprungError, ImportError):
    """An optional package that the called function needs is not installed."""
