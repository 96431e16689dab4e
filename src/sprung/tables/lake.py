"""Lakes as tables and sentences."""

from collections.abc import Mapping
from typing import Any

from sprung._display import counted
from sprung.tables.table import Table, time_in_words


def lake_in_words(document: Mapping[str, Any]) -> list[str]:
    """Return the contents of a `sprung.lake/1`, and what was done to it, in sentences."""
    size = f"{counted(document['windows'], 'window')} of {counted(len(document['vehicles']), 'vehicle')}"
    period = "" if document["first"] is None else f", {document['first']} to {document['last']}"
    sentences = [f"{size} in {counted(document['files'], 'file')}, {document['bytes'] / 1e6:.4g} MB{period}"]
    if document["compacted"] is not None:
        sentences.append(f"compacted {counted(document['compacted'], 'date')}")
    if document["removed"] is not None:
        sentences.append(f"deleted {counted(document['removed'], 'window')}")
    return sentences


def lake_table(document: Mapping[str, Any]) -> Table:
    """Return the table of the vehicles in a `sprung.lake/1`."""
    rows = (
        (own["vehicle"], str(own["windows"]), time_in_words(own["first"]), time_in_words(own["last"]))
        for own in document["vehicles"]
    )
    return Table("", ("vehicle", "windows", "first (UTC)", "last (UTC)"), tuple(rows))


def lake_import_table(document: Mapping[str, Any]) -> Table:
    """Return the table of the vehicles in a `sprung.lake-import/1`."""
    names = ("files", "added", "known")
    rows = ((own["vehicle"], *(str(own[name]) for name in names)) for own in document["vehicles"])
    return Table("", ("vehicle", "files", "windows added", "already present"), tuple(rows), ends_in_words=False)
