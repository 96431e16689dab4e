"""Reading and writing recordings in the formats of the field, each in a module of its own.

A format is a module with `ENDINGS`, `open_table` and `write`. It yields the rows of a table as they are in the file;
time and SI units are interpreted in one place for all formats.
"""

from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import NoReturn

from sprung._checks import check_number
from sprung.errors import DataError, FormatError, ParameterError
from sprung.formats import csv, mat, npz, parquet
from sprung.formats.assembly import assemble, survey
from sprung.formats.table import Table, join, rebatch, reported
from sprung.recording import Recording

#: Module that reads each file name ending.
FORMATS: dict[str, ModuleType] = {ending: module for module in (csv, parquet, npz, mat) for ending in module.ENDINGS}

#: Module that writes each file name ending.
WRITERS: dict[str, ModuleType] = {".csv": csv, ".parquet": parquet, ".npz": npz, ".mat": mat}


def read(
    path: str | PathLike[str], *, sampling_rate: float | None = None, channels: Sequence[str] | None = None
) -> Recording:
    """Return the recording in a file, in SI units.

    Parameters
    ----------
    path
        Path of a file with one of the endings in `FORMATS`.
    sampling_rate
        Sampling rate [Hz], above 0; needed if the file holds no time. It must agree with time stamps within 1 %.
    channels
        Names of the channels to read, in this order; default: all channels.

    Returns
    -------
    Recording
        Recording in SI units. A dead channel (values in less than half of the rows) is kept, with NaN for missing
        values. A row in which any other channel has no value is cut, which leaves a gap.

    Raises
    ------
    FormatError
        If the file cannot be read; the message names file and row.
    DataError
        If the file holds no samples, one sample, or channels of several rates.
    ParameterError
        If the sampling rate is missing or contradicts the file, or a channel is not in the file.
    """
    table = _open_table(path, sampling_rate, channels)
    blocks = [join(list(table.blocks()) or _no_samples(table))]
    return next(assemble(table, blocks, survey(table, blocks, sampling_rate=sampling_rate)))


def read_blocks(
    path: str | PathLike[str],
    *,
    sampling_rate: float | None = None,
    channels: Sequence[str] | None = None,
    block_samples: int = 1 << 16,
) -> Iterator[Recording]:
    """Yield the recording in a file piece by piece, in bounded memory for CSV and Parquet.

    Parameters
    ----------
    path, sampling_rate, channels
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
    The file is read twice: first for the living channels and the advance of time, then for the samples.
    """
    check_number("block_samples", block_samples, at_least=1000)
    table = _open_table(path, sampling_rate, channels)
    facts = survey(table, table.blocks(), sampling_rate=sampling_rate)
    yield from assemble(table, rebatch(table.blocks(), block_samples), facts)


def write(recording: Recording, path: str | PathLike[str]) -> None:
    """Write a recording as CSV, Parquet, NPZ or MAT, according to the ending, with a time column and units.

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
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise ParameterError(f"{path} ends in {ending!r}: recordings are written as {', '.join(WRITERS)}")
    WRITERS[ending].write(recording, path)


def _open_table(path: str | PathLike[str], sampling_rate: float | None, channels: Sequence[str] | None) -> Table:
    """Return the table in an existing file of a known format."""
    path = Path(path)
    if sampling_rate is not None:
        check_number("sampling_rate", sampling_rate, above=0, advice="state it in Hz")
    ending = next((known for known in FORMATS if path.name.lower().endswith(known)), None)
    if not path.exists():
        raise FormatError(f"{path}: there is no such file")
    if not path.is_file():
        raise FormatError(f"{path} is not a file: name a file with one of the endings {', '.join(FORMATS)}")
    if ending is None:
        raise FormatError(f"{path} has an unknown ending: files in {', '.join(FORMATS)} are read")
    with reported(path, "file"):
        if path.stat().st_size == 0:
            raise FormatError(f"{path} is empty")
        table: Table = FORMATS[ending].open_table(path, channels=channels)
    return table


def _no_samples(table: Table) -> NoReturn:
    """Raise the error for a table without rows."""
    raise DataError(f"{table.path} holds no samples: it ends after the column names")
