"""Vehicle files (`sprung.vehicle/1`): read, check and write; the vehicles that come with the package."""

import difflib
import json
import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from sprung.errors import FormatError, ParameterError
from sprung.vehicles.description import KINDS, Chain, Quarter, Vehicle

#: Vehicles that come with the package.
VEHICLES = ("chain3", "plate", "quarter", "scale-bogie", "y25", "zafira", "zafira-printed")

# A vehicle file is a page of text; anything larger is another file.
_LARGEST_FILE = 1_000_000

# What a value must be, by the type of problem that pydantic reports.
_RULES = {
    "greater_than": "above {:g}: correct it",
    "greater_than_equal": "at least {:g}: correct it",
    "finite_number": "finite: give a number",
    "float_type": "a number: write it without quotes, as in 1480.0",
    "string_type": 'text: write it in quotes, as in "front"',
    "string_too_short": "text of at least {} character: fill it in",
    "string_too_long": "text of at most {} characters: shorten it",
    "string_pattern_mismatch": "one line of text without blanks around it: correct it",
    "tuple_type": "a list: write numbers in brackets, as in [1.2, 0.7, 0.0], and tables as [[name]]",
    "model_type": "a table of fields: write [name] above them",
    "literal_error": "{}: correct it",
}


def read_vehicle(path_or_name: str | Path) -> Vehicle | Quarter | Chain:
    """Read a vehicle file, or one of the vehicles that come with the package.

    Parameters
    ----------
    path_or_name
        A name of `VEHICLES`, or the path of a TOML file.

    Returns
    -------
    Vehicle, Quarter or Chain
        As the `kind` of the file says.

    Raises
    ------
    ParameterError
        Where there is no such file or name.
    FormatError
        Where the file is no vehicle file; the message names file, field, rule and remedy.

    Examples
    --------
    >>> read_vehicle("zafira").body.mass
    1480.0
    """
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
        As in a vehicle file; `schema` may be left out.

    Raises
    ------
    ParameterError
        Where a field is missing, unknown or outside its range; the message names field, rule and remedy.
    """
    kind = fields.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ParameterError(f"kind={kind!r} must be one of {', '.join(KINDS)}: add or correct it")
    try:
        return KINDS[kind].model_validate(dict(fields))
    except ValidationError as error:
        problems = _without_consequences(error.errors(include_url=False))
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise ParameterError(_sentence(problems[0], KINDS[kind]) + more) from None


def write_vehicle(vehicle: Vehicle | Quarter | Chain, path: str | Path) -> None:
    """Write a vehicle file; reading it gives an equal vehicle."""
    Path(path).write_text(vehicle_text(vehicle), encoding="utf-8")


def vehicle_text(vehicle: Vehicle | Quarter | Chain) -> str:
    """Return the text of a vehicle file."""
    fields = vehicle.model_dump(mode="json", exclude_defaults=True)
    return _toml({"schema": vehicle.schema_name, **fields})


def vehicle_from_text(text: str, *, source: str) -> Vehicle:
    """Return the vehicle on axles that the text of a file describes; `source` names it in messages.

    Raises
    ------
    FormatError
        Where it is no vehicle file.
    ParameterError
        Where it describes something that is not on axles.
    """
    vehicle = _read(source, text.encode("utf-8"))
    if not isinstance(vehicle, Vehicle):
        raise ParameterError(f"{source} is a {vehicle.kind}: corners need a body on axles")
    return vehicle


def _shipped(name: str) -> bytes:
    """Text of a vehicle file of the package."""
    return (resources.files("sprung.vehicles") / "data" / f"{name}.toml").read_bytes()


def _read(source: str, content: bytes) -> Vehicle | Quarter | Chain:
    """Parse and check a vehicle file; `source` is its name in messages."""
    try:
        fields = tomllib.loads(content.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else error
        raise FormatError(f"{source} is no TOML file: {reason}: correct it or give another file") from None
    if fields.get("schema") != "sprung.vehicle/1":
        raise FormatError(
            f'{source}: schema={fields.get("schema")!r} must be "sprung.vehicle/1": add it as the first line if this '
            "is a vehicle file"
        )
    try:
        return parse_vehicle(fields)
    except ParameterError as error:
        raise FormatError(f"{source}: {error}") from None


def _without_consequences(problems: Sequence[Any]) -> list[Mapping[str, Any]]:
    """Leave out that a list is too short where that is so because of another problem inside it."""
    places = [problem["loc"] for problem in problems]

    def is_consequence(problem: Mapping[str, Any]) -> bool:
        start = problem["loc"]
        return problem["type"] == "too_short" and any(
            place != start and place[: len(start)] == start for place in places
        )

    return [problem for problem in problems if not is_consequence(problem)]


def _sentence(problem: Mapping[str, Any], model: type[Vehicle | Quarter | Chain]) -> str:
    """Word one problem found by the checks: field and value, rule, remedy."""
    location, kind, context = problem["loc"], problem["type"], problem.get("ctx", {})
    where = _path(location)
    if kind == "value_error":
        return f"{where}: {context['error']}" if location else str(context["error"])
    if kind == "missing":
        return f"{where} is missing: add it"
    if kind == "extra_forbidden":
        return f"{where} is not known here: {_remedy(str(location[-1]), model)}"
    if kind in {"too_short", "too_long"}:
        wanted = f"at least {context['min_length']}" if kind == "too_short" else f"at most {context['max_length']}"
        return f"{where} has {context['actual_length']} entries, but must have {wanted}: correct it"
    value = repr(problem["input"])
    shown = value if len(value) <= 60 else f"{value[:57]}..."
    rule = _RULES.get(kind, "{}").format(*context.values() or [problem["msg"]])
    return f"{where}={shown} must be {rule}"


def _path(location: Sequence[str | int]) -> str:
    """Write the place of a field as a reader of the file counts: [[axle]] 2, damping."""
    words: list[str] = []
    for step in location:
        if isinstance(step, int):
            words[-1] = f"[[{words[-1]}]] {step + 1}" if len(words) == 1 else f"{words[-1]}[{step}]"
        else:
            words.append(step)
    return ", ".join(words)


def _remedy(key: str, model: type[Vehicle | Quarter | Chain]) -> str:
    """Name the field that an unknown key may have meant."""
    definitions = model.model_json_schema(by_alias=True)
    tables = [definitions, *definitions.get("$defs", {}).values()]
    known = sorted({name for table in tables for name in table.get("properties", {})})
    close = difflib.get_close_matches(key, known, n=1)
    return f"did you mean {close[0]}?" if close else "remove it, or correct its spelling"


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
