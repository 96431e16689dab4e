"""Common parts of all published documents: JSON text, files, and the refusal of files that hold something else."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainSerializer,
    SerializerFunctionWrapHandler,
    ValidationError,
    WithJsonSchema,
)
from pydantic_core import CoreSchema, core_schema, to_jsonable_python

from sprung._checks import check_path, check_type
from sprung._display import in_short, listed
from sprung.errors import FormatError, ParameterError

#: A number that may be unknown: NaN in Python, null in JSON.
Number = Annotated[
    float,
    BeforeValidator(lambda value: math.nan if value is None else value),
    PlainSerializer(lambda value: value if math.isfinite(value) else None),
    WithJsonSchema({"type": ["number", "null"]}),
]
#: Two ends of an interval or a range.
Pair = tuple[float, float]


class Document(BaseModel):
    """A published JSON document, or a part of one.

    Notes
    -----
    Unknown keys are ignored on reading: a document of the same schema may gain keys. A key that is absent from a
    document is not written either.
    """

    model_config = ConfigDict(frozen=True, from_attributes=True, arbitrary_types_allowed=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        if "schema_name" in cls.model_fields:
            KINDS[schema_of(cls)] = cls

    @classmethod
    def of(cls, value: object = None, /, **exceptions: Any) -> Self:
        """Return the document of a value, or a part of one: its fields are the attributes of the same names.

        Parameters
        ----------
        value
            Dataclass, or another value with attributes; None: all fields are given.
        **exceptions
            Fields that are not attributes of the value, or are written differently.
        """
        names = [name for name in cls.model_fields if name != "schema_name"]
        fields = {name: exceptions[name] if name in exceptions else getattr(value, name) for name in names}
        schema = {"schema": schema_of(cls)} if "schema_name" in cls.model_fields else {}
        return cls.model_validate({**schema, **fields})

    def __repr__(self) -> str:
        """Return the kind of document, and the names of its fields."""
        return in_short(f"{type(self).__name__}: {listed(type(self).model_fields)}")

    def __str__(self) -> str:
        """Return the text of `repr`."""
        return repr(self)

    def save(self, path: str | Path) -> None:
        """Write the document as a JSON file; an existing one is replaced."""
        write_document(self, path)

    def as_json(self) -> dict[str, Any]:
        """Return the document as plain JSON values; null for numbers that are not finite."""
        fields: dict[str, Any] = plain(self.model_dump(mode="json", by_alias=True, exclude_unset=True))
        return fields


#: Published documents by the name of their schema; each enters as its module is imported.
KINDS: dict[str, type[Document]] = {}

_Document = TypeVar("_Document", bound=Document)


class Published:
    """Annotation of a dataclass whose JSON object has other keys: fewer fields, or texts computed from the value.

    Reading sets fields that are not published to their defaults.

    Parameters
    ----------
    names
        Names of the fields in the JSON object; none: all.
    computed
        Functions of the dataclass that return the texts of further keys.
    """

    def __init__(self, *names: str, **computed: Callable[[Any], str]) -> None:
        self._names, self._computed = names, computed

    def _picked(self, fields: dict[str, Any]) -> dict[str, Any]:
        return {name: fields[name] for name in self._names or fields}

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def publish(value: Any, serialise: SerializerFunctionWrapHandler) -> Any:
            texts = {name: function(value) for name, function in self._computed.items()}
            return {**self._picked(serialise(value)), **texts}

        inner = handler(source)
        return core_schema.no_info_after_validator_function(
            lambda value: value,
            inner,
            serialization=core_schema.wrap_serializer_function_ser_schema(publish, schema=inner),
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        written = handler(schema)
        fields = handler.resolve_ref_schema(written)
        texts = {name: {"type": "string"} for name in self._computed}
        fields["properties"] = {**self._picked(fields["properties"]), **texts}
        return written


class Estimate(Document):
    """An estimate and its standard deviation."""

    value: float
    std: Number


def plain(value: Any) -> Any:
    """Return values, arrays and dataclasses as plain JSON values; null for numbers that are not finite."""
    return to_jsonable_python(value, inf_nan_mode="null", fallback=lambda array: plain(array.tolist()))


def document_text(document: Document | Mapping[str, Any]) -> str:
    """Return the JSON text of a document.

    Examples
    --------
    >>> print(document_text({"schema": "sprung.accounts/1", "accounts": []}), end="")
    {
      "schema": "sprung.accounts/1",
      "accounts": []
    }
    """
    fields = document.as_json() if isinstance(document, Document) else plain(document)
    return json.dumps(fields, indent=2, allow_nan=False) + "\n"


def write_document(document: Document | Mapping[str, Any], path: str | Path) -> None:
    """Write a document as a JSON file.

    Parameters
    ----------
    document
        Document, or its fields.
    path
        File to write; an existing one is replaced.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> fields = {"schema": "sprung.accounts/1", "accounts": []}
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "accounts.json")
    ...     write_document(fields, path)
    ...     sprung.read_document(path).schema_name
    'sprung.accounts/1'
    """
    check_type("document", document, Document, Mapping, advice="what a sprung.read_ function returns")
    Path(path).write_text(document_text(document), encoding="utf-8")


def read_fields(path: str | Path) -> dict[str, Any]:
    """Return the fields of a JSON file.

    Raises
    ------
    ParameterError
        If the file cannot be read.
    FormatError
        If it does not hold a JSON object.
    """
    check_path("path", path)
    try:
        fields = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(
            f"{path} cannot be read ({error.strerror}): give a JSON document that sprung wrote"
        ) from None
    except (ValueError, RecursionError):
        raise FormatError(f"{path} is not valid JSON: give a JSON document that sprung wrote") from None
    if not isinstance(fields, dict):
        raise FormatError(f"{path} does not hold a JSON object: give a JSON document that sprung wrote")
    return fields


def checked(model: type[_Document], fields: Mapping[str, Any], *, source: str) -> _Document:
    """Return the document of fields.

    Parameters
    ----------
    model
        Kind of document.
    fields
        JSON object.
    source
        Name of the document in messages.

    Raises
    ------
    FormatError
        If the schema is another one, or a key is missing or contains something else.
    """
    schema = schema_of(model)
    if fields.get("schema") != schema:
        raise FormatError(
            f"{source} has the schema {fields.get('schema')!r}, but must have {schema!r}: give another one"
        )
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        raise FormatError(f"{source}: {first_problem(error)}: write it again") from None


def schema_of(model: type[Document]) -> str:
    """Return the name of the schema of a kind of document, such as "sprung.baseline/1"."""
    return str(get_args(model.model_fields["schema_name"].annotation)[0])


def first_problem(error: ValidationError) -> str:
    """Return the first problem of a failed check, with its place."""
    problem = error.errors(include_url=False, include_input=False)[0]
    return f"{_place(problem['loc'])} is not valid ({problem['msg']})"


def _place(location: Sequence[str | int]) -> str:
    words = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in location)
    return words.removeprefix(".") or "the document"
