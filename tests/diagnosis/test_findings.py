"""Findings in words."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import Finding, Observation, mode_changes
from sprung.diagnosis.findings import detectable_in_words
from sprung.modal import mac
from sprung.vehicles import Component, parse_fault, read_vehicle, structure, with_faults

FINDING = Finding(
    corner="rear_left",
    component="spring",
    change=-0.3,
    interval=(-0.33, -0.27),
    score=12.0,
    severity="high",
    severity_number=700,
    advice="inspect before the next 500 km",
    since=1200.0,
    since_interval=(600.0, 1200.0),
    runner_up="",
    trend=None,
)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({}, "rear-left spring 30 % (27 to 33 %) softer, since 20 min; inspect before the next 500 km"),
        (
            {"corner": "all", "component": "damper", "change": 0.5, "interval": (0.4, 0.6)},
            "all dampers 50 % (40 to 60 %) stronger, since 20 min; inspect before the next 500 km",
        ),
        (
            {"interval": (-0.205, -0.195), "runner_up": "rear-left tyre by -9 %", "since": 1_795_219_200.0},
            "rear-left spring 30.0 % (19.5 to 20.5 %) softer (or rear-left tyre by -9 %), since 2026-11-21 00:00 UTC; "
            "inspect before the next 500 km",
        ),
        (
            {"corner": "rear", "component": "damper", "change": -0.01, "interval": (-0.03, 0.01)},
            "both rear dampers 1 % (-3 to +1 %) weaker, since 20 min; inspect before the next 500 km",
        ),
        (
            {"component": "wheel", "change": None, "interval": None, "run_out": (1.9e-4, 1.7e-4, 2.1e-4, 4e-5)},
            "rear-left wheel out of round: run-out 0.19 mm RMS (0.17 to 0.21; up to 0.04 in the baseline), since "
            "20 min; inspect before the next 500 km",
        ),
        (
            {"component": "damper", "change": -0.86, "interval": (-0.92, -0.77), "runner_up": "rear-left tyre by -9 %"},
            "rear-left damper 86 % (77 to 92 %) weaker (or its mount or rear-left tyre by -9 %), since 20 min; "
            "inspect before the next 500 km",
        ),
        (
            {"component": "damper", "change": 0.35, "interval": (0.31, 0.4)},
            "rear-left damper 35 % (31 to 40 %) stronger (or friction beside it), since 20 min; "
            "inspect before the next 500 km",
        ),
        (
            {"component": "tyre", "change": 0.59, "interval": (0.44, 0.76)},
            "rear-left tyre 59 % (44 to 76 %) stiffer (or another wheel, up to 30 % lighter), since 20 min; "
            "inspect before the next 500 km",
        ),
        (
            {"corner": "front_axle", "component": "anti_roll", "change": -0.9, "interval": (-0.95, -0.8)},
            "front anti-roll bar or a link of it 90 % (80 to 95 %) softer (or a soft spring of that axle on its bump "
            "stop), since 20 min; inspect before the next 500 km",
        ),
        (
            {"change": None, "interval": None, "score": None},
            "rear-left corner meets its bump stop more than before: its spring has sagged or is broken (or only that "
            "corner is overloaded), since 20 min; inspect before the next 500 km",
        ),
        (
            {"corner": "vehicle", "component": "unmodelled", "change": None, "interval": None, "score": None},
            "the suspension differs from the baseline in a way that no single part explains: "
            "inspect before the next 500 km",
        ),
    ],
)
def test_a_finding_is_one_sentence(fields, sentence) -> None:
    assert replace(FINDING, **fields).sentence == sentence


def test_a_finding_names_its_hypothesis() -> None:
    assert FINDING.hypothesis == "rear_left.spring"
    assert replace(FINDING, corner="vehicle", component="unmodelled").hypothesis == "unmodelled"


def test_the_smallest_changes_are_one_clause() -> None:
    parts = [Component("front_left", kind) for kind in ("spring", "damper", "tyre")]
    clause = "a change of {} % of any part would have been found"
    assert detectable_in_words(dict(zip(parts, (0.07, 0.12, 0.1), strict=True))) == clause.format("7 to 12")
    assert detectable_in_words(dict.fromkeys(parts, 0.071)) == clause.format("7")
    assert detectable_in_words({}) == ""


@pytest.fixture(scope="module")
def car():
    return read_vehicle("zafira")


def test_modes_after_a_change_are_those_of_a_vehicle_with_the_fault(car) -> None:
    healthy = structure(car)
    before, after = healthy.modes(), with_faults(healthy, [parse_fault("rear_left.spring=-0.3")]).modes()
    changes = mode_changes(car, FINDING)
    assert [change.label for change in changes] == ["bounce", "pitch", "roll"]
    for k, change in enumerate(changes):
        assert before.labels[k] == change.label
        assert change.frequency == pytest.approx((before.natural_frequency[k], after.natural_frequency[k]), rel=1e-9)
        assert change.damping == pytest.approx((before.damping_ratio[k], after.damping_ratio[k]), rel=1e-9)
        assert change.mac == pytest.approx(mac(before.mode_shapes, after.mode_shapes)[k, k], rel=1e-9)
        assert change.channels == before.channels
        assert change.shapes.max(axis=1) == pytest.approx([1.0, 1.0])
        assert (change.measured_before, change.measured_since) == (None, None)


def test_a_change_of_an_axle_is_a_change_of_both_its_sides(car) -> None:
    faults = [parse_fault(f"front_{side}.damper=0.4") for side in ("left", "right")]
    after = with_faults(structure(car), faults).modes()
    finding = replace(FINDING, corner="front", component="damper", change=0.4)
    changes = mode_changes(car, finding)
    assert [change.damping[1] for change in changes] == pytest.approx(after.damping_ratio[:3], rel=1e-9)


def test_an_unmodelled_change_changes_no_mode(car) -> None:
    unmodelled = replace(FINDING, corner="vehicle", component="unmodelled", change=None, interval=None, score=None)
    assert mode_changes(car, unmodelled) == ()


def test_measured_modes_are_medians_before_the_onset_and_since(car) -> None:
    def observed(time: float, frequency: float, reason: str = "") -> Observation:
        components, values = (Component("rear_left", "spring"),), np.zeros(1)
        modes = {"bounce": (frequency, 0.3)}
        return Observation(time, components, values, np.eye(1), {}, modes, (), reason=reason)

    times = np.arange(6) * 600.0  # the onset is at 1200 s
    frequencies = [1.5, 1.6, 1.2, 1.3, 1.1, 9.0]
    windows = [observed(time, value) for time, value in zip(times, frequencies, strict=True)]
    windows[-1] = replace(windows[-1], reason="standing")
    bounce, pitch, _ = mode_changes(car, FINDING, observations=windows)
    assert bounce.measured_before == pytest.approx((1.55, 0.3))
    assert bounce.measured_since == pytest.approx((1.2, 0.3))
    assert (pitch.measured_before, pitch.measured_since) == (None, None)
