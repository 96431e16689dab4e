"""Diagnoses of windows drawn from their own model, and of a bogie on its rig."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sprung.diagnosis import (
    Observation,
    ResidualTest,
    SensorFault,
    assessment,
    detectable_in_words,
    diagnose,
    doubt_about,
    learn,
    observe_window,
)
from sprung.diagnosis.changes import Candidate, Detection, Size
from sprung.diagnosis.hypotheses import Hypothesis
from sprung.errors import ParameterError
from sprung.likelihood.bump_stops import Stiffening
from sprung.likelihood.elements import log_of_bars
from sprung.results.tables.diagnosis import describe_diagnosis
from sprung.simulation import RigRun, RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import Component, parse_fault, read_vehicle, structure

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")


@pytest.mark.parametrize("name", ["front_left.spring", "rear_right.damper", "front_right.tyre", "rear_left.spring"])
@pytest.mark.parametrize("size", [-0.1, 0.15])
def test_change_is_found_at_its_corner_with_its_size_and_onset(faulty, baseline, name, size) -> None:
    found = diagnose(faulty(3, {name: size}), baseline)
    (finding,) = found.findings
    assert f"{finding.corner}.{finding.component}" == name
    assert finding.interval is not None
    assert finding.interval[0] <= size <= finding.interval[1]
    assert abs(finding.since - 2400.0) <= 600.0
    assert finding.since_interval[0] <= 2400.0 <= finding.since_interval[1]
    assert finding.corner.replace("_", "-") in finding.sentence


def stiffer(windows: list[Observation], by: tuple[float, ...], generator: np.random.Generator) -> list[Observation]:
    """Return windows whose springs stiffen inwards by so much, but for chance, under loads to either side."""
    chance = 0.02 * generator.standard_normal((len(windows), 4)) + 0.03 * generator.standard_normal((len(windows), 1))
    return [
        replace(
            window,
            stiffening=Stiffening(CORNERS, np.array(by) + own, 0.01**2 * np.eye(4)),
            conditions=window.conditions | {"payload_y_moment": 20.0 * float(side)},
        )
        for window, own, side in zip(windows, chance, np.cos(np.arange(len(windows))), strict=True)
    ]


@pytest.mark.parametrize(
    ("rises", "found"),
    [
        ((0.0, 0.0, 0.0, 0.0), []),
        ((0.2, 0.0, 0.0, 0.0), ["front_left.spring"]),
        ((0.0, 0.0, 0.0, 0.2), ["rear_right.spring"]),
        ((0.0, 0.0, 0.25, 0.25), []),  # a load over the rear axle
        ((0.2, 0.2, 0.2, 0.2), []),  # a rough road
        ((-0.2, 0.0, 0.0, 0.0), []),
    ],
)
def test_a_spring_that_stiffens_at_one_corner_alone_lets_it_down_on_its_bump_stop(healthy, rises, found) -> None:
    generator = np.random.default_rng(5)
    learnt = learn(stiffer(healthy(12), (0.0,) * 4, generator))
    later = stiffer(healthy(6, seed=7), rises, generator)
    result = diagnose(later, learnt)
    assert [finding.hypothesis for finding in result.findings] == found
    assert [finding.change for finding in result.findings] == [None] * len(found)
    assert ("ln evidence of sizes of parts" in describe_diagnosis(result)[-1]) == bool(found)
    towards = {"payload_y_moment": -25.0 if found == ["rear_right.spring"] else 25.0}  # a load on that side
    loaded = [replace(window, conditions=window.conditions | towards) for window in later]
    assert not diagnose(loaded, learnt).findings
    without = [replace(window, stiffening=None) for window in later]  # of an earlier version
    assert not diagnose(without, learnt).findings
    assert not diagnose(later, replace(learnt, stiffenings=())).findings


@pytest.mark.parametrize(("error", "named"), [(0.0, ["unmodelled"]), (0.08, [])])
def test_what_the_error_of_the_file_may_make_of_a_load_is_not_named(healthy, faulty, error, named) -> None:
    """Springs, dampers and tyres 4 % stiffer in front and softer at the rear."""
    change = {f"{corner}.{kind}": 0.04 for corner in CORNERS[:2] for kind in ("spring", "damper", "tyre")}
    change |= {name.replace("front", "rear"): -size for name, size in change.items()}

    def fitted(windows: list[Observation]) -> list[Observation]:
        return [replace(window, conditions=window.conditions | {"model_error": error}) for window in windows]

    result = diagnose(fitted(faulty(5, change, before=0, after=30)), learn(fitted(healthy(12))))
    assert [finding.hypothesis for finding in result.findings] == named
    assert any("the error of the vehicle file (8 %)" in doubt for doubt in result.doubts) == (not named)


@pytest.mark.parametrize(
    ("later", "before", "named", "others"),
    [
        ({"front_left": (2e-4, 1e-5), "rear_right": (3e-5, 1e-5)}, 4e-5, ["front_left.wheel"], ""),
        ({"front_left": (2e-4, 2e-5), "rear_right": (1.8e-4, 2e-5)}, 4e-5, ["front_left.wheel"], "rear-right wheel"),
        ({"front_left": (2e-4, 1e-5)}, 0.0, ["front_left.wheel"], ""),
        ({"front_left": (2e-4, 1e-5)}, 1.3e-4, [], ""),  # uneven since long
        ({"front_left": (2e-4, 7e-5)}, 0.0, [], ""),  # known too little
    ],
)
def test_a_wheel_that_becomes_uneven_is_a_finding_against_the_baseline(healthy, later, before, named, others) -> None:
    worn = [replace(window, run_outs={"front_left": (before, 0.0)} if before else {}) for window in healthy(12)]
    learnt = learn(worn)
    assert learnt.run_outs == ({"front_left": before} if before else {})
    windows = healthy(5, seed=7)
    result = diagnose([*windows[:2], *(replace(window, run_outs=later) for window in windows[2:])], learnt)
    assert [finding.hypothesis for finding in result.findings] == named
    assert [finding.runner_up for finding in result.findings] == [others] * len(named)
    assert [finding.since for finding in result.findings] == [windows[2].time] * len(named)
    assert not diagnose([replace(windows[0], run_outs=later), *windows[1:]], learnt).findings  # once


HIDDEN = "would not have been found in every part"
NOTHING, REAR, FRONT_LEFT = (0.0,) * 4, (0.0, 0.0, 0.25, 0.25), (0.05, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("change", "rises", "expected"),
    [
        ({"rear_right.spring": 0.5}, REAR, (False, ["the change of rear-right spring is within what bump", HIDDEN])),
        ({"front_left.spring": -0.2}, REAR, (False, [HIDDEN])),
        (
            {"front_left.spring": 0.12},
            FRONT_LEFT,
            (False, ["the change of front-left spring is within what bump stops"]),
        ),
        ({"rear_right.spring": 0.5}, NOTHING, (True, [])),
        ({"rear_right.spring": 0.5}, FRONT_LEFT, (True, [])),
        ({"front_left.spring": -0.2}, FRONT_LEFT, (True, [])),
        ({"rear_right.damper": -0.3}, REAR, (True, [HIDDEN])),
        ({"rear_right.damper": -0.1}, NOTHING, (True, [])),
        ({"rear_right.damper": -0.1}, REAR, (False, ["the change of rear-right damper is within what bump", HIDDEN])),
    ],
)
def test_a_spring_that_a_load_brings_on_its_bump_stop_is_not_named(healthy, faulty, change, rises, expected) -> None:
    """Multibody cars with 180 kg over the rear axle and 120 kg on the left had a healthy spring named."""
    is_named, doubts = expected
    generator = np.random.default_rng(5)
    learnt = learn(stiffer(healthy(12), NOTHING, generator))
    result = diagnose(stiffer(faulty(5, change, before=0), rises, generator), learnt)
    named = [finding.hypothesis for finding in result.findings]
    assert (result.verdict, named) == (("change", list(change)) if is_named else ("inconclusive", []))
    assert [words in doubt for words, doubt in zip(doubts, result.doubts, strict=True)] == [True] * len(doubts)
    assert result.detection is not None
    assert not (result.detection.is_alert and "no change detected" in describe_diagnosis(result)[0])


@pytest.mark.parametrize("change", [{}, {"front_left.spring": -0.2}, {"rear_right.spring": 0.25}])
def test_windows_on_bump_stops_neither_name_a_spring_nor_hide_one_in_others(healthy, faulty, change) -> None:
    """A third with the rear axle on its stops, where a linear fit is wrong at all springs by chance: 180 kg did so."""
    generator = np.random.default_rng(5)
    learnt = learn(stiffer(healthy(12), NOTHING, generator))
    windows = stiffer(faulty(5, change, before=0), NOTHING, generator)
    for number, window in enumerate(stiffer(windows[::3], REAR, generator)):
        wrong = 0.3 * generator.standard_normal(4) + np.array([0.0, 0.0, 0.4, 0.4])
        of_parts = [wrong[CORNERS.index(part.corner)] * (part.kind == "spring") for part in window.components]
        windows[3 * number] = replace(window, log_ratios=window.log_ratios + of_parts)
    result = diagnose(windows, learnt)
    assert [finding.hypothesis for finding in result.findings] == list(change)
    assert any(note.startswith("in 2 of 6 windows some corners meet their bump stops") for note in result.notes)


@pytest.mark.parametrize(("rises", "named"), [(NOTHING, ["rear_left.damper"]), ((0.25, 0.05, 0.0, 0.0), [])])
def test_without_a_baseline_a_damper_is_not_named_where_a_corner_is_on_its_bump_stop(faulty, rises, named) -> None:
    """A sunk front-left spring of a multibody car read as a rear-left damper 20 % weaker."""
    windows = stiffer(faulty(5, {"rear_left.damper": -0.3}, before=0, after=3), rises, np.random.default_rng(5))
    assert [finding.hypothesis for finding in diagnose(windows).findings] == named


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"rear_left.damper": -0.2, "rear_right.damper": -0.2}, "rear.damper"),
        ({f"{corner}.spring": -0.5 for corner in CORNERS}, "all.spring"),
        (
            {"front_left.spring": -0.1, "rear_right.tyre": 0.12, "front_right.damper": -0.15, "rear_left.tyre": -0.1},
            "unmodelled",
        ),
        # cold dampers and a payload
        ({f"{corner}.damper": 0.25 for corner in CORNERS} | {f"{corner}.spring": -0.12 for corner in CORNERS}, None),
    ],
)
def test_a_change_of_several_parts_is_one_finding_or_none(faulty, baseline, change, found) -> None:
    findings = diagnose(faulty(5, change), baseline).findings
    assert [finding.hypothesis for finding in findings] == ([] if found is None else [found])
    for low, high in (finding.interval for finding in findings if finding.interval is not None):
        assert low <= min(change.values()) <= high


@pytest.mark.parametrize(
    ("parts", "after"),
    [
        (("front_left.spring", "rear_right.damper"), 2),
        (("rear_left.tyre", "rear_left.damper"), 2),
        (("front_left.damper", "rear_right.damper"), 2),
        (("front_right.spring", "front_right.tyre"), 1),
    ],
)
def test_two_parts_at_once_are_two_findings(faulty, baseline, parts, after) -> None:
    findings = diagnose(faulty(7, dict.fromkeys(parts, -0.2), before=0, after=after), baseline).findings
    assert {finding.hypothesis for finding in findings} == set(parts)
    for finding in findings:
        assert finding.interval is not None
        assert finding.interval[0] <= -0.2 <= finding.interval[1]


@pytest.mark.slow
@pytest.mark.parametrize("after", [1, 12])
def test_a_single_part_stays_single(faulty, baseline, after) -> None:
    """Whatever the size above the detectable one, 13 to 18 % in one window: every part once."""
    for number, component in enumerate(baseline.components):
        size = (-0.2, -0.3, -0.6)[number % 3]
        findings = diagnose(faulty(number, {str(component): size}, before=0, after=after), baseline).findings
        assert [finding.hypothesis for finding in findings] == [str(component)]


@pytest.mark.slow
def test_a_worn_part_has_the_size_that_it_has_now(window, baseline) -> None:
    """A damper that loses 1 % of its damping from window to window, thirty times, over 20 vehicles' scatter."""
    sizes = []
    for seed in range(20):
        generator = np.random.default_rng([seed, 31])
        worn = [window(generator, 600.0 * k, {"rear_left.damper": 0.99 ** (k + 1) - 1}) for k in range(30)]
        (finding,) = diagnose(worn, baseline).findings
        assert finding.hypothesis == "rear_left.damper"
        assert finding.change is not None
        sizes.append(finding.change)
    assert np.mean(sizes) == pytest.approx(0.99**30 - 1, abs=0.02)


def test_a_verdict_needs_windows_a_baseline_and_the_power_to_find_a_fifth(
    window, healthy, faulty, baseline, silent
) -> None:
    calm = diagnose(healthy(6, seed=2), baseline)
    assert (calm.verdict, calm.is_healthy, calm.doubts) == ("no_change_detected", True, ())
    assert max(calm.detectable.values()) < 0.2
    changed = diagnose(faulty(3, {"front_left.spring": -0.3}), baseline)
    assert (changed.verdict, changed.is_healthy) == ("change", False)
    idle = diagnose([silent("standing")], baseline)
    assert (idle.verdict, idle.is_healthy) == ("inconclusive", None)
    alone = diagnose(healthy(6, seed=2))
    assert (alone.verdict, alone.is_healthy) == ("inconclusive", None)
    assert alone.doubts[0].startswith("no baseline")
    assert alone.doubts[0] in alone.notes
    vague = replace(baseline, covariance=9 * baseline.covariance, nuisance=9 * baseline.nuisance)
    unsure = diagnose(healthy(1, seed=2), vague)
    assert (unsure.verdict, unsure.is_healthy) == ("inconclusive", None)
    assert unsure.doubts[0].startswith("a change of 20 % would not have been found in every part")
    assert "front-left spring " in unsure.doubts[0]


def test_a_second_opinion_that_disagrees_makes_the_diagnosis_inconclusive(healthy, baseline, monkeypatch) -> None:
    """Two of three windows differ by the residual test, and no part has changed by the vehicle file."""
    every = healthy(3, seed=2)

    def tests(n_different):
        return {one.time: ResidualTest(1.0, 1e-5 if k < n_different else 0.5) for k, one in enumerate(every)}

    monkeypatch.setattr(assessment, "_residual_tests", lambda *_: tests(1))
    assert diagnose(every, baseline).verdict == "no_change_detected"
    monkeypatch.setattr(assessment, "_residual_tests", lambda *_: tests(2))
    doubtful = diagnose(every, baseline)
    assert (doubtful.verdict, doubtful.is_healthy) == ("inconclusive", None)
    assert "2 of 3 windows differ" in doubtful.doubts[0]
    assert doubtful.notes.count(doubtful.doubts[0]) == 1


def test_a_part_is_named_though_an_imperfect_file_leaves_a_rest(faulty, baseline) -> None:
    """What an unknown engine does to the fit: the right part, and a little of everything else."""
    rest = {"front_left.damper": 0.04, "front_right.tyre": -0.04, "rear_right.spring": 0.03, "rear_right.tyre": 0.024}
    found = diagnose(faulty(5, {"rear_left.tyre": -0.2, **rest}), baseline)
    assert found.detection is not None
    assert found.detection.candidates[0].hypothesis.scope in {"else", "pair"}
    (finding,) = found.findings
    assert (finding.corner, finding.component) == ("rear_left", "tyre")


def loaded_windows(moments, *, model_error, seed, faulty=None):
    """Windows whose rear axle reads 10 % stiffer than the front one for each 100 kg m, and twice that far out."""
    parts = tuple(structure(read_vehicle("zafira")).components())
    generator, windows = np.random.default_rng(seed), []
    for number, moment in enumerate(moments):
        values = 0.02 * generator.standard_normal(12)
        per_unit = moment / 100 + np.sign(moment) * max(abs(moment) / 100 - 2, 0)
        values += [0.05 * per_unit * (-1 if part.axle == "front" else 1) for part in parts]
        values += [np.log(0.5) if str(part) == faulty else 0.0 for part in parts]
        conditions = {"payload_x_moment": moment, "model_error": model_error}
        windows.append(Observation(600.0 * (seed + number), parts, values, 0.02**2 * np.eye(12), conditions, {}, ()))
    return windows


def test_a_load_over_an_axle_is_no_change_where_the_file_misfits() -> None:
    """180 kg over the rear axle of a multibody car, which had met none, made its rear springs 95 % stiffer."""
    met = np.random.default_rng(4).uniform(-100, 100, 12)
    baseline = learn(loaded_windows(met, model_error=0.13, seed=1))
    far = {"model_error": 0.13, "seed": 100}
    assert diagnose(loaded_windows([390, 400, 410], **far), baseline).findings == ()
    (finding,) = diagnose(loaded_windows([390, 400, 410], **far, faulty="front_left.damper"), baseline).findings
    assert (finding.corner, finding.component) == ("front_left", "damper")


def test_a_second_part_is_named_only_where_it_explains_what_the_first_does_not() -> None:
    """Evidence of three windows of a multibody car whose front-right tyre had lost 25 %; and of two parts."""
    tyres = Hypothesis("pair", "front_left", "tyre", Component("front_right", "tyre"))
    left, right = tyres.changes
    first, second = Size(0.10, (0.05, 0.14), 4.5), Size(-0.18, (-0.21, -0.14), 9.5)

    def named(of_pair, of_right, of_other=100.0):
        candidates = [
            (tyres, 114.3, of_pair, (first, second)),
            (Hypothesis("else", "vehicle", "unmodelled"), 107.2, 1208.9, ()),
            (right, 106.8, of_right, (Size(-0.24, (-0.26, -0.22), 29.9),)),
            (left, 20.0, 300.0, (first,)),
            (Hypothesis("single", "rear_right", "spring"), 10.0, of_other, (second,)),
        ]
        every = tuple(Candidate(*one, 0.0, (0.0, 0.0)) for one in candidates)
        return assessment._best_two(Detection(np.zeros(3), np.full(3, 110.0), 109.0, 10.8, every, {}))[0].hypothesis

    assert named(1213.0, 1190.0) == right
    assert named(1213.0, 900.0) == tyres
    assert named(1213.0, 900.0, 1100.0).scope != "pair"


@pytest.mark.parametrize(
    ("of_first", "of_second", "is_pair"),
    [(0.37, -0.14, False), (-0.25, -0.14, False), (-0.25, -0.2, True), (0.37, -0.25, True)],
)
def test_a_second_part_beside_a_damper_changes_more_than_friction_makes_it_seem_to(
    of_first, of_second, is_pair
) -> None:
    """Six times the friction at the front left of a multibody car, where the damper behind it was healthy."""
    dampers = Hypothesis("pair", "front_left", "damper", Component("rear_left", "damper"))
    first, second = (Size(size, (size - 0.07, size + 0.07), 8.0) for size in (of_first, of_second))
    alone = [(part, 50.0, 600.0, (size,)) for part, size in zip(dampers.changes, (first, second), strict=True)]
    candidates = [(dampers, 60.0, 900.0, (first, second)), *alone]
    every = tuple(Candidate(*one, 0.0, (0.0, 0.0)) for one in candidates)
    best, _ = assessment._best_two(Detection(np.zeros(3), np.full(3, 60.0), 60.0, 10.8, every, {}))
    assert (best.hypothesis == dampers) == is_pair


@pytest.mark.parametrize(
    ("of_damper", "closest"), [(6.58, "front_right.spring"), (1.9, "front_right.damper"), (-0.97, "front_right.damper")]
)
def test_a_second_hypothesis_is_a_possible_change(of_damper, closest) -> None:
    """No damper becomes 7.6 times as strong, however little the evidence says against it."""
    candidates = [
        (Component("front_left", "damper"), 30.0, -0.2),
        (Component("front_right", "damper"), 29.0, of_damper),
        (Component("front_right", "spring"), 28.0, -0.1),
    ]
    every = tuple(
        Candidate(
            Hypothesis("single", part.corner, part.kind), evidence, 60.0, (Size(size, (size, size), 5.0),), 0.0, (0, 0)
        )
        for part, evidence, size in candidates
    )
    best, second = assessment._best_two(Detection(np.zeros(3), np.full(3, 30.0), 30.0, 10.8, every, {}))
    assert second is not None
    assert (best.hypothesis.name, second.hypothesis.name) == ("front_left.damper", closest)
    alone = Detection(np.zeros(3), np.full(3, 30.0), 30.0, 10.8, every[:1], {})
    assert assessment._best_two(alone) == (every[0], None)


def test_conditions_outside_the_baseline_are_not_taken_for_a_change(window) -> None:
    """One component follows the road as the prior of slopes has it, and all learning was on one road."""
    generator = np.random.default_rng(4)

    def at(roughness, k):
        one = window(generator, 600.0 * k)
        is_moved = np.array([str(component) == "front_left.spring" for component in one.components])
        moved = one.log_ratios + 0.01 * (np.log(roughness) + 8) / 1.4 * is_moved
        return replace(one, log_ratios=moved, conditions={**one.conditions, "roughness": roughness})

    baseline = learn([at(np.exp(-8 + 0.01 * k), k) for k in range(12)])
    rough = [at(np.exp(-8 + 3 * 1.4), k) for k in range(24)]
    found = diagnose(rough, baseline)
    assert found.findings == ()
    assert any("roughness far from that of the baseline" in note for note in found.notes)
    smooth = diagnose([at(np.exp(-8 - 3 * 1.4), k) for k in range(24)], baseline)
    assert any("roughness far from that of the baseline" in note for note in smooth.notes)


def test_sensor_faults_never_become_findings(faulty, baseline) -> None:
    shifted = [
        replace(one, log_ratios=one.log_ratios + 0.5, sensor_faults=(SensorFault("acc_fl", "wrong_gain", "1.5"),))
        for one in faulty(5, {"front_left.spring": -0.3})
    ]
    found = diagnose(shifted, baseline)
    assert found.findings == ()
    assert [fault.kind for fault in found.sensor_faults] == ["wrong_gain"]
    assert not found.is_healthy


@pytest.mark.parametrize(
    ("size", "severity", "number"),
    [(-0.05, "low", 300), (-0.16, "medium", 500), (-0.28, "high", 700), (-0.6, "critical", 900)],
)
def test_severity_is_that_of_the_part_that_is_sure(faulty, baseline, size, severity, number) -> None:
    (finding,) = diagnose(faulty(3, {"front_left.spring": size}, after=24), baseline).findings
    assert (finding.severity, finding.severity_number) == (severity, number)


def test_what_the_named_part_leaves_unexplained_is_noted(faulty, baseline) -> None:
    found = diagnose(faulty(6, {"front_left.spring": -0.25, "rear_right.tyre": -0.07}, after=12), baseline)
    (finding,) = found.findings
    assert finding.hypothesis == "front_left.spring"
    assert any("the rest may be another part" in note for note in found.notes)
    alone = diagnose(faulty(6, {"front_left.spring": -0.25}, after=12), baseline)
    assert not any("the rest" in note for note in alone.notes)


def test_an_alert_that_has_cleared_is_noted(window, baseline) -> None:
    generator = np.random.default_rng(8)
    changes: list[dict[str, float]] = [{}] * 3 + [{"front_left.spring": -0.12}] * 3 + [{}] * 60
    found = diagnose([window(generator, 600.0 * k, change) for k, change in enumerate(changes)], baseline)
    assert found.findings == ()
    assert any("an alert was raised in the window at" in note and "has cleared" in note for note in found.notes)


def test_windows_with_a_dead_sensor_are_noted_as_not_monitored(healthy, faulty, baseline) -> None:
    dead = (SensorFault("acc_fl", "dead", ""),)
    every = [replace(one, sensor_faults=dead) for one in faulty(3, {"front_left.spring": -0.25}, before=0)]
    found = diagnose([*healthy(2, seed=3), *every], baseline)
    assert found.findings == ()
    (note,) = (note for note in found.notes if "not monitored" in note)
    assert note.startswith("6 of 8 windows were excluded because acc_fl is dead; the suspension is not monitored")


def test_without_a_baseline_what_no_part_explains_is_the_vehicle_file(faulty) -> None:
    """A file with another car's numbers: all over the place, and the same from the first window on."""
    change = {"front_left.spring": 0.6, "front_right.damper": -0.5, "rear_left.tyre": 0.5, "rear_right.damper": 0.7}
    found = diagnose(faulty(3, change, before=0))
    assert found.detection is not None
    assert found.detection.is_alert
    assert (found.findings, found.verdict) == ((), "inconclusive")
    assert any("does not describe this vehicle" in doubt for doubt in found.doubts)


@cache
def window_of_a_bogie(seed: int, fault: str = "") -> Observation:
    """Two minutes on the rig."""
    bogie, faults = read_vehicle("scale-bogie"), (parse_fault(fault),) if fault else ()
    settings = RigRun(duration=120.0, speed=(5.6, 5.8), snr=50.0, faults=faults)
    return observe_window(simulate_drive(bogie, settings, seed=seed).recording, bogie, time=600.0 * seed)


@pytest.mark.slow
@pytest.mark.parametrize(("corner", "change"), [("front_left", 0.5), ("rear_left", -0.75)])
def test_mounts_of_the_bogie_on_its_rig(corner, change) -> None:
    """Chapter 7 of the thesis: the right corner, component and sign."""
    normal = learn([window_of_a_bogie(seed) for seed in range(6)])
    assert diagnose([window_of_a_bogie(seed) for seed in range(6, 9)], normal).is_healthy
    fault = f"{corner}.spring={change}"
    (finding,) = diagnose([window_of_a_bogie(seed, fault) for seed in (20, 21)], normal).findings
    assert (finding.corner, finding.component) == (corner, "spring")
    assert finding.change == pytest.approx(change, abs=0.08)


def test_windows_of_another_vehicle_than_the_baseline_are_refused(healthy) -> None:
    zafira, other = ([replace(one, vehicle=name) for one in healthy(8)] for name in ("zafira", "other"))
    with pytest.raises(ParameterError, match="of the vehicle 'other', the baseline is of 'zafira'"):
        diagnose(other, learn(zafira))


def test_a_hidden_loss_of_a_bar_is_named_and_no_doubt_about_the_other_parts() -> None:
    part, bar = Component("front_left", "spring"), Component("front_axle", "anti_roll")
    assert doubt_about({part: 0.2, bar: 0.99}) == ""
    assert "front-left spring 21 %" in doubt_about({part: 0.21, bar: 0.99})
    assert "the loss of the front-axle anti-roll bar would not" in detectable_in_words({part: 0.2, bar: 0.81})
    assert "20 to 80 % of any part would have been found" in detectable_in_words({part: 0.2, bar: 0.8})


@pytest.mark.slow
@pytest.mark.parametrize(("bar_std", "is_found"), [(0.2, True), (0.6, False)])
def test_a_lost_bar_is_found_where_the_sentence_does_not_except_it(bar_std, is_found) -> None:
    """All of it reads as a loss of 82 %, and by chance as another one: found in 95 of 100."""
    parts = (*structure(read_vehicle("zafira")).components(), Component("front_axle", "anti_roll"))
    deviation = np.array([*np.full(12, 0.02), bar_std])
    generator = np.random.default_rng(4)

    def half_hours(number, change=0.0):
        values = deviation * generator.standard_normal((number, 3, 13)) + np.log1p(change) * np.eye(13)[12]
        covariance = np.diag(deviation**2)
        return [[Observation(600.0 * k, parts, x, covariance, {}, {}, ()) for k, x in enumerate(one)] for one in values]

    normal = learn([window for one in half_hours(4) for window in one])
    healthy = [diagnose(one, normal) for one in half_hours(8)]
    assert Counter(one.verdict for one in healthy) == {"no_change_detected": 8}
    exceptions = sum("anti-roll bar would not" in detectable_in_words(one.detectable) for one in healthy)
    assert exceptions == (0 if is_found else 8)
    broken = [diagnose(one, normal).findings for one in half_hours(20, np.expm1(log_of_bars(np.array([-1.0]))[0][0]))]
    assert (sum(bool(found) for found in broken) >= 18) == is_found


@pytest.mark.slow
def test_a_broken_link_of_an_anti_roll_bar_is_the_bar_alone() -> None:
    """Simulated by a vehicle without the bar that its file states, after eight healthy windows of four minutes."""
    file = read_vehicle("zafira")
    front, rear = file.axle
    file = file.model_copy(update={"axle": (front.model_copy(update={"anti_roll_stiffness": 12e3}), rear)})
    broken = file.model_copy(update={"axle": (front, rear)})

    def window(vehicle, number):
        settings = RoadDrive(duration=240.0, sampling_rate=60.0, snr=50.0, road=RoadConditions("C"))
        drive = simulate_drive(vehicle, settings, seed=number).recording
        return observe_window(drive, file, time=240.0 * number)

    baseline = learn([window(file, number) for number in range(8)])
    found = diagnose([window(broken, number) for number in (8, 9)], baseline)
    (finding,) = found.findings
    assert (finding.corner, finding.component) == ("front_axle", "anti_roll")
    assert finding.interval is not None
    assert finding.interval[0] == -1.0 < finding.interval[1] < -0.7
    healthy = diagnose([window(file, number) for number in (10, 11)], baseline)
    assert not healthy.findings
    assert healthy.detectable[Component("front_axle", "anti_roll")] < 0.7


def test_what_a_fit_withholds_from_a_lost_bar_is_no_stiffer_bar_at_the_other_axle() -> None:
    """As three windows of a multibody car without its front link read, when bars were fitted by their logarithms."""
    bars = (Component("front_axle", "anti_roll"), Component("rear_axle", "anti_roll"))
    parts, generator = (*structure(read_vehicle("zafira")).components(), *bars), np.random.default_rng(5)
    std = np.array([0.02] * 12 + [0.1, 0.1])

    def windows(number, *, front, rear):
        change = np.array([0.0] * 12 + [front, rear])
        values = change + std * generator.standard_normal((number, 14))
        return [Observation(600.0 * k, parts, x, np.diag(std**2), {}, {}, ()) for k, x in enumerate(values)]

    baseline = learn(windows(12, front=0.0, rear=0.0))
    (finding,) = diagnose(windows(3, front=-0.95, rear=0.55), baseline).findings
    assert (finding.corner, finding.component) == ("front_axle", "anti_roll")
    both = diagnose(windows(3, front=-0.95, rear=-0.9), baseline).findings
    assert {one.corner for one in both} == {"front_axle", "rear_axle"}


@pytest.mark.parametrize("change", [{"front_left.spring": -0.2}, {"front_right.tyre": -0.25}])
def test_the_interval_of_a_size_allows_for_the_error_of_the_file(faulty, baseline, change) -> None:
    halves, sizes = [], []
    for error in (0.0, 0.1):
        windows = [replace(one, conditions=one.conditions | {"model_error": error}) for one in faulty(3, change)]
        (finding,) = diagnose(windows, baseline).findings
        assert finding.interval is not None
        assert finding.change is not None
        halves.append(np.diff(np.log1p(finding.interval))[0] / 2)
        sizes.append(np.log1p(finding.change))
    assert halves[1] ** 2 - halves[0] ** 2 == pytest.approx((1.96 * 1.5 * 0.1 * sizes[1]) ** 2, rel=0.1)


def test_a_much_stiffer_tyre_may_be_another_wheel(faulty, baseline) -> None:
    """A tyre +30 % with 18 % less mass reads as ln(1.3 / 0.82): its interval has the tyre's own change."""
    windows = faulty(3, {"rear_right.tyre": 1.3 / 0.82 - 1})
    (finding,) = diagnose(windows, baseline).findings
    assert (finding.corner, finding.component) == ("rear_right", "tyre")
    assert finding.interval is not None
    assert finding.interval[0] < 0.3 < finding.interval[1]
    assert "or another wheel, up to 30 % lighter" in finding.sentence
    wrong = [replace(one, conditions=one.conditions | {"model_error": 0.15}) for one in windows]
    (same,) = diagnose(wrong, baseline).findings
    assert same.interval is not None
    assert same.interval[0] == 0.0  # the same tyre on a lighter wheel, not a softer one
    (one,) = diagnose(faulty(3, {"rear_right.tyre": 0.2}), baseline).findings
    assert one.interval is not None
    assert one.interval[0] > 0.15
    assert "wheel" not in one.sentence
