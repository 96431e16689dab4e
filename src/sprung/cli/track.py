"""The command `sprung track`."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.options import (
    INPUT,
    AllowMissing,
    complete_recordings_or_documents,
    option,
    shares_options,
    vehicle_file,
)
from sprung.cli.output import Output, progress_bar
from sprung.cli.reading import Reading
from sprung.errors import IdentificationError, ParameterError

if TYPE_CHECKING:
    from sprung.identification import IdentificationSettings
    from sprung.identification.methods import WindowModes
    from sprung.recording import Recording
    from sprung.vehicles.usable import AnyVehicle

#: Length of a window that no recording reaches [s]: each is one window.
_WHOLE = 1e9
_TRACKING = "Tracking"


@shares_options
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
    vehicle: Annotated[str | None, vehicle_file("sensors, band and labels.")] = None,
    allow_missing: AllowMissing = False,
    method: Annotated[
        Literal["cov", "acs", "coss", "plscf", "fdd"],
        option(None, "Identification of each window, as for sprung identify.", panel=INPUT),
    ] = "cov",
    band: Annotated[
        tuple[float, float] | None,
        option("LO HI", "Lowest and highest natural frequency, in Hz.", panel=INPUT),
    ] = None,
    gap: Annotated[
        float | None,
        option("SECONDS", "Longest gap over which a mode is still tracked. Default: 48 windows.", panel=_TRACKING),
    ] = None,
    reach: Annotated[
        float,
        option("D", "Largest sudden relative change of a natural frequency that is followed.", panel=_TRACKING),
    ] = 0.1,
    output: Output,
    reading: Reading,
) -> None:
    """Follow modes over files or windows by frequency, shape and standard deviations, with births and deaths."""
    from sprung.identification import IdentificationSettings
    from sprung.identification.tracking import TrackingSettings, track_modes
    from sprung.results import tables
    from sprung.results.documents import tracking_document
    from sprung.vehicles import read_description

    output.check(*files, vehicle)
    settings = TrackingSettings(gap=gap, reach=reach)
    source = str(files[0]) if len(files) == 1 else f"{len(files)} files"
    start = None
    with progress_bar() as report:
        if _are_documents(files):
            windows = _from_documents(files, distance=1.0 if window is None else window)
        else:
            description = None if vehicle is None else read_description(vehicle)
            may_lack = reading.may_lack(description, allow_missing=allow_missing)
            recordings = _Recordings(files, reading, report)
            identifying = IdentificationSettings(band=band, allow_missing=may_lack)
            windows = _identified(recordings, window, method, identifying, description)
            start = recordings.start
        windows = sorted(windows, key=lambda part: part.time)
        tracked = track_modes(
            [part.modes for part in windows], times=[part.time for part in windows], settings=settings
        )
        has_times = window is not None or not _are_documents(files)
        when: dict[str, Any] = {"start": start, "has_times": has_times}
        output.draw(lambda drawn: {"tracks": drawn.tracks_figure(tracked, source=Path(source).name, **when)})
        notes = tables.tracks_notes(tracked, windows)
        document = tracking_document(tracked, windows, notes=notes, **when)
        output.report(
            lambda pages, inputs: pages.tracking_report(tracked, inputs, notes=notes, document=document, **when),
            files,
            None if _are_documents(files) else reading,
            vehicle=vehicle,
        )
    shown = [tables.tracks_table(tracked, **when)] if tracked.tracks else []
    output.show(document, *shown, notes=notes, heading=f"{source}: {tables.describe_tracks(tracked)}")
    if not tracked.tracks:
        raise IdentificationError("no mode was found in enough windows: use longer windows, or more of them")


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

    def __init__(self, files: Sequence[Path], reading: Reading, report: Callable[[str, float], None]) -> None:
        self.source = ""
        self.start: int | None = None
        self._share = 0.0
        self._files, self._reading, self._report = files, reading, report

    def report(self, step: str) -> None:
        """Report a step in the current file."""
        self._report(step, self._share)

    def __iter__(self) -> "Iterator[Recording]":
        for number, path in enumerate(self._files):
            self.source, self._share = path.name, number / len(self._files)
            for recording in self._reading.records([path], self._report):
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
