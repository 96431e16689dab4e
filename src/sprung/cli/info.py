"""The command `sprung info`."""

from pathlib import Path
from typing import TYPE_CHECKING

from sprung.cli.documents import write_json
from sprung.cli.files import Channels, Files, Json, SamplingRate, check_file, names, records
from sprung.cli.printing import console, notes, printable, rich_table
from sprung.cli.progress import progress_bar

if TYPE_CHECKING:
    from sprung.signals.inspection import Inspection


def info(
    files: Files,
    *,
    sampling_rate: SamplingRate = None,
    channels: Channels = None,
    json: Json = None,
) -> None:
    """Summarise recordings: channels, units, rate, length, gaps, levels and faults."""
    from sprung.documents import inspection_document

    check_file("--json", json, inputs=files)
    inspections = {}
    for path in files:
        inspection = _inspect(path, sampling_rate, names(channels))
        inspections[str(path)] = inspection
        if json != "-":
            _show(path, inspection)
    if json is not None:
        write_json(inspection_document(inspections), json)


def _inspect(path: Path, sampling_rate: float | None, channels: tuple[str, ...] | None) -> "Inspection":
    """Inspect a file, in bounded memory where it is large."""
    from sprung.signals.inspection import inspect_blocks

    with progress_bar() as report:
        return inspect_blocks(records([path], sampling_rate=sampling_rate, channels=channels, report=report))


def _show(path: Path, inspection: "Inspection") -> None:
    """Print the facts about a file."""
    from sprung.tables import inspection_in_words, inspection_table

    screen = console()
    screen.print(printable(str(path)), style="bold", soft_wrap=True)
    screen.print(inspection_in_words(inspection))
    screen.print(rich_table(inspection_table(inspection)))
    screen.print(notes(inspection.history))
    screen.print()
