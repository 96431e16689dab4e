"""The document of the baseline of a type of vehicles, `sprung.type_baseline/1`."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from sprung._arrays import Real
from sprung._checks import check_type
from sprung.diagnosis import TypeBaseline
from sprung.errors import FormatError, ParameterError
from sprung.results.documents.baseline import (
    BY_CONDITION,
    ConditionDocument,
    conditions_document,
    conditions_from_document,
)
from sprung.results.documents.document import Document, checked, read_fields, write_document
from sprung.vehicles import Component


class TypeBaselineDocument(Document):
    """Normal state of the vehicles of a type, as stored in a file."""

    schema_name: Literal["sprung.type_baseline/1"] = Field(alias="schema")
    name: str
    n_vehicles: int = Field(ge=0)
    n_windows: int = Field(ge=0)
    components: tuple[Component, ...]
    mean: Real
    between: Real
    scales: Real
    front_rear_std: dict[str, float]
    common_std: dict[str, float]
    has_temperature: bool
    degrees_of_freedom: float = Field(gt=0)
    conditions: dict[str, ConditionDocument]


def type_baseline_document(type_baseline: TypeBaseline) -> TypeBaselineDocument:
    """Return the baseline of a type as `sprung.type_baseline/1`.

    Parameters
    ----------
    type_baseline
        Learnt from several vehicles of the type.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> of_type = sprung.learn_type(fleet, name="zafira")
    >>> document = type_baseline_document(of_type)
    >>> document.schema_name, document.n_vehicles, document.n_windows
    ('sprung.type_baseline/1', 8, 24)
    """
    check_type("type_baseline", type_baseline, TypeBaseline)
    return TypeBaselineDocument.model_validate(
        {
            "schema": "sprung.type_baseline/1",
            **{name: getattr(type_baseline, name) for name in _alike()},
            "conditions": conditions_document(type_baseline),
        }
    )


def type_baseline_from_document(
    document: TypeBaselineDocument | Mapping[str, Any], *, source: str = "the baseline of the type"
) -> TypeBaseline:
    """Return the baseline of a type from a document.

    Parameters
    ----------
    document
        Document, or its fields.
    source
        Name of the document in messages.

    Raises
    ------
    FormatError
        If it is not the document of the baseline of a type.

    Examples
    --------
    >>> import json
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> of_type = sprung.learn_type(fleet, name="zafira")
    >>> text = sprung.results.documents.document_text(sprung.results.documents.type_baseline_document(of_type))
    >>> again = type_baseline_from_document(json.loads(text))
    >>> again.name, bool(np.array_equal(again.mean, of_type.mean))
    ('zafira', True)
    """
    if not isinstance(document, TypeBaselineDocument):
        document = checked(TypeBaselineDocument, document, source=source)
    try:
        return TypeBaseline(
            **{name: getattr(document, name) for name in _alike()},
            **conditions_from_document(document.conditions, source=source),
        )
    except (ParameterError, ValueError) as error:
        raise FormatError(f"{source}: {error}") from None


def write_type_baseline(type_baseline: TypeBaseline, path: str | Path) -> None:
    """Write the baseline of a type as a JSON file, `sprung.type_baseline/1`; reading it gives an equal one.

    Parameters
    ----------
    type_baseline
        Learnt from several vehicles of the type.
    path
        File to write; an existing one is replaced.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> of_type = sprung.learn_type(fleet, name="zafira")
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "zafira.json")
    ...     write_type_baseline(of_type, path)
    ...     again = sprung.read_type_baseline(path)
    >>> again.name, bool(np.array_equal(again.mean, of_type.mean))
    ('zafira', True)
    """
    write_document(type_baseline_document(type_baseline), path)


def read_type_baseline(path: str | Path) -> TypeBaseline:
    """Read the baseline of a type from a JSON file.

    Parameters
    ----------
    path
        File that `write_type_baseline` or `sprung fleet rank` wrote.

    Raises
    ------
    ParameterError
        If the file cannot be read.
    FormatError
        If it contains something else.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> of_type = sprung.learn_type(fleet, name="zafira")
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "zafira.json")
    ...     sprung.write_type_baseline(of_type, path)
    ...     again = read_type_baseline(path)
    >>> again.n_vehicles, again.n_windows
    (8, 24)
    """
    return type_baseline_from_document(read_fields(path), source=str(path))


def _alike() -> list[str]:
    """Return the fields of the baseline of a type that its document holds unchanged."""
    return [field.name for field in fields(TypeBaseline) if field.name not in BY_CONDITION]
