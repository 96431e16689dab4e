"""Baseline, change tests and findings, on windows drawn from their own model and on simulated drives."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import (
    Observation,
    SensorFault,
    detect,
    diagnose,
    false_discoveries,
    learn,
    observe_window,
    windows,
)
from sprung.diagnosis.directions import usual_nuisance
from sprung.documents import baseline_document, baseline_from_document, observation_document, observation_from_document
from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Recording
from sprung.simulation import (
    FEW_POTHOLES,
    REALISTIC_SUSPENSION,
    Payload,
    RigRun,
    RoadConditions,
    RoadDrive,
    simulate_drive,
)
from sprung.vehicles import Component, parse_fault, read_vehicle

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
COMPONENTS = tuple(Component(corner, kind) for corner in CORNERS for kind in ("spring", "damper", "tyre"))
IS_SPRING = np.array([component == Component("front_left", "spring") for component in COMPONENTS])
COVARIANCE = 0.012**2 * (np.eye(12) + 0.3)
ENDS = {"spring": 0.004, "damper": 0.006, "tyre": 0.003}


def drawn(generator, covariance):
    """Values of a covariance; by Cholesky, as directions of equal variance come out differently from every library."""
    return np.linalg.cholesky(covariance) @ generator.standard_normal(len(covariance))


def window(generator, time, change=(), **fields):
    """A window as the model of the change tests has it."""
    values = drawn(generator, COVARIANCE + usual_nuisance(COMPONENTS, ENDS))
    for name, size in dict(change).items():
        values[COMPONENTS.index(Component.parse(name))] += np.log1p(size)
    conditions = {
        "payload": float(generator.uniform(0, 300)),
        "roughness": float(np.exp(generator.normal(-8, 1))),
        "speed": 12.0,
    }
    return Observation(time, COMPONENTS, values, COVARIANCE, conditions, {}, (), **fields)


def healthy(count, seed=0):
    generator = np.random.default_rng(seed)
    return [window(generator, 600.0 * k) for k in range(count)]


@pytest.fixture(scope="module")
def baseline():
    return learn(healthy(12))


def faulty(seed, change, *, before=4, after=6):
    generator = np.random.default_rng([seed, 1])
    return [window(generator, 600.0 * k, change if k >= before else ()) for k in range(before + after)]


@pytest.mark.parametrize("name", ["front_left.spring", "rear_right.damper", "front_right.tyre", "rear_left.spring"])
@pytest.mark.parametrize("size", [-0.1, 0.15])
def test_change_is_found_at_its_corner_with_its_size_and_onset(baseline, name, size):
    found = diagnose(faulty(3, {name: size}), baseline)
    (finding,) = found.findings
    assert f"{finding.corner}.{finding.component}" == name
    assert finding.interval[0] <= size <= finding.interval[1]
    assert abs(finding.since - 2400.0) <= 600.0
    assert finding.since_interval[0] <= 2400.0 <= finding.since_interval[1]
    assert finding.corner.replace("_", "-") in finding.sentence


def test_a_file_that_explains_its_windows_badly_is_remarked_on(baseline):
    bad = [replace(one, conditions={**one.conditions, "model_error": 0.51}) for one in healthy(12)]
    taught = learn(bad)
    (note,) = taught.notes
    assert "deviates by 51 %" in note
    assert baseline_from_document(baseline_document(taught).as_json()).notes == taught.notes
    assert note in diagnose(bad, taught).notes
    assert baseline.notes == ()


def test_both_sides_of_an_axle_are_one_finding(baseline):
    (finding,) = diagnose(faulty(5, {"rear_left.damper": -0.2, "rear_right.damper": -0.2}), baseline).findings
    assert (finding.corner, finding.component) == ("rear", "damper")
    assert finding.change == pytest.approx(-0.2, abs=0.04)


def test_several_parts_at_once_are_unmodelled(baseline):
    change = {"front_left.spring": -0.1, "rear_right.tyre": 0.12, "front_right.damper": -0.15, "rear_left.tyre": -0.1}
    (finding,) = diagnose(faulty(5, change), baseline).findings
    assert finding.component == "unmodelled"


def test_a_part_is_named_though_an_imperfect_file_leaves_a_rest(baseline):
    """What an unknown engine does to the fit: the right part, and a little of everything else."""
    rest = {"front_left.damper": 0.04, "front_right.tyre": -0.04, "rear_right.spring": 0.03, "rear_right.tyre": 0.024}
    found = diagnose(faulty(5, {"rear_left.tyre": -0.2, **rest}), baseline)
    assert found.detection.candidates[0].hypothesis.scope == "else"
    (finding,) = found.findings
    assert (finding.corner, finding.component) == ("rear_left", "tyre")


def test_more_than_usual_at_all_corners_is_one_finding(baseline):
    (finding,) = diagnose(faulty(5, {f"{corner}.spring": -0.5 for corner in CORNERS}), baseline).findings
    assert (finding.corner, finding.component) == ("all", "spring")
    assert finding.sentence.startswith("all springs ")
    assert finding.interval[0] <= -0.5 <= finding.interval[1]


def test_what_moves_all_corners_is_no_finding(baseline):
    """Cold dampers and a payload: all of a kind by the same factor."""
    change = {f"{corner}.damper": 0.25 for corner in CORNERS} | {f"{corner}.spring": -0.12 for corner in CORNERS}
    assert diagnose(faulty(5, change), baseline).findings == ()


def test_false_alarms_stay_below_the_stated_rate():
    """200 vehicles with 48 windows each, at one false alarm in ten vehicle-days: 20 expected at most."""
    alarms = 0
    for seed in range(200):
        every = healthy(54, seed=seed + 1000)
        found = detect(learn(every[:6]), every[6:], false_alarms=0.1)
        alarms += found.first_alert is not None
    assert alarms <= 28  # 20 and 1.7 standard deviations


def test_windows_that_scatter_twice_as_much_as_they_report_raise_no_more_alarms():
    """Whatever the fit says of itself: the scatter follows from six windows of learning and from those tested."""
    alarms = 0
    for seed in range(100):
        generator = np.random.default_rng(seed + 5000)
        every = []
        for k in range(30):
            one = window(generator, 600.0 * k)
            every.append(replace(one, log_ratios=one.log_ratios + drawn(generator, 3 * COVARIANCE)))
        found = detect(learn(every[:6], n_windows=4), every[6:], false_alarms=0.1)
        alarms += found.first_alert is not None
    assert alarms <= 10  # 5 and two standard deviations


def test_conditions_that_the_baseline_never_met_are_no_change():
    """One component follows the road as the prior of slopes has it, and all learning was on one road."""
    generator = np.random.default_rng(4)

    def at(roughness, k):
        one = window(generator, 600.0 * k)
        moved = one.log_ratios + 0.01 * (np.log(roughness) + 8) / 1.4 * np.array(
            [str(name) == "front_left.spring" for name in COMPONENTS]
        )
        return replace(one, log_ratios=moved, conditions={**one.conditions, "roughness": roughness})

    baseline = learn([at(np.exp(-8 + 0.01 * k), k) for k in range(12)])
    rough = [at(np.exp(-8 + 3 * 1.4), k) for k in range(24)]
    found = diagnose(rough, baseline)
    assert found.findings == ()
    assert any("roughness far from that of the baseline" in note for note in found.notes)
    smooth = diagnose([at(np.exp(-8 - 3 * 1.4), k) for k in range(24)], baseline)
    assert any("roughness far from that of the baseline" in note for note in smooth.notes)


def test_e_values_have_the_mean_one_at_most_without_a_change():
    values = []
    for seed in range(150):
        every = healthy(18, seed=seed + 9000)
        values.append(np.exp(detect(learn(every[:12]), every[12:]).e_value))
    assert np.mean(values) <= 1.0
    assert false_discoveries(np.log(values)) == []


def test_intervals_cover_the_size(baseline):
    inside = 0
    for seed in range(100):
        (finding,) = diagnose(faulty(seed + 50, {"front_left.spring": -0.15}), baseline).findings
        inside += finding.interval[0] <= -0.15 <= finding.interval[1]
    assert inside >= 88


def test_suspect_windows_are_not_learnt_from():
    good = healthy(10)
    generator = np.random.default_rng(9)
    bad = [window(generator, 0.0, {"front_left.spring": -0.4}), window(generator, 0.0, {"rear_left.tyre": 0.5})]
    faulty_sensor = replace(good[0], sensor_faults=(SensorFault("acc_fl", "noisy", ""),))
    mute = Observation(0.0, (), np.zeros(0), np.zeros((0, 0)), {}, {}, (), reason="standing")
    found = learn([*good, *bad, faulty_sensor, mute])
    assert (found.n_windows, found.n_refused) == (10, 4)
    assert np.abs(found.mean[0]) < 0.1


def test_too_few_windows_are_refused_with_the_reason():
    mute = Observation(0.0, (), np.zeros(0), np.zeros((0, 0)), {}, {}, (), reason="12 segments are too few")
    with pytest.raises(
        DataError, match=r"3 of 5 windows can be learnt from, .* 6 are needed: .*\(12 segments are too few\)"
    ):
        learn([*healthy(3), mute, mute])


def test_baseline_and_observations_survive_json(baseline):
    again = baseline_from_document(json.loads(json.dumps(baseline_document(baseline).as_json())))
    one = observation_from_document(json.loads(json.dumps(observation_document(healthy(1)[0]))))
    assert again.residual(one) == pytest.approx(baseline.residual(healthy(1)[0]))
    assert (again.version, again.reason) == (1, "first learning")
    later = learn(healthy(8), reason="new dampers", previous=again)
    assert (later.version, later.reason) == (2, "new dampers")
    with pytest.raises(ParameterError, match="incomplete or invalid"):
        baseline_from_document({**baseline_document(baseline).as_json(), "mean": "much"})


def test_sensor_faults_never_become_findings(baseline):
    shifted = [
        replace(one, log_ratios=one.log_ratios + 0.5, sensor_faults=(SensorFault("acc_fl", "wrong_gain", "1.5"),))
        for one in faulty(5, {"front_left.spring": -0.3})
    ]
    found = diagnose(shifted, baseline)
    assert found.findings == ()
    assert [fault.kind for fault in found.sensor_faults] == ["wrong_gain"]
    assert not found.is_healthy


def test_growing_change_has_a_trend_and_a_forecast(baseline):
    generator = np.random.default_rng(4)
    growing = [window(generator, 600.0 * k, {"front_left.spring": -0.01 * k}) for k in range(16)]
    (finding,) = diagnose(growing, baseline).findings
    assert finding.trend.interval[0] < finding.trend.interval[1] < 0
    assert finding.trend.per_hour == pytest.approx(-0.065, abs=0.02)
    earliest, latest = finding.trend.hours_to_limit
    assert 0 < earliest < 2.5 < latest  # another 15 windows at -1 % each make 30 %
    (steady,) = diagnose(faulty(3, {"front_left.spring": -0.2}), baseline).findings
    assert steady.trend is None or steady.trend.hours_to_limit is None


def test_a_limit_that_is_passed_is_due_now(baseline):
    generator = np.random.default_rng(4)
    growing = [window(generator, 600.0 * k, {"front_left.spring": -0.03 * k}) for k in range(16)]
    (finding,) = diagnose(growing, baseline).findings
    assert finding.trend.hours_to_limit[0] == 0


@pytest.mark.parametrize(
    ("size", "severity", "number"),
    [(-0.05, "low", 300), (-0.16, "medium", 500), (-0.28, "high", 700), (-0.6, "critical", 900)],
)
def test_severity_is_that_of_the_part_that_is_sure(baseline, size, severity, number):
    (finding,) = diagnose(faulty(3, {"front_left.spring": size}, after=24), baseline).findings
    assert (finding.severity, finding.severity_number) == (severity, number)


def test_sizes_are_not_drawn_towards_nothing(baseline):
    """However large, and from one window: the prior of sizes weighs evidence, and no more."""
    errors = []
    for seed in range(40):
        (finding,) = diagnose(faulty(seed, {"front_left.spring": -0.75}, after=1), baseline).findings
        errors.append(np.log1p(finding.change) - np.log1p(-0.75))
    assert abs(np.mean(errors)) < 0.02


def test_what_the_named_part_leaves_unexplained_is_noted(baseline):
    found = diagnose(faulty(6, {"front_left.spring": -0.25, "rear_right.tyre": -0.07}, after=12), baseline)
    (finding,) = found.findings
    assert finding.hypothesis == "front_left.spring"
    assert any("the rest may be another part" in note for note in found.notes)
    alone = diagnose(faulty(6, {"front_left.spring": -0.25}, after=12), baseline)
    assert not any("the rest" in note for note in alone.notes)


def test_an_alert_that_has_cleared_is_noted(baseline):
    generator = np.random.default_rng(8)
    changes = [()] * 3 + [{"front_left.spring": -0.12}] * 3 + [()] * 60
    found = diagnose([window(generator, 600.0 * k, change) for k, change in enumerate(changes)], baseline)
    assert found.findings == ()
    assert any("an alert was raised in the window at" in note and "has cleared" in note for note in found.notes)


def test_windows_with_a_dead_sensor_are_noted_as_not_monitored(baseline):
    dead = (SensorFault("acc_fl", "dead", ""),)
    every = [replace(one, sensor_faults=dead) for one in faulty(3, {"front_left.spring": -0.25}, before=0)]
    found = diagnose([*healthy(2, seed=3), *every], baseline)
    assert found.findings == ()
    (note,) = (note for note in found.notes if "not monitored" in note)
    assert note.startswith("6 of 8 windows were excluded because acc_fl is dead; the suspension is not monitored")


def test_sentences_of_intervals_and_axles():
    (finding,) = diagnose(faulty(5, {"rear_left.damper": -0.2, "rear_right.damper": -0.2}), learn(healthy(12))).findings
    assert finding.sentence.startswith("both rear dampers ")
    doubtful = replace(finding, change=-0.01, interval=(-0.03, 0.01))
    assert "1 % (-3 to +1 %) weaker" in doubtful.sentence


def test_a_baseline_of_the_wrong_shape_is_refused(baseline):
    for name, value in (("mean", [0.0]), ("covariance", [[1.0]]), ("design", [[np.nan] * 4] * 4)):
        with pytest.raises(ParameterError, match=f"{name} of a baseline must be"):
            baseline_from_document({**baseline_document(baseline).as_json(), name: value})


def test_without_a_baseline_limits_are_wide():
    change = {"front_left.spring": -0.3}
    found = diagnose(faulty(3, change, before=0))
    assert any("no baseline" in note for note in found.notes)
    (finding,) = found.findings
    assert (finding.corner, finding.component) == ("front_left", "spring")
    assert finding.interval[1] - finding.interval[0] > 0.06
    assert diagnose(faulty(3, {"front_left.spring": -0.05}, before=0)).findings == ()


def test_conditions_never_met_are_noted(baseline):
    far = [replace(one, conditions={**one.conditions, "payload": 900.0}) for one in healthy(3, seed=8)]
    assert any("payload far from that of the baseline" in note for note in diagnose(far, baseline).notes)


def test_false_discoveries_of_a_fleet():
    assert false_discoveries([0.0, 12.0, -1.0, 9.0], rate=0.05) == [1, 3]
    assert false_discoveries([0.0, 1.0, -1.0], rate=0.05) == []
    with pytest.raises(ParameterError, match="rate"):
        false_discoveries([0.0], rate=0.0)


def test_windows_follow_each_other_and_keep_the_rest():
    samples = np.arange(1300.0)[None, :]
    run = Recording(samples, 1.0, (Channel("a", "acceleration"),))
    parts = list(windows([run, run], length=600.0))
    assert [time for time, _ in parts] == [0.0, 600.0, 1300.0, 1900.0]
    assert [part.n_samples for _, part in parts] == [600, 700, 600, 700]
    dated = replace(run, start=10**18)
    assert [time for time, _ in windows([dated, replace(dated, start=10**18 + 10**13)], length=2000.0)] == [0.0, 10**4]


def test_conditions_of_an_inconclusive_window():
    car = read_vehicle("zafira")
    yaw = car.sensor[0].model_copy(
        update={"channel": "yaw_rate", "quantity": "angular_velocity", "unit": "deg/s", "direction": (0.0, 0.0, -1.0)}
    )
    car = car.model_copy(update={"sensor": (*car.sensor, yaw)})
    run = simulate_drive(car, RoadDrive(duration=30.0), seed=1).recording
    samples = run.samples.copy()
    samples[run.index("speed"), : run.n_samples // 4] = 0.0
    samples[run.index("yaw_rate")] = 0.2
    warm = np.full((1, run.n_samples), 21.5)
    channels = (*run.channels, Channel("oil", "temperature"))
    found = observe_window(replace(run, samples=np.concatenate([samples, warm]), channels=channels), car)
    assert not found.is_conclusive
    assert found.conditions["standing"] == pytest.approx(0.25, abs=0.01)
    assert found.conditions["temperature"] == pytest.approx(21.5)
    assert found.conditions["turning"] == pytest.approx(0.2)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["front_right.tyre=-0.3", "rear_left.damper=-0.1"])
def test_simulated_drives(fault):
    """Nonlinear drives over roads B to D with payload and warm dampers: the right corner within two windows."""
    car = read_vehicle("zafira")

    def seen(seed, faults=()):
        generator = np.random.default_rng(seed)
        settings = RoadDrive(
            road=RoadConditions(str(generator.choice(["B", "C", "D"])), potholes=FEW_POTHOLES),
            payload=Payload(float(generator.uniform(0, 300))),
            suspension=replace(REALISTIC_SUSPENSION, temperature=float(generator.uniform(0, 40))),
            snr=50.0,
            faults=faults,
        )
        return observe_window(simulate_drive(car, settings, seed=seed).recording, car, time=600.0 * seed)

    normal = learn([seen(seed) for seed in range(6)])
    assert diagnose([seen(seed) for seed in range(6, 9)], normal).is_healthy
    (finding,) = diagnose([seen(seed, (parse_fault(fault),)) for seed in (20, 21)], normal).findings
    assert f"{finding.corner}.{finding.component}" == fault.partition("=")[0]
    assert finding.change == pytest.approx(parse_fault(fault).change, abs=0.04)


@pytest.mark.slow
@pytest.mark.parametrize(("corner", "change"), [("front_left", 0.5), ("rear_left", -0.75)])
def test_mounts_of_the_bogie_on_its_rig(corner, change):
    """Chapter 7 of the thesis: the right corner, component and sign."""
    bogie = read_vehicle("scale-bogie")

    def seen(seed, faults=()):
        settings = RigRun(duration=120.0, speed=(5.6, 5.8), snr=50.0, faults=faults)
        return observe_window(simulate_drive(bogie, settings, seed=seed).recording, bogie, time=600.0 * seed)

    normal = learn([seen(seed) for seed in range(6)])
    assert diagnose([seen(seed) for seed in range(6, 9)], normal).is_healthy
    faults = (parse_fault(f"{corner}.spring={change}"),)
    (finding,) = diagnose([seen(seed, faults) for seed in (20, 21)], normal).findings
    assert (finding.corner, finding.component) == (corner, "spring")
    assert finding.change == pytest.approx(change, abs=0.08)
