"""Sources of samples: files and a simulator, continued after a restart, and replayed at a pace.

A source is an iterator of blocks: short recordings without gaps, one after the other, each with the time of its first
sample.
"""

from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING

from sprung._checks import check_number
from sprung.formats import ReadSettings, read_blocks
from sprung.link import joined
from sprung.online.box.resampling import BLOCK
from sprung.recording import Recording
from sprung.vehicles import Vehicle

if TYPE_CHECKING:
    from sprung.simulation import DriveSettings


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
    """Return blocks at a pace.

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
    if pace is None:
        return iter(blocks)
    return _paced(blocks, check_number("pace", pace, above=0), clock, sleep)


def _paced(
    blocks: Iterable[Recording], pace: float, clock: Callable[[], float], sleep: Callable[[float], None]
) -> Iterator[Recording]:
    """Yield each block when it would have been complete."""
    begin, driven = clock(), 0.0
    for block in blocks:
        driven += block.duration
        wait = begin + driven / pace - clock()
        if wait > 0:
            sleep(wait)
        yield block
