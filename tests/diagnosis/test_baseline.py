"""The baseline: residuals in its conditions, which windows it accepts, and what it notes about itself."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import SensorFault, diagnose, learn, nominal_type
from sprung.diagnosis.baseline import mean_deviation, typical_std, unequal_stiffening, units_of
from sprung.errors import ParameterError
from sprung.likelihood.bump_stops import Stiffening


def test_a_file_that_explains_its_windows_badly_is_noted(healthy, baseline) -> None:
    bad = [replace(one, conditions={**one.conditions, "model_error": 0.51}) for one in healthy(12)]
    learnt = learn(bad)
    (note,) = learnt.notes
    assert "deviates by 51 %" in note
    assert note in diagnose(bad, learnt).notes
    assert baseline.notes == ()


def test_a_window_that_the_vehicle_file_explains_badly_is_not_compared_with_it(healthy) -> None:
    (one,) = healthy(1)
    nominal = nominal_type(one.components, name="car").baseline([one])
    bad = replace(one, conditions={"model_error": 0.2})
    assert nominal.accepts(one)
    assert not nominal.accepts(bad)


def test_a_window_with_other_components_or_a_failing_sensor_is_not_accepted(baseline, healthy, silent) -> None:
    (sound,) = healthy(1)
    assert baseline.accepts(sound)
    assert not baseline.accepts(silent("standing"))
    assert not baseline.accepts(replace(sound, sensor_faults=(SensorFault("acc_fl", "dead", ""),)))
    fewer = replace(
        sound, components=sound.components[1:], log_ratios=sound.log_ratios[1:], covariance=sound.covariance[1:, 1:]
    )
    assert not baseline.accepts(fewer)
    with pytest.raises(ParameterError, match="the components differ from those of the baseline"):
        baseline.residual(fewer)


def test_a_window_whose_fit_made_a_tyre_absurdly_stiff_is_not_compared(baseline, healthy) -> None:
    """Of a multibody car with a spare wheel, whose hop is at the end of the band, one window had a tyre 22 times."""
    (window,) = healthy(1)
    tyre = next(part for part in window.components if str(part) == "rear_left.tyre")
    row = window.components.index(tyre)
    values = baseline.mean.copy()
    values[row] += 3.1
    absurd = replace(window, log_ratios=values)
    assert not baseline.accepts(absurd)
    (note,) = (note for note in diagnose([absurd], baseline).notes if "no fault explains" in note)
    assert note.startswith(
        "1 of 1 window was excluded because the fit of rear-left tyre is more than 2.5 times as stiff"
    )
    values[row] = baseline.mean[row] + np.log(1.9)  # a spare wheel
    assert baseline.accepts(replace(window, log_ratios=values))


def test_conditions_count_in_units_from_the_middle(healthy) -> None:
    """100 kg, ln roughness 1.4 and 5 m/s; at most 5 units, and 0 where unknown."""
    middle = {"payload": 100.0, "roughness": 1e-4, "speed": 10.0}
    (one,) = healthy(1)
    near = replace(one, conditions={"payload": 250.0, "roughness": 1e-4 * np.exp(-0.7), "speed": 12.0})
    assert units_of(near.conditions, middle) == pytest.approx([1.5, -0.5, 0.4, 0.0, 0.0, 0.0])
    far = replace(one, conditions={"payload": 1e5, "speed": 0.0})
    assert units_of(far.conditions, middle) == pytest.approx([5.0, 0.0, -2.0, 0.0, 0.0, 0.0])
    assert units_of(near.conditions, {}).tolist() == [0.0] * 6


def test_the_residual_is_what_mean_and_slopes_leave(baseline, healthy) -> None:
    (one,) = healthy(1, seed=5)
    slopes = np.zeros((12, 6))
    slopes[3, 0] = 0.02  # per 100 kg
    steep = replace(baseline, slopes=slopes)
    loaded = replace(one, conditions={**one.conditions, "payload": baseline.centre["payload"] + 200.0})
    expected = one.log_ratios - baseline.mean
    expected[3] -= 0.04
    assert steep.residual(loaded) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "value"), [("mean", np.zeros(1)), ("covariance", np.eye(1)), ("information", np.full((84, 84), np.nan))]
)
def test_a_baseline_of_the_wrong_shape_is_refused(baseline, name, value) -> None:
    with pytest.raises(ParameterError, match=f"{name} of a baseline must be"):
        replace(baseline, **{name: value})


def test_mean_and_deviations_are_those_of_the_windows(healthy) -> None:
    every = healthy(30)
    baseline, later = learn(every[:12]), every[12:]
    mean = mean_deviation(baseline, later)
    np.testing.assert_allclose(mean.log_ratios, np.mean([baseline.residual(window) for window in later], axis=0))
    by_chance = np.diag(baseline.covariance) * (1 / 18 + 1 / 12)
    np.testing.assert_allclose(mean.std_by_chance**2, by_chance)
    np.testing.assert_allclose(mean.std**2, by_chance + np.diag(baseline.nuisance))
    np.testing.assert_allclose(typical_std(baseline) ** 2, np.diag(baseline.covariance + baseline.nuisance))
    assert (mean.components, mean.n_windows) == (baseline.components, 18)
    assert np.all(np.abs(mean.log_ratios) < 3 * mean.std)


STEADY = 0.01**2 * np.eye(6)
#: The second and the third axle of a bus are hard to distinguish.
_APART = np.kron([0.0, 1.0, -1.0], [1.0, 1.0])
HARDLY_APART = STEADY + 0.2**2 * np.outer(_APART, _APART) / 4


@pytest.mark.parametrize(
    ("stated", "rises", "expected"),
    [
        (STEADY, 0.0 * _APART, None),
        (STEADY, 0.2 * _APART, (0.2**2 * 4 / 5, 0.01)),
        (HARDLY_APART, 0.2 * _APART, None),
        (HARDLY_APART, np.array([0.2, 0.2, -0.1, -0.1, -0.1, -0.1]), (0.12 / 5, 0.3)),
    ],
)
def test_unequal_stiffening_is_that_of_corners_that_the_window_tells_apart(healthy, stated, rises, expected) -> None:
    """Rises over six corners, of which the variance is exact where each is known well."""
    corners = tuple(f"{axle}_{side}" for axle in ("front", "axle2", "rear") for side in ("left", "right"))
    window = replace(healthy(1)[0], stiffening=Stiffening(corners, rises, stated))
    value, tolerance = expected or (0.0, 0.0)
    usual = 1.5 * 0.02**2
    assert unequal_stiffening((), window) == pytest.approx(max(value - usual, 0.0), rel=tolerance, abs=1e-12)


def test_no_window_has_no_mean(healthy) -> None:
    with pytest.raises(ParameterError, match="at least one conclusive window"):
        mean_deviation(learn(healthy(12)), [])
