"""Samples of vehicles as Parquet files, one for each stretch, and their retention."""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sprung._checks import check_number, frozen_array
from sprung.errors import ParameterError
from sprung.storage.rows import check_count
from sprung.storage.schema import StoreError

_NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")


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
) -> Path:
    """Write samples to ``folder/vehicle/YYYY-mm-dd/boot-seq.parquet``, whole or not at all.

    Parameters
    ----------
    folder
        The archive.
    vehicle
        1 to 64 letters, digits, dots, dashes and underscores.
    boot, first_seq
        Of the first frame.
    t0
        Time of the first sample, UTC nanoseconds; also the time of the file.
    samples
        Shape (channels, samples); stored with 32 bits.
    channels
        Their names, the headings of the columns behind the time.
    sampling_rate
        In Hz.

    Raises
    ------
    ParameterError
        Where a name or number cannot be used.
    StoreError
        Where the archive cannot be written.
    """
    values = frozen_array("samples", samples, ndim=2, dtype=np.float32)
    _check_channels(channels, len(values))
    check_number("sampling_rate", sampling_rate, above=0.0)
    name = f"{check_count('boot', boot)}-{check_count('first_seq', first_seq)}.parquet"
    day = f"{datetime.fromtimestamp(t0 // 10**9, UTC):%Y-%m-%d}"
    path = Path(folder) / _checked_vehicle(vehicle) / day / name
    facts = {"vehicle": vehicle, "boot": str(boot), "first_seq": str(first_seq), "t0": str(t0)}
    _write(path, _table(values, channels, sampling_rate, facts), t0)
    return path


def prune_archive(folder: Path | str, *, before: int, most_bytes: int | None = None) -> int:
    """Delete files whose samples begin before a time, then the oldest until the rest is small enough.

    Parameters
    ----------
    folder
        The archive.
    before
        UTC nanoseconds.
    most_bytes
        Bytes that may remain; None for any number.

    Returns
    -------
    int
        Number of files deleted.

    Raises
    ------
    StoreError
        Where a file cannot be deleted.
    """
    with _reported(Path(folder)):
        files = [file for pattern in ("*.parquet", "*.part") for file in Path(folder).glob(f"*/*/{pattern}")]
        rows = sorted((file.stat().st_mtime_ns, file, file.stat().st_size) for file in files)
        remaining = sum(size for _, _, size in rows)
        n_deleted = 0
        for begin, file, size in rows:
            if begin >= before and (most_bytes is None or remaining <= most_bytes):
                break
            file.unlink()
            if not any(file.parent.iterdir()):
                file.parent.rmdir()
            remaining -= size
            n_deleted += 1
    return n_deleted


def _checked_vehicle(vehicle: str) -> str:
    """Return the name of a vehicle if it can name a folder."""
    if not _NAME.fullmatch(vehicle) or vehicle in {".", ".."}:
        raise ParameterError(f"vehicle {vehicle!r} must be 1 to 64 letters, digits, dots, dashes or underscores")
    return vehicle


def _check_channels(channels: Sequence[str], n_rows: int) -> None:
    """Refuse names that cannot head the columns."""
    if len(channels) != n_rows or len(set(channels)) < n_rows or "time" in channels:
        raise ParameterError(
            f"channels {', '.join(channels)} must be {n_rows} different names, one for each row of samples, "
            f"and none of them 'time'"
        )


def _table(samples: NDArray[np.float32], channels: Sequence[str], sampling_rate: float, facts: dict[str, str]) -> Any:
    """Return a column of time since t0 [s] and one for each channel."""
    import pyarrow as pa

    columns = {"time": np.arange(samples.shape[1]) / sampling_rate, **dict(zip(channels, samples, strict=True))}
    return pa.table(columns).replace_schema_metadata({**facts, "sampling_rate": repr(float(sampling_rate))})


def _write(path: Path, table: Any, t0: int) -> None:
    """Write a file under another name, sync it, and rename it."""
    import pyarrow.parquet as pq

    part = path.with_name(f"{path.name}.part")
    with _reported(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with part.open("wb") as file:
                pq.write_table(table, file, compression="zstd")
                file.flush()
                os.fsync(file.fileno())
            os.utime(part, ns=(t0, t0))
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        _sync(path.parent)


def _sync(folder: Path) -> None:
    """Make a rename in a folder last."""
    opened = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


@contextmanager
def _reported(path: Path) -> Iterator[None]:
    """Raise what the disk refuses as StoreError."""
    try:
        yield
    except OSError as error:
        raise StoreError(
            f"the archive cannot write {path}: {error.strerror or error}: free space on its disk or make it writable"
        ) from error
