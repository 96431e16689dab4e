"""The commands `sprung identify` and `sprung track`."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.options import (
    INPUT,
    OUTPUT,
    AllowMissing,
    Files,
    Group,
    Reading,
    check_file,
    complete_recordings_or_documents,
    declared,
    names,
    option,
    shares_options,
    vehicle_file,
)
from sprung.cli.output import Output, progress_bar
from sprung.errors import IdentificationError, ParameterError

if TYPE_CHECKING:
    from sprung.identification import Identification, IdentificationSettings
    from sprung.identification.methods import WindowModes
    from sprung.recording import Recording
    from sprung.vehicles.sensor_layout import AnyVehicle


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
    """Track modes over files or windows. They are matched by frequency, shape and standard deviations."""
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


_SHAPES = (".gif", ".html", ".unv", ".uff")
_PREPARATION, _SIZES = "Preparation (default: chosen from the data)", "Identification (default: chosen from the data)"


@dataclass(frozen=True, slots=True)
class Identifying(Group):
    """How modes are identified; what is None is chosen from the data."""

    method: Literal["cov", "acs", "coss", "plscf", "fdd"] = declared(
        None,
        "cov: correlations of whole records, which scatter least. acs: correlations averaged over segments."
        " coss: averaged over segments of similar level, which shows dependence on amplitude. For comparison:"
        " plscf (polynomials fitted to half spectra) and fdd (peaks of the singular values).",
        default="cov",
        panel=_SIZES,
    )
    subsets: int | None = declared("J", "Number of level ranges for coss (3).", panel=_SIZES, min=1, max=50)
    segment: float | None = declared("SECONDS", "Length of the segments.", panel=_SIZES)
    block_rows: int | None = declared("I", "Number of block rows.", panel=_SIZES, min=2)
    max_order: int | None = declared("N", "Largest model order.", panel=_SIZES, min=2)
    stable_rate: float | None = declared("D", "Minimum share of orders at which a mode is stable (0.2).", panel=_SIZES)
    references: str | None = declared(
        "A,B,..",
        "Reference channels (with --setups, those that stay in place), or disjoint: outputs and references from"
        " disjoint sets of channels, which rejects sensor noise in the band of the modes.",
        panel=_SIZES,
    )
    setups: bool = declared(
        None,
        "Each file is a set-up of roving sensors: identify them one by one and merge the mode shapes at the"
        " references. Files whose channel names differ are treated as set-ups without this option.",
        "--setups",
        default=False,
        panel=_SIZES,
    )
    thesis: bool = declared(
        None,
        "Settings of F. Liu (2020): 12 to 45 (or I) block rows, correlations as data, loose criteria.",
        "--thesis",
        default=False,
        panel=_SIZES,
    )
    refine: bool = declared(
        None,
        "Refine the modes by the likelihood of the spectra of whole records, where it fits them.",
        "--refine/--no-refine",
        default=True,
        panel=_SIZES,
    )
    kind: Literal["auto", "random", "free"] = declared(
        None,
        "random: stationary random motion. free: free motion after pushes, drops or releases. auto: free where"
        " records are quiet but for motions that die away.",
        default="auto",
        panel=_PREPARATION,
    )
    band: tuple[float, float] | None = declared(
        "LO HI", "Lowest and highest natural frequency, in Hz.", panel=_PREPARATION
    )
    decimate_to: float | None = declared("HZ", "Sampling rate of the identification.", panel=_PREPARATION)
    cepstrum: float | None = declared(
        "SECONDS",
        "Remove periodic excitation: keep the cepstrum up to this quefrency. A low value (0.25) adds damping to"
        " lightly damped modes.",
        panel=_PREPARATION,
    )
    pick: str | None = declared(
        "F1,F2,..",
        "Frequencies in Hz at which to pick modes by hand: the nearest stable poles, or maxima with fdd.",
        panel=_SIZES,
    )

    @property
    def settings(self) -> "IdentificationSettings":
        """Settings of the identification."""
        from sprung.identification import IdentificationSettings, as_in_thesis
        from sprung.identification.settings import THESIS_ROWS
        from sprung.signals.spectrum import ShortPass

        if self.subsets is not None and self.method != "coss":
            raise ParameterError(f"--subsets {self.subsets} needs --method coss: {self.method} does not sort segments")
        names_alike = ("band", "decimate_to", "segment", "max_order", "refine", "kind")
        given = {name: getattr(self, name) for name in names_alike}
        given |= {"n_subsets": self.subsets, "block_rows": None if self.thesis else self.block_rows}
        settings = IdentificationSettings(
            lifter=None if self.cepstrum is None else ShortPass(self.cepstrum),
            references=None if self.references == "disjoint" else names(self.references),
            has_disjoint_references=self.references == "disjoint",
            **{name: value for name, value in given.items() if value is not None},
        )
        if self.thesis:
            first, last = THESIS_ROWS[0], self.block_rows or THESIS_ROWS[1]
            if self.max_order is not None:
                raise ParameterError(
                    f"--max-order {self.max_order} does not apply with --thesis, whose ladder is over block rows:"
                    " leave it out"
                )
            if last <= first:
                raise ParameterError(
                    f"--block-rows {last} must be above {first} with --thesis, whose ladder starts there"
                )
            settings = as_in_thesis(settings, rows=(first, last))
        if self.stable_rate is None:
            return settings
        return replace(settings, criteria=replace(settings.criteria, stable_rate=self.stable_rate))

    @property
    def picked(self) -> list[float]:
        """Frequencies of --pick."""
        try:
            return [float(part) for part in names(self.pick) or ()]
        except ValueError:
            raise ParameterError(
                f"--pick {self.pick} must be frequencies in Hz, separated by commas: such as 1.88,2.42"
            ) from None


@shares_options
def identify(
    files: Files,
    *,
    vehicle: Annotated[str | None, vehicle_file("gives sensor layout, band and labels.")] = None,
    allow_missing: AllowMissing = False,
    identifying: Identifying,
    output: Output,
    shapes: Annotated[
        Path | None,
        option(
            "FILE",
            "Write the mode shapes: animated as .gif or .html, or with the geometry as a universal file, .unv or .uff.",
            panel=OUTPUT,
        ),
    ] = None,
    reading: Reading,
) -> None:
    """Identify frequencies, damping ratios and shapes of modes. All recordings are of one condition."""
    from sprung._checks import check_one_of
    from sprung.identification import METHODS, identify_setups, pick_modes
    from sprung.results import tables
    from sprung.results.documents import identification_document
    from sprung.vehicles import read_description

    output.check(*files, vehicle)
    check_file("--shapes", shapes, inputs=files)
    if shapes is not None:
        check_one_of("ending of --shapes", shapes.suffix.lower(), _SHAPES)
    if identifying.setups and len(files) < 2:
        raise ParameterError("--setups needs at least two files, one for each set-up")
    settings, picked, method = identifying.settings, identifying.picked, METHODS[identifying.method]
    source = str(files[0]) if len(files) == 1 else f"{len(files)} files"
    with progress_bar() as report:
        description = None if vehicle is None else read_description(vehicle)
        if description is not None:
            settings = replace(settings, allow_missing=reading.may_lack(description, allow_missing=allow_missing))
        if identifying.setups:
            identification = identify_setups(
                method,
                [reading.records([file], report) for file in files],
                references=settings.references,
                settings=replace(settings, references=None),
                vehicle=description,
                on_progress=report,
            )
        else:
            recordings = reading.records(files, report)
            identification = method(recordings, settings=settings, vehicle=description, on_progress=report)
        if picked:
            identification = pick_modes(identification, picked, vehicle=description)
        if output.figures is not None:
            report("drawing figures", 1.0)
        output.draw(lambda drawn: drawn.figures(identification, source=Path(source).name))
        output.paths += _write_shapes(identification, shapes, Path(source).name)
        document = identification_document(identification, vehicle=description)
        output.report(
            lambda pages, inputs: pages.identification_report(identification, inputs, document=document),
            files,
            reading,
            vehicle=vehicle,
        )
    heading = f"{source}: {tables.describe_identification(identification)}"
    output.show(document, *tables.identification_tables(identification), notes=identification.notes, heading=heading)
    if not len(identification.modes):
        raise IdentificationError(tables.why_none(identification))


def _write_shapes(identification: "Identification", path: Path | None, source: str) -> list[Path]:
    """Write the mode shapes to a file if there is one and there are modes, and return its path."""
    if path is None or not len(identification.modes):
        return []
    modes, channels = identification.modes, identification.channels
    if path.suffix.lower() in {".unv", ".uff"}:
        from sprung.formats.nodes import write_universal

        write_universal(modes, channels, path)
    else:
        from sprung.results.figures import save_animation

        save_animation(modes, channels, path, source=source)
    return [path]
