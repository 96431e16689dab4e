"""Recordings: samples with channels, units, positions, gaps, and the history of their processing."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_each, check_number, check_one_of, check_type, freeze
from sprung._display import Drawable, Tabular, counted, in_short, listed
from sprung.errors import DataError, ParameterError

#: Quantities that a channel may measure, with their SI units. An unknown quantity has no unit.
QUANTITIES = MappingProxyType(
    {
        "acceleration": "m/s^2",
        "angular_velocity": "rad/s",
        "speed": "m/s",
        "velocity": "m/s",
        "displacement": "m",
        "angle": "rad",
        "strain": "1",
        "force": "N",
        "temperature": "degC",
        "pressure": "Pa",
        "distance": "m",
        "unknown": "",
    }
)

#: Names of the channels with latitude and longitude [degrees], in lower case.
PLACES = (
    ("latitude", "lat", "gnss_latitude", "gps_latitude", "gps_lat"),
    ("longitude", "lon", "lng", "gnss_longitude", "gps_longitude", "gps_lon"),
)
#: Largest relative difference of the sampling rates of pieces of one measurement: clocks of loggers drift.
_SAME_RATE = 1e-3


@dataclass(frozen=True, slots=True)
class Channel:
    """One measured quantity at one place.

    Parameters
    ----------
    name
        Name in the file and in all results.
    quantity
        Key of `QUANTITIES`; "unknown" where the source does not state it. Samples of a known quantity are in its SI
        unit.
    position
        Position x forward, y left, z up from the body's centre of gravity [m] (ISO 8855); None where unknown.
    direction
        Unit vector of the measured axis; None where unknown.
    comment, calibration
        Description of the channel and of its calibration (sensor, sensitivity, date) as in the file; channels that
        differ in these only are equal.

    Raises
    ------
    ParameterError
        If the name is empty, or the quantity is not a key of `QUANTITIES`.
    """

    name: str
    quantity: str = "unknown"
    position: tuple[float, float, float] | None = None
    direction: tuple[float, float, float] | None = None
    comment: str = field(default="", compare=False)
    calibration: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise ParameterError("a channel has an empty name: give every column a name")
        check_one_of(f"quantity of channel {self.name!r}:", self.quantity, QUANTITIES)

    @property
    def unit(self) -> str:
        """SI unit of the samples; empty if the quantity is unknown."""
        return QUANTITIES[self.quantity]


@dataclass(frozen=True, slots=True)
class Gap:
    """Interruption before sample `index`, during which `duration` seconds were not recorded."""

    index: int
    duration: float


@dataclass(frozen=True, eq=False, slots=True)
class Recording(Tabular, Drawable):
    """Samples of several channels at one rate, with their meaning and their history.

    Parameters
    ----------
    samples
        Samples, in SI units where the quantity is known, shape (channels, samples); NaN where a value is missing.
    sampling_rate
        Sampling rate [Hz], above 0.
    channels
        Channel of each row of `samples`, with distinct names.
    start
        Time of the first sample, UTC in nanoseconds since 1970; None where unknown.
    gaps
        Interruptions by rising index. Nothing in sprung filters, interpolates or correlates across a gap.
    history
        Processing steps since reading, one line each, oldest first.
    comment
        Comment on the measurement, as in the file.
    source
        File that it was read from, which errors name; empty for none.

    Raises
    ------
    ParameterError
        If shapes, names, gaps or rate are inconsistent.
    """

    samples: Real
    sampling_rate: float
    channels: tuple[Channel, ...]
    start: int | None = None
    gaps: tuple[Gap, ...] = ()
    history: tuple[str, ...] = ()
    comment: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        freeze(self, samples=2)
        check_number("sampling_rate", self.sampling_rate, above=0)
        if len(self.channels) != self.samples.shape[0]:
            raise ParameterError(
                f"{len(self.channels)} channels are described, but samples hold {self.samples.shape[0]} rows"
            )
        repeated = sorted({name for name in self.names if self.names.count(name) > 1})
        if repeated:
            raise ParameterError(f"channel name {repeated[0]!r} occurs more than once: rename one of them")
        indices = [0, *(gap.index for gap in self.gaps), self.n_samples]
        if any(late <= early for early, late in itertools.pairwise(indices)) and self.gaps:
            raise ParameterError(f"gap indices {indices[1:-1]} must rise between 1 and {self.n_samples - 1}")

    def __repr__(self) -> str:
        """Return size, rate, gaps, start and channels in words."""
        size = f"Recording: {self.n_samples} samples at {self.sampling_rate:.8g} Hz ({self.duration:.5g} s)"
        gaps = f", {counted(len(self.gaps), 'gap')}" if self.gaps else ""
        start = "" if self.start is None else f", from {datetime.fromtimestamp(self.start // 10**9, tz=UTC):%F %T} UTC"
        units = (f"{channel.name} [{channel.unit or '?'}]" for channel in self.channels)
        last = f"last step: {self.history[-1]}" if self.history else ""
        return in_short(size + gaps + start, listed(units), last)

    @property
    def names(self) -> tuple[str, ...]:
        """Channel names, in the order of the rows."""
        return tuple(channel.name for channel in self.channels)

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return int(self.samples.shape[1])

    @property
    def duration(self) -> float:
        """Recorded time without gaps [s]."""
        return self.n_samples / self.sampling_rate

    def index(self, name: str) -> int:
        """Return the row of the channel called `name`.

        Raises
        ------
        ParameterError
            If the recording has no channel of that name.
        """
        if name not in self.names:
            with naming(self):
                raise ParameterError(f"there is no channel {name!r}: the recording has {', '.join(self.names)}")
        return self.names.index(name)

    def __getitem__(self, name: str) -> Real:
        """Return the samples of the channel called `name`, shape (samples,)."""
        check_type("name", name, str, advice='the name of a channel: recording["acc_fl"]')
        return self.samples[self.index(name)]

    def select(self, names: Sequence[str]) -> "Recording":
        """Return the recording with only the channels in `names`, in that order; one name is one channel."""
        names = [names] if isinstance(names, str) else names
        rows = [self.index(name) for name in names]
        return replace(self, samples=self.samples[rows], channels=tuple(self.channels[row] for row in rows))

    def stretches(self) -> Iterator[slice]:
        """Yield the sample ranges between gaps."""
        edges = [0, *(gap.index for gap in self.gaps), self.n_samples]
        for first, last in itertools.pairwise(edges):
            yield slice(first, last)

    def part(self, first: int, last: int) -> "Recording":
        """Return the samples from `first` to before `last`, with the gaps among them."""
        start = self.start
        if start is not None:
            lost = sum(gap.duration for gap in self.gaps if gap.index <= first)
            start += round(1e9 * (first / self.sampling_rate + lost))
        gaps = tuple(replace(gap, index=gap.index - first) for gap in self.gaps if first < gap.index < last)
        return replace(self, samples=self.samples[:, first:last], start=start, gaps=gaps)

    def changed(self, step: str, **fields: Any) -> "Recording":
        """Return a copy with other `fields` and `step` added to the history."""
        return replace(self, history=(*self.history, step), **fields)


@contextmanager
def naming(recording: Recording) -> Iterator[None]:
    """Begin the message of an error with the file that the recording was read from."""
    try:
        yield
    except (DataError, ParameterError) as error:
        if recording.source and recording.source not in str(error):
            error.args = (f"{recording.source}: {error}", *error.args[1:])
        raise


def each_recording(recordings: Recording | Iterable[Recording]) -> Iterable[Recording]:
    """Return one recording or several as an iterable, which is read once if it is an iterator.

    Raises
    ------
    ParameterError
        If anything other than recordings is given, such as a path or an array.

    Examples
    --------
    >>> run = Recording(np.zeros((1, 4)), 100.0, (Channel("acc", "acceleration"),))
    >>> [part.n_samples for part in each_recording(run)], [part.n_samples for part in each_recording([run, run])]
    ([4], [4, 4])
    """
    return [recordings] if isinstance(recordings, Recording) else check_each("recordings", recordings, Recording)


class Piece(Protocol):
    """Consecutive samples of several channels; a `Recording` is one."""

    @property
    def samples(self) -> Real:
        """Samples in SI units, shape (channels, samples)."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Channel of each row."""

    @property
    def sampling_rate(self) -> float:
        """Sampling rate [Hz]."""

    @property
    def start(self) -> int | None:
        """Time of the first sample, UTC in nanoseconds since 1970; None where unknown."""

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """Gaps within the samples."""


def join(pieces: Sequence[Piece], *, waits: Sequence[float | None] | None = None) -> Recording:
    """Put pieces of one measurement one after another.

    Parameters
    ----------
    pieces
        One or more pieces with the same channels and, but for the clock, the same sampling rate.
    waits
        Time that was not recorded before each piece but the first [s], one less than there are pieces; None for samples
        that continue without a gap. Default: no gap between any two.

    Returns
    -------
    Recording
        Recording with the start and the rate of the first piece, the gaps of all pieces and those between them, without
        history.

    Raises
    ------
    ParameterError
        If there is no piece, the pieces differ in channels or sampling rate, or the number of waits is wrong.

    Examples
    --------
    >>> half = Recording(np.zeros((1, 50)), 100.0, (Channel("a"),))
    >>> join([half, half], waits=[2.0]).gaps
    (Gap(index=50, duration=2.0),)
    """
    if not pieces:
        raise ParameterError("there is nothing to join: give at least one piece")
    first = pieces[0]
    if waits is None:
        waits = [None] * (len(pieces) - 1)
    if len(waits) != len(pieces) - 1:
        raise ParameterError(f"{len(pieces)} pieces need {len(pieces) - 1} waits, but there are {len(waits)}")
    samples = [piece.samples for piece in pieces]
    starts = itertools.accumulate((part.shape[1] for part in samples), initial=0)
    gaps: list[Gap] = []
    for piece, wait, start in zip(pieces, [None, *waits], starts, strict=False):
        if piece.channels != first.channels or abs(piece.sampling_rate / first.sampling_rate - 1) > _SAME_RATE:
            raise ParameterError("pieces of one recording must have the same channels and sampling rate")
        if wait is not None:
            gaps.append(Gap(start, wait))
        gaps += [replace(gap, index=gap.index + start) for gap in piece.gaps]
    return Recording(
        samples=np.concatenate(samples, axis=1),
        sampling_rate=first.sampling_rate,
        channels=first.channels,
        start=first.start,
        gaps=tuple(gaps),
    )
