"""Expected precision against that of fits, and its limits."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings, fit_corners
from sprung.likelihood.expected import NOISE, ExpectedDrive, ExpectedFit, _model, expected_fit
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle

CAR = read_vehicle("zafira")


@pytest.mark.slow
def test_a_fit_reports_what_was_expected() -> None:
    drive = RoadDrive(duration=600.0, sampling_rate=100.0, speed=(6.0, 20.0), road=RoadConditions("C"), snr=50.0)
    fit = fit_corners(simulate_drive(CAR, drive, seed=1).recording, CAR)
    rows = fit.model.rows("components")
    reported = ExpectedFit(fit.components, fit.covariance[np.ix_(rows, rows)], 0.7)
    expected = expected_fit(CAR, ExpectedDrive(speed=(6.0, 20.0), roughness=256e-6, sampling_rate=100.0, driving=1e-5))
    for name in ("std", "contrast_std"):
        ratios = np.array(list(getattr(reported, name).values())) / list(getattr(expected, name).values())
        assert np.all(np.abs(ratios - 1) < 0.25), name


@pytest.mark.slow
def test_fits_to_one_sensor_report_what_is_expected_where_their_estimates_are() -> None:
    """At the nominal vehicle alone, ratios of the rear dampers and tyres are expected at 1.2 to 1.4 times of it.

    Without the cornering that the fits allow for, as they do not see that there is none, the spring under the sensor is
    expected at 0.84 times of it.
    """
    one = CAR.model_copy(update={"sensor": CAR.sensor[:1]})
    drive = RoadDrive(duration=600.0, sampling_rate=100.0, speed=(6.0, 20.0), road=RoadConditions("C"), snr=50.0)
    conditions = ExpectedDrive(speed=(6.0, 20.0), roughness=256e-6, sampling_rate=100.0, driving=1e-5)
    expected = expected_fit(one, conditions, n_pairs=4)
    reported = []
    for seed in range(12):
        fit = fit_corners(simulate_drive(one, drive, seed=seed).recording, one)
        rows = fit.model.rows("components")
        reported.append(ExpectedFit(fit.components, fit.covariance[np.ix_(rows, rows)], 0.7))
    stds, contrasts = (
        np.median([list(getattr(each, name).values()) for each in reported], axis=0)
        / list(getattr(expected, name).values())
        for name in ("std", "contrast_std")
    )
    assert np.all(np.abs(contrasts - 1) < 0.3)
    assert np.all(np.abs(contrasts[6:] - 1) < 0.15)  # the rear axle's
    assert np.all(np.abs(stds[list(expected.is_identifiable.values())] - 1) < 0.15)


@pytest.mark.parametrize("part", range(8))
def test_the_ends_of_the_band_do_not_depend_on_rounding(part) -> None:
    """They are 3 and 99 cycles of a segment, by an eigenvalue whose last digit depends on the processor."""
    car = CAR
    body = car.body.model_copy(update={"mass": car.body.mass * (1 + 0.01 * part)})
    model, _ = _model(car.model_copy(update={"body": body}), ExpectedDrive(), CornerSettings(), dict(NOISE))
    cycles = model.spectra.frequencies * model.spectra.segment_length
    assert cycles[[0, -1]] == pytest.approx([3, 99])


def test_a_vehicle_without_speed_is_less_certain() -> None:
    known, unknown = (expected_fit(CAR, ExpectedDrive(has_speed=each)) for each in (True, False))
    assert all(unknown.std[part] >= known.std[part] - 1e-12 for part in known.components)


def test_the_information_of_a_mix_is_the_mean_of_its_roads() -> None:
    """The inverse of the covariance without a prior is additive; here the roads are far from the prior's limit."""
    smooth, rough = 1e-6, 256e-6
    alone = [expected_fit(CAR, ExpectedDrive(roughness=each)) for each in (smooth, rough)]
    mixed = expected_fit(CAR, ExpectedDrive(roughness=((smooth, 0.25), (rough, 0.75))))
    for part, std in mixed.contrast_std.items():
        mean = sum(share / each.contrast_std[part] ** 2 for share, each in zip((0.25, 0.75), alone, strict=True))
        assert std == pytest.approx(mean**-0.5, rel=0.03)
    assert any(alone[0].contrast_std[part] > 1.05 * alone[1].contrast_std[part] for part in mixed.contrast_std)
    same = expected_fit(CAR, ExpectedDrive(roughness=((rough, 0.5), (rough, 0.5))))
    assert list(same.std.values()) == pytest.approx(list(alone[1].std.values()), rel=1e-9)


@pytest.mark.parametrize(
    ("roads", "message"), [(((64e-6, 0.5),), "add up to 0.5"), (((64e-6, 1.5), (1e-6, -0.5)), "share of a road")]
)
def test_shares_that_are_none_are_refused(roads, message) -> None:
    with pytest.raises(ParameterError, match=message):
        ExpectedDrive(roughness=roads)


def test_speeds_that_fall_are_refused() -> None:
    with pytest.raises(ParameterError, match="must rise"):
        ExpectedDrive(speed=(20.0, 10.0))
