"""Files of any format into a lake, as the windows that `sprung diagnose` makes of them, and back as recordings."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

from sprung._checks import check_number
from sprung.diagnosis import windows
from sprung.errors import DataError, ParameterError, SprungError
from sprung.fleet.lake import Lake, LakeWindow, recording_of, window_of_recording
from sprung.fleet.lake.lake import in_parts
from sprung.formats import ReadSettings, read_records, write
from sprung.link.archive import is_archive, read_archive
from sprung.recording import Channel, Gap, Recording

#: Size of samples in memory after which they are written [bytes].
_WRITTEN_TOGETHER = 1 << 27


@dataclass(slots=True)
class ImportedFile:
    """Result of importing a file.

    Parameters
    ----------
    path
        The file.
    vehicle
        Name of the vehicle.
    n_windows, n_added
        Number of its windows, and of those that the lake did not hold before.
    reason
        Why it could not be imported; empty if it was.
    """

    path: Path
    vehicle: str = ""
    n_windows: int = 0
    n_added: int = 0
    reason: str = ""


class Importer:
    """Adds files to a lake, one after the other.

    Parameters
    ----------
    lake
        The lake.
    vehicle
        Name of the vehicle of all files; None: that in a file of the monitor's archive, else the name of the folder.
    length
        Length of a window [s].
    start
        Time of the first sample of the first file without a start time, UTC ns; further such files of the same vehicle
        follow. None: such files are refused.
    settings
        As for `sprung.formats.read`.
    """

    def __init__(
        self,
        lake: Lake,
        *,
        vehicle: str | None = None,
        length: float = 600.0,
        start: int | None = None,
        settings: ReadSettings | None = None,
    ) -> None:
        check_number("length", length, at_least=60)
        self._lake, self._vehicle, self._length, self._start = lake, vehicle, length, start
        self._settings = settings or ReadSettings()
        self._ends: dict[str, int] = {}

    def add(
        self, paths: Sequence[Path], *, on_progress: Callable[[str, float], None] = lambda step, share: None
    ) -> list[ImportedFile]:
        """Add files, and return the result of each; one that cannot be read does not stop the import of the others.

        Parameters
        ----------
        paths
            Files in the order of time.
        on_progress
            Callback that receives the current step and the share that is done (0 to 1).

        Raises
        ------
        SprungError
            If the lake cannot be read or written.
        """
        files = [ImportedFile(path) for path in paths]
        made = self._each_window(files, on_progress)
        for part in in_parts(made, size=lambda own: own[1].n_bytes, limit=_WRITTEN_TOGETHER):
            new = self._lake.missing([window for _, window in part])
            self._lake.write(new)
            added = set(map(id, new))
            for file, window in part:
                file.n_windows += 1
                file.n_added += id(window) in added
        return files

    def _each_window(
        self, files: Sequence[ImportedFile], on_progress: Callable[[str, float], None]
    ) -> Iterator[tuple[ImportedFile, LakeWindow]]:
        """Yield the windows of files; one where that fails has the reason."""
        for number, file in enumerate(files):
            on_progress(f"importing {file.path.name}", number / len(files))
            try:
                file.vehicle = self._vehicle_of(file.path)
                for recording in self._recordings(file.path, file.vehicle):
                    for _, part in windows(recording, length=self._length):
                        yield file, window_of_recording(file.vehicle, part, source=file.path.name)
            except (SprungError, OSError) as error:
                file.reason = str(error)

    def _vehicle_of(self, path: Path) -> str:
        """Return the name of the vehicle of a file."""
        stated = read_archive(path).vehicle if self._vehicle is None and is_archive(path) else ""
        name = self._vehicle or stated or path.absolute().parent.name
        if not name.strip():
            raise ParameterError(f"{path} is in no folder that names its vehicle: give its name with --vehicle-id")
        return name

    def _recordings(self, path: Path, vehicle: str) -> Iterator[Recording]:
        """Yield the recordings in a file, with start times."""
        records = [_archived(path, self._settings)] if is_archive(path) else None
        for recording in records or read_records([path], settings=self._settings):
            if recording.start is not None:
                yield recording
                continue
            begin = self._ends.get(vehicle, self._start)
            if begin is None:
                raise DataError(f"{path} has no start time: state that of the first sample with --start TIME")
            gaps = sum(gap.duration for gap in recording.gaps)
            self._ends[vehicle] = begin + round(1e9 * (recording.duration + gaps))
            yield replace(recording, start=begin)


def _archived(path: Path, settings: ReadSettings) -> Recording:
    """Return the samples of a file of the monitor's archive, whose gaps and start are in its metadata."""
    if settings.start is not None or settings.end is not None:
        raise ParameterError(f"{path} is of the archive of a monitor, which is read whole: leave out --from and --to")
    kept = read_archive(path)
    quantities = kept.quantities or ("unknown",) * len(kept.channels)
    channels = tuple(Channel(name, quantity) for name, quantity in zip(kept.channels, quantities, strict=True))
    gaps = tuple(Gap(index, length) for index, length in kept.gaps)
    recording = Recording(kept.samples, kept.sampling_rate, channels, kept.t0 or None, gaps)
    return recording if settings.channels is None else recording.select(settings.channels)


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
