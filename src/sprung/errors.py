"""Errors that sprung raises for its users, each with one sentence: what, where, what to do."""


class SprungError(Exception):
    """Base class of all errors that sprung raises on purpose."""


class ParameterError(SprungError, ValueError):
    """An argument, option or setting that cannot be used."""


class FormatError(SprungError, ValueError):
    """A file that does not have the format it claims; the message names file and position."""


class DataError(SprungError):
    """Data that are well formed but insufficient: too short, dead, full of gaps."""


class MixedRatesError(DataError):
    """Samples of a channel at another rate than those of the others, whose names are `others`."""

    def __init__(self, message: str, others: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.others = others


class IdentificationError(SprungError):
    """An identification without any mode, from good data."""


class MissingPackageError(SprungError, ImportError):
    """An optional package that the called function needs is not installed."""
