"""Documents of baselines: of one vehicle, `sprung.baseline/1`, and of a type, `sprung.type_baseline/1`."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from pydantic import Field

from sprung._arrays import Real
from sprung._checks import check_type
from sprung.diagnosis import Baseline, ResidualReference, TypeBaseline, detectable
from sprung.diagnosis.baseline import CONDITIONS
from sprung.errors import FormatError, ParameterError
from sprung.results.documents.document import Document, Pair, checked, read_fields, write_document
from sprung.vehicles import Component


class ConditionDocument(Document):
    """Dependence of the mean on a condition; `centre` and `range` are null if it was never known."""

    centre: float | None
    range: Pair | None
    slopes: Real


class BaselineDocument(Document):
    """Normal state of one vehicle, as stored in a file."""

    schema_name: Literal["sprung.baseline/1"] = Field(alias="schema")
    vehicle: str
    version: int
    reason: str
    n_windows: int
    n_refused: int
    model_error: float = 0.0
    components: tuple[Component, ...]
    mean: Real
    covariance: Real
    nuisance: Real
    reported: Real
    information: Real
    degrees_of_freedom: float
    learning_times: tuple[float, ...] = ()
    vehicle_file: str = ""
    missing: tuple[str, ...] = ()
    conditions: dict[str, ConditionDocument]
    residuals: ResidualReference | None = None
    detectable: dict[str, dict[str, float]] = Field(default_factory=dict)


#: Numbers of further windows for which a baseline states the smallest detectable losses.
FURTHER_WINDOWS = (6, 12)


def baseline_document(baseline: Baseline) -> BaselineDocument:
    """Return a baseline as `sprung.baseline/1`.

    Parameters
    ----------
    baseline
        Learnt from windows of a healthy vehicle.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows)
    >>> document = baseline_document(baseline)
    >>> document.schema_name, document.n_windows, len(document.components)
    ('sprung.baseline/1', 12, 12)
    """
    check_type("baseline", baseline, Baseline)
    losses = {
        str(count): {str(part): loss for part, loss in detectable(baseline, n_windows=count).items()}
        for count in FURTHER_WINDOWS
    }
    return BaselineDocument.of(baseline, conditions=conditions_document(baseline), detectable=losses)


def baseline_from_document(document: BaselineDocument | Mapping[str, Any], *, source: str = "the baseline") -> Baseline:
    """Return the baseline of a document.

    Parameters
    ----------
    document
        Document, or its fields.
    source
        Name of the document in messages.

    Raises
    ------
    FormatError
        If it is not the document of a baseline.

    Examples
    --------
    >>> import json
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows)
    >>> text = sprung.results.documents.document_text(sprung.results.documents.baseline_document(baseline))
    >>> again = baseline_from_document(json.loads(text))
    >>> bool(np.array_equal(again.mean, baseline.mean)), again.components == baseline.components
    (True, True)
    """
    if not isinstance(document, BaselineDocument):
        document = checked(BaselineDocument, document, source=source)
    return _restored(Baseline, document, source)


def conditions_document(baseline: Baseline | TypeBaseline) -> dict[str, dict[str, Any]]:
    """Return the dependence of a baseline on each condition."""
    conditions = {
        name: {
            "centre": baseline.centre.get(name),
            "range": baseline.ranges.get(name),
            "slopes": baseline.slopes[:, column],
        }
        for column, name in enumerate(CONDITIONS)
    }
    without_slopes = {
        name: {"centre": None, "range": baseline.ranges[name], "slopes": np.zeros(len(baseline.components))}
        for name in baseline.ranges
        if name not in conditions
    }
    return conditions | without_slopes


def conditions_from_document(conditions: Mapping[str, ConditionDocument], *, source: str) -> dict[str, Any]:
    """Return slopes, middle and ranges of a baseline from its dependence on each condition.

    Raises
    ------
    FormatError
        If a condition is missing.
    """
    missing = [name for name in CONDITIONS if name not in conditions]
    if missing:
        raise FormatError(f"{source} lacks the condition {missing[0]!r}: learn the baseline again")
    return {
        "slopes": np.array([conditions[name].slopes for name in CONDITIONS]).T,
        "centre": {name: condition.centre for name, condition in conditions.items() if condition.centre is not None},
        "ranges": {name: condition.range for name, condition in conditions.items() if condition.range is not None},
    }


def write_baseline(baseline: Baseline, path: str | Path) -> None:
    """Write a baseline as a JSON file, `sprung.baseline/1`; reading it gives an equal baseline.

    Parameters
    ----------
    baseline
        Learnt from windows of a healthy vehicle.
    path
        File to write; an existing one is replaced.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "car.json")
    ...     write_baseline(baseline, path)
    ...     again = sprung.read_baseline(path)
    >>> bool(np.array_equal(again.covariance, baseline.covariance))
    True
    """
    write_document(baseline_document(baseline), path)


def read_baseline(path: str | Path) -> Baseline:
    """Read a baseline from a JSON file.

    Parameters
    ----------
    path
        File that `write_baseline` or `sprung baseline` wrote.

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
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "car.json")
    ...     sprung.write_baseline(baseline, path)
    ...     again = read_baseline(path)
    >>> again.n_windows, bool(np.array_equal(again.mean, baseline.mean))
    (12, True)
    """
    return baseline_from_document(read_fields(path), source=str(path))


_AnyBaseline = TypeVar("_AnyBaseline", Baseline, TypeBaseline)


def _restored(
    kind: type[_AnyBaseline], document: "BaselineDocument | TypeBaselineDocument", source: str
) -> _AnyBaseline:
    """Return the baseline of a checked document, whose conditions are columns again."""
    by_condition = conditions_from_document(document.conditions, source=source)
    alike = {field.name: getattr(document, field.name) for field in fields(kind) if field.name not in by_condition}
    try:
        return kind(**alike, **by_condition)
    except (ParameterError, ValueError) as error:
        raise FormatError(f"{source}: {error}") from None


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
    model_error: float = Field(0.0, ge=0)
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
    return TypeBaselineDocument.of(type_baseline, conditions=conditions_document(type_baseline))


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
    return _restored(TypeBaseline, document, source)


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
