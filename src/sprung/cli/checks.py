"""Checks of options that several commands share, made before any long computation."""

import csv
from collections.abc import Sequence
from pathlib import Path

from sprung.errors import ParameterError


def names(text: str | None) -> tuple[str, ...] | None:
    """Return the names in a comma-separated list; a name that contains a comma is written in double quotes."""
    if text is None:
        return None
    parts = [part.strip() for part in next(csv.reader([text], skipinitialspace=True), [])]
    if not parts or not all(parts) or len(set(parts)) < len(parts):
        raise ParameterError(f"{text!r} is not a list of distinct names: separate them by commas, as in acc_fl,acc_fr")
    return tuple(parts)


def check_file(option: str, path: str | Path | None, *, inputs: Sequence[str | Path] = ()) -> None:
    """Refuse an output file without a folder, or one that would overwrite an input."""
    if path is None or str(path) == "-":
        return
    if Path(path).exists() and any(Path(name).exists() and Path(path).samefile(name) for name in inputs):
        raise ParameterError(f"{option} {path} would overwrite an input: give another name")
    if Path(path).is_dir():
        raise ParameterError(f"{option} {path} is a folder: give the name of a file")
    if not Path(path).parent.is_dir():
        raise ParameterError(f"{option} {path} needs the folder {Path(path).parent}, which does not exist: create it")


def check_folder(option: str, path: Path | None) -> None:
    """Refuse a folder for output that is a file."""
    if path is not None and path.exists() and not path.is_dir():
        raise ParameterError(f"{option} {path} is a file: give the name of a folder")
