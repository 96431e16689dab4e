"""Documents: what is written is read again, with its keys, their order and all numbers."""

import json
from dataclasses import fields

import numpy as np
import pytest

import sprung
from sprung.diagnosis import ModeChange, Trend
from sprung.documents import (
    baseline_document,
    baseline_from_document,
    corners_document,
    diagnosis_document,
    document_text,
    finding_document,
    identification_document,
    inspection_document,
    mode_documents,
    observation_document,
    observation_from_document,
    truth_document,
)
from sprung.documents.baseline import BY_CONDITION, BaselineDocument
from sprung.errors import FormatError
from sprung.simulation import SimulatedDrive
from sprung.vehicles import Component

COMPONENTS = tuple(
    Component(f"{axle}_{side}", kind)
    for axle in ("front", "rear")
    for side in ("left", "right")
    for kind in ("spring", "damper", "tyre")
)


def same(one, other):
    """Whether two values are equal, field by field and array by array; NaN equals NaN."""
    if hasattr(one, "__dataclass_fields__"):
        return type(one) is type(other) and all(
            same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one)
        )
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other


def plain(document, check_document):
    """The fields of a document as a reader of its JSON text has them, checked against its JSON Schema."""
    return check_document(json.loads(document_text(document)))


@pytest.fixture(scope="module")
def identification():
    chain = sprung.structure(sprung.read_description("chain3"))
    run = sprung.simulate(chain, sprung.usual_excitation(chain), duration=60.0, sampling_rate=200.0, snr=10, seed=1)
    return sprung.coss_ssi(run, settings=sprung.IdentificationSettings(n_subsets=2, lifter=sprung.ShortPass(2.0)))


@pytest.fixture(scope="module")
def drive() -> SimulatedDrive:
    fault = sprung.parse_fault("front_left.spring=-0.3")
    settings = sprung.RoadDrive(duration=120.0, faults=(fault,), snr=50.0)
    return sprung.simulate_drive(sprung.read_vehicle("zafira"), settings, seed=1)


@pytest.fixture(scope="module")
def fit(drive):
    return sprung.fit_corners(drive.recording, sprung.read_vehicle("zafira"))


def window(generator, time, *, change=0.0):
    values = 0.02 * generator.standard_normal(12)
    values[0] += change
    conditions = {name: float(generator.uniform(1, 2)) for name in ("payload", "roughness", "speed")}
    modes = {"roll": (2.0, 0.2)}
    return sprung.Observation(time, COMPONENTS, values, 0.02**2 * np.eye(12), conditions, modes, (), vehicle="car")


@pytest.fixture(scope="module")
def observations():
    generator = np.random.default_rng(1)
    return [window(generator, 600.0 * k, change=-0.4 if k >= 8 else 0.0) for k in range(14)]


@pytest.fixture(scope="module")
def baseline(observations):
    return sprung.learn(observations[:8])


def test_an_identification_is_read_as_it_was_written(identification, check_document, tmp_path):
    sprung.write_identification(identification, tmp_path / "modes.json")
    document = sprung.read_identification(tmp_path / "modes.json")
    written = plain(identification_document(identification), check_document)
    assert plain(document, check_document) == written
    assert sprung.read_document(tmp_path / "modes.json").as_json() == written
    assert written["settings"]["lifter"] == {"kind": "ShortPass", "length": 2.0}
    assert written["modes"][0]["subsets"][0]["stable_rate"] == pytest.approx(
        identification.subsets[0].modes.stable_rate[identification.members[0, 0]]
    )


def test_modes_of_a_document_are_those_of_the_identification(identification, tmp_path):
    sprung.write_identification(identification, tmp_path / "modes.json")
    modes = sprung.read_identification(tmp_path / "modes.json").as_modes()
    np.testing.assert_allclose(modes.poles, identification.modes.poles, rtol=1e-12)
    np.testing.assert_array_equal(modes.mode_shapes, identification.modes.mode_shapes)
    np.testing.assert_array_equal(modes.damping_ratio_std, identification.modes.damping_ratio_std)
    assert (modes.labels, modes.channels) == (identification.modes.labels, identification.modes.channels)


def test_modes_alone_are_those_of_a_subset(identification, check_document):
    subset = identification.subsets[0]
    written = plain(identification_document(identification), check_document)
    assert mode_documents(subset.modes) == written["subsets"][0]["modes"]


def test_harmonics_have_the_unit_of_their_kind(identification, check_document):
    from dataclasses import replace

    lines = (
        sprung.Harmonic(17.0, "constant", (16.9, 17.1), 0.1, 20.0, ("acc_1",)),
        sprung.Harmonic(0.5, "speed", (4.0, 9.0), 0.01, 12.0, ("acc_1", "acc_2"), 0.25, 2),
    )
    document = identification_document(replace(identification, harmonics=lines))
    written = plain(document, check_document)["harmonics"]
    assert [line["unit"] for line in written] == ["Hz", "1/m"]
    assert list(written[0])[-1] == "unit"
    assert identification_document(replace(identification, harmonics=document.harmonics)).harmonics == lines


def test_corners_are_read_as_they_were_written(fit, check_document, tmp_path):
    sprung.write_corners(fit, tmp_path / "corners.json")
    document = sprung.read_corners(tmp_path / "corners.json")
    written = plain(corners_document(fit), check_document)
    assert plain(document, check_document) == written
    spring = document.corners["front_left"]["spring"]
    assert spring.value == fit.values[fit.components.index(Component("front_left", "spring"))]
    assert "from_modes" not in written["corners"]["front_left"]["spring"]
    assert np.diag(document.fit.correlation).tolist() == [1.0] * len(fit.components)


def test_a_baseline_is_read_as_it_was_written(baseline, check_document, tmp_path):
    sprung.write_baseline(baseline, tmp_path / "baseline.json")
    assert same(sprung.read_baseline(tmp_path / "baseline.json"), baseline)
    check_document(json.loads((tmp_path / "baseline.json").read_text()))


def test_a_residual_reference_is_read_as_it_was_written(baseline, check_document):
    from dataclasses import replace

    generator = np.random.default_rng(2)
    reference = sprung.diagnosis.ResidualReference(
        ("a", "b"), 25.0, 2.0, generator.standard_normal((4, 2)), generator.standard_normal((3, 4)), 0.1, 0.2, 5
    )
    baseline = replace(baseline, residuals=reference)
    assert same(baseline_from_document(plain(baseline_document(baseline), check_document)), baseline)


def test_every_field_of_a_baseline_is_in_its_document(baseline):
    names = {field.name for field in fields(baseline)}
    assert names - set(BY_CONDITION) == set(BaselineDocument.model_fields) - {"schema_name", "conditions"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "sprung.baseline/9"}, "has the schema 'sprung.baseline/9', but must have 'sprung.baseline/1'"),
        ({"mean": "much"}, "mean is not valid"),
        ({"mean": [0.0]}, "mean of a baseline must be"),
        ({"components": ["wheel"]}, r"components\[0\].* is not valid"),
        ({"conditions": {}}, "lacks the condition"),
        ({"n_windows": None}, "n_windows is not valid"),
        ({"design": None}, "design"),
    ],
)
def test_other_documents_are_not_a_baseline(baseline, change, message):
    document = baseline_document(baseline).as_json()
    with pytest.raises(FormatError, match=message):
        baseline_from_document({**document, **change})


def test_windows_are_read_as_they_were_written(observations):
    nothing = sprung.Observation(
        5.0,
        (),
        np.zeros(0),
        np.zeros((0, 0)),
        {"temperature": np.nan, "speed": 3.0},
        {},
        (sprung.SensorFault("acc_fl", "dead", "stays at 0"),),
        "no segment",
    )
    for observation in (observations[0], nothing):
        again = observation_from_document(json.loads(json.dumps(observation_document(observation), allow_nan=False)))
        assert same({**again.conditions}.keys(), observation.conditions.keys())
        assert list(again.conditions.values()) == pytest.approx(list(observation.conditions.values()), nan_ok=True)
        for name in ("time", "components", "log_ratios", "covariance", "modes", "sensor_faults", "reason"):
            assert same(getattr(again, name), getattr(observation, name))
    with pytest.raises(FormatError, match="the window's time is not valid"):
        observation_from_document({**observation_document(nothing), "time": "now"})


def test_a_diagnosis_is_read_as_it_was_written(observations, baseline, check_document, tmp_path):
    diagnosis = sprung.diagnose(observations, baseline)
    shapes = np.array([[1.0, 0.5], [1.0, 0.4]])
    changes = [ModeChange("roll", (2.0, 1.9), (0.2, 0.21), 0.99, ("acc_fl", "acc_fr"), shapes, None, (1.9, 0.2))]
    sprung.write_diagnosis(diagnosis, tmp_path / "diagnosis.json", modes=changes)
    document = sprung.read_diagnosis(tmp_path / "diagnosis.json")
    written = plain(diagnosis_document(diagnosis, modes=changes), check_document)
    assert plain(document, check_document) == written
    assert document.findings == diagnosis.findings
    assert document.findings
    assert written["findings"] == [finding_document(finding) for finding in diagnosis.findings]
    assert written["findings"][0]["sentence"] == diagnosis.findings[0].sentence
    assert written["windows"] == [observation_document(window) for window in observations]
    assert written["detection"]["hypotheses"][0]["kind"] == "single"
    assert (written["vehicle"], written["baseline"]) == ("car", 1)
    assert written["modes"][0]["natural_frequency"] == [2.0, 1.9]
    assert document.modes[0].measured_since == (1.9, 0.2)


def test_a_finding_keeps_its_trend(observations, baseline, check_document):
    from dataclasses import replace

    diagnosis = sprung.diagnose(observations, baseline)
    trend = Trend(-0.02, (-0.03, -0.01), (2.0, 6.0))
    finding = replace(diagnosis.findings[0], trend=trend, change=None, interval=None, score=None)
    document = diagnosis_document(replace(diagnosis, findings=(finding,)))
    written = plain(document, check_document)["findings"][0]
    assert written["trend"] == {"per_hour": -0.02, "interval": [-0.03, -0.01], "hours_to_limit": [2.0, 6.0]}
    assert document.findings == (finding,)


def test_inspections_are_read_as_they_were_written(drive, check_document, tmp_path):
    facts = {"run.csv": sprung.inspect(drive.recording)}
    sprung.write_inspections(facts, tmp_path / "info.json")
    assert sprung.read_inspections(tmp_path / "info.json") == facts
    (file,) = plain(inspection_document(facts), check_document)["files"]
    assert file["path"] == "run.csv"
    assert file["channels"][0]["is_dead"] is False


def test_the_truth_is_read_as_it_was_written(drive, check_document, tmp_path):
    sprung.write_truth({**drive.truth, "kind": "road"}, tmp_path / "truth.json")
    document = sprung.read_truth(tmp_path / "truth.json")
    assert plain(document, check_document) == {**drive.truth, "kind": "road"}
    assert document.faults == {"front_left.spring": -0.3}
    with pytest.raises(FormatError, match="the truth of a simulation: modes is not valid"):
        truth_document({**drive.truth, "modes": 3})


def test_what_is_not_finite_is_null():
    values = {"a": np.nan, "b": [np.inf, np.float64(1.5)], "c": np.array([[1.0, np.nan]]), "d": (np.int64(3), None)}
    assert json.loads(document_text(values)) == {"a": None, "b": [None, 1.5], "c": [[1.0, None]], "d": [3, None]}
    assert json.loads(document_text({"a": np.bool_(True)})) == {"a": True}
