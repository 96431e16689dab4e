"""The commands `sprung fleet import`, `archive` and `rank`."""

import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

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
from sprung.errors import DataError, ParameterError

if TYPE_CHECKING:
    from sprung.diagnosis import Observation
    from sprung.fleet.jobs.recordings import ImportedFile
    from sprung.fleet.lake import Lake


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
    """Add recordings to a lake. They are cut into the windows that sprung diagnose uses.

    Windows already in the lake are not added again. A file that cannot be read is listed, and the others are
    imported; the exit code is 2 if no file could be imported.
    """
    from sprung._checks import check_number
    from sprung.fleet.jobs.recordings import Importer
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import LakeImportDocument
    from sprung.results.tables.wording import parse_time

    check_file("--json", json, inputs=files)
    check_number("--window", window, at_least=1)
    begin = parse_time("--start", start)
    opened = Lake(lake)
    importer = Importer(opened, vehicle=vehicle_id, length=60 * window, start=begin, settings=reading.settings)
    with progress_bar() as report:
        imported = importer.add(files, on_progress=report)
    bad = [{"file": str(file.path), "reason": file.reason} for file in imported if file.reason]
    document = LakeImportDocument.of(lake=opened.location, vehicles=_by_vehicle(imported), bad_files=bad)
    problems = [_problem(**each) for each in bad]
    if write_result(document, json):
        show(tables.lake_import_table(document.as_json()), problems, written([], json))
    if len(bad) == len(imported):
        raise ParameterError(f"no file could be imported: {problems[0]}")


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
    from sprung.results.documents import LakeDocument
    from sprung.results.documents.fleet import LakeVehicle

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
    document = LakeDocument.of(
        facts,
        lake=opened.location,
        windows=facts.n_windows,
        files=facts.n_files,
        bytes=facts.n_bytes,
        vehicles=[LakeVehicle.of(own, windows=own.n_windows) for own in opened.vehicles()],
        compacted=compacted,
        removed=None if keep_days is None else before - facts.n_windows,
        exported=list(map(str, paths)),
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
    """Compare the vehicles of a type, and learn what is normal for it."""
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
        ranked = document.as_json()
        advice = filter(None, map(tables.describe_next_inspection, ranked["types"]))
        show(*tables.fleet_tables(ranked), [*advice, tables.describe_type(of_type), *notes, *outputs])


def _by_vehicle(files: "Sequence[ImportedFile]") -> list[dict[str, Any]]:
    """Return the vehicles of files with their numbers of files, of windows added, and of windows known before."""
    counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for file in files:
        if file.n_windows:
            counts[file.vehicle].update(files=1, added=file.n_added, known=file.n_windows - file.n_added)
    return [{"vehicle": vehicle, **own} for vehicle, own in sorted(counts.items())]


def _problem(file: str, reason: str) -> str:
    """Return why a file could not be imported; most reasons name it already."""
    return reason if file in reason else f"{file}: {reason}"


def _exported(lake: "Lake", folder: Path, *, vehicle: str | None, since: str | None, until: str | None) -> list[Path]:
    """Write the windows of a vehicle and period as recordings, and return the paths."""
    from sprung.fleet.jobs.recordings import export_windows
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
