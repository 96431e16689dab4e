"""All published documents by the name of their schema, and their JSON Schemas, which are part of the package."""

import json
from importlib import import_module, resources
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from sprung.errors import FormatError, ParameterError
from sprung.results.documents.document import KINDS, Document, checked, read_fields

for _module in iter_modules([str(Path(__file__).parent)]):
    import_module(f"sprung.results.documents.{_module.name}")

#: Published documents by the name of their schema.
DOCUMENTS = dict(sorted(KINDS.items()))


def read_document(path: str | Path) -> Document:
    """Read any published document from a JSON file.

    Parameters
    ----------
    path
        File that sprung wrote, such as with `--json`.

    Returns
    -------
    Document
        Document of the kind that its key `schema` names.

    Raises
    ------
    ParameterError
        If the file cannot be read.
    FormatError
        If its schema is unknown, or a key is missing or holds something else.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> settings = sprung.RoadDrive(duration=10.0, sampling_rate=60.0)
    >>> drive = sprung.simulate_drive(sprung.read_vehicle("zafira"), settings, seed=1)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "truth.json")
    ...     sprung.write_truth(drive.truth, path)
    ...     again = read_document(path)
    >>> type(again).__name__, again.schema_name
    ('TruthDocument', 'sprung.truth/1')
    """
    fields = read_fields(path)
    schema = fields.get("schema")
    if not isinstance(schema, str) or schema not in DOCUMENTS:
        known = ", ".join(DOCUMENTS)
        raise FormatError(f"{path} has the schema {schema!r}, which is not one of {known}: give another file")
    return checked(DOCUMENTS[schema], fields, source=str(path))


def json_schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a published document, as shipped with the package.

    Parameters
    ----------
    name
        Schema of the document, such as "sprung.baseline/1".

    Raises
    ------
    ParameterError
        If no document has that schema.

    Examples
    --------
    >>> schema = json_schema("sprung.baseline/1")
    >>> schema["properties"]["schema"]["const"], "components" in schema["required"]
    ('sprung.baseline/1', True)
    """
    if name not in DOCUMENTS:
        raise ParameterError(f"schema {name!r} is not one of {', '.join(DOCUMENTS)}: correct it")
    text = (resources.files("sprung.results.documents") / "json_schemas" / _file_name(name)).read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def write_json_schemas(folder: str | Path) -> None:
    """Write the JSON Schemas of all published documents, one file each, as generated from their models.

    Parameters
    ----------
    folder
        Existing folder; files of the same names are replaced.

    Examples
    --------
    The schema of a baseline is as shipped:

    >>> import json
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.results.documents import json_schema
    >>> with TemporaryDirectory() as folder:
    ...     write_json_schemas(folder)
    ...     json.loads(Path(folder, "baseline-1.json").read_text()) == json_schema("sprung.baseline/1")
    True
    """
    for name, kind in DOCUMENTS.items():
        schema = kind.model_json_schema(schema_generator=_WithoutProse)
        text = json.dumps({"$schema": GenerateJsonSchema.schema_dialect, "$id": name, **schema}, indent=2)
        (Path(folder) / _file_name(name)).write_text(text + "\n", encoding="utf-8")


def _file_name(name: str) -> str:
    """Return the file of a schema: baseline-1.json for sprung.baseline/1."""
    return f"{name.removeprefix('sprung.').replace('/', '-')}.json"


class _WithoutProse(GenerateJsonSchema):
    """JSON Schemas without the docstrings of dataclasses, which are about Python, and without titles of fields."""

    def dataclass_schema(self, schema: core_schema.DataclassSchema) -> dict[str, Any]:
        return {key: value for key, value in super().dataclass_schema(schema).items() if key != "description"}

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False
