"""Reading and writing recordings in the formats of the field, each in a module of its own.

A format is a module with `NAME`, `ENDINGS`, `recognises`, `groups` and, where it can, `write`. It yields the rows of a
table as they are in the file; time and SI units are interpreted in one place for all formats. A package of one's own
adds such a module as an entry point of the group `sprung.formats`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from sprung._checks import check_number, check_path, check_type, settings_of
from sprung.errors import DataError, ParameterError, SprungError
from sprung.formats.columns import wanted_table
from sprung.formats.grid import assemble, survey
from sprung.formats.isolation import isolated_groups
from sprung.formats.registry import ENDINGS, FOREIGN, FORMATS, WRITERS, format_of, writer_of
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Block, Group, join, rebatch, reported
from sprung.recording import Recording

__all__ = ["ENDINGS", "FORMATS", "WRITERS", "ReadSettings", "groups", "read", "read_blocks", "read_records", "write"]

#: Total size [bytes], unpacked, above which files are read in blocks, each a record of its own.
LARGE = 256 * 2**20
#: Samples in such a block.
BLOCK_SAMPLES = 1 << 19


def read(
    path: str | PathLike[str],
    *,
    sampling_rate: float | None = None,
    channels: Sequence[str] | None = None,
    settings: ReadSettings | None = None,
) -> Recording:
    r"""Return the recording in a file, in SI units.

    Parameters
    ----------
    path
        Path of a file in one of the formats `FORMATS`, recognised by its content, then by its name.
    sampling_rate
        Sampling rate [Hz], above 0; needed if the file holds no time. It must agree with time stamps within 1 %.
    channels
        Names of the channels to read, in this order; default: all channels.
    settings
        Group, part, time column and others; `sampling_rate` and `channels` take the place of those in it.

    Returns
    -------
    Recording
        Recording in SI units. A dead channel (values in less than half of the rows) is kept, with NaN for missing
        values. A row in which any other channel has no value is removed, which leaves a gap.

    Raises
    ------
    FormatError
        If the file cannot be read; the message names file and row.
    DataError
        If the file holds no samples, one sample, or channels of several rates.
    ParameterError
        If the sampling rate is missing or contradicts the file, or a channel is not in the file.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "run.csv"
    ...     _ = path.write_text("time [s],acc [g]\n0.00,0.0\n0.01,1.0\n0.02,0.0\n")
    ...     run = read(path)
    ...
    >>> run.names, round(run.sampling_rate, 6), run.samples.round(5).tolist()
    (('acc',), 100.0, [[0.0, 9.80665, 0.0]])
    """
    check_path("path", path)
    return next(_recordings(Path(path), settings, sampling_rate, channels))


def read_blocks(
    path: str | PathLike[str],
    *,
    sampling_rate: float | None = None,
    channels: Sequence[str] | None = None,
    settings: ReadSettings | None = None,
    block_samples: int = 1 << 16,
) -> Iterator[Recording]:
    """Yield the recording in a file block by block, in bounded memory for formats whose rows are read in pieces.

    Parameters
    ----------
    path, sampling_rate, channels, settings
        As for `read`.
    block_samples
        Approximate number of samples in a block, at least 1,000.

    Yields
    ------
    Recording
        Blocks, each of which begins one sample interval after the end of the one before: gaps lie inside blocks.
        Joined, they are the recording that `read` returns.

    Raises
    ------
    SprungError
        As raised by `read`, before the first block.

    Notes
    -----
    The file is read twice: first to find live channels and the timing, then for the samples.

    Examples
    --------
    >>> import tempfile
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.0, 0.5] * 2500], 100.0, (Channel("acc", "acceleration"),))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(run, Path(folder) / "run.csv")
    ...     sizes = [block.n_samples for block in read_blocks(Path(folder) / "run.csv", block_samples=1000)]
    ...
    >>> len(sizes) > 1, sum(sizes)
    (True, 5000)
    """
    check_path("path", path)
    check_number("block_samples", block_samples, at_least=1000)
    return _recordings(Path(path), settings, sampling_rate, channels, block_samples)


def _recordings(
    path: Path,
    settings: ReadSettings | None,
    sampling_rate: float | None,
    channels: Sequence[str] | None,
    block_samples: int | None = None,
) -> Iterator[Recording]:
    """Yield the recording in a file in blocks; None: as one."""
    settings = settings_of(ReadSettings, settings)
    if sampling_rate is not None:
        settings = replace(settings, sampling_rate=sampling_rate)
    if channels is not None:
        settings = replace(settings, channels=channels)
    with reported(path, "file"):
        table = wanted_table(path, groups(path, settings), settings)
    if block_samples is None:
        blocks = list(table.blocks())
        if not blocks:
            raise DataError(f"{path} holds no samples: it ends after the column names")
        whole: Iterable[Block] = [join(blocks)]
        facts = survey(table, whole, sampling_rate=settings.sampling_rate)
    else:
        facts = survey(table, table.blocks(), sampling_rate=settings.sampling_rate)
        whole = rebatch(table.blocks(), block_samples)
    for recording in assemble(table, whole, facts, bridge=settings.bridge):
        yield replace(recording, source=str(path))


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
        How files are read; default: as `read` without options.
    on_progress
        Callback that receives the current step and the share that is done (0 to 1).

    Returns
    -------
    iterable of Recording
        One record for each file; a large file gives several.

    Raises
    ------
    SprungError
        As `read`; where the files are large together, once the record is reached.
    """
    sizes = [_unpacked_size(path) for path in paths]

    def records() -> Iterator[Recording]:
        for path, size in zip(paths, sizes, strict=True):
            on_progress(f"reading {path.name}", 0.0)
            if size > LARGE:
                yield from read_blocks(path, settings=settings, block_samples=BLOCK_SAMPLES)
            else:
                yield read(path, settings=settings)

    return records() if sum(sizes) > LARGE else list(records())


def _unpacked_size(path: Path) -> int:
    """Return the size of a file [bytes], of a packed one that of its rows where they can be read; 0: there is none."""
    size = path.stat().st_size if path.is_file() else 0
    try:
        unpacked = getattr(format_of(path), "unpacked_size", None)
        return size if unpacked is None else int(unpacked(path, LARGE))
    except SprungError:
        return size


def groups(path: str | PathLike[str], settings: ReadSettings | None = None) -> tuple[Group, ...]:
    r"""Return the groups of channels in a file.

    Parameters
    ----------
    path
        As for `read`.
    settings
        CAN databases, where the file holds raw CAN frames.

    Raises
    ------
    FormatError
        If the file cannot be read.
    MissingPackageError
        If the reader of the format is not installed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "run.csv"
    ...     _ = path.write_text("time [s],acc [g]\n0.00,0.0\n0.01,1.0\n")
    ...     [group.headings for group in groups(path)]
    ...
    [('time [s]', 'acc [g]')]
    """
    check_path("path", path)
    path = Path(path)
    module, settings = format_of(path), settings_of(ReadSettings, settings)
    if module in FOREIGN:
        return isolated_groups(module.__name__, path, settings)
    with reported(path, module.NAME):
        return module.groups(path, settings)


def write(recording: Recording, path: str | PathLike[str]) -> None:
    """Write a recording in the format of the file's ending, with a time column and units.

    Reading the file gives the same channels, samples, rate, gaps and start; positions, directions and the history are
    not kept in these formats.

    Parameters
    ----------
    recording
        Any recording.
    path
        Path of the file, with one of the endings in `WRITERS`.

    Raises
    ------
    ParameterError
        If the ending is not in `WRITERS`, or the name of a channel would not be read back.

    Examples
    --------
    >>> import tempfile
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.0, 0.5, -0.5]], 100.0, (Channel("acc", "acceleration"),))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(run, Path(folder) / "run.csv")
    ...     again = read(Path(folder) / "run.csv")
    ...
    >>> again.names, round(again.sampling_rate, 6), again.samples.tolist()
    (('acc',), 100.0, [[0.0, 0.5, -0.5]])
    """
    check_type("recording", recording, Recording)
    check_path("path", path)
    path = Path(path)
    ending = path.suffix.lower()
    writer = writer_of(ending)
    if writer is None:
        raise ParameterError(f"{path} ends in {ending!r}: recordings are written as {', '.join(WRITERS)}")
    writer.write(recording, path)
