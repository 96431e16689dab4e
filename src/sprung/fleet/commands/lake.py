"""The commands `sprung fleet import`, `archive` and `rank`; files into a lake, and back as recordings."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from sprung._checks import check_number
from sprung.cli.options import (
    INPUT,
    OUTPUT,
    Files,
    Json,
    Minutes,
    Reading,
    Since,
    Until,
    check_file,
    check_folder,
    option,
    shares_options,
)
from sprung.cli.output import progress_bar, show, write_result, written
from sprung.diagnosis import windows
from sprung.errors import DataError, ParameterError, SprungError
from sprung.fleet.lake import Lake, LakeWindow, recording_of, window_of_recording
from sprung.fleet.lake.lake import in_parts
from sprung.formats import ReadSettings, read_records, write
from sprung.link.archive import is_archive, read_archive
from sprung.recording import Channel, Gap, Recording

if TYPE_CHECKING:
    from sprung.diagnosis import Observation


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


@shares_options
def import_files(
    files: Files,
    *,
    lake: Annotated[str, option("LAKE", "Folder or URL of the lake, created if it does not exist.")],
    vehicle_id: Annotated[
        str | None,
        option(
            "ID",
            "Vehicle of all files. Default: the one named in a file of the monitor's archive, otherwise the name of "
            "the folder that the file is in.",
            panel=INPUT,
        ),
    ] = None,
    start: Annotated[
        str | None,
        option(
            "TIME",
            "Time of the first sample of files without a start time, such as 2026-11-21T08:30 (UTC); further such "
            "files of a vehicle follow one another.",
            panel=INPUT,
        ),
    ] = None,
    window: Minutes = 10.0,
    json: Json = None,
    reading: Reading,
) -> None:
    """Add recordings to a lake, cut into the windows that sprung diagnose uses.

    Windows already in the lake are not added again. A file that cannot be read is listed, and the others are
    imported; the exit code is 2 if no file could be imported.
    """
    from sprung._checks import check_number
    from sprung.fleet.commands.lake import Importer
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import lake_import_document
    from sprung.results.tables.wording import parse_time

    check_file("--json", json, inputs=files)
    check_number("--window", window, at_least=1)
    begin = parse_time("--start", start)
    opened = Lake(lake)
    importer = Importer(opened, vehicle=vehicle_id, length=60 * window, start=begin, settings=reading.settings)
    with progress_bar() as report:
        imported = importer.add(files, on_progress=report)
    bad = [(file.path, file.reason) for file in imported if file.reason]
    document = lake_import_document(opened.location, _by_vehicle(imported), bad)
    if write_result(document, json):
        problems = [_problem(path, reason) for path, reason in bad]
        show(tables.lake_import_table(document.as_json()), problems, written([], json))
    if len(bad) == len(imported):
        raise ParameterError(f"no file could be imported: {_problem(*bad[0])}")


def archive(
    lake: Annotated[str, typer.Argument(metavar="LAKE", help="Folder or URL of the lake.", show_default=False)],
    *,
    compact: Annotated[
        bool, option(None, "Rewrite the small files of each date as large ones by vehicle.", "--compact")
    ] = False,
    keep_days: Annotated[
        float | None,
        option("DAYS", "Delete dates that ended longer ago; their files are removed a day later, for readers.", min=0),
    ] = None,
    export: Annotated[
        Path | None, option("DIR", "Write windows as recordings (Parquet), in a folder for each vehicle.", panel=OUTPUT)
    ] = None,
    vehicle_id: Annotated[str | None, option("ID", "Vehicle to export. Default: all.", panel=OUTPUT)] = None,
    since: Since = None,
    until: Until = None,
    json: Json = None,
) -> None:
    """Summarise a lake, and compact, prune or export it."""
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import lake_document

    check_file("--json", json)
    check_folder("--export", export)
    if export is None and (vehicle_id, since, until) != (None, None, None):
        raise ParameterError("--vehicle-id, --since and --until choose what is exported: add --export DIR")
    opened = Lake(lake)
    opened.table.open()  # raises if there is none
    paths = [] if export is None else _exported(opened, export, vehicle=vehicle_id, since=since, until=until)
    before = opened.facts.n_windows
    if keep_days is not None:
        opened.prune(before=time.time_ns() - round(keep_days * 86400e9))
    with progress_bar() as report:
        report("compacting", 0.0)
        compacted = opened.compact() if compact else None
    facts = opened.facts
    document = lake_document(
        opened.location,
        windows=facts.n_windows,
        files=facts.n_files,
        n_bytes=facts.n_bytes,
        first=facts.first,
        last=facts.last,
        vehicles=[(own.vehicle, own.n_windows, own.first, own.last) for own in opened.vehicles()],
        compacted=compacted,
        removed=None if keep_days is None else before - facts.n_windows,
        exported=paths,
    )
    if write_result(document, json):
        plain = document.as_json()
        outputs = [] if export is None else [f"wrote {len(paths)} recordings to {export}"]
        show(tables.describe_lake(plain), tables.lake_table(plain), [*outputs, *written([], json)])


def rank(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="CAR.json",
            help=(
                "Results of sprung diagnose --json, one for each vehicle, made with one vehicle file. Each is named "
                "after its vehicle; files of the same name in several folders belong to one vehicle."
            ),
            show_default=False,
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        option("T.json", "Write the baseline of the type, for --type of sprung baseline and diagnose.", panel=OUTPUT),
    ] = None,
    rate: Annotated[
        float, option("SHARE", "Expected share of healthy vehicles among those reported to deviate.")
    ] = 0.05,
    json: Json = None,
) -> None:
    """Compare the vehicles of a type with each other, and learn what is normal for the type."""
    from sprung.diagnosis import learn_type, rank_fleet
    from sprung.results import tables
    from sprung.results.documents import fleet_document, write_type_baseline

    check_file("--out", out, inputs=files)
    check_file("--json", json, inputs=files)
    windows = _windows_by_vehicle(files)
    of_type = learn_type(windows)
    notes = [
        f"{vehicle} has no usable window"
        for vehicle, own in windows.items()
        if not any(window.is_conclusive and not window.sensor_faults for window in own)
    ]
    try:
        rankings = [(of_type.name, rank_fleet(windows, rate=rate))]
    except DataError as error:
        if out is None:
            raise
        rankings, notes = [], [*notes, f"not ranked: {error}"]
    if out is not None:
        write_type_baseline(of_type, out)
    document = fleet_document(rankings, rate=rate, notes=notes)
    if write_result(document, json):
        outputs = written([] if out is None else [out], json)
        show(*tables.fleet_tables(document.as_json()), [tables.describe_type(of_type), *notes, *outputs])


def _by_vehicle(files: "Sequence[ImportedFile]") -> list[tuple[str, int, int, int]]:
    """Return the vehicles of files with their numbers of files, of windows added, and of windows known before."""
    counts: dict[str, tuple[int, int, int]] = {}
    for file in files:
        if file.n_windows:
            n_files, added, known = counts.get(file.vehicle, (0, 0, 0))
            counts[file.vehicle] = (n_files + 1, added + file.n_added, known + file.n_windows - file.n_added)
    return [(vehicle, *own) for vehicle, own in sorted(counts.items())]


def _problem(path: Path, reason: str) -> str:
    """Return why a file could not be imported; most reasons name it already."""
    return reason if str(path) in reason else f"{path}: {reason}"


def _exported(lake: "Lake", folder: Path, *, vehicle: str | None, since: str | None, until: str | None) -> list[Path]:
    """Write the windows of a vehicle and period as recordings, and return the paths."""
    from sprung.fleet.commands.lake import export_windows
    from sprung.results.tables.wording import parse_period

    period = parse_period(since, until)
    with progress_bar() as report:
        report("exporting", 0.0)
        paths = export_windows(lake.windows(vehicle=vehicle, since=period.since, until=period.until), folder)
    if not paths:
        whose = "" if vehicle is None else f" of {vehicle}"
        raise ParameterError(f"{lake.location} contains no window{whose} in that period: see `sprung fleet archive`")
    return paths


def _windows_by_vehicle(files: list[Path]) -> "Mapping[str, list[Observation]]":
    """Return the windows of each vehicle, all of one type."""
    from sprung.results.documents import read_diagnosis

    windows: dict[str, list[Observation]] = {}
    types: dict[str, Path] = {}
    for path in files:
        document = read_diagnosis(path)
        if document.vehicle is not None:
            types.setdefault(document.vehicle, path)
        own = windows.setdefault(path.stem, [])
        own += [replace(window, vehicle=document.vehicle or "") for window in document.windows]
    if len(types) > 1:
        cases = ", ".join(f"{name!r} ({path})" for name, path in types.items())
        raise ParameterError(f"the files belong to the types {cases}: give those of one type")
    return windows
