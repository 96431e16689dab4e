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
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

    from sprung.formats import ReadSettings
    from sprung.formats.table import Group
    from sprung.recording import Recording
    from sprung.signals.inspection import ChannelFacts, Inspection


#: Difference of rates up to which they are the same.
_SAME_RATE = 0.01


@shares_options
def info(
    files: Files,
    *,
    figures: Figures = None,
    file_format: FileFormat = "png",
    json: Json = None,
    reading: Reading,
) -> None:
    """Summarise recordings: channels, units, rate, gaps, faults."""
    from sprung.formats import groups, read
    from sprung.results import tables
    from sprung.results.documents import inspection_document
    from sprung.signals.inspection import doubts

    output = Output(figures, file_format, json=json)
    output.check(*files)
    inspections: dict[str, Inspection] = {}
    unread: list[SprungError] = []
    for path in files:
        found = groups(path, reading.settings)
        parts, refused = _parts(path, found, reading.settings), []
        for name, part in parts.items():
            try:
                inspection, settings, clockless = _inspected(path, found, part)
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


def _inspected(
    path: Path, found: "Sequence[Group]", settings: "ReadSettings"
) -> "tuple[Inspection, ReadSettings, SprungError | None]":
    """Return the inspection of a part, the settings without its channels of other rates, and what its clock lacks.

    Rows without a clock are counted at 1 Hz, so that their levels are seen.
    """
    from sprung.formats import read_records
    from sprung.formats.columns import wanted_table
    from sprung.formats.table import is_time, spellings
    from sprung.signals.inspection import facts_without_values, inspect_blocks

    given, left_out = settings, dict[str, str]()
    clockless: SprungError | None = None
    while True:
        try:
            with progress_bar() as report:
                inspection = inspect_blocks(read_records([path], settings=settings, on_progress=report))
            break
        except MixedRatesError as error:
            if not error.others:
                raise
            left_out |= dict(error.left_out)
            settings = replace(settings, channels=error.others)
        except SprungError as error:
            if settings.sampling_rate is not None:
                raise clockless or error from None
            clockless, settings = error, replace(settings, sampling_rate=1.0)
    known = {facts.name for facts in inspection.channels}
    headings = [heading for group in found for heading in group.headings if not is_time(heading)]
    is_read = clockless is None and all(known & {*spellings(heading)} for heading in headings)
    table = None if is_read else wanted_table(path, found, settings)
    left_out |= dict(table.left_out) if table is not None and given.channels is None else {}
    rows = [_with_reason(facts, inspection.history) for facts in inspection.channels]
    for name, reason in left_out.items():
        rows.append(_alone(path, replace(settings, channels=(name,)), f"left out: {reason}", inspection.sampling_rate))
    if clockless is not None:
        history = [f"{clockless}", *(line for line in inspection.history if "1 Hz as stated" not in line)]
        inspection = replace(inspection, sampling_rate=math.nan, duration=math.nan, history=tuple(history))
        if table is not None and table.time_heading is not None:
            reason = str(clockless).removeprefix(str(path)).lstrip(":, ").rsplit(": ", 1)[0]
            rows.insert(0, facts_without_values(table.time_heading, reason))
    return replace(inspection, channels=tuple(rows)), settings, clockless


def _with_reason(facts: "ChannelFacts", history: "Sequence[str]") -> "ChannelFacts":
    """Return the facts about a channel with what the history says of its values that were not measured."""
    from sprung.formats.grid import UNMEASURED

    start, end = f"{facts.name}: ", f" {UNMEASURED}"
    found = next((line for line in history if line.startswith(start) and line.endswith(end)), "")
    return replace(facts, reason=found.removeprefix(start).removesuffix(end).rstrip(","))


def _alone(path: Path, settings: "ReadSettings", reason: str, others: float) -> "ChannelFacts":
    """Return the row of a channel that is left out, with its levels and rate where it can be read by itself."""
    from sprung.formats import read_records
    from sprung.signals.inspection import facts_without_values, inspect_blocks

    try:
        own = inspect_blocks(read_records([path], settings=settings))
    except SprungError:
        return facts_without_values(", ".join(settings.channels or ()), reason)
    is_other = abs(own.sampling_rate / others - 1) > _SAME_RATE
    return replace(own.channels[0], reason=f"{reason}, {own.sampling_rate:.4g} Hz" if is_other else reason)


def _overview(drawn: Any, *, recording_of: "Callable[[], Recording]", name: str) -> "dict[str, Figure]":
    """Return the figures of a recording by the name of their file."""
    source = Path(name).name
    label = re.sub(r"\W+", "-", source).strip("-")
    return {f"{label}-{kind}": figure for kind, figure in drawn.overview_figures(recording_of(), source=source).items()}


def _parts(path: Path, found: "Sequence[Group]", reading: "ReadSettings") -> "dict[str, ReadSettings]":
    """Return the settings for each inspected part by name: the file, or each group if the groups share no clock."""
    from sprung.results.documents.recordings import group_label

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
    """Convert recordings to another format. Units, names, start, calibration and comments are kept."""
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
    from sprung.formats.table import without_unit

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
