"""Windows of a lake back as recordings in files, which all commands read."""

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

from sprung.errors import ParameterError
from sprung.fleet.lake import LakeWindow, recording_of
from sprung.formats import write


def export_windows(windows: Iterable[LakeWindow], folder: Path) -> list[Path]:
    """Write each window to ``folder/vehicle/start-digest.parquet``, and return the paths.

    Parameters
    ----------
    windows
        Windows of a lake, such as those of `Lake.windows`.
    folder
        Folder, created if missing; files of the same windows are replaced.

    Raises
    ------
    ParameterError
        If a file cannot be written.
    FormatError
        If a window is damaged.

    Notes
    -----
    Samples, sampling rate, gaps and start are those of the lake; positions and directions of sensors are not kept in
    these files. Names of files are in the order of time.
    """
    paths = []
    for window in windows:
        path = folder / _folder_name(window.vehicle) / _file_name(window)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write(recording_of(window.row), path)
        except OSError as error:
            raise ParameterError(f"{path} cannot be written: {error.strerror or error}: give another folder") from None
        paths.append(path)
    return paths


def _folder_name(vehicle: str) -> str:
    """Return the name of a vehicle without what a path would take for a folder."""
    name = quote(vehicle, safe=" ()+,;=@äöüÄÖÜß")
    return name if name.strip(".") else name.replace(".", "%2E")


def _file_name(window: LakeWindow) -> str:
    """Return the name of a file: start to the millisecond, UTC, and the beginning of the digest."""
    start = datetime.fromtimestamp(window.row["start"] / 1e9, UTC)
    return f"{start:%Y%m%dT%H%M%S}{start.microsecond // 1000:03d}Z-{window.row['digest'][:6]}.parquet"
