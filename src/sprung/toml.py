"""TOML files written by people, checked against models: every mistake becomes one sentence."""

import tomllib
from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from sprung._checks import nearest_name
from sprung.errors import FormatError, ParameterError

_Model = TypeVar("_Model", bound=BaseModel)

# Requirement on a value, by the type of problem that pydantic reports.
_RULES = {
    "greater_than": "above {:g}: correct it",
    "greater_than_equal": "at least {:g}: correct it",
    "less_than_equal": "at most {:g}: correct it",
    "finite_number": "finite: give a number",
    "float_type": "a number: write it without quotes, as in 1480.0",
    "int_type": "a whole number: write it without quotes and decimal point, as in 12",
    "bool_type": "true or false: write it without quotes",
    "string_type": 'text: write it in quotes, as in "front"',
    "string_too_short": "text of at least {} character: fill it in",
    "string_too_long": "text of at most {} characters: shorten it",
    "string_pattern_mismatch": "one line of text without blanks around it: correct it",
    "tuple_type": "a list: write numbers in brackets, as in [1.2, 0.7, 0.0], and tables as [[name]]",
    "list_type": 'a list: write texts in brackets, as in ["a", "b"], and tables as [[name]]',
    "dict_type": "a table of fields: write [name] above them",
    "model_type": "a table of fields: write [name] above them",
    "literal_error": "{}: correct it",
}
# Types of problems of a key that the model or dataclass lacks.
_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
# Largest number of unknown keys that are compared with missing ones.
_MAX_MISSPELT = 100
# Fields whose values, and the values of tables that may contain them, never appear in a message.
_SECRETS = {"url", "headers", "password"}


def toml_fields(content: bytes, *, source: str) -> dict[str, Any]:
    """Return the fields of a TOML file; `source` names it in messages.

    Raises
    ------
    FormatError
        If the content is not valid TOML.
    """
    try:
        return tomllib.loads(content.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else error
        raise FormatError(f"{source} is not a TOML file: {reason}: correct it or give another file") from None


def checked(model: type[_Model], fields: Mapping[str, Any]) -> _Model:
    """Return the model with the given fields.

    Raises
    ------
    ParameterError
        If a field is missing, unknown or outside its range; the message names field, rule and remedy, and counts
        further problems.
    """
    try:
        return model.model_validate(dict(fields))
    except ValidationError as error:
        schema = model.model_json_schema(by_alias=True)
        every = error.errors(include_url=False)
        problems = _without_consequences(every, schema)
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        absent = _absent(every, problems[0]["loc"])
        raise ParameterError(_sentence(problems[0], schema, absent) + more) from None


def _without_consequences(problems: Sequence[Any], schema: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Omit problems that follow from another: of a list too short for one inside it, of a key missing as misspelt."""
    places = [problem["loc"] for problem in problems]

    def is_consequence(problem: Mapping[str, Any]) -> bool:
        start = problem["loc"]
        return problem["type"] == "too_short" and any(
            place != start and place[: len(start)] == start for place in places
        )

    unknown = [problem["loc"] for problem in problems if problem["type"] in _UNKNOWN]
    meant = {
        (*location[:-1], _nearest_key(location, schema, _absent(problems, location))): location
        for location in unknown[:_MAX_MISSPELT]
    }
    by_place = {problem["loc"]: problem for problem in problems}
    causes: dict[Any, Mapping[str, Any]] = {}
    for problem in problems:
        if not is_consequence(problem):
            place = meant.get(problem["loc"], problem["loc"]) if problem["type"] == "missing" else problem["loc"]
            causes.setdefault(place, by_place[place])
    return list(causes.values())


def _absent(problems: Sequence[Any], location: Sequence[str | int]) -> list[str]:
    """Return the keys that the table at a location must have and lacks."""
    return [
        problem["loc"][-1]
        for problem in problems
        if problem["type"] == "missing" and problem["loc"][:-1] == location[:-1]
    ]


def _sentence(problem: Mapping[str, Any], schema: Mapping[str, Any], absent: Collection[str]) -> str:
    """Return one problem as a sentence: field and value, rule, remedy; `absent` are keys that the table must have."""
    location, kind, context = problem["loc"], problem["type"], problem.get("ctx", {})
    where = _path(location)
    if kind == "value_error":
        return f"{where}: {context['error']}" if location else str(context["error"])
    if kind == "missing":
        return f"{where} is missing: add it"
    if kind in _UNKNOWN:
        return f"{where} is not known here: {_remedy(location, schema, absent)}"
    if kind in {"too_short", "too_long"}:
        wanted = f"at least {context['min_length']}" if kind == "too_short" else f"at most {context['max_length']}"
        return f"{where} has {context['actual_length']} entries, but must have {wanted}: correct it"
    rule = _RULES.get(kind, "{}").format(*context.values() or [problem["msg"]])
    if _SECRETS.intersection(location) or isinstance(problem["input"], dict | list):
        return f"{where} must be {rule}"
    value = repr(problem["input"])
    shown = value if len(value) <= 60 else f"{value[:57]}..."
    return f"{where}={shown} must be {rule}"


def _path(location: Sequence[str | int]) -> str:
    """Return the location of a field as a reader of the file counts: [[axle]] 2, damping."""
    words: list[str] = []
    for place, step in enumerate(location):
        if isinstance(step, str):
            words.append(step)
        elif all(isinstance(before, str) for before in location[:place]):
            words = [f"[[{'.'.join(words)}]] {step + 1}"]
        else:
            words[-1] = f"{words[-1]}[{step}]"
    return ", ".join(words)


def _remedy(location: Sequence[str | int], schema: Mapping[str, Any], absent: Collection[str]) -> str:
    """Return the advice for an unknown key: the key that may have been meant, or the table that it belongs to."""
    near = _nearest_key(location, schema, absent)
    if near:
        return f"did you mean {near}?"
    everywhere = {name for table in _tables(schema) for name in table.get("properties", {})}
    if location[-1] in everywhere:
        return "move it to the table that it belongs to"
    near = nearest_name(str(location[-1]), sorted(everywhere))
    return f"did you mean {near}, of another table?" if near else "remove it, or correct its spelling"


def _nearest_key(location: Sequence[str | int], schema: Mapping[str, Any], absent: Collection[str] = ()) -> str | None:
    """Return the key of the table at a location that is nearest to an unknown one there; None if none is like it.

    Keys of `absent`, which the table must have, come first; there the last word of a key ("stiffness") is enough.
    """
    table: Mapping[str, Any] = schema
    for step in location[:-1]:
        table = table.get("items", {}) if isinstance(step, int) else table.get("properties", {}).get(step, {})
        reference = table.get("$ref", "").rsplit("/", maxsplit=1)[-1]
        table = schema.get("$defs", {}).get(reference, table)
    key = str(location[-1])
    last_words = {name.rsplit("_", maxsplit=1)[-1]: name for name in absent}
    last_word = nearest_name(key, last_words)
    whole = nearest_name(key, absent) or nearest_name(key, table.get("properties", {}))
    return whole if last_word is None else last_words[last_word]


def _tables(schema: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the schemas of all tables."""
    return [schema, *schema.get("$defs", {}).values()]
