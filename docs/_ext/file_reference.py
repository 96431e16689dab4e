"""Fields of vehicle files, files of conditions, site files and published documents, from their models.

The directives `vehicle-fields`, `condition-fields`, `site-fields` and `json-schemas` make sections of tables.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, get_type_hints

from docutils import nodes
from numpydoc.docscrape import NumpyDocString
from pydantic import BaseModel, TypeAdapter
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from sprung.cli.conditions import DriveConditions, RailDriveConditions, RigRunConditions, RoadDriveConditions
from sprung.online.monitor.site import Site
from sprung.results.documents import DOCUMENTS, json_schema
from sprung.vehicles.description import Chain, Quarter, Vehicle

#: Limits of pydantic and their names in JSON Schema.
_LIMITS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in MyST."""
    lines = [head, ("---",) * len(head), *rows]
    cells = ([" ".join(cell.split()).replace("|", r"\|") for cell in line] for line in lines)
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def describe_type(schema: Mapping[str, Any]) -> str:
    """Return what a JSON Schema allows, such as "number > 0 or null"."""
    if "$ref" in schema:
        return f"`{schema['$ref'].rpartition('/')[2]}`"
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(describe_type(option) for option in schema["anyOf"]))
    if "const" in schema or "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema.get("enum", [schema.get("const")]))
    kinds = schema.get("type", "any")
    words = [_kind(kind, schema) for kind in ([kinds] if isinstance(kinds, str) else kinds)]
    limits = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    bounds = " and ".join(f"{sign} {schema[key]:g}" for key, sign in limits.items() if key in schema)
    return " or ".join(words) + (f" {bounds}" if bounds else "")


def _kind(kind: str, schema: Mapping[str, Any]) -> str:
    """Return one JSON type in words."""
    if kind == "array":
        entries = schema.get("prefixItems") or ([schema["items"]] if schema.get("items") else [])
        return "list" + (
            f" of {' and '.join(dict.fromkeys(describe_type(entry) for entry in entries))}" if entries else ""
        )
    if kind == "object" and isinstance(schema.get("additionalProperties"), dict):
        return f"object of {describe_type(schema['additionalProperties'])}"
    return {"null": "`null`", "string": "text"}.get(kind, kind)


def _meanings(model: type) -> dict[str, str]:
    """Return the meanings of fields from the docstring of their model or dataclass."""
    texts = [vars(kind).get("__doc__") or "" for kind in reversed(model.__mro__) if _is_table(kind)]
    entries = [entry for text in texts for entry in NumpyDocString(inspect.cleandoc(text))["Parameters"]]
    return {name.strip(): " ".join(entry.desc) for entry in entries for name in entry.name.split(",")}


def _is_table(kind: type) -> bool:
    """Return whether a type is a table of a file: a model, or a dataclass that is not written as one text."""
    return issubclass(kind, BaseModel) or (
        dataclasses.is_dataclass(kind) and not hasattr(kind, "__get_pydantic_core_schema__")
    )


def _fields(model: Any) -> dict[str, FieldInfo]:
    """Return the fields of a model or dataclass by name."""
    if issubclass(model, BaseModel):
        return dict(model.model_fields)
    hints = get_type_hints(model)
    found = {}
    for field in dataclasses.fields(model):
        default = PydanticUndefined if field.default is dataclasses.MISSING else field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        found[field.name] = FieldInfo(annotation=hints[field.name], default=default)
    return found


def _parts(annotation: Any) -> Iterator[type]:
    """Yield the models and dataclasses in an annotation."""
    if inspect.isclass(annotation) and _is_table(annotation):
        yield annotation
    for inner in getattr(annotation, "__args__", ()):
        yield from _parts(inner)


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return "required"
    return "-" if field.default is None else f"`{field.default!r}`".replace("'", '"')


def sections_of(model: type, name: str = "") -> Iterator[tuple[str, type, list[Sequence[str]]]]:
    """Yield heading, model and rows of a file's tables, the top level first."""
    meanings = _meanings(model)
    rows: list[Sequence[str]] = []
    below: list[tuple[str, type]] = []
    for key, field in _fields(model).items():
        inner = next(_parts(field.annotation), None)
        if inner is not None:
            place = f"{name.strip('[]')}.{field.alias or key}".lstrip(".")
            place += ".PART" if "dict[" in str(field.annotation) else ""
            is_list = re.search("tuple|list", str(field.annotation)) is not None
            below.append((f"[[{place}]]" if is_list else f"[{place}]", inner))
            continue
        schema = TypeAdapter(field.annotation or object).json_schema()
        for limit in field.metadata:
            schema |= {
                name: bound for word, name in _LIMITS.items() if (bound := getattr(limit, word, None)) is not None
            }
        meaning = field.description or meanings.get(field.alias or key, "")
        rows.append((f"`{field.alias or key}`", describe_type(schema), _default(field), meaning))
    yield name, model, rows
    for place, inner in below:
        yield from sections_of(inner, place)


def _tables(model: type, depth: int) -> str:
    return _paragraphs(sections_of(model), depth)


def _paragraphs(sections: Iterable[tuple[str, type, list[Sequence[str]]]], depth: int) -> str:
    paragraphs = []
    for name, part, rows in sections:
        if name:
            paragraphs += [f"{'#' * depth} `{name}`", re.split(r"\n\n", inspect.getdoc(part) or "")[0]]
        if rows:
            paragraphs.append(table(("key", "value", "default", "meaning"), rows))
    return "\n\n".join(paragraphs)


class VehicleFields(SphinxDirective):
    """Tables of the fields of vehicle files, by kind."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each kind."""
        kinds = (("Road, rail and rig vehicles", Vehicle), ("Quarter vehicles", Quarter), ("Chains of masses", Chain))
        text = "\n\n".join(f"## {title}\n\n{_tables(model, 3)}" for title, model in kinds)
        return self.parse_text_to_nodes(text, allow_section_headings=True)


class ConditionFields(SphinxDirective):
    """Tables of the fields of files of conditions, by kind of drive."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each kind; the tables of all drives once."""
        common = {name for name, _, _ in sections_of(DriveConditions) if name}
        own = {
            kind: [section for section in sections_of(model) if section[0] not in common]
            for kind, model in (
                ("road", RoadDriveConditions),
                ("rail", RailDriveConditions),
                ("rig", RigRunConditions),
            )
        }
        text = f"## All drives\n\n{_tables(DriveConditions, 3)}"
        for kind, sections in own.items():
            text += f"\n\n## `sprung simulate {kind}`\n\n{_paragraphs(_only_own(sections), 3)}"
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _only_own(sections: Sequence[tuple[str, type, list[Sequence[str]]]]) -> list[tuple[str, type, list[Sequence[str]]]]:
    """Return the sections without the rows at the top level that all drives have."""
    shared = {f"`{key}`" for key in DriveConditions.model_fields}
    return [(name, part, [row for row in rows if name or row[0] not in shared]) for name, part, rows in sections]


class SiteFields(SphinxDirective):
    """Tables of the fields of site files."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each table."""
        return self.parse_text_to_nodes(_tables(Site, 2), allow_section_headings=True)


class JsonSchemas(SphinxDirective):
    """Keys and types of all published documents."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each document."""
        text = "\n\n".join(_document(name) for name in sorted(DOCUMENTS))
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _document(name: str) -> str:
    """Return the section of a document."""
    schema = json_schema(name)
    parts = {"": schema, **{key: part for key, part in schema.get("$defs", {}).items() if "properties" in part}}
    paragraphs = [f"## `{name}`"]
    for title, part in parts.items():
        if title:
            paragraphs.append(f"**{title}**")
        if part.get("description"):
            paragraphs.append(part["description"].split("\n\n")[0])
        required = part.get("required", ())
        rows = [
            (f"`{key}`", describe_type(value), "yes" if key in required else "no")
            for key, value in part.get("properties", {}).items()
        ]
        paragraphs.append(table(("key", "type", "always there"), rows))
    return "\n\n".join(paragraphs)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("vehicle-fields", VehicleFields)
    app.add_directive("condition-fields", ConditionFields)
    app.add_directive("site-fields", SiteFields)
    app.add_directive("json-schemas", JsonSchemas)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
