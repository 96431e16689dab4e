"""Changes of lateral parts of a rail vehicle: observed under a load, named and worded."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sprung import Observation, diagnose, learn
from sprung.diagnosis import observation, observe_window
from sprung.diagnosis.findings import mode_changes
from sprung.diagnosis.observation import _lateral_parts
from sprung.likelihood.fitting import fit_windows
from sprung.simulation import Payload, RailDrive, simulate_drive
from sprung.vehicles import Component, parse_fault, read_vehicle
from sprung.vehicles.lateral import lateral_components, lateral_parts
from sprung.vehicles.window import window_of

COACH = read_vehicle("coach")
PARTS = (Component("bogie1_left", "secondary_spring"), Component("bogie1_right", "secondary_spring"))


def windows(n, first=0, seed=1, **changes):
    """Windows with 1 % scatter and relative changes of parts such as bogie1__lateral_damper."""
    parts = (*PARTS, *lateral_parts(COACH))
    values = 0.01 * np.random.default_rng(seed).standard_normal((n, len(parts)))
    for name, change in changes.items():
        values[:, list(map(str, parts)).index(name.replace("__", "."))] += np.log1p(change)
    C = 0.01**2 * np.eye(len(parts))
    return [Observation(600.0 * (first + k), parts, x, C, {}, {}, ()) for k, x in enumerate(values)]


@pytest.fixture(scope="module")
def baseline():
    return learn(windows(12))


@pytest.mark.parametrize(
    ("part", "change", "words"),
    [
        ("bogie1__lateral_damper", -0.4, "bogie1 lateral dampers 4? % weaker"),
        ("bogie2__primary_longitudinal_spring", -0.3, "bogie2 primary longitudinal springs 3? % softer"),
        ("wheelsets__conicity", 0.6, "equivalent conicity of the wheelsets ?? % higher"),
    ],
)
def test_the_changed_part_is_named(baseline, part, change, words) -> None:
    result = diagnose(windows(6, first=12, seed=2, **{part: change}), baseline)
    (finding,) = result.findings
    assert f"{finding.corner}__{finding.component}" == part
    low, high = finding.interval or (0.0, 0.0)
    assert low < change < high
    start, _, end = words.partition("?")
    assert finding.sentence.startswith(start)
    assert f") {end.rpartition(' ')[2]}" in finding.sentence


def test_two_windows_tell_a_soft_lateral_spring_from_a_stiff_one_of_the_other_bogie(baseline) -> None:
    """Springs of steel hardly change together from day to day, whatever the temperature."""
    (finding,) = diagnose(windows(2, first=12, seed=2, bogie2__lateral_spring=-0.25), baseline).findings
    assert (finding.corner, finding.component, finding.runner_up) == ("bogie2", "lateral_spring", "")


def test_modes_of_the_body_change_with_parts_that_it_rolls_on(baseline) -> None:
    for part, labels in (
        ("bogie1__primary_longitudinal_spring", set()),
        ("bogie1__lateral_damper", {"roll"}),
        ("bogie1_left__secondary_spring", {"bounce", "pitch", "roll"}),
    ):
        (finding,) = diagnose(windows(6, first=12, seed=2, **{part: -0.4}), baseline).findings
        changes = mode_changes(COACH, finding, baseline=baseline)
        assert {change.label for change in changes if not np.isclose(*change.damping, rtol=0.005)} == labels


def test_no_change_is_said_of_parts_and_not_of_the_conicity(baseline) -> None:
    result = diagnose(windows(6, first=12, seed=3), baseline)
    assert result.detectable[Component("wheelsets", "conicity")] > 0.2  # follows the gauge of the rails
    assert result.verdict == "no_change_detected"


def test_a_lost_yaw_damper_has_a_finite_change_that_is_certain() -> None:
    """At -99 % the logarithm says -4.3 +- 0.25, and softer springs beside it were named in its place."""
    components = tuple(lateral_components(COACH))
    parameters, lost = np.full(len(components), -0.2), components.index("bogie2.lateral_damper")
    parameters[lost] = -4.3
    given = {"components": components, "parameters": parameters, "covariance": 0.25**2 * np.eye(len(components))}
    fit: Any = SimpleNamespace(model=SimpleNamespace(vehicle=COACH), **given)
    parts, ratios, covariance = _lateral_parts(fit)
    row = list(map(str, parts)).index("bogie2.lateral_damper")
    assert (ratios[row], covariance[row, row] ** 0.5) == pytest.approx((-1.666, 2 * 0.25 * np.exp(-4.3)), abs=1e-3)
    others = np.arange(len(parts)) != row
    assert ratios[others] == pytest.approx(-0.2)
    assert np.diag(covariance)[others] == pytest.approx(0.25**2)


@pytest.mark.slow
def test_lateral_parts_of_a_loaded_vehicle_are_observed(coach, monkeypatch) -> None:
    """Ten tons of load are a third of the body: taken for lateral springs they would read 20 % soft."""
    changes = {"bogie1.lateral_damper": -0.4, "wheelsets.conicity": 0.3, "bogie2.lateral_spring": -0.2}
    drive = RailDrive(
        duration=240.0,
        sampling_rate=60.0,
        speed=(34.0, 38.0),
        snr=20.0,
        payload=Payload(10_000.0),
        faults=tuple(parse_fault(f"{name}={change}") for name, change in changes.items()),
    )
    run = simulate_drive(coach, drive, seed=1)
    assert run.truth["faults"] == pytest.approx(changes)
    fit = fit_windows([window_of(run.recording, coach)])
    monkeypatch.setattr(observation, "fit_windows", lambda *_, **__: fit)  # of vertical motion, for both
    window = observe_window(run.recording, coach)
    assert not window.reason
    found = dict(zip(map(str, window.components), window.log_ratios, strict=True))
    stds = dict(zip(map(str, window.components), np.sqrt(np.diag(window.covariance)), strict=True))
    assert stds["bogie2.lateral_spring"] < 0.09
    for part in map(str, lateral_parts(coach)):
        assert abs(found[part] - np.log1p(changes.get(part, 0.0))) < 3 * stds[part], part
    without_speed = run.recording.select([name for name in run.recording.names if name != "speed"])
    observed = observe_window(without_speed, coach)
    assert observed.components == window.components[: -len(lateral_parts(coach))]
