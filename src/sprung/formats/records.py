"""Files as the records of one condition, in bounded memory where they are large."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from sprung.formats import read, read_blocks
from sprung.formats.settings import ReadSettings
from sprung.recording import Recording

#: Total size [bytes] above which files are read in blocks, each a record of its own.
LARGE = 256 * 2**20
#: Samples in such a block.
BLOCK_SAMPLES = 1 << 19


def read_records(
    paths: Sequence[Path],
    *,
    settings: ReadSettings | None = None,
    on_progress: Callable[[str, float], None] = lambda step, share: None,
) -> Iterable[Recording]:
    """Return the recordings in files: as a list, or one at a time where they are large together.

    Parameters
    ----------
    paths
        Files in the order of the records.
    settings
        As for `sprung.formats.read`.
    on_progress
        Callback that receives the current step and the share that is done (0 to 1).

    Returns
    -------
    iterable of Recording
        One record for each file; a large file gives several.

    Raises
    ------
    SprungError
        As `sprung.formats.read`; where the files are large together, once the record is reached.
    """
    recordings = _read(paths, settings, on_progress)
    return recordings if _is_large(paths) else list(recordings)


def _is_large(paths: Sequence[Path]) -> bool:
    """Whether the files together are too large to be held in memory."""
    return sum(path.stat().st_size for path in paths if path.is_file()) > LARGE


def _read(
    paths: Sequence[Path],
    settings: ReadSettings | None,
    on_progress: Callable[[str, float], None],
) -> Iterator[Recording]:
    """Yield the recording in each file; a large one in blocks."""
    for path in paths:
        on_progress(f"reading {path.name}", 0.0)
        if _is_large([path]):
            yield from read_blocks(path, settings=settings, block_samples=BLOCK_SAMPLES)
        else:
            yield read(path, settings=settings)
