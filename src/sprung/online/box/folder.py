"""Blocks of files that appear in a watched folder."""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from sprung.errors import ParameterError, SprungError
from sprung.formats import ENDINGS, ReadSettings
from sprung.online.box.sources import blocks_of_file
from sprung.recording import Recording

#: Time between two checks of the folder, and for which a file must be unchanged before it is read [s].
SETTLED = 2.0


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
    r"""Return the blocks of files that appear in a folder, by name.

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

    Raises
    ------
    ParameterError
        If the folder does not exist.

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
    if not folder.is_dir():
        raise ParameterError(f"{folder} is not a folder: give the one in which files appear")
    return _watch(
        folder,
        start=start,
        is_done=is_done,
        sleep=sleep,
        done=done,
        finished=set(known),
        settings=settings,
    )


def _watch(
    folder: Path,
    *,
    start: Callable[[], int],
    is_done: Callable[[], bool],
    sleep: Callable[[float], None],
    done: Callable[[str, str], None],
    finished: set[str],
    settings: ReadSettings | None,
) -> Iterator[Recording]:
    """Yield the blocks of files as they settle."""
    seen: dict[str, tuple[int, int]] = {}
    free = 0
    while True:
        now = _states(folder, finished)
        for name in [name for name in sorted(now) if _is_settled(now[name], seen.get(name))]:
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


def _is_settled(state: tuple[int, int], before: tuple[int, int] | None) -> bool:
    """Return whether a file is unchanged since the last pass, or for long; clocks of other machines may be wrong."""
    return state == before or time.time_ns() - state[1] > SETTLED * 1e9
