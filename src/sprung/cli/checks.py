"""Checks of options that several commands share, made before any long computation."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.vehicles import Sensor


def names(text: str | None) -> tuple[str, ...] | None:
    """Return the names in a comma-separated list; a name that contains a comma is written in double quotes."""
    if text is None:
        return None
    parts = [part.strip() for part in next(csv.reader([text], skipinitialspace=True), [])]
    if not parts or not all(parts) or len(set(parts)) < len(parts):
        raise ParameterError(f"{text!r} is not a list of distinct names: separate them by commas, as in acc_fl,acc_fr")
    return tuple(parts)


def may_lack_sensors(sensors: "Sequence[Sensor]", *, allow_missing: bool, channels: Sequence[str] | None) -> bool:
    """Return whether recordings may lack sensors of a vehicle file: as allowed, or left out with --channels.

    Parameters
    ----------
    sensors
        Sensors of the vehicle file.
    allow_missing
        Option of the command.
    channels
        Channels that are read; None: all.

    Raises
    ------
    ParameterError
        If one of the chosen channels looks like a sensor that is not among them, without permission.
    """
    from sprung.vehicles.sensor_layout import check_present

    if channels is not None:
        check_present(channels, sensors, allow_missing=allow_missing, is_choice=True)
    return allow_missing or channels is not None


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


def check_page(page: Path | None, *, inputs: Sequence[str | Path] = ()) -> None:
    """Refuse a report that is not an HTML file, or that cannot be written."""
    check_file("--report", page, inputs=inputs)
    if page is not None and page.suffix.lower() not in {".html", ".htm"}:
        raise ParameterError(f"--report {page} must be an HTML file: name it {page.with_suffix('.html').name}")


def check_outputs(
    *, json: str | None, page: Path | None, figures: Path | None, inputs: Sequence[str | Path | None]
) -> None:
    """Refuse a JSON file, a report or a folder of figures that cannot be written; None of the inputs is not given."""
    given = [path for path in inputs if path is not None]
    check_file("--json", json, inputs=given)
    check_page(page, inputs=given)
    check_folder("--figures", figures)


def check_folder(option: str, path: Path | None) -> None:
    """Refuse a folder for output that is a file."""
    if path is not None and path.exists() and not path.is_dir():
        raise ParameterError(f"{option} {path} is a file: give the name of a folder")
