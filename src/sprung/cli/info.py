"""The command `sprung info`."""

from sprung.cli.checks import check_file, names
from sprung.cli.options import Channels, Files, Json, SamplingRate
from sprung.cli.output import show, write_result, written
from sprung.cli.progress import progress_bar


def info(files: Files, *, sampling_rate: SamplingRate = None, channels: Channels = None, json: Json = None) -> None:
    """Summarise recordings: channels, units, rate, length, gaps, levels and faults."""
    from sprung import tables
    from sprung.documents import inspection_document
    from sprung.formats.records import read_records
    from sprung.signals.inspection import inspect_blocks

    check_file("--json", json, inputs=files)
    inspections = {}
    for path in files:
        with progress_bar() as report:
            inspection = inspect_blocks(
                read_records([path], sampling_rate=sampling_rate, channels=names(channels), on_progress=report)
            )
        inspections[str(path)] = inspection
        if json != "-":
            heading = f"{path}: {tables.inspection_in_words(inspection)}"
            show(tables.inspection_table(inspection), inspection.history, heading=heading)
    if write_result(inspection_document(inspections), json):
        show(written([], json))
