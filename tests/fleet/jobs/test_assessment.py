"""Baselines, diagnoses and discoveries are those of the library, whatever the order of the windows."""

import json
import random
from dataclasses import asdict, replace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sprung.diagnosis import diagnose, false_discoveries, learn, rank_fleet
from sprung.diagnosis.scatter import LASTING
from sprung.fleet.jobs.analysis import WindowSettings, Work, analyse
from sprung.fleet.jobs.assessment import (
    COMPARED,
    SCHEMA,
    WEIGHTS,
    AssessmentSettings,
    Compared,
    WindowRow,
    assess,
    common_scatter,
    discoveries,
    learnt,
    outline,
    weights_of,
    without_overlaps,
)
from sprung.results.documents import (
    baseline_document,
    baseline_from_document,
    diagnosis_document,
    observation_from_document,
    restored_statistics,
)

LEARN = 4
SETTINGS = AssessmentSettings(learning_windows=LEARN)
FAULT = "rear_left.damper=-0.5"


@pytest.fixture(scope="module")
def rows(window, car_text):
    """Rows of the table of windows: a damper changes after the fifth."""
    found = []
    for number in range(8):
        row = window("car0", number, FAULT if number >= 5 else None).row
        results, _ = analyse(row, Work(car_text, "f", steps=["observe"], has_segments=True), WindowSettings())
        found.append(results["windows"])
    return found


@pytest.fixture(scope="module")
def vehicle(car_text):
    """The row of the vehicle."""
    names = {"vehicle": "car0", "type": "t", "type_name": "zafira", "vehicle_file": "f", "state": "s"}
    return names | {"vehicle_text": car_text}


def typed(rows):
    return [WindowRow.of(row | {"has_result": bool(row["document"])}) for row in rows]


def outlined(vehicle, rows, settings=SETTINGS):
    """The outline of a vehicle and its baseline, and what its assessment takes."""
    windows = typed(rows)
    found = outline(vehicle, [replace(row, document="", residuals=None) for row in windows], settings)
    first = [row for row in windows if found.learning and row.start <= found.learn_until]
    own = learnt(found, first, settings) if first else {"document": "", "reason": ""}
    compared = {
        "baseline": own["document"],
        "no_baseline": own["reason"],
        "type_baseline": "",
        "type_state": "",
        "weights": None,
    }
    since = found.since if own["document"] else found.since_alone
    return own, Compared(**asdict(found) | compared | {"since": since})


def assessed(vehicle, rows, settings=SETTINGS, *, by_type=False):
    """The assessment of a vehicle, of no more windows than it takes; `by_type`: the only one of its type."""
    own, compared = outlined(vehicle, rows, settings)
    if by_type:
        row = {"vehicle": "car0", "type": "t", "document": own["document"]}
        batches = pa.Table.from_pylist([row]).to_batches()
        (scatter,) = common_scatter(pa.Table.from_batches(weights_of(iter(batches)))).to_pylist()
        compared = replace(compared, weights=scatter["weights"])
    last = [row for row in typed(rows) if compared.since is not None and row.start >= compared.since]
    return assess(compared, last, settings)


class TestAssessment:
    @pytest.mark.slow
    def test_the_evidence_is_that_of_the_list_of_a_type(self, vehicle, rows):
        """Its baselines show together how parts scatter: evidence is that of `rank_fleet` up to a rounding."""
        own, compared = outlined(vehicle, rows)
        names = [f"car{k}" for k in range(6)]
        table = pa.Table.from_pylist([{"vehicle": name, "type": "t", "document": own["document"]} for name in names])
        weights = pa.Table.from_batches(weights_of(iter(table.to_batches())))
        (scatter,) = common_scatter(weights).to_pylist()
        assert common_scatter(weights.take([3, 1, 5, 0, 4, 2])).to_pylist() == [scatter]
        last = [row for row in typed(rows) if row.start >= compared.since]
        alone, found = (assess(replace(compared, weights=one), last, SETTINGS) for one in (None, scatter["weights"]))
        baseline = baseline_from_document(json.loads(own["document"]))
        observed = {name: [row.observation("zafira") for row in last] for name in names}
        ranked = rank_fleet(observed, baselines=dict.fromkeys(names, baseline))
        assert found["e_value"] == pytest.approx(ranked[0].detection.e_value, abs=0.1)
        assert abs(alone["e_value"] - found["e_value"]) > 0.3
        assert {**found, "e_value": 0, "document": ""} == {**alone, "e_value": 0, "document": ""}

    def test_a_damaged_baseline_says_nothing_of_the_scatter_of_others(self, vehicle, rows):
        own, _ = outlined(vehicle, rows)
        documents = {"car0": own["document"], "car1": "{", "car2": json.dumps({"schema": "sprung.baseline/0"})}
        table = pa.Table.from_pylist([{"vehicle": n, "type": "t", "document": text} for n, text in documents.items()])
        assert pa.Table.from_batches(weights_of(iter(table.to_batches())))["vehicle"].to_pylist() == ["car0"]

    def test_a_common_scatter_is_unchanged_by_one_baseline_of_many(self):
        """So that no vehicle need be assessed again."""
        generator = np.random.default_rng(1)
        weights = LASTING.prior * np.exp(generator.normal(np.linspace(2.0, -2.0, 16).reshape(2, 8), 0.5, (300, 2, 8)))
        rows = [
            {"vehicle": f"car{k:03d}", "type": "t", "weights": (one / one.sum()).ravel().tolist()}
            for k, one in enumerate(weights)
        ]
        states = [common_scatter(pa.Table.from_pylist(rows[:n], schema=WEIGHTS)).to_pylist() for n in (299, 300)]
        assert states[0] == states[1]
        assert sum(states[0][0]["weights"]) == pytest.approx(1.0, abs=1e-12)

    @pytest.mark.slow
    def test_baseline_and_diagnosis_are_those_of_the_library(self, vehicle, rows):
        own, _ = outlined(vehicle, rows)
        found = assessed(vehicle, rows)
        observed = [
            replace(
                observation_from_document(json.loads(row["document"])),
                vehicle="zafira",
                residuals=restored_statistics(row["residuals"]),
            )
            for row in rows
        ]
        baseline = learn(observed[:LEARN], min_windows=2)
        diagnosis = diagnose(observed[LEARN:], baseline)
        assert json.loads(own["document"]) == json.loads(json.dumps(baseline_document(baseline).as_json()))
        document = json.loads(json.dumps(diagnosis_document(diagnosis, modes=()).as_json()))
        assert json.loads(found["document"]) | {"modes": []} == document | {"modes": []}
        assert found["verdict"] == "change"
        (finding,) = json.loads(found["document"])["findings"]
        assert (finding["corner"], finding["component"]) == ("rear_left", "damper")
        assert finding["interval"][0] < -0.5 < finding["interval"][1]
        assert finding["since"] == rows[5]["start"] / 1e9
        assert (own["n_windows"], own["until"]) == (LEARN, rows[LEARN - 1]["start"])

    def test_the_order_of_windows_does_not_matter(self, vehicle, rows):
        shuffled = list(rows)
        random.Random(3).shuffle(shuffled)
        assert outlined(vehicle, shuffled) == outlined(vehicle, rows)
        assert assessed(vehicle, shuffled) == assessed(vehicle, rows)

    def test_overlapping_windows_count_once(self, vehicle, rows):
        late = [{**row, "start": row["start"] + 30 * 10**9, "digest": "late"} for row in rows]
        found = assessed(vehicle, [*rows, *late])
        alone = assessed(vehicle, rows)
        counts = {"n_windows": 2 * len(rows), "n_valid": 2 * len(rows), "n_left_out": len(late)}
        assert found == alone | counts

    def test_a_vehicle_without_enough_windows_is_compared_with_its_type(self, vehicle, rows):
        own, _ = outlined(vehicle, rows[:2])
        found = assessed(vehicle, rows[:2])
        assert found["reason"].startswith("2 of the 4 valid windows that a baseline needs")
        assert found["verdict"] == "inconclusive"
        assert own["document"] == ""

    def test_a_vehicle_whose_windows_all_failed_states_the_commonest_reason(self, vehicle, rows):
        broken = [{**row, "document": "", "is_valid": False, "reason": "no motion"} for row in rows]
        assert assessed(vehicle, broken)["reason"] == "no motion"

    def test_a_vehicle_without_a_file_states_this(self, vehicle, rows):
        broken = [{**row, "document": "", "is_valid": False, "vehicle_file": "", "reason": "no file"} for row in rows]
        assert assessed(vehicle | {"vehicle_file": ""}, broken)["reason"] == "no file"

    def test_damaged_results_are_a_reason(self, vehicle, rows):
        found = assessed(vehicle, [{**row, "document": "{"} for row in rows])
        assert "JSONDecodeError" in found["reason"]

    def test_a_vehicle_whose_baseline_cannot_be_learnt_is_compared_in_all_windows(self, vehicle, rows):
        damaged = [row | {"document": "{"} if k == 1 else row for k, row in enumerate(rows[:5])]
        own, compared = outlined(vehicle, damaged)
        assert own["reason"].startswith("no baseline: JSONDecodeError")
        assert compared.since == rows[0]["start"]

    def test_an_assessment_is_a_row_of_a_table(self, vehicle, rows):
        _, compared = outlined(vehicle, rows)
        (plain,) = pa.Table.from_pylist([asdict(compared)], schema=COMPARED).to_pylist()
        assert Compared(**plain) == compared
        table = pa.Table.from_pylist([assess(compared, typed(rows[LEARN:]), SETTINGS)], schema=SCHEMA)
        assert table["verdict"].to_pylist() == ["change"]

    def test_a_baseline_stays_the_same_while_its_windows_do(self, vehicle, rows):
        whole = outline(vehicle, typed(rows), SETTINGS)
        assert outline(vehicle, typed(rows[:LEARN]), SETTINGS).learning == whole.learning != ""
        earlier = rows[0] | {"start": rows[0]["start"] - 1800 * 10**9, "digest": "earlier"}
        assert outline(vehicle, typed([earlier, *rows]), SETTINGS).learning != whole.learning
        assert outline(vehicle | {"vehicle_file": "g"}, typed(rows), SETTINGS).learning != whole.learning

    def test_no_more_windows_are_needed_than_are_compared(self, vehicle, rows):
        found = outline(vehicle, typed(rows), replace(SETTINGS, max_windows=2))
        assert (found.learn_until, found.since) == (rows[LEARN - 1]["start"], rows[-2]["start"])
        assert found.since_alone == rows[-2]["start"]


def row_of(start, duration, digest=""):
    return WindowRow("car0", start * 10**9, digest, duration, is_valid=True)


class TestWindows:
    def test_windows_that_touch_do_not_overlap(self):
        assert len(without_overlaps([row_of(k * 600, 600.2) for k in range(5)])) == 5

    def test_the_earlier_and_longer_window_counts(self):
        rows = [row_of(0, 100.0, "a"), row_of(0, 600.0, "b"), row_of(300, 600.0, "c"), row_of(600, 600.0, "d")]
        assert [row.digest for row in without_overlaps(rows)] == ["b", "d"]


@given(
    st.lists(st.floats(-5, 30, allow_nan=False), min_size=1, max_size=40),
    st.sampled_from([0.01, 0.05, 0.2, 1.0]),
)
def test_discoveries_are_those_of_all_vehicles(values, rate):
    names = [f"car{k}" for k in range(len(values))]
    candidates = [(name, value) for name, value in zip(names, values, strict=True) if value >= -np.log(rate)]
    table = pa.table(
        {"vehicle": pa.array([name for name, _ in candidates], pa.string()), "e_value": [v for _, v in candidates]}
    )
    found = discoveries(table, rate=rate, n_vehicles=len(values))["vehicle"].to_pylist()
    assert found == [names[k] for k in false_discoveries(values, rate=rate)]
