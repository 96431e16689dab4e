"""The command `sprung info`."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sprung.cli.checks import check_file
from sprung.cli.options import Files, Json
from sprung.cli.output import show, write_result, written
from sprung.cli.progress import progress_bar
from sprung.cli.reading import reads_files
from sprung.errors import DataError

if TYPE_CHECKING:
    from sprung.formats import ReadSettings
    from sprung.signals.inspection import Inspection


@reads_files
def info(files: Files, *, reading: "ReadSettings", json: Json = None) -> None:
    """Summarise recordings: groups, channels, units, rate, length, gaps, levels and faults."""
    from sprung.formats import read_records
    from sprung.results import tables
    from sprung.results.documents import inspection_document
    from sprung.signals.inspection import inspect_blocks

    check_file("--json", json, inputs=files)
    inspections: dict[str, Inspection] = {}
    for path in files:
        parts, refused = _parts(path, reading), []
        for name, settings in parts.items():
            try:
                with progress_bar() as report:
                    inspection = inspect_blocks(read_records([path], settings=settings, on_progress=report))
            except DataError as error:
                refused.append(error)
                if len(refused) == len(parts):
                    raise
                continue
            inspections[name] = replace(inspection, group=settings.groups[0] if name != str(path) else None)
            if json != "-":
                heading = f"{name}: {tables.inspection_in_words(inspection)}"
                show(tables.inspection_table(inspection), inspection.history, heading=heading)
        if refused and json != "-":
            show([str(error) for error in refused], heading="Groups without samples of motion")
    if write_result(inspection_document(inspections), json):
        show(written([], json))


def _parts(path: Path, reading: "ReadSettings") -> "dict[str, ReadSettings]":
    """Return the settings for each inspected part by name: the file, or each group if the groups share no clock."""
    from sprung.formats import groups
    from sprung.results.documents.recordings import group_label

    found = groups(path, reading)
    if reading.groups or reading.channels is not None or len({group.clock for group in found}) == 1:
        return {str(path): reading}
    return {f"{path}{group_label(group.name)}": replace(reading, groups=(group.name,)) for group in found}
