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
    """Channels at another rate than the `others`, by their names; `left_out` has a reason by the name of each."""

    def __init__(self, message: str, others: tuple[str, ...] = (), left_out: tuple[tuple[str, str], ...] = ()) -> None:
        super().__init__(message)
        self.others = tuple(others)
        self.left_out = left_out


class IdentificationError(SprungError):
    """An identification without any mode, from good data."""


class MissingPackageError(SprungError, ImportError):
    """An optional package that the called function needs is not installed."""
