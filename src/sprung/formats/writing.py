"""What the writers of all formats have in common: names that are read back, units, times and values."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung.errors import FormatError, ParameterError
from sprung.formats.table import MISSING, Column, column, is_number, is_time, known_unit, split_heading
from sprung.recording import Recording
from sprung.units import UNITS


@dataclass(frozen=True, eq=False, slots=True)
class Written:
    """Columns of a file that is read as a recording.

    Parameters
    ----------
    headings, units
        Heading of each channel, with its unit where the format states it nowhere else, and its unit.
    time, stamps
        Name and values of the time column: UTC date-times if the start is known, else seconds.
    values
        Samples in these units, shape (channels, samples).
    """

    headings: list[str]
    units: list[str]
    time: str
    stamps: NDArray[Any]
    values: Real


def written(recording: Recording, *, has_units: bool) -> Written:
    """Return the columns of a recording; `has_units`: whether headings state units.

    Raises
    ------
    ParameterError
        If a name would be read as a unit, a number, a missing value or a time column.
    """
    headings, units, factors = [], [], []
    for channel in recording.channels:
        unit, factor = next(
            ((unit, factor) for unit, (quantity, factor) in UNITS.items() if quantity == channel.quantity), ("", 1.0)
        )
        expected = Column(channel.name, channel.name)
        if unit and has_units:
            expected = Column(f"{channel.name} [{unit}]", channel.name, channel.quantity, factor)
        if not _reads_back(expected):
            raise ParameterError(
                f"channel name {channel.name!r} would not be read back from a file: rename it to plain text "
                "without a unit, not a number and not a name of a time column"
            )
        headings.append(expected.heading)
        units.append(unit)
        factors.append([factor])
    seconds = seconds_of(recording)
    name, stamps = "time", np.round(seconds, 9)
    if recording.start is not None:
        nanoseconds = recording.start + np.round(seconds * 1e9).astype(np.int64)
        name, stamps = "timestamp", nanoseconds.astype("M8[ns]")
    return Written(headings, units, name, stamps, recording.samples / np.array(factors))


def _reads_back(expected: Column) -> bool:
    """Return whether a file with the heading of a column gives this channel."""
    name = expected.name
    if not name.isprintable() or is_number(name) or name in MISSING or is_time(expected.heading):
        return False
    try:
        return column(expected.heading, path=Path()) == expected
    except FormatError:
        return False


def without_unit(name: str) -> str:
    """Return a name without a known unit in brackets at its end, with which it would not be read back."""
    plain, unit, _ = split_heading(name)
    return plain if plain and known_unit(unit or "") else name


def seconds_of(recording: Recording) -> Real:
    """Return the time of each sample since the first one [s]."""
    seconds: Real = np.arange(recording.n_samples) / recording.sampling_rate
    for gap in recording.gaps:
        seconds[gap.index :] += gap.duration
    return seconds
