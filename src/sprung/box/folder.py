"""Blocks of files that come into a watched folder."""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from sprung.box.sources import blocks_of_file
from sprung.errors import ParameterError, SprungError
from sprung.formats import FORMATS
from sprung.recording import Recording

#: Seconds between two looks, and for which a file must not have changed before it is read.
SETTLED = 2.0


def from_folder(
    folder: Path,
    *,
    start: Callable[[], int],
    is_done: Callable[[], bool],
    sleep: Callable[[float], None],
    done: Callable[[str, str], None],
    known: Sequence[str] = (),
    sampling_rate: float | None = None,
    channels: Sequence[str] | None = None,
) -> Iterator[Recording]:
    """Return the blocks of files that come into a folder, by name.

    Parameters
    ----------
    folder
        Watched for files of the formats that can be read. A file is read when it has not changed for 2 s, and once:
        a new one needs a name of its own.
    start
        Returns the time of a file that has none of its own, UTC ns; it follows on the one before if that is later.
    is_done
        Whether to stop watching; asked when all that has settled is read.
    sleep
        Waits for a time [s].
    done
        Called with the name of each file that was read, and why not to its end; empty where it was.
    known
        Names of files that were read before.
    sampling_rate, channels
        As for `sprung.formats.read`.

    Raises
    ------
    ParameterError
        Where there is no such folder.
    """
    if not folder.is_dir():
        raise ParameterError(f"{folder} is no folder: give the one that files come into")
    return _watched(
        folder,
        start=start,
        is_done=is_done,
        sleep=sleep,
        done=done,
        finished=set(known),
        sampling_rate=sampling_rate,
        channels=channels,
    )


def _watched(
    folder: Path,
    *,
    start: Callable[[], int],
    is_done: Callable[[], bool],
    sleep: Callable[[float], None],
    done: Callable[[str, str], None],
    finished: set[str],
    sampling_rate: float | None,
    channels: Sequence[str] | None,
) -> Iterator[Recording]:
    """Yield the blocks of files as they settle."""
    seen: dict[str, tuple[int, int]] = {}
    free = 0
    while True:
        now = _states(folder, finished)
        for name in [name for name in sorted(now) if _is_settled(now[name], seen.get(name))]:
            begin, said = max(start(), free), ""
            try:
                end = yield from blocks_of_file(
                    folder / name, start=begin, sampling_rate=sampling_rate, channels=channels
                )
                free = end if end > begin else free
            except SprungError as error:
                said = str(error)
            finished.add(name)
            done(name, said)
        seen = now
        if is_done():
            return
        sleep(SETTLED)


def _states(folder: Path, finished: set[str]) -> dict[str, tuple[int, int]]:
    """Return size and time of change [ns] of each file that is still to be read; hidden ones are none."""
    states = {}
    try:
        for path in folder.iterdir():
            is_wanted = path.name.lower().endswith(tuple(FORMATS)) and not path.name.startswith(".")
            if is_wanted and path.name not in finished and path.is_file():
                status = path.stat()
                states[path.name] = status.st_size, status.st_mtime_ns
    except OSError:
        # A file or the folder was taken away during the look: the next one sees what is left.
        return states
    return states


def _is_settled(state: tuple[int, int], before: tuple[int, int] | None) -> bool:
    """Tell whether a file has not changed since the last look, or for long; clocks of others may be wrong."""
    return state == before or time.time_ns() - state[1] > SETTLED * 1e9
