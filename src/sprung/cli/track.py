"""The command `sprung track`."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sprung.cli.checks import check_outputs, may_lack_sensors
from sprung.cli.options import (
    INPUT,
    AllowMissing,
    Figures,
    FileFormat,
    Json,
    Page,
    complete_recordings_or_documents,
    complete_vehicles,
    option,
)
from sprung.cli.output import progress_bar, show, write_figures, write_page, write_result, written
from sprung.cli.reading import reads_files
from sprung.errors import IdentificationError, ParameterError

if TYPE_CHECKING:
    from sprung.formats import ReadSettings
    from sprung.identification import IdentificationSettings
    from sprung.identification.methods import WindowModes
    from sprung.recording import Recording
    from sprung.vehicles.usable import AnyVehicle

#: Length of a window that no recording reaches [s]: each is one window.
_WHOLE = 1e9
_TRACKING = "Tracking"


@reads_files
def track(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE",
            help="Recordings in the order of time, or JSON files of sprung identify.",
            show_default=False,
            autocompletion=complete_recordings_or_documents,
        ),
    ],
    *,
    window: Annotated[
        float | None,
        option("SECONDS", "Length of a window. Default: one per file. JSON files: time between them.", panel=INPUT),
    ] = None,
    vehicle: Annotated[
        str | None,
        option(
            "V.toml|NAME",
            "Vehicle file or name of a shipped vehicle: sensors, band and labels.",
            panel=INPUT,
            autocompletion=complete_vehicles,
        ),
    ] = None,
    reading: "ReadSettings",
    allow_missing: AllowMissing = False,
    method: Annotated[
        Literal["cov", "acs", "coss", "plscf", "fdd"],
        typer.Option(help="Identification of each window, as for sprung identify.", rich_help_panel=INPUT),
    ] = "cov",
    band: Annotated[
        tuple[float, float] | None,
        option("LO HI", "Lowest and highest natural frequency, in Hz.", panel=INPUT),
    ] = None,
    gap: Annotated[
        float | None,
        option(
            "SECONDS",
            "Longest gap over which a mode is still tracked. Default: 48 windows.",
            panel=_TRACKING,
        ),
    ] = None,
    reach: Annotated[
        float,
        option("D", "Largest sudden relative change of a natural frequency that is followed.", panel=_TRACKING),
    ] = 0.1,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    json: Json = None,
) -> None:
    """Follow modes over files or windows by frequency, shape and standard deviations, with births and deaths."""
    from sprung.identification.tracking import TrackingSettings, track_modes
    from sprung.results import page as pages
    from sprung.results import tables
    from sprung.results.documents import tracking_document
    from sprung.vehicles import read_description

    check_outputs(json=json, page=page, figures=figures, inputs=[*files, vehicle])
    settings = TrackingSettings(gap=gap, reach=reach)
    source = str(files[0]) if len(files) == 1 else f"{len(files)} files"
    start = None
    with progress_bar() as report:
        if _are_documents(files):
            windows = _from_documents(files, distance=1.0 if window is None else window)
        else:
            description = None if vehicle is None else read_description(vehicle)
            sensors = () if description is None else description.sensor
            may_lack = may_lack_sensors(sensors, allow_missing=allow_missing, channels=reading.channels)
            recordings = _Recordings(files, settings=reading, report=report)
            windows = _identified(recordings, window, method, _settings(band, may_lack=may_lack), description)
            start = recordings.start
        windows = sorted(windows, key=lambda part: part.time)
        tracked = track_modes(
            [part.modes for part in windows], times=[part.time for part in windows], settings=settings
        )
        has_times = window is not None or not _are_documents(files)
        paths = write_figures(
            figures,
            lambda drawn: {
                "tracks": drawn.tracks_figure(tracked, start=start, has_times=has_times, source=Path(source).name)
            },
            file_format,
        )
        notes = tables.tracks_notes(tracked, windows)
        document = tracking_document(tracked, windows, start=start, has_times=has_times, notes=notes)
        paths += write_page(
            page,
            lambda inputs: pages.tracking_report(
                tracked, inputs, start=start, has_times=has_times, notes=notes, document=document
            ),
            files,
            has_recordings=not _are_documents(files),
            reading=reading,
            others={"vehicle": vehicle},
        )
    if write_result(document, json):
        words = [*notes, *written(paths, json)]
        table = tables.tracks_table(tracked, start=start, has_times=has_times)
        show(*([table] if tracked.tracks else []), words, heading=f"{source}: {tables.tracks_in_words(tracked)}")
    if not tracked.tracks:
        raise IdentificationError("no mode was found in enough windows: use longer windows, or more of them")


def _settings(band: tuple[float, float] | None, *, may_lack: bool) -> "IdentificationSettings":
    from sprung.identification import IdentificationSettings

    return IdentificationSettings(band=band, allow_missing=may_lack)


def _are_documents(files: Sequence[Path]) -> bool:
    """Whether files are identifications; refuse a mixture with recordings."""
    is_document = [path.suffix.lower() == ".json" for path in files]
    if any(is_document) and not all(is_document):
        raise ParameterError("JSON files and recordings cannot be followed together: give files of one kind")
    return all(is_document)


def _from_documents(files: Sequence[Path], *, distance: float) -> "list[WindowModes]":
    """Read the modes of identifications, one window each."""
    from sprung._checks import check_number
    from sprung.identification.methods import WindowModes
    from sprung.results.documents import read_identification

    check_number("--window", distance, above=0)
    windows = []
    for number, path in enumerate(files):
        modes = read_identification(path).as_modes()
        windows.append(WindowModes(number * distance, path.name, modes, "" if len(modes) else "no mode found"))
    return windows


class _Recordings:
    """Recordings of files, read one after the other; name of the current file, and start of the first recording."""

    def __init__(
        self,
        files: Sequence[Path],
        *,
        settings: "ReadSettings",
        report: Callable[[str, float], None],
    ) -> None:
        self.source = ""
        self.start: int | None = None
        self._share = 0.0
        self._files, self._settings, self._report = files, settings, report

    def report(self, step: str) -> None:
        """Report a step in the current file."""
        self._report(step, self._share)

    def __iter__(self) -> "Iterator[Recording]":
        from sprung.formats import read_records

        for number, path in enumerate(self._files):
            self.source, self._share = path.name, number / len(self._files)
            for recording in read_records([path], settings=self._settings, on_progress=self._report):
                if recording.start is not None:
                    self.start = recording.start if self.start is None else min(self.start, recording.start)
                yield recording


def _identified(
    recordings: _Recordings,
    window: float | None,
    method: str,
    settings: "IdentificationSettings",
    vehicle: "AnyVehicle | None",
) -> "list[WindowModes]":
    """Identify the modes of each window."""
    from sprung._checks import check_number
    from sprung.diagnosis import windows
    from sprung.identification.methods import identify_window

    length = _WHOLE if window is None else check_number("--window", window, above=0)
    parts = []
    for number, (time, part) in enumerate(windows(recordings, length=length), start=1):
        recordings.report(f"window {number}")
        parts.append(
            identify_window(
                part, time=time, source=recordings.source, method=method, settings=settings, vehicle=vehicle
            )
        )
    return parts
