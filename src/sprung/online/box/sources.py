"""Sources of samples: files, a watched folder, lines of text and a simulator, continued after a restart, at a pace.

A source is an iterator of blocks: short recordings without gaps, one after the other, each with the time of its first
sample. Single values with times become blocks of a constant rate (`Regular`).
"""

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung._checks import check_number
from sprung._display import counted
from sprung.errors import FormatError, ParameterError, SprungError
from sprung.formats import ENDINGS, ReadSettings, read_blocks
from sprung.formats.table import MISSING, Column, chosen_columns, is_number, is_time
from sprung.link import TIME_SET, TIME_UNKNOWN, joined
from sprung.recording import Channel, Recording
from sprung.results.tables.wording import format_time
from sprung.vehicles import Vehicle

if TYPE_CHECKING:
    from sprung.simulation import DriveSettings


#: Length of a block [s].
BLOCK = 1.0

# A time that is further than this from the latest one [s] indicates a pause, a clock that was set, or an error.
_STEP = 2.0
# Such times are accepted after this time [s], or number of messages, without others in between.
_WITNESSED = 1.0
_MAX_WITNESSES = 10_000
# Longest delay of the values of a channel after those of others of the same time [s].
_PATIENCE = 1.0
# Most values of a channel that are kept: only faulty senders send more in 3 s.
_MAX_VALUES = 20_000
# Largest plausible value of a sensor; squares of larger ones would overflow.
_LARGEST = 1e100
# A value this close to a sample, in sample intervals, is taken as it is: floating-point stamps are rounded.
_NEAR = 0.01


class Regular:
    """Resamples single values with times to blocks of a constant rate.

    Parameters
    ----------
    channels
        Channels, or their names.
    sampling_rate
        Sampling rate of the blocks [Hz], at most 100,000. Nothing is filtered: it must not be below that of the values.
    longest
        Longest time between two values of a channel [s], at most 2; samples within longer intervals are missing.
        Channels slower than 2 Hz need more than the default.

    Raises
    ------
    ParameterError
        If channels are missing or repeated, or a number is out of range.

    Notes
    -----
    The first time is that of the first sample. Samples are interpolated linearly between values; they are missing
    before the first value of a channel, after its last one, next to a missing value (NaN) and between values more than
    `longest` apart, unless a value is within 1 % of a sample interval.

    A block is complete once a further second has arrived, so values of one time need not arrive together. The times of
    a channel must increase: a value that is not later than the one before is discarded.

    A time more than 2 s from the latest one, forward or back, is a pause, a clock that was set, or an error. It is
    accepted once such times have continued for 1 s: then the present blocks are closed, and new ones begin. Until then
    a single time that agrees with the old ones indicates an error, and the deviating values are discarded. If the
    clocks of senders disagree permanently, the values of the first sender are kept.

    Memory is bounded for any input.

    Examples
    --------
    >>> regular = Regular(["acc_fl"], 4.0)
    >>> [block] = [block for k in range(9) for block in regular.add(k * 250_000_000, {"acc_fl": k})]
    >>> block.samples.tolist(), block.start
    ([[0.0, 1.0, 2.0, 3.0]], 0)
    >>> [block.samples.tolist() for block in regular.finish()]
    [[[4.0, 5.0, 6.0, 7.0]], [[8.0]]]
    """

    def __init__(self, channels: Sequence[Channel | str], sampling_rate: float, *, longest: float = 0.5) -> None:
        self._channels = tuple(Channel(item) if isinstance(item, str) else item for item in channels)
        names = [channel.name for channel in self._channels]
        if not names:
            raise ParameterError("no channel is named: name those of the blocks")
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ParameterError(f"channel {repeated[0]!r} is named more than once: name it once")
        self._sampling_rate = check_number("sampling_rate", sampling_rate, above=0, at_most=1e5)
        self._longest = round(check_number("longest", longest, above=0, at_most=_STEP) * 1e9)
        self._hold = max(round(_PATIENCE * 1e9), self._longest)
        self._step = max(1, round(BLOCK * sampling_rate))
        self._points: dict[str, deque[tuple[int, float]]] = {name: deque() for name in names}
        self._waiting: list[tuple[int, dict[str, float]]] = []
        self._origin = 0
        self._n_done = 0
        self._latest: int | None = None

    def add(self, when: int, values: Mapping[str, float]) -> list[Recording]:
        """Take in values at a time (UTC ns), and return the blocks that are complete with them.

        Values of other channels are ignored.
        """
        known = {name: float(value) for name, value in values.items() if name in self._points}
        if not known:
            return []
        if not 0 <= when < 1 << 62:
            return []
        if self._agrees(when):
            self._doubt()
            self._take(when, known)
            return self._complete()
        if self._waiting and abs(when - self._waiting[-1][0]) > _STEP * 1e9:
            self._doubt()
        self._waiting.append((when, known))
        if when - self._waiting[0][0] < _WITNESSED * 1e9 and len(self._waiting) < _MAX_WITNESSES:
            return []
        return self._begin_anew()

    def finish(self) -> list[Recording]:
        """Return the samples up to the latest value; values added afterwards begin a new block."""
        self._doubt()
        blocks = self._rest()
        self._forget()
        return blocks

    def _agrees(self, when: int) -> bool:
        """Return whether a time continues from the latest accepted one, not from unconfirmed ones."""
        if self._latest is None:
            return True
        off = abs(when - self._latest)
        return off <= _STEP * 1e9 and not (self._waiting and abs(when - self._waiting[-1][0]) < off)

    def _doubt(self) -> None:
        """Discard values whose times were not confirmed."""
        self._waiting = []

    def _begin_anew(self) -> list[Recording]:
        """Close the present blocks, and continue with the values at other times."""
        blocks = self._rest()
        self._forget()
        waiting, self._waiting = self._waiting, []
        for when, values in waiting:
            self._take(when, values)
            blocks += self._complete()
        return blocks

    def _forget(self) -> None:
        """Begin with the next value."""
        for points in self._points.values():
            points.clear()
        self._latest = None

    def _take(self, when: int, values: Mapping[str, float]) -> None:
        if self._latest is None:
            self._origin = when
            self._n_done = 0
            self._latest = when
        self._latest = max(self._latest, when)
        for name, value in values.items():
            points = self._points[name]
            if not (points and when <= points[-1][0]) and len(points) < _MAX_VALUES:
                points.append((when, value if abs(value) <= _LARGEST else np.nan))

    def _complete(self) -> list[Recording]:
        blocks = []
        while self._latest is not None and self._time(self._step - 1) + self._hold <= self._latest:
            blocks.append(self._block(self._step))
        return [block for block in blocks if block is not None]

    def _rest(self) -> list[Recording]:
        """Return the blocks up to the latest value."""
        blocks = []
        while (n_left := self._n_left()) > 0:
            blocks.append(self._block(min(self._step, n_left)))
        return [block for block in blocks if block is not None]

    def _n_left(self) -> int:
        """Return the number of samples up to the latest value."""
        if self._latest is None:
            return 0
        return math.floor((self._latest - self._time(0)) * self._sampling_rate / 1e9 + _NEAR) + 1

    def _time(self, index: int) -> int:
        """Return the time of a sample of the next block, UTC ns."""
        return self._origin + round((self._n_done + index) * 1e9 / self._sampling_rate)

    def _block(self, n_samples: int) -> Recording | None:
        """Return the next block, None if it is empty, and release values before its end."""
        begin = self._time(0)
        times = np.array([self._time(index) - begin for index in range(n_samples)], dtype=np.int64)
        samples = np.array([self._at(name, begin, times) for name in self._points])
        self._n_done += n_samples
        for points in self._points.values():
            while len(points) > 1 and points[1][0] <= self._time(0):
                points.popleft()
        return None if np.isnan(samples).all() else Recording(samples, self._sampling_rate, self._channels, begin)

    def _at(self, name: str, begin: int, times: NDArray[np.int64]) -> Real:
        """Return a channel at times after `begin` [ns], shape (samples,)."""
        points = self._points[name]
        if not points:
            return np.full(times.size, np.nan)
        known = np.array([when - begin for when, _ in points], dtype=np.int64)
        values = np.array([value for _, value in points])
        following = np.minimum(np.searchsorted(known, times), known.size - 1)
        before = np.maximum(following - 1, 0)
        width = np.maximum(known[following] - known[before], 1)
        is_between = (known[before] < times) & (times < known[following]) & (width <= self._longest)
        share = (times - known[before]) / width
        lines = np.where(is_between, (1 - share) * values[before] + share * values[following], np.nan)
        nearest = np.where(times - known[before] < known[following] - times, before, following)
        is_near = np.abs(known[nearest] - times) * self._sampling_rate <= _NEAR * 1e9
        return np.where(np.isnan(lines) & is_near, values[nearest], lines)


#: Time between two checks of a folder, and for which a file must be unchanged before it is read [s].
SETTLED = 2.0
#: Name of a stream of lines in messages.
_NAME = "standard input"
#: Longest line [characters].
_LONGEST_LINE = 1 << 16
#: A longer wait for a line [s] may be a pause of the sender.
_PAUSE = 2.0


def blocks_of(recording: Recording, *, length: float = BLOCK) -> Iterator[Recording]:
    """Yield a recording in blocks of about `length` [s]; no block spans a gap.

    The last block before a gap or the end has 0.5 to 1.5 times this length, or is the whole stretch.

    Raises
    ------
    ParameterError
        If the length is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> recording = Recording(np.zeros((1, 1000)), 100.0, (Channel("acc_fl", "acceleration"),), start=0)
    >>> [(block.start, block.n_samples) for block in blocks_of(recording, length=3.0)]
    [(0, 300), (3000000000, 300), (6000000000, 400)]
    """
    step = max(1, round(check_number("length", length, above=0) * recording.sampling_rate))
    for stretch in recording.stretches():
        n_samples = stretch.stop - stretch.start
        edges = [stretch.start + k * step for k in range(max(1, (n_samples + step // 2) // step))]
        for first, last in zip(edges, [*edges[1:], stretch.stop], strict=True):
            if last > first:
                yield replace(recording.part(first, last), gaps=(), history=())


def from_files(
    paths: Iterable[str | PathLike[str]],
    *,
    start: int,
    settings: ReadSettings | None = None,
) -> Iterator[Recording]:
    r"""Yield the blocks of files; joined, they are the recordings that `sprung.formats.read` returns.

    Parameters
    ----------
    paths
        Files in order of time.
    start
        Time of the first file without time, UTC ns; others without time follow it.
    settings
        As for `sprung.formats.read`.

    Raises
    ------
    SprungError
        As raised by `sprung.formats.read`, before the first block of the file.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.formats import ReadSettings
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "run.csv")
    ...     _ = path.write_text("acc_fl [g]" + 300 * "\n0.5")
    ...     blocks = list(from_files([path], start=0, settings=ReadSettings(sampling_rate=100.0)))
    >>> [(block.start, block.n_samples, float(block.samples[0, 0])) for block in blocks]
    [(0, 100, 4.903325), (1000000000, 100, 4.903325), (2000000000, 100, 4.903325)]
    """
    for path in paths:
        start = yield from blocks_of_file(path, start=start, settings=settings)


def blocks_of_file(
    path: str | PathLike[str], *, start: int, settings: ReadSettings | None
) -> Generator[Recording, None, int]:
    """Yield the blocks of a file, as `from_files`, and return the start of the next one without time, UTC ns."""
    elapsed = 0.0
    held: Recording | None = None
    for part in read_blocks(path, settings=settings):
        begin = part.start
        if begin is None:
            begin = start + round(elapsed * 1e9)
            elapsed += part.duration + sum(gap.duration for gap in part.gaps)
        timed = replace(part, start=begin)
        # Pieces of a file that is read in parts have no gap between them: a block may continue in the next piece.
        blocks = list(blocks_of(timed if held is None else joined([held, timed])))
        yield from blocks[:-1]
        held = blocks[-1] if blocks else None
    if held is not None:
        yield held
    return start + round(elapsed * 1e9)


def from_simulator(
    vehicle: Vehicle, settings: "Callable[[int], DriveSettings]", *, start: int, seed: int = 0
) -> Iterator[Recording]:
    """Yield the blocks of an endless simulated drive.

    Parameters
    ----------
    vehicle
        Vehicle to drive.
    settings
        Function from the number of a piece of the drive, from 0, to its settings.
    start
        Time of the first sample, UTC ns.
    seed
        Seed of the drive.

    Examples
    --------
    >>> from itertools import islice
    >>> from sprung.simulation import RoadDrive
    >>> from sprung.vehicles import read_vehicle
    >>> blocks = from_simulator(read_vehicle("zafira"), lambda number: RoadDrive(duration=20.0), start=0)
    >>> [(block.start, block.n_samples) for block in islice(blocks, 2)]
    [(0, 200), (1000000000, 200)]
    """
    from sprung.simulation import simulate_drive

    number = 0
    while True:
        run = simulate_drive(vehicle, settings(number), seed=[seed, number]).recording
        yield from blocks_of(replace(run, start=start))
        start += round(run.duration * 1e9)
        number += 1


def after(blocks: Iterable[Recording], when: int | None) -> Iterator[Recording]:
    """Yield the blocks after a time (UTC ns), at which a stopped box continues; None: all blocks.

    Once the time has been reached all blocks are yielded, even if the clock of the source then goes back.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> recording = Recording(np.zeros((1, 1000)), 100.0, (Channel("acc_fl", "acceleration"),), start=0)
    >>> blocks = after(blocks_of(recording, length=5.0), when=3_000_000_000)
    >>> [(block.start, block.n_samples) for block in blocks]
    [(3000000000, 200), (5000000000, 500)]
    """
    for block in blocks:
        first = 0
        if when is not None and block.start is not None:
            first = max(0, round((when - block.start) * block.sampling_rate / 1e9))
        if first < block.n_samples:
            when = None
            yield block.part(first, block.n_samples) if first else block


def paced(
    blocks: Iterable[Recording],
    pace: float | None,
    *,
    clock: Callable[[], float],
    sleep: Callable[[float], None],
) -> Iterator[Recording]:
    """Yield blocks at a pace, each when it would have been complete.

    Parameters
    ----------
    blocks
        Blocks in order of time; gaps between them are skipped.
    pace
        Speed above 0, as a multiple of real time; None: no limit.
    clock
        Present time [s] of a monotonic clock.
    sleep
        Function that waits for a time [s].

    Raises
    ------
    ParameterError
        If the pace is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> recording = Recording(np.zeros((1, 1000)), 100.0, (Channel("acc_fl", "acceleration"),), start=0)
    >>> waits = []
    >>> blocks = paced(blocks_of(recording, length=5.0), 2.0, clock=lambda: sum(waits), sleep=waits.append)
    >>> [(block.n_samples, sum(waits)) for block in blocks]
    [(500, 2.5), (500, 5.0)]
    """
    if pace is not None:
        check_number("pace", pace, above=0)
    begin, driven = clock(), 0.0
    for block in blocks:
        driven += block.duration
        wait = 0.0 if pace is None else begin + driven / pace - clock()
        if wait > 0:
            sleep(wait)
        yield block


def from_folder(
    folder: Path,
    *,
    start: Callable[[], int],
    is_done: Callable[[], bool],
    sleep: Callable[[float], None],
    done: Callable[[str, str], None],
    known: Sequence[str] = (),
    settings: ReadSettings | None = None,
) -> Iterator[Recording]:
    r"""Yield the blocks of files that appear in a folder, by name.

    Parameters
    ----------
    folder
        Folder in which files of any readable format appear. A file is read once, when it has not changed for 2 s; a
        new one needs a new name.
    start
        Function that returns the time of a file without time, UTC ns; it follows the one before if that ends later.
    is_done
        Function that returns whether to stop, called once all settled files are read.
    sleep
        Function that waits for a time [s].
    done
        Function called with the name of each file that was read, and the reason if it was not read completely (empty if
        it was).
    known
        Names of files that were read before.
    settings
        As for `sprung.formats.read`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> read = []
    >>> with TemporaryDirectory() as name:
    ...     folder = Path(name)
    ...     _ = (folder / "run.csv").write_text("t,acc_fl" + "".join(f"\n{k / 100},0.5" for k in range(300)))
    ...     waits = {"is_done": lambda: bool(read), "sleep": lambda seconds: None}
    ...     blocks = list(from_folder(folder, start=lambda: 0, done=lambda *file: read.append(file), **waits))
    >>> sum(block.n_samples for block in blocks), read
    (300, [('run.csv', '')])
    """
    finished = set(known)
    seen: dict[str, tuple[int, int]] = {}
    free = 0
    while True:
        now = _states(folder, finished)
        for name in [name for name in sorted(now) if now[name] == seen.get(name) or _is_old(now[name])]:
            begin, problem = max(start(), free), ""
            try:
                end = yield from blocks_of_file(folder / name, start=begin, settings=settings)
                free = end if end > begin else free
            except SprungError as error:
                problem = str(error)
            finished.add(name)
            done(name, problem)
        seen = now
        if is_done():
            return
        sleep(SETTLED)


def _states(folder: Path, finished: set[str]) -> dict[str, tuple[int, int]]:
    """Return size and time of change [ns] of each file that is still to be read; hidden ones are ignored."""
    states = {}
    try:
        for path in folder.iterdir():
            is_wanted = path.name.lower().endswith(ENDINGS) and not path.name.startswith(".")
            if is_wanted and path.name not in finished and path.is_file():
                status = path.stat()
                states[path.name] = status.st_size, status.st_mtime_ns
    except OSError:
        # A file or the folder was removed meanwhile: the next pass finds what is left.
        return states
    return states


def _is_old(state: tuple[int, int]) -> bool:
    """Return whether a file is unchanged for long; clocks of other machines may be wrong."""
    return time.time_ns() - state[1] > SETTLED * 1e9


class LineStream(Protocol):
    """Stream of text that is read line by line, such as `sys.stdin`."""

    def readline(self, limit: int, /) -> str:
        """Return the next line, at most `limit` characters of it; empty at the end."""


def from_lines(lines: LineStream, *, sampling_rate: float, start: Callable[[], int]) -> Iterator[Recording]:
    r"""Yield the blocks of comma-separated values as they arrive, such as from standard input.

    Parameters
    ----------
    lines
        Lines of the stream. The first has the names of the channels, with units in brackets as in files; the others
        have a number for each, or nothing where it is missing.
    sampling_rate
        Sampling rate of the lines [Hz].
    start
        Function that returns the present time, UTC ns.

    Raises
    ------
    FormatError
        If a line cannot be read, with its number, after the samples before it.
    ParameterError
        If the sampling rate is not above 0.

    Notes
    -----
    The first line of values has its time of arrival; the times of later lines follow from their number. After a pause
    of more than 2 s, or if the clock was set back meanwhile, a new block begins at the arrival of the next line.

    Examples
    --------
    >>> from io import StringIO
    >>> lines = StringIO("acc_fl [g]" + 200 * "\n0.5")
    >>> blocks = list(from_lines(lines, sampling_rate=100.0, start=lambda: 0))
    >>> [(block.start, block.n_samples, float(block.samples[0, 0])) for block in blocks]
    [(0, 100, 4.903325), (1000000000, 100, 4.903325)]
    """
    check_number("sampling_rate", sampling_rate, above=0)
    texts = _texts(lines)
    columns = _columns(texts)
    channels = tuple(Channel(column.name, column.quantity) for column in columns)
    factors = np.array([[column.factor] for column in columns])
    n_full = max(1, round(BLOCK * sampling_rate))
    pause = max(_PAUSE, 5 / sampling_rate) * 1e9
    rows: list[list[float]] = []
    following: int | None = None  # time of the next block; None: that of the arrival of its first line

    def block() -> Iterator[Recording]:
        nonlocal following
        if rows and following is not None:
            yield Recording(np.array(rows).T * factors, sampling_rate, channels, following)
            following += round(len(rows) * 1e9 / sampling_rate)
            rows.clear()

    began = start()
    try:
        for number, text in texts:
            came = start()
            if following is not None:
                # A late line is not a pause if lines before it were early, as from a sender that writes in batches.
                is_late = came - following - len(rows) * 1e9 / sampling_rate > pause
                if came - began < -pause or (came - began > pause and is_late):
                    yield from block()
                    following = None
            rows.append(_values(text, number, columns))
            following = came if following is None else following
            if len(rows) >= n_full:
                yield from block()
            began = start()
    except FormatError:
        yield from block()
        raise
    yield from block()


def _texts(lines: LineStream) -> Iterator[tuple[int, str]]:
    """Yield the lines that are not blank, with their numbers."""
    number = 0
    while True:
        number += 1
        try:
            line = lines.readline(_LONGEST_LINE)
        except UnicodeDecodeError:
            raise FormatError(f"line {number} of {_NAME} is not text in UTF-8: send names and numbers") from None
        if not line:
            return
        if len(line) >= _LONGEST_LINE:
            raise FormatError(
                f"line {number} of {_NAME} is longer than {_LONGEST_LINE} characters: end each line of values"
            )
        if line.strip():
            yield number, line.removeprefix("\ufeff").strip()


def _columns(texts: Iterator[tuple[int, str]]) -> tuple[Column, ...]:
    """Return the channels that the first line names."""
    number, text = next(texts, (0, ""))
    headings = [_bare(heading) for heading in text.split(",")]
    if not text:
        raise FormatError(f"{_NAME} is empty: the first line must name the channels")
    if not all(headings) or any(is_number(heading) for heading in headings):
        raise FormatError(
            f"line {number} of {_NAME} is {text[:60]!r}: it must name the channels, separated by commas, before the "
            "lines of numbers"
        )
    stamped = [heading for heading in headings if is_time(heading)]
    if stamped:
        raise FormatError(f"{_NAME} has a time column {stamped[0]!r}: leave it out, as lines are timed on arrival")
    return chosen_columns(headings, None, path=Path(_NAME))


def _values(text: str, number: int, columns: tuple[Column, ...]) -> list[float]:
    """Return the numbers of a line; NaN where one is missing."""
    fields = [_bare(field) for field in text.split(",")]
    if len(fields) != len(columns):
        found = f"{counted(len(fields), 'value')} for {counted(len(columns), 'channel')} ({text[:60]!r})"
        raise FormatError(
            f"line {number} of {_NAME} has {found}: send one for each, or nothing between commas where it is missing"
        )
    values = []
    for field, column in zip(fields, columns, strict=True):
        if field in MISSING:
            values.append(np.nan)
        elif is_number(field) and abs(float(field)) < _LARGEST:
            values.append(float(field))
        else:
            raise FormatError(
                f"line {number} of {_NAME}, channel {column.name!r}: {field[:40]!r} is not a measured value: send a "
                "number, or nothing where it is missing"
            )
    return values


def _bare(field: str) -> str:
    """Return the contents of a field, without blanks and quotes around it."""
    text = field.strip()
    return text[1:-1].strip() if len(text) > 1 and text[0] == text[-1] == '"' else text


@dataclass(frozen=True, slots=True)
class ReplayTimes:
    """Times that files without start time get in a replay.

    Parameters
    ----------
    start
        Time of the first sample of the first of these files, UTC ns; the others follow.
    untimed
        Names of these files.
    is_given
        Whether the time was given by the operator.
    """

    start: int
    untimed: tuple[str, ...]
    is_given: bool

    @property
    def status(self) -> int:
        """Status of the time of the samples, as in `Frame`."""
        return TIME_UNKNOWN if self.untimed and not self.is_given else TIME_SET

    @property
    def notes(self) -> list[str]:
        """Sentence about files without start time, or about a time that was given for none; else empty."""
        if not self.untimed:
            return ["--start is not used: every file states its own start time"] * self.is_given
        others = f" and {counted(len(self.untimed) - 1, 'other file')}" if self.untimed[1:] else ""
        how = "as given" if self.is_given else "so that they end now; give --start TIME for the time of recording"
        begin = format_time(self.start)
        return [f"no start time in {self.untimed[0]}{others}: samples count from {begin} UTC on, {how}"]


def replay_times(
    paths: Sequence[str | PathLike[str]],
    *,
    now: int,
    start: str | None = None,
    settings: ReadSettings | None = None,
) -> ReplayTimes:
    """Return the times of recordings in a replay: files without start time end now, unless one is given.

    Parameters
    ----------
    paths
        Files in order of time.
    now
        Present time, UTC ns.
    start
        Time of the first sample of the first file without start time, ISO 8601, UTC unless it has another offset; None:
        unknown.
    settings
        As for `sprung.formats.read`.

    Raises
    ------
    ParameterError
        If the time cannot be read.
    SprungError
        As raised by `sprung.formats.read`.
    """
    given = None if start is None else _utc(start)
    found = {str(path): _untimed_duration(path, settings) for path in paths}
    durations = {name: duration for name, duration in found.items() if duration is not None}
    begin = now - round(1e9 * sum(durations.values())) if given is None else given
    return ReplayTimes(begin, tuple(durations), given is not None)


def _untimed_duration(path: str | PathLike[str], settings: ReadSettings | None) -> float | None:
    """Return the duration of a file without start time, with its gaps [s]; None if it has one."""
    duration = 0.0
    for part in read_blocks(path, settings=settings):
        if part.start is not None:
            return None
        duration += part.duration + sum(gap.duration for gap in part.gaps)
    return duration


def _utc(text: str) -> int:
    """Return the time in a text, UTC ns."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        raise ParameterError(f"--start {text!r} is not a time: write it like 2026-11-21T08:30 (UTC)") from None
    return round((time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()) * 10**9
