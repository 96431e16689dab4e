"""The documents of a lake: its contents, `sprung.lake/1`, and the result of an import, `sprung.lake-import/1`."""

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from pydantic import Field

from sprung.results.documents.document import Document


class LakeVehicle(Document):
    """A vehicle in a lake: times of its first and last window, UTC ns."""

    vehicle: str
    windows: int
    first: int
    last: int


class LakeDocument(Document):
    """Contents of a lake, after what was done to it."""

    schema_name: Literal["sprung.lake/1"] = Field(alias="schema")
    lake: str
    windows: int
    files: int
    bytes: int
    first: str | None
    last: str | None
    vehicles: tuple[LakeVehicle, ...]
    compacted: int | None
    removed: int | None
    exported: tuple[str, ...]


class ImportedVehicle(Document):
    """Windows of a vehicle that were added, and that were in the lake already."""

    vehicle: str
    files: int
    added: int
    known: int


class BadFile(Document):
    """A file that could not be imported."""

    file: str
    reason: str


class LakeImportDocument(Document):
    """Result of an import."""

    schema_name: Literal["sprung.lake-import/1"] = Field(alias="schema")
    lake: str
    vehicles: tuple[ImportedVehicle, ...]
    bad_files: tuple[BadFile, ...]


def lake_document(
    lake: str,
    *,
    windows: int,
    files: int,
    n_bytes: int,
    first: str | None,
    last: str | None,
    vehicles: Iterable[tuple[str, int, int, int]],
    compacted: int | None = None,
    removed: int | None = None,
    exported: Iterable[Path] = (),
) -> LakeDocument:
    """Return the contents of a lake as `sprung.lake/1`.

    Parameters
    ----------
    lake
        Folder or URL.
    windows, files, n_bytes
        Numbers of windows and files, and their size.
    first, last
        First and last date, as YYYY-mm-dd.
    vehicles
        Name of each vehicle, its number of windows, and the times of its first and last one, UTC ns.
    compacted, removed
        Numbers of dates that were compacted and of windows that were deleted; None: not asked for.
    exported
        Files that windows were written to.

    Examples
    --------
    >>> vehicle = ("bus-17", 144, 1_790_000_000_000_000_000, 1_790_086_400_000_000_000)
    >>> document = lake_document(
    ...     "lake", windows=144, files=3, n_bytes=21_000_000, first="2026-09-21", last="2026-09-22", vehicles=[vehicle]
    ... )
    >>> document.schema_name, document.vehicles[0].windows, document.removed is None
    ('sprung.lake/1', 144, True)
    """
    names = ("vehicle", "windows", "first", "last")
    return LakeDocument.model_validate(
        {
            "schema": "sprung.lake/1",
            "lake": lake,
            "windows": windows,
            "files": files,
            "bytes": n_bytes,
            "first": first,
            "last": last,
            "vehicles": [dict(zip(names, own, strict=True)) for own in vehicles],
            "compacted": compacted,
            "removed": removed,
            "exported": list(map(str, exported)),
        }
    )


def lake_import_document(
    lake: str, vehicles: Iterable[tuple[str, int, int, int]], bad_files: Iterable[tuple[Path, str]]
) -> LakeImportDocument:
    """Return the result of an import as `sprung.lake-import/1`.

    Parameters
    ----------
    lake
        Folder or URL.
    vehicles
        Name of each vehicle, its number of files, of windows added, and of windows known before.
    bad_files
        Files that could not be imported, and why.

    Examples
    --------
    >>> from pathlib import Path
    >>> document = lake_import_document("lake", [("bus-17", 2, 10, 4)], [(Path("x.csv"), "no time column")])
    >>> document.vehicles[0].added, document.bad_files[0].reason
    (10, 'no time column')
    """
    names = ("vehicle", "files", "added", "known")
    return LakeImportDocument.model_validate(
        {
            "schema": "sprung.lake-import/1",
            "lake": lake,
            "vehicles": [dict(zip(names, own, strict=True)) for own in vehicles],
            "bad_files": [{"file": str(path), "reason": reason} for path, reason in bad_files],
        }
    )
