"""The commands `sprung fleet import` and `sprung fleet archive`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.checks import check_file, check_folder
from sprung.cli.options import INPUT, OUTPUT, Files, Json, Minutes, Since, Until, option
from sprung.cli.output import show, write_result, written
from sprung.cli.progress import progress_bar
from sprung.cli.reading import reads_files
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.fleet.jobs.importing import ImportedFile
    from sprung.fleet.lake import Lake
    from sprung.formats import ReadSettings


@reads_files
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
    reading: "ReadSettings",
    window: Minutes = 10.0,
    json: Json = None,
) -> None:
    """Add recordings to a lake, cut into the windows that sprung diagnose uses.

    Windows already in the lake are not added again. A file that cannot be read is listed, and the others are
    imported; the exit code is 2 if no file could be imported.
    """
    from sprung._checks import check_number
    from sprung.fleet.jobs.importing import Importer
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import lake_import_document
    from sprung.results.periods import parse_time

    check_file("--json", json, inputs=files)
    check_number("--window", window, at_least=1)
    begin = parse_time("--start", start)
    opened = Lake(lake)
    importer = Importer(opened, vehicle=vehicle_id, length=60 * window, start=begin, settings=reading)
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
    removed = None if keep_days is None else _pruned(opened, keep_days)
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
        removed=removed,
        exported=paths,
    )
    if write_result(document, json):
        plain = document.as_json()
        outputs = [] if export is None else [f"wrote {len(paths)} recordings to {export}"]
        show(tables.lake_in_words(plain), tables.lake_table(plain), [*outputs, *written([], json)])


def _by_vehicle(files: "Sequence[ImportedFile]") -> list[tuple[str, int, int, int]]:
    """Return the vehicles of files with their numbers of files, of windows added, and of windows known before."""
    own: dict[str, list[ImportedFile]] = {}
    for file in files:
        if file.n_windows:
            own.setdefault(file.vehicle, []).append(file)
    counts = {
        name: (sum(file.n_added for file in of_it), sum(file.n_windows for file in of_it))
        for name, of_it in own.items()
    }
    return [(name, len(own[name]), added, total - added) for name, (added, total) in sorted(counts.items())]


def _problem(path: Path, reason: str) -> str:
    """Return why a file could not be imported; most reasons name it already."""
    return reason if str(path) in reason else f"{path}: {reason}"


def _exported(lake: "Lake", folder: Path, *, vehicle: str | None, since: str | None, until: str | None) -> list[Path]:
    """Write the windows of a vehicle and period as recordings, and return the paths."""
    from sprung.fleet.jobs.exporting import export_windows
    from sprung.results.periods import parse_period

    period = parse_period(since, until)
    with progress_bar() as report:
        report("exporting", 0.0)
        paths = export_windows(lake.windows(vehicle=vehicle, since=period.since, until=period.until), folder)
    if not paths:
        whose = "" if vehicle is None else f" of {vehicle}"
        raise ParameterError(f"{lake.location} contains no window{whose} in that period: see `sprung fleet archive`")
    return paths


def _pruned(lake: "Lake", days: float) -> int:
    """Delete dates that ended before a number of days, and return the number of windows deleted."""
    import time

    before = lake.facts.n_windows
    lake.prune(before=time.time_ns() - round(days * 86400e9))
    return before - lake.facts.n_windows
