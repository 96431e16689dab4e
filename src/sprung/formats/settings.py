"""Settings of reading a file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sprung._checks import check_number, check_one_of
from sprung.errors import ParameterError

#: Seconds in each unit that a time column may carry.
TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0}
#: Digits of the time of day as one number: its last units in a second, before a decimal point.
CLOCK_FACES = {"HHMMSS": 1, "HHMMSScc": 100, "HHMMSSmmm": 1000}


@dataclass(frozen=True, slots=True)
class ReadSettings:
    """What to read from a file, and what the file does not state.

    Parameters
    ----------
    sampling_rate
        Sampling rate [Hz], above 0, of a file without time, or with an inconsistent time column, which it replaces.
    channels
        Names of the channels to read, in this order, or the only one; None: all.
    groups
        Names of the groups to read, the first of which gives the sample times; empty: all, which must share a clock.
    time
        Name of the time column; None: found by its name and behaviour.
    time_unit
        Unit of the time column, a key of `TIME_UNITS` or `CLOCK_FACES`; None: as stated in the file or found by its
        behaviour.
    start, end
        Part of the file to read [s after its first sample]; None: from its beginning, to its end.
    databases
        CAN databases (DBC) that decode raw CAN frames.
    names
        TOML file with further names of channels; None: those of the package.
    bridge
        Longest gap [s] across which samples are interpolated; 0: none.

    Raises
    ------
    ParameterError
        If a value is outside its range.
    """

    sampling_rate: float | None = None
    channels: Sequence[str] | None = None
    groups: Sequence[str] = ()
    time: str | None = None
    time_unit: str | None = None
    start: float | None = None
    end: float | None = None
    databases: Sequence[Path] = ()
    names: Path | None = None
    bridge: float = 0.0

    def __post_init__(self) -> None:
        if self.sampling_rate is not None:
            check_number("sampling_rate", self.sampling_rate, above=0, advice="state it in Hz")
        for name in ("channels", "groups"):
            given = getattr(self, name)
            if isinstance(given, str):
                object.__setattr__(self, name, (given,))
        if self.time_unit is not None:
            check_one_of("time_unit", self.time_unit, [*TIME_UNITS, *CLOCK_FACES])
        check_number("bridge", self.bridge, at_least=0)
        if self.start is not None:
            check_number("start", self.start, at_least=0)
        if self.end is not None and self.end <= (self.start or 0.0):
            raise ParameterError(f"end={self.end:g} must be above start={self.start or 0:g}: state both in seconds")
