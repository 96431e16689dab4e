"""Samples of vehicles as Parquet files, one for each stretch: what a monitor keeps, and a lake takes in."""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sprung._checks import check_number, frozen_array
from sprung.errors import ParameterError, SprungError
from sprung.link.messages import check_vehicle


class ArchiveError(SprungError):
    """A file of an archive that cannot be read or written."""


@dataclass(frozen=True, eq=False, slots=True)
class ArchivedSamples:
    """Samples of a stretch as the archive keeps them.

    Parameters
    ----------
    samples
        Samples in SI units, with 32 bits of precision, shape (channels, samples).
    channels
        Names of the channels.
    sampling_rate
        Sampling rate [Hz].
    t0
        Time of the first sample, UTC ns.
    gaps
        Index of the first sample after each gap, and the length of the gap [s].
    vehicle
        Name of the vehicle.
    quantities
        Quantity of each channel; empty if the file does not state them.
    """

    samples: NDArray[np.float64]
    channels: tuple[str, ...]
    sampling_rate: float
    t0: int
    gaps: tuple[tuple[int, float], ...] = ()
    vehicle: str = ""
    quantities: tuple[str, ...] = ()


def write_archive(
    folder: Path | str,
    vehicle: str,
    boot: int,
    first_seq: int,
    t0: int,
    *,
    samples: ArrayLike,
    channels: Sequence[str],
    sampling_rate: float,
    gaps: Sequence[tuple[int, float]] = (),
    quantities: Sequence[str] = (),
) -> Path:
    """Write samples to ``folder/vehicle/YYYY-mm-dd/boot-seq.parquet``, whole or not at all.

    Parameters
    ----------
    folder
        Folder of the archive.
    vehicle
        Name of the vehicle: 1 to 64 letters, digits, dots, dashes and underscores.
    boot, first_seq
        Boot and sequence number of the first frame.
    t0
        Time of the first sample, UTC nanoseconds; also the time of the file.
    samples
        Samples in SI units, shape (channels, samples); stored with 32 bits.
    channels
        Names of the channels, the headings of the columns after the time.
    sampling_rate
        Sampling rate [Hz].
    gaps
        Index of the first sample after each gap, and the length of the gap [s].
    quantities
        Quantity of each channel, a key of `sprung.recording.QUANTITIES`; none: unknown.

    Returns
    -------
    Path
        File that was written.

    Raises
    ------
    ParameterError
        If a name or number cannot be used.
    ArchiveError
        If the archive cannot be written.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> stretch = {"samples": [[0.0, 0.5, -1.0]], "channels": ["acc_fl"], "sampling_rate": 400.0}
    >>> with TemporaryDirectory() as folder:
    ...     path = write_archive(folder, "bus-17", 4, 600, 1_700_000_000 * 10**9, **stretch)
    ...     path.relative_to(folder).as_posix(), read_archive(path).samples.tolist()
    ('bus-17/2023-11-14/4-600.parquet', [[0.0, 0.5, -1.0]])
    """
    import pyarrow as pa

    values = frozen_array("samples", samples, ndim=2, dtype=np.float32)
    if len(channels) != len(values) or len(set(channels)) < len(values) or "time" in channels:
        raise ParameterError(
            f"channels {', '.join(channels)} must be {len(values)} different names, one for each row of samples, "
            "and none of them 'time'"
        )
    check_number("sampling_rate", sampling_rate, above=0.0)
    path = archive_path(folder, vehicle, boot, first_seq, t0)
    facts = {"vehicle": vehicle, "boot": str(boot), "first_seq": str(first_seq), "t0": str(t0)}
    stated = {"gaps": json.dumps([[int(index), float(length)] for index, length in gaps])} if gaps else {}
    stated |= {"quantities": json.dumps(list(quantities))} if quantities else {}
    facts |= stated | {"sampling_rate": repr(float(sampling_rate))}
    columns = {"time": np.arange(values.shape[1]) / sampling_rate, **dict(zip(channels, values, strict=True))}
    _write(path, pa.table(columns).replace_schema_metadata(facts), t0)
    return path


def archive_path(folder: Path | str, vehicle: str, boot: int, first_seq: int, t0: int) -> Path:
    """Return the path of the samples of a stretch, whether they are kept or not; parameters as for `write_archive`.

    Raises
    ------
    ParameterError
        If a name or number cannot be used.

    Examples
    --------
    >>> archive_path("raw", "bus-17", boot=4, first_seq=600, t0=1_700_000_000 * 10**9).as_posix()
    'raw/bus-17/2023-11-14/4-600.parquet'
    """
    name = f"{_whole('boot', boot)}-{_whole('first_seq', first_seq)}.parquet"
    day = f"{datetime.fromtimestamp(t0 // 10**9, UTC):%Y-%m-%d}"
    return Path(folder) / check_vehicle(vehicle) / day / name


def read_archive(path: Path | str) -> ArchivedSamples:
    """Return the samples of a file that `write_archive` wrote.

    Raises
    ------
    ArchiveError
        If the file does not exist, or contains something else.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> stretch = {"samples": [[0.0, 0.5, -1.0]], "channels": ["acc_fl"], "sampling_rate": 400.0}
    >>> with TemporaryDirectory() as folder:
    ...     path = write_archive(folder, "bus-17", 4, 600, 1_700_000_000 * 10**9, **stretch, gaps=[(2, 0.5)])
    ...     archived = read_archive(path)
    >>> archived.vehicle, archived.channels, archived.sampling_rate, archived.gaps
    ('bus-17', ('acc_fl',), 400.0, ((2, 0.5),))
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
        facts = {name.decode(): value.decode() for name, value in (table.schema.metadata or {}).items()}
        channels = tuple(name for name in table.column_names if name != "time")
        return ArchivedSamples(
            np.array([table[name].to_numpy() for name in channels], dtype=np.float64),
            channels,
            float(facts["sampling_rate"]),
            int(facts["t0"]),
            tuple((int(index), float(length)) for index, length in json.loads(facts.get("gaps", "[]"))),
            facts.get("vehicle", ""),
            tuple(map(str, json.loads(facts.get("quantities", "[]")))),
        )
    except (OSError, pa.ArrowException, ValueError, TypeError, LookupError) as error:
        raise ArchiveError(f"the samples in {Path(path).name} cannot be read: {error}") from error


def is_archive(path: Path | str) -> bool:
    """Return whether a file is one that `write_archive` wrote, by its metadata.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> stretch = {"samples": [[0.0, 0.5, -1.0]], "channels": ["acc_fl"], "sampling_rate": 400.0}
    >>> with TemporaryDirectory() as folder:
    ...     path = write_archive(folder, "bus-17", 4, 600, 1_700_000_000 * 10**9, **stretch)
    ...     is_archive(path), is_archive(path.with_suffix(".csv"))
    (True, False)
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with open(path, "rb") as file:
            if file.read(4) != b"PAR1":
                return False
            return {b"vehicle", b"boot", b"first_seq", b"t0"} <= (pq.read_schema(file).metadata or {}).keys()
    except (OSError, pa.ArrowException):
        return False


def _whole(name: str, value: int) -> int:
    """Return a number if it is whole and fits into 63 bits."""
    if not isinstance(value, int) or not 0 <= value < 2**63:
        raise ParameterError(f"{name}={value!r} must be a whole number from 0 to 2^63 - 1")
    return value


def _write(path: Path, table: Any, t0: int) -> None:
    """Write a file under another name, sync it, and rename it."""
    import pyarrow.parquet as pq

    part = path.with_name(f"{path.name}.part")
    with reported(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with part.open("wb") as file:
                # No dictionary: samples hardly repeat. Bytes of equal weight together compress well.
                pq.write_table(table, file, compression="zstd", use_dictionary=False, use_byte_stream_split=True)
                file.flush()
                os.fsync(file.fileno())
            os.utime(part, ns=(t0, t0))
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


@contextmanager
def reported(path: Path, kind: type[SprungError] = ArchiveError) -> Iterator[None]:
    """Raise errors of the disk as another kind of error."""
    try:
        yield
    except OSError as error:
        raise kind(
            f"the archive cannot write {path} ({error.strerror or error}): free space on its disk or make it writable"
        ) from error
