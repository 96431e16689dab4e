"""Documents of baselines and diagnoses, the latter also of one window and one finding."""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AliasChoices, BeforeValidator, Field, TypeAdapter, ValidationError

from sprung._arrays import Real
from sprung._checks import check_type
from sprung._display import in_short
from sprung.diagnosis import (
    Baseline,
    Candidate,
    Detection,
    Diagnosis,
    Finding,
    Findings,
    ModeChange,
    Observation,
    Observations,
    ResidualReference,
    ResidualStatistics,
    SensorFault,
    TypeBaseline,
    Verdict,
    detectable,
)
from sprung.diagnosis.baseline import CONDITIONS
from sprung.diagnosis.scatter import LASTING
from sprung.errors import FormatError, ParameterError
from sprung.results.documents.document import (
    Document,
    Number,
    Pair,
    Published,
    checked,
    first_problem,
    plain,
    read_fields,
    write_document,
)
from sprung.vehicles import Component


def _restored(fields: Any) -> Any:
    """Restore what JSON does not keep of a window: the shape of an empty covariance, and NaN."""
    if not isinstance(fields, Mapping):
        return fields
    conditions = {name: np.nan if value is None else value for name, value in fields.get("conditions", {}).items()}
    restored = {**fields, "conditions": conditions}
    return restored if fields.get("covariance") else {**restored, "covariance": np.zeros((0, 0))}


Window = Annotated[
    Observation,
    Published(
        *("time", "components", "log_ratios", "covariance", "conditions", "modes", "sensor_faults", "reason"),
        *("missing", "notes", "phase_shifts", "stiffening", "run_outs"),
    ),
    BeforeValidator(_restored),
]


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
    weights: Real = Field(default_factory=lambda: LASTING.prior)
    coordinates: Real = Field(default_factory=lambda: np.zeros((0, 0)))
    squares: Real = Field(default_factory=lambda: np.zeros((0, 0)))
    degrees: Real = Field(default_factory=lambda: np.zeros(0))
    stiffenings: tuple[Window, ...] = ()
    run_outs: dict[str, float] = Field(default_factory=dict)
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
    return _baseline_restored(Baseline, document, source)


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


def _baseline_restored(
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
    return _baseline_restored(TypeBaseline, document, source)


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


_WINDOW: TypeAdapter[Observation] = TypeAdapter(Window)
PublishedFinding = Annotated[Finding, Published(sentence=attrgetter("sentence"))]
_FINDING: TypeAdapter[Finding] = TypeAdapter(PublishedFinding)


class PartDocument(Document):
    """A part of a pair with its size."""

    name: str
    change: float
    interval: Pair
    score: float


class HypothesisDocument(Document):
    """A hypothesis of what changed, with its evidence."""

    name: str
    kind: str
    log_evidence: float
    explained: float
    change: float | None
    interval: Pair | None
    score: float | None
    onset: float
    onset_interval: Pair
    parts: tuple[PartDocument, ...] = ()


class DetectionDocument(Document):
    """The change test behind the findings."""

    times: Real
    evidence: Real
    e_value: Number
    threshold: float
    first_alert: float | None
    hypotheses: tuple[HypothesisDocument, ...]


class ModeChangeDocument(Document):
    """A mode of the body before and after a change."""

    label: str
    natural_frequency: Pair = Field(validation_alias=AliasChoices("natural_frequency", "frequency"))
    damping_ratio: Pair = Field(validation_alias=AliasChoices("damping_ratio", "damping"))
    mac: float
    channels: tuple[str, ...]
    shapes: Real
    measured_before: Pair | None
    measured_since: Pair | None


class ResidualTestDocument(Document):
    """The subspace residual test of a window."""

    time: float
    p_value: float


class DiagnosisDocument(Document):
    """A diagnosis as stored in a file: with the version of the baseline instead of the baseline itself."""

    schema_name: Literal["sprung.diagnosis/1"] = Field(alias="schema")
    vehicle: str | None
    baseline: int | None
    false_alarms: float
    verdict: Verdict
    detectable: dict[str, float]
    findings: tuple[PublishedFinding, ...]
    sensor_faults: tuple[SensorFault, ...]
    windows: tuple[Window, ...]
    detection: DetectionDocument | None
    notes: tuple[str, ...]
    modes: tuple[ModeChangeDocument, ...] = ()
    residual_test: tuple[ResidualTestDocument, ...] = ()

    def __repr__(self) -> str:
        """Return the verdict with the findings, or the notes."""
        head = f"DiagnosisDocument of {self.vehicle!r}: {self.verdict.replace('_', ' ')}"
        return in_short(head, *(finding.sentence for finding in self.findings), *self.notes)

    def _repr_html_(self) -> str:
        return Findings(self.findings)._repr_html_()

    def to_dataframe(self) -> Any:
        """Return the findings as a pandas.DataFrame, as `Diagnosis.to_dataframe`."""
        return Findings(self.findings).to_dataframe()

    @property
    def observations(self) -> Observations:
        """Windows of the diagnosis."""
        return Observations(self.windows)


def observation_document(observation: Observation) -> dict[str, Any]:
    """Return a window as one JSON object, as in the `windows` of `sprung.diagnosis/1` and in the store.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> part, conditions = (sprung.Component("front_left", "spring"),), {"speed": 15.0, "payload": 40.0}
    >>> window = sprung.Observation(600.0, part, np.zeros(1), np.eye(1), conditions, {"bounce": (1.4, 0.25)}, ())
    >>> document = observation_document(window)
    >>> document["time"], document["conditions"], document["modes"]
    (600.0, {'speed': 15.0, 'payload': 40.0}, {'bounce': [1.4, 0.25]})
    """
    fields: dict[str, Any] = plain(_WINDOW.dump_python(observation, mode="json"))
    return fields


def observation_from_document(document: Mapping[str, Any]) -> Observation:
    """Return the window of a JSON object.

    Raises
    ------
    FormatError
        If the object does not describe a window.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> part, conditions = (sprung.Component("front_left", "spring"),), {"speed": 15.0, "payload": 40.0}
    >>> window = sprung.Observation(600.0, part, np.zeros(1), np.eye(1), conditions, {"bounce": (1.4, 0.25)}, ())
    >>> again = observation_from_document(sprung.results.documents.observation_document(window))
    >>> again.time, again.conditions == window.conditions, again.components == window.components
    (600.0, True, True)
    """
    try:
        return _WINDOW.validate_python(document)
    except ValidationError as error:
        raise FormatError(f"the window's {first_problem(error)}") from None


def stored_statistics(statistics: ResidualStatistics | None) -> dict[str, Any] | None:
    """Return the statistics of the residual test as plain values and bytes."""
    if statistics is None:
        return None
    segments = statistics.segments
    return {
        "channels": list(statistics.channels),
        "sampling_rate": statistics.sampling_rate,
        "segment": statistics.segment,
        "n_segments": statistics.n_segments,
        "mean": np.ascontiguousarray(statistics.mean, dtype="<f8").tobytes(),
        "segments": None if segments is None else np.ascontiguousarray(segments, dtype="<f8").tobytes(),
    }


def restored_statistics(stored: Mapping[str, Any] | None) -> ResidualStatistics | None:
    """Return the statistics of plain values and bytes."""
    if stored is None:
        return None
    channels = tuple(stored["channels"])
    shape = (len(channels), len(channels), -1)
    segments = stored["segments"]
    return ResidualStatistics(
        channels,
        stored["sampling_rate"],
        stored["segment"],
        stored["n_segments"],
        np.frombuffer(stored["mean"], dtype="<f8").reshape(shape),
        None if segments is None else np.frombuffer(segments, dtype="<f8").reshape(stored["n_segments"], *shape),
    )


def finding_document(finding: Finding) -> dict[str, Any]:
    """Return a finding as one JSON object, as in the `findings` of `sprung.diagnosis/1` and in the store.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> document = finding_document(diagnosis.findings[0])
    >>> document["corner"], document["component"], round(document["change"], 1), document["severity"]
    ('front_left', 'spring', -0.3, 'high')
    """
    fields: dict[str, Any] = plain(_FINDING.dump_python(finding, mode="json"))
    return fields


def detectable_document(detectable: Mapping[Component, float]) -> dict[str, float]:
    """Return the smallest detectable losses as one JSON object, as in `detectable` of `sprung.diagnosis/1`.

    Examples
    --------
    >>> from sprung.vehicles import Component
    >>> detectable_document({Component("front_left", "spring"): 0.07})
    {'front_left.spring': 0.07}
    """
    return {str(component): loss for component, loss in detectable.items()}


def detection_document(detection: Detection, *, max_windows: int, max_hypotheses: int) -> dict[str, Any]:
    """Return a change test as one JSON object, as `detection` of `sprung.diagnosis/1`, shortened for an alert.

    Parameters
    ----------
    detection
        Change test.
    max_windows, max_hypotheses
        Number of the last windows, and of the likeliest hypotheses, that are kept.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> document = detection_document(diagnosis.detection, max_windows=2, max_hypotheses=1)
    >>> document["times"], [hypothesis["name"] for hypothesis in document["hypotheses"]]
    ([7200.0, 7800.0], ['front_left.spring'])
    """
    fields = _detection(detection).as_json()
    kept = {name: fields[name][-max_windows:] for name in ("times", "evidence")}
    return {**fields, **kept, "hypotheses": fields["hypotheses"][:max_hypotheses]}


def diagnosis_document(
    diagnosis: Diagnosis,
    *,
    modes: Iterable[ModeChange] = (),
) -> DiagnosisDocument:
    """Return a diagnosis as `sprung.diagnosis/1`.

    Parameters
    ----------
    diagnosis
        Findings and what led to them.
    modes
        Changes of the body's modes that the findings imply.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> document = diagnosis_document(diagnosis)
    >>> document.schema_name, document.verdict, len(document.windows)
    ('sprung.diagnosis/1', 'change', 6)
    """
    check_type("diagnosis", diagnosis, Diagnosis)
    baseline = diagnosis.baseline
    return DiagnosisDocument.of(
        diagnosis,
        vehicle=None if baseline is None else baseline.vehicle,
        baseline=None if baseline is None else baseline.version,
        detectable=detectable_document(diagnosis.detectable),
        windows=diagnosis.observations,
        detection=None if diagnosis.detection is None else _detection(diagnosis.detection),
        modes=tuple(modes),
        residual_test=[{"time": time, "p_value": test.p_value} for time, test in diagnosis.residual_tests.items()],
    )


class ComparisonDocument(Document):
    """Two sets of windows compared: changes of the second from the first."""

    schema_name: Literal["sprung.compare/1"] = Field(alias="schema")
    vehicle: str | None
    n_windows: tuple[int, int]
    false_alarms: float
    verdict: Verdict
    detectable: dict[str, float]
    findings: tuple[PublishedFinding, ...]
    sensor_faults: tuple[SensorFault, ...]
    notes: tuple[str, ...]


def comparison_document(comparison: Diagnosis) -> ComparisonDocument:
    """Return a comparison of two sets of windows as `sprung.compare/1`; `comparison` is from `sprung.compare`."""
    baseline = comparison.baseline
    return ComparisonDocument.of(
        comparison,
        vehicle=None if baseline is None else baseline.vehicle,
        n_windows=(0 if baseline is None else baseline.n_windows, len(comparison.observations)),
        detectable=detectable_document(comparison.detectable),
    )


def write_diagnosis(diagnosis: Diagnosis, path: str | Path, *, modes: Iterable[ModeChange] = ()) -> None:
    """Write a diagnosis as a JSON file, `sprung.diagnosis/1`.

    Parameters
    ----------
    diagnosis
        Findings and what led to them.
    path
        File to write; an existing one is replaced.
    modes
        Changes of the body's modes that the findings imply.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "diagnosis.json")
    ...     write_diagnosis(diagnosis, path)
    ...     again = sprung.read_diagnosis(path)
    >>> again.verdict, again.findings[0].sentence == diagnosis.findings[0].sentence
    ('change', True)
    """
    write_document(diagnosis_document(diagnosis, modes=modes), path)


def read_diagnosis(path: str | Path) -> DiagnosisDocument:
    """Read a diagnosis from a JSON file.

    Parameters
    ----------
    path
        File that `write_diagnosis` or `sprung diagnose --json` wrote.

    Returns
    -------
    DiagnosisDocument
        Findings, sensor faults, windows and evidence. The baseline of a `Diagnosis` is not in the file, only its
        version.

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
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "diagnosis.json")
    ...     sprung.write_diagnosis(diagnosis, path)
    ...     again = read_diagnosis(path)
    >>> print(again.findings[0].sentence)
    front-left spring 30 % (27 to 32 %) softer, since 80 min; inspect before the next 500 km
    """
    return checked(DiagnosisDocument, read_fields(path), source=str(path))


def _detection(detection: Detection) -> DetectionDocument:
    return DetectionDocument.of(detection, hypotheses=tuple(map(_hypothesis, detection.candidates)))


def _hypothesis(candidate: Candidate) -> HypothesisDocument:
    parts = [
        PartDocument.of(size, name=change.name)
        for change, size in zip(candidate.hypothesis.changes, candidate.sizes, strict=True)
        if len(candidate.sizes) > 1
    ]
    name, kind = candidate.hypothesis.name, candidate.hypothesis.scope
    return HypothesisDocument.of(candidate, name=name, kind=kind, parts=parts)
