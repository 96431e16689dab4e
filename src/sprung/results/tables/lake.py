"""Lakes as tables and sentences."""

from collections.abc import Mapping
from typing import Any

from sprung._display import counted
from sprung.results.tables.table import Table, time_in_words


def lake_in_words(document: Mapping[str, Any]) -> list[str]:
    """Return what a `sprung.lake/1` holds, and what was done to it, in sentences.

    Examples
    --------
    >>> contents = {"windows": 144, "files": 3, "bytes": 21_000_000, "vehicles": [{"vehicle": "bus-17"}]}
    >>> contents |= {"first": "2026-11-20", "last": "2026-11-21", "compacted": None, "removed": 12}
    >>> lake_in_words(contents)
    ['144 windows of 1 vehicle in 3 files, 21 MB, 2026-11-20 to 2026-11-21', 'deleted 12 windows']
    """
    size = f"{counted(document['windows'], 'window')} of {counted(len(document['vehicles']), 'vehicle')}"
    period = "" if document["first"] is None else f", {document['first']} to {document['last']}"
    sentences = [f"{size} in {counted(document['files'], 'file')}, {document['bytes'] / 1e6:.4g} MB{period}"]
    if document["compacted"] is not None:
        sentences.append(f"compacted {counted(document['compacted'], 'date')}")
    if document["removed"] is not None:
        sentences.append(f"deleted {counted(document['removed'], 'window')}")
    return sentences


def lake_table(document: Mapping[str, Any]) -> Table:
    """Return the vehicles in a `sprung.lake/1`.

    Examples
    --------
    >>> first = 1_790_000_000_000_000_000
    >>> vehicle = {"vehicle": "bus-17", "windows": 144, "first": first, "last": first + 3_600_000_000_000}
    >>> table = lake_table({"vehicles": [vehicle]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    vehicle | windows | first (UTC) | last (UTC)
    bus-17 | 144 | 2026-09-21 14:13 | 2026-09-21 15:13
    """
    rows = (
        (own["vehicle"], str(own["windows"]), time_in_words(own["first"]), time_in_words(own["last"]))
        for own in document["vehicles"]
    )
    return Table("", ("vehicle", "windows", "first (UTC)", "last (UTC)"), tuple(rows))


def lake_import_table(document: Mapping[str, Any]) -> Table:
    """Return what a `sprung.lake-import/1` states of each vehicle.

    Examples
    --------
    >>> vehicle = {"vehicle": "bus-17", "files": 2, "added": 10, "known": 4}
    >>> table = lake_import_table({"vehicles": [vehicle]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    vehicle | files | windows added | already present
    bus-17 | 2 | 10 | 4
    """
    names = ("files", "added", "known")
    rows = ((own["vehicle"], *(str(own[name]) for name in names)) for own in document["vehicles"])
    return Table("", ("vehicle", "files", "windows added", "already present"), tuple(rows), ends_in_words=False)
