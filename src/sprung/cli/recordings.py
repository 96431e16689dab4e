"""The commands `sprung info` and `sprung convert`."""

import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sprung._display import counted
from sprung.cli.options import Figures, FileFormat, Files, Json, Reading, check_file, option, shares_options
from sprung.cli.output import Output, progress_bar, show, write_result, written
from sprung.errors import DataError, MixedRatesError, ParameterError, SprungError

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from sprung.formats import ReadSettings
    from sprung.recording import Recording
    from sprung.signals.inspection import Inspection


@shares_options
def info(
    files: Files,
    *,
    figures: Figures = None,
    file_format: FileFormat = "png",
    json: Json = None,
    reading: Reading,
) -> None:
    """Summarise recordings: groups, channels, units, rate, length, gaps, levels and faults."""
    from sprung.formats import read
    from sprung.results import tables
    from sprung.results.documents import inspection_document
    from sprung.signals.plausibility import doubts

    output = Output(figures, file_format, json=json)
    output.check(*files)
    inspections: dict[str, Inspection] = {}
    unread: list[SprungError] = []
    for path in files:
        parts, refused = _parts(path, reading.settings), []
        for name, part in parts.items():
            try:
                inspection, settings, clockless = _inspected(path, part)
            except DataError as error:
                refused.append(error)
                if len(refused) == len(parts):
                    raise
                continue
            inspections[name] = replace(inspection, group=settings.groups[0] if name != str(path) else None)
            if json != "-":
                heading = f"{name}: {tables.describe_inspection(inspection)}"
                show(tables.inspection_table(inspection), [*doubts(inspection), *inspection.history], heading=heading)
            if clockless is not None:
                unread.append(clockless)
                continue
            recording_of = partial(read, path, settings=settings)
            output.draw(partial(_overview, recording_of=recording_of, name=name))
        if refused and json != "-":
            show([str(error) for error in refused], heading="Groups without samples of motion")
    if write_result(inspection_document(inspections), json):
        show(written(output.paths, json))
    if unread:
        raise unread[0]


def _inspected(path: Path, settings: "ReadSettings") -> "tuple[Inspection, ReadSettings, SprungError | None]":
    """Return the inspection of a part, the settings without its channels of other rates, and what its clock lacks.

    Rows without a clock are counted at 1 Hz, so that their levels are seen.
    """
    from sprung.formats import read_records
    from sprung.signals.inspection import inspect_blocks

    left_out: list[str] = []
    clockless: SprungError | None = None
    while True:
        try:
            with progress_bar() as report:
                inspection = inspect_blocks(read_records([path], settings=settings, on_progress=report))
            if clockless is not None:
                history = [f"{clockless}", *(line for line in inspection.history if "1 Hz as stated" not in line)]
                inspection = replace(inspection, sampling_rate=math.nan, duration=math.nan, history=tuple(history))
            return replace(inspection, history=(*inspection.history, *left_out)), settings, clockless
        except MixedRatesError as error:
            if not error.others:
                raise
            left_out.append(str(error))
            settings = replace(settings, channels=error.others)
        except SprungError as error:
            if settings.sampling_rate is not None:
                raise clockless or error from None
            clockless, settings = error, replace(settings, sampling_rate=1.0)


def _overview(drawn: Any, *, recording_of: "Callable[[], Recording]", name: str) -> "dict[str, Figure]":
    """Return the figures of a recording by the name of their file."""
    source = Path(name).name
    label = re.sub(r"\W+", "-", source).strip("-")
    return {f"{label}-{kind}": figure for kind, figure in drawn.overview_figures(recording_of(), source=source).items()}


def _parts(path: Path, reading: "ReadSettings") -> "dict[str, ReadSettings]":
    """Return the settings for each inspected part by name: the file, or each group if the groups share no clock."""
    from sprung.formats import groups
    from sprung.results.documents.recordings import group_label

    found = groups(path, reading)
    if reading.groups or reading.channels is not None or len({group.clock for group in found}) == 1:
        return {str(path): reading}
    return {f"{path}{group_label(group.name)}": replace(reading, groups=(group.name,)) for group in found}


@shares_options
def convert(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="IN... OUT",
            help="Recordings, then the file to write, whose ending sets its format, or a folder for several.",
            show_default=False,
        ),
    ],
    *,
    ending: Annotated[str, option(".END", "Ending of the files in a folder, which sets their format.")] = ".parquet",
    reading: Reading,
) -> None:
    """Convert recordings to another format, with units, names, start, calibration and comments."""
    from sprung.formats import read, write

    *files, out = paths
    if not files:
        raise ParameterError(f"{out} is the only path: name the recordings, then the file or folder to write")
    targets = _targets(files, out, ending)
    for path, target in zip(files, targets, strict=True):
        check_file("OUT", target, inputs=files)
        with progress_bar() as report:
            report(f"reading {path.name}", 0.0)
            recording = _with_plain_names(read(path, settings=reading.settings))
            report(f"writing {target.name}", 0.5)
            write(recording, target)
        minutes = recording.duration / 60
        channels = counted(len(recording.channels), "channel")
        heading = f"{path}: {channels}, {minutes:.4g} min at {recording.sampling_rate:.6g} Hz"
        show([*recording.history, f"wrote {target}"], heading=heading)


def _with_plain_names(recording: "Recording") -> "Recording":
    """Return a recording whose channel names do not end with the unit, which is written separately."""
    from sprung.formats.writing import without_unit

    names = {channel.name: without_unit(channel.name) for channel in recording.channels}
    if len(set(names.values())) < len(names) or all(name == plain for name, plain in names.items()):
        return recording
    renamed = ", ".join(f"{name!r} {plain!r}" for name, plain in names.items() if name != plain)
    channels = tuple(replace(channel, name=names[channel.name]) for channel in recording.channels)
    return recording.changed(f"renamed as the unit is stated separately: {renamed}", channels=channels)


def _targets(files: list[Path], out: Path, ending: str) -> list[Path]:
    """Return the file that each recording is written to."""
    from sprung.formats import WRITERS

    is_folder = out.is_dir() or out.suffix == ""
    if not is_folder and len(files) > 1:
        raise ParameterError(f"{out} is one file for {len(files)} recordings: give the name of a folder")
    if not is_folder:
        return [out]
    if ending not in WRITERS:
        raise ParameterError(f"--ending {ending!r} must be one of {', '.join(WRITERS)}")
    stems = [path.name.split(".")[0] for path in files]
    if len(set(stems)) < len(stems):
        raise ParameterError(
            f"several recordings would be written to {out / stems[0]}{ending}: convert them one by one"
        )
    out.mkdir(exist_ok=True)
    return [out / f"{stem}{ending}" for stem in stems]
