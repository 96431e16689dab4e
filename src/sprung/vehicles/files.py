"""Vehicle files read and written, and those shipped with the package."""

import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from sprung._checks import check_path, check_type
from sprung.errors import FormatError, ParameterError
from sprung.toml import checked, toml_fields
from sprung.vehicles.description import KINDS, Chain, Quarter, Vehicle

#: Vehicles shipped with the package.
VEHICLES = ("chain3", "coach", "metro", "plate", "quarter", "scale-bogie", "y25", "zafira", "zafira-printed")

# A vehicle file is a page of text; anything larger is another file.
_LARGEST_FILE = 1_000_000


def read_vehicle(path_or_name: str | Path) -> Vehicle:
    """Read the file of a vehicle on axles, or one of those shipped with the package.

    Parameters
    ----------
    path_or_name
        A name of `VEHICLES`, or the path of a TOML file.

    Returns
    -------
    Vehicle
        Description of a body on axles (kind road, rail or rig). `read_description` reads quarter vehicles and chains
        as well.

    Raises
    ------
    ParameterError
        If the file or name does not exist, or describes a quarter vehicle or a chain.
    FormatError
        If the file is not a valid vehicle file; the message names file, field, rule and remedy.

    Examples
    --------
    >>> read_vehicle("zafira").body.mass
    1480.0
    """
    return _on_axles(read_description(path_or_name), source=str(path_or_name))


def read_description(path_or_name: str | Path) -> Vehicle | Quarter | Chain:
    """Read a vehicle file of any kind, or one of the vehicles shipped with the package.

    Parameters
    ----------
    path_or_name
        A name of `VEHICLES`, or the path of a TOML file.

    Returns
    -------
    Vehicle, Quarter or Chain
        Description of the kind that the file states.

    Raises
    ------
    ParameterError
        If the file or name does not exist.
    FormatError
        If the file is not a valid vehicle file; the message names file, field, rule and remedy.

    Examples
    --------
    >>> read_description("chain3").kind
    'chain'
    """
    check_path("path_or_name", path_or_name)
    if str(path_or_name) in VEHICLES:
        return _read(str(path_or_name), _shipped(str(path_or_name)))
    path = Path(path_or_name)
    if not path.is_file():
        raise ParameterError(
            f"vehicle {str(path_or_name)!r} is neither a file nor one of {', '.join(VEHICLES)}: correct the path"
        )
    if path.stat().st_size > _LARGEST_FILE:
        raise FormatError(
            f"{path} has {path.stat().st_size} bytes, more than any vehicle file: give the TOML file of the vehicle"
        )
    return _read(str(path), path.read_bytes())


def parse_vehicle(fields: Mapping[str, Any]) -> Vehicle | Quarter | Chain:
    """Check the fields of a vehicle and return it.

    Parameters
    ----------
    fields
        Fields as in a vehicle file; `schema` may be left out.

    Raises
    ------
    ParameterError
        If a field is missing, unknown or outside its range; the message names field, rule and remedy.

    Examples
    --------
    >>> corner = {"unsprung_mass": 40.0, "spring_stiffness": 2e4, "damping": 1500.0, "tyre_stiffness": 2e5}
    >>> quarter = parse_vehicle({"kind": "quarter", "name": "mine", "corner": corner, "body": {"mass": 400.0}})
    >>> quarter.corner.tyre_stiffness
    200000.0
    """
    kind = fields.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ParameterError(f"kind={kind!r} must be one of {', '.join(KINDS)}: add or correct it")
    return checked(KINDS[kind], fields)


def write_vehicle(vehicle: Vehicle | Quarter | Chain, path: str | Path) -> None:
    """Write a vehicle file; reading it gives an equal vehicle.

    Examples
    --------
    >>> import tempfile
    >>> zafira = read_vehicle("zafira")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_vehicle(zafira, Path(folder) / "car.toml")
    ...     again = read_vehicle(Path(folder) / "car.toml")
    ...
    >>> again == zafira
    True
    """
    check_type("vehicle", vehicle, Vehicle, Quarter, Chain)
    check_path("path", path)
    Path(path).write_text(vehicle_text(vehicle), encoding="utf-8")


def vehicle_text(vehicle: Vehicle | Quarter | Chain) -> str:
    """Return the text of a vehicle file.

    Examples
    --------
    >>> print(vehicle_text(read_vehicle("zafira")).splitlines()[0])
    schema = "sprung.vehicle/1"
    """
    fields = vehicle.model_dump(mode="json", exclude_defaults=True)
    return _toml({"schema": vehicle.schema_name, **fields})


def vehicle_from_text(text: str, *, source: str) -> Vehicle:
    """Return the vehicle on axles that the text of a file describes.

    Parameters
    ----------
    text
        Content of a vehicle file.
    source
        Name of the file in messages.

    Raises
    ------
    FormatError
        If the text is not a valid vehicle file.
    ParameterError
        If it describes a quarter vehicle or a chain.

    Examples
    --------
    >>> text = vehicle_text(read_vehicle("zafira"))
    >>> vehicle_from_text(text, source="zafira.toml") == read_vehicle("zafira")
    True
    """
    return _on_axles(_read(source, text.encode("utf-8")), source=source)


def _on_axles(description: Vehicle | Quarter | Chain, *, source: str) -> Vehicle:
    """Reject a description that is not of a body on axles."""
    if not isinstance(description, Vehicle):
        raise ParameterError(
            f"vehicle {source!r} is of kind {description.kind}, but must be a body on axles (kind road, rail or rig): "
            "give the file of such a vehicle"
        )
    return description


def _shipped(name: str) -> bytes:
    """Text of a vehicle file of the package."""
    return (resources.files("sprung.vehicles") / "data" / f"{name}.toml").read_bytes()


def _read(source: str, content: bytes) -> Vehicle | Quarter | Chain:
    """Parse and check a vehicle file; `source` is its name in messages."""
    fields = toml_fields(content, source=source)
    if fields.get("schema") != "sprung.vehicle/1":
        raise FormatError(
            f'{source}: schema={fields.get("schema")!r} must be "sprung.vehicle/1": add it as the first line if this '
            "is a vehicle file"
        )
    try:
        return parse_vehicle(fields)
    except ParameterError as error:
        raise FormatError(f"{source}: {error}") from None


def _toml(fields: Mapping[str, Any], prefix: str = "") -> str:
    """Write scalars and lists, then tables, then arrays of tables."""
    lines = [f"{key} = {_toml_value(value)}" for key, value in fields.items() if not _is_table(value)]
    for key, value in fields.items():
        if isinstance(value, Mapping):
            lines.append(f"\n[{prefix}{key}]\n{_toml(value)}".rstrip("\n"))
        elif _is_table(value):
            lines += [f"\n[[{prefix}{key}]]\n{_toml(entry)}".rstrip("\n") for entry in value]
    return "\n".join(lines) + "\n"


def _is_table(value: Any) -> bool:
    """Whether a value is a table or a list of tables."""
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def _toml_value(value: Any) -> str:
    """Write text, numbers and lists of numbers; their TOML is their JSON, but for the delete character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
