"""The interface as people read it, from its OpenAPI document: values, no markup."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

_REFERENCE = "#/components/schemas/"
#: Depth to which an example is filled in.
_DEEPEST = 4
#: Limits of values, in the order in which they are worded.
_LIMITS = (
    ("minimum", "at least {}"),
    ("exclusiveMinimum", "above {}"),
    ("maximum", "at most {}"),
    ("exclusiveMaximum", "below {}"),
    ("minLength", "at least {} characters"),
    ("maxLength", "at most {} characters"),
)
_KINDS = {
    "integer": "integer",
    "number": "number",
    "string": "text",
    "boolean": "true or false",
    "null": "null",
    "object": "object",
}
#: Largest limit that is worded: beyond it is what a column holds.
_MOST = 2**62


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter, or a field of a body or an answer.

    Parameters
    ----------
    name
        Name.
    place
        Location of a parameter: path, query or header; body for a field of a body.
    kind
        Its type in words.
    shape
        Shape that the type mentions; empty: none.
    is_required
        Whether it must be given.
    default
        Default as JSON; empty: none.
    description
        Meaning.
    """

    name: str
    place: str
    kind: str
    shape: str
    is_required: bool
    default: str
    description: str


@dataclass(frozen=True, slots=True)
class Shape:
    """An object of a body or an answer: name, description and fields."""

    name: str
    description: str
    fields: tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Operation:
    """A method on a path.

    Parameters
    ----------
    method, path
        Method and path.
    summary
        Description in a sentence.
    role
        Minimum role; empty: none is needed.
    parameters
        Parameters of path, query and header, and fields of the body.
    status
        Status of the answer.
    answer
        Type of the answer in words.
    shape
        Shape of the answer; empty: none.
    example
        Command that calls it.
    """

    method: str
    path: str
    summary: str
    role: str
    parameters: tuple[Value, ...]
    status: str
    answer: str
    shape: str
    example: str

    @property
    def anchor(self) -> str:
        """Name of its place on a page."""
        return f"{self.method.lower()}{self.path.replace('/', '-').replace('{', '').replace('}', '')}"


def operations(document: Mapping[str, Any], *, address: str) -> dict[str, list[Operation]]:
    """Return the operations of an OpenAPI document by the first of their tags.

    Parameters
    ----------
    document
        OpenAPI document, version 3.1.
    address
        Address of the server, such as https://sprung.example.org, for the examples.
    """
    groups: dict[str, list[Operation]] = {}
    for path, methods in document["paths"].items():
        for method, given in methods.items():
            tag = (given.get("tags") or ["other"])[0]
            groups.setdefault(tag, []).append(_operation(document, method.upper(), path, given, address))
    return dict(sorted(groups.items()))


def shapes(document: Mapping[str, Any]) -> list[Shape]:
    """Return the objects of an OpenAPI document by name."""
    named = document["components"]["schemas"]
    return [
        Shape(name, schema.get("description", ""), tuple(_fields(schema, ""))) for name, schema in sorted(named.items())
    ]


def _operation(
    document: Mapping[str, Any], method: str, path: str, given: Mapping[str, Any], address: str
) -> Operation:
    """Return a method on a path."""
    body = given.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
    parameters = [
        _value(each["name"], each["in"], each["schema"], each, each.get("required", False))
        for each in given.get("parameters", ())
    ]
    status = min(given["responses"])
    content = given["responses"][status].get("content", {})
    answer = content.get("application/json", {}).get("schema", {})
    scopes = [scope for entry in given.get("security", ()) for names in entry.values() for scope in names]
    return Operation(
        method,
        path,
        given.get("description", given.get("summary", "")),
        str(scopes[0]) if scopes else "",
        (*parameters, *_fields(_resolve(document, body), "body")),
        status,
        _kind(answer) if answer else next((kind for kind in content if kind != "application/json"), "text"),
        _shape(answer),
        _example_call(document, method, path, body, address, needs_token=bool(scopes)),
    )


def _fields(schema: Mapping[str, Any], place: str) -> Iterator[Value]:
    """Yield the fields of an object."""
    required = schema.get("required", ())
    for name, field in schema.get("properties", {}).items():
        yield _value(name, place, field, field, name in required)


def _value(name: str, place: str, schema: Mapping[str, Any], about: Mapping[str, Any], required: bool) -> Value:
    """Return a parameter or field."""
    default = schema.get("default")
    written = "" if default in (None, "", []) else json.dumps(default)
    return Value(name, place, _kind(schema), _shape(schema), required, written, about.get("description", ""))


def _kind(schema: Mapping[str, Any]) -> str:
    """Return a type in words."""
    if "$ref" in schema:
        return str(schema["$ref"]).removeprefix(_REFERENCE)
    if "anyOf" in schema:
        return " or ".join(_kind(each) for each in schema["anyOf"])
    if words := schema.get("enum") or [schema[key] for key in ("const",) if key in schema]:
        return ", ".join(map(json.dumps, words))
    kind = schema.get("type")
    if kind == "array":
        return f"list of {', '.join(_kind(each) for each in schema.get('prefixItems', [schema.get('items', {})]))}"
    limits = [words.format(schema[key]) for key, words in _LIMITS if abs(schema.get(key, _MOST)) < _MOST]
    return ", ".join([_KINDS.get(str(kind), "any value"), *limits])


def _shape(schema: Mapping[str, Any]) -> str:
    """Return the first object that a type mentions; empty: none."""
    if "$ref" in schema:
        return str(schema["$ref"]).removeprefix(_REFERENCE)
    inner = [*schema.get("anyOf", ()), *([schema["items"]] if isinstance(schema.get("items"), dict) else [])]
    return next((name for each in inner if (name := _shape(each))), "")


def _resolve(document: Mapping[str, Any], schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the object that a reference names."""
    if "$ref" not in schema:
        return schema
    named: Mapping[str, Any] = document["components"]["schemas"][str(schema["$ref"]).removeprefix(_REFERENCE)]
    return named


def _example_call(
    document: Mapping[str, Any], method: str, path: str, body: Mapping[str, Any], address: str, *, needs_token: bool
) -> str:
    """Return a command that calls an operation; words in capitals are to be replaced."""
    words = ["curl", *(["-X", method] if method not in {"GET", "POST"} else [])]
    if needs_token:
        words.append('-H "Authorization: Bearer TOKEN"')
    if body:
        words.append(f"-H \"Content-Type: application/json\" -d '{json.dumps(_example(document, body))}'")
    elif method == "POST":
        words += ["-X", "POST"]
    parts = [part[1:-1].upper() if part.startswith("{") else part for part in path.split("/")]
    return " ".join([*words, address.rstrip("/") + "/".join(parts)])


def _example(document: Mapping[str, Any], schema: Mapping[str, Any], *, depth: int = 0) -> Any:
    """Return a value that a type allows."""
    schema = _resolve(document, schema)
    for key in ("default", "const"):
        if schema.get(key) not in (None, ""):
            return schema[key]
    if "enum" in schema:
        return schema["enum"][0]
    if "anyOf" in schema:
        return _example(document, schema["anyOf"][0], depth=depth)
    kind = schema.get("type")
    if kind == "object":
        fields = schema.get("properties", {}) if depth < _DEEPEST else {}
        return {name: _example(document, field, depth=depth + 1) for name, field in fields.items()}
    if kind == "array":
        return [_example(document, schema.get("items", {}), depth=depth + 1)] if depth < _DEEPEST else []
    return {"integer": 1, "number": 1.0, "boolean": False, "string": "TEXT"}.get(str(kind))
