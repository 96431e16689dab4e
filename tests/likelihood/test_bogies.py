"""Springs and dampers of both stages of a vehicle on bogies, from sensors on frames and body."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis.sensors import sensor_faults
from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings, fit_corners
from sprung.simulation import Payload, RailDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle

FAULTS = {"bogie1_left.secondary_spring": -0.2, "bogie2_rear_left.primary_damper": -0.3}


@pytest.mark.slow
def test_all_springs_and_dampers_of_both_stages_are_fitted() -> None:
    """Four secondary and eight primary suspensions; the contacts with the rails keep the file's values."""
    faults = tuple(parse_fault(f"{name}={change}") for name, change in FAULTS.items())
    drive = RailDrive(duration=180.0, sampling_rate=100.0, snr=50.0, welded=True, faults=faults)
    metro, settings = read_vehicle("metro"), CornerSettings(band=(0.4, 12.0))
    fit = fit_corners(simulate_drive(metro, drive, seed=3).recording, metro, settings=settings)
    kinds = [component.kind for component in fit.components]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "secondary_spring": 4,
        "secondary_damper": 4,
        "primary_spring": 8,
        "primary_damper": 8,
    }
    assert fit.is_identifiable.all()
    true = np.array([np.log1p(FAULTS.get(str(component), 0.0)) for component in fit.components])
    errors = fit.log_ratios - true
    assert np.abs(errors).max() < 0.03
    assert np.sqrt(np.mean((errors / fit.log_ratios_std) ** 2)) < 1.6
    assert np.max(fit.log_ratios_std) < 0.03


def with_two_sensors():
    """The metro car with one accelerometer on a frame and one on the body."""
    metro = read_vehicle("metro")
    return metro.model_copy(
        update={"sensor": tuple(sensor for sensor in metro.sensor if sensor.channel in {"bogie1_fl", "body_fl"})}
    )


@pytest.mark.slow
def test_two_accelerometers_suffice_with_speed_and_load_unmeasured() -> None:
    """A primary and a secondary spring of the first bogie are found; the other parts differ from nominal by chance."""
    metro, faults = (
        with_two_sensors(),
        {"bogie1_front_left.primary_spring": -0.3, "bogie1_right.secondary_spring": -0.4},
    )
    drive = RailDrive(
        duration=300.0,
        sampling_rate=100.0,
        snr=30.0,
        welded=True,
        payload=Payload(3000.0, x=1.0),
        faults=tuple(parse_fault(f"{name}={change}") for name, change in faults.items()),
    )
    run = simulate_drive(metro, drive, seed=5).recording
    fit = fit_corners(run.select(["bogie1_fl", "body_fl"]), metro)
    assert fit.notes[-1].startswith("the speed was not recorded: ")
    values = dict(zip(map(str, fit.components), zip(fit.log_ratios, fit.log_ratios_std, strict=True), strict=True))
    for name, (value, std) in values.items():
        assert abs(value - np.log1p(faults.get(name, 0.0))) < 4 * std, name
    for name, size in faults.items():
        assert values[name][0] < np.log1p(size / 2)
        assert values[name][1] < 0.2


@pytest.mark.slow  # a fit of 90 s
def test_a_weak_primary_spring_does_not_hide_the_speed() -> None:
    """To the nominal vehicle no wheelset repeats another one, in 0 of 22 segments; the speeds are right still."""
    metro, fault = with_two_sensors(), parse_fault("bogie1_rear_left.primary_spring=-0.4")
    drive = RailDrive(duration=90.0, sampling_rate=60.0, snr=30.0, welded=True, faults=(fault,))
    run = simulate_drive(metro, drive, seed=2).recording
    fit = fit_corners(run.select(["bogie1_fl", "body_fl"]), metro)
    assert fit.n_segments >= 20
    assert fit.log_ratios[fit.components.index(fault.component)] == pytest.approx(np.log(0.6), abs=0.1)
    speed = run.samples[run.index("speed")]
    assert float(np.average(fit.model.spectra.speeds, weights=fit.model.spectra.counts)) == pytest.approx(
        speed.mean(), rel=0.03
    )


@pytest.mark.slow
def test_joints_are_found_in_the_default_band() -> None:
    """Their lines lie between the modes of body and frames and 25 Hz."""
    metro = with_two_sensors()
    run = simulate_drive(metro, RailDrive(duration=300.0, sampling_rate=100.0, snr=50.0), seed=1).recording
    fit = fit_corners(run, metro)
    assert "rail joints every 18.0 m are part of the fit" in fit.notes
    assert fit.model_error < 0.2


@pytest.mark.slow
def test_joints_are_found_on_a_rough_track() -> None:
    """Their lines stand out above 18 Hz only; without them the model error is 45 %."""
    settings = RailDrive(duration=300.0, sampling_rate=100.0, speed=(31.0, 37.0), snr=20.0, quality="bad")
    fit = fit_corners(simulate_drive(read_vehicle("coach"), settings, seed=1).recording, read_vehicle("coach"))
    assert "rail joints every 18.0 m are part of the fit" in fit.notes
    assert fit.model_error < 0.15


@pytest.mark.slow
def test_misfit_of_channels_without_noise_is_put_down_to_leakage() -> None:
    """Twelve channels of nine coordinates without noise differ by what segments leak from one frequency to another."""
    metro = read_vehicle("metro")
    run = simulate_drive(metro, RailDrive(duration=120.0, sampling_rate=100.0), seed=1).recording
    (note,) = (note for note in fit_corners(run, metro).notes if "more than chance allows" in note)
    assert "have no noise, as simulated ones" in note
    assert "moving part" not in note


@pytest.mark.slow
def test_a_misfit_of_little_noise_claims_no_missing_part() -> None:
    """At 1 % of noise, leakage makes a model error of 12 % of a car that is as its file states."""
    metro = read_vehicle("metro")
    run = simulate_drive(
        metro, RailDrive(duration=180.0, sampling_rate=100.0, snr=100.0, welded=True), seed=1
    ).recording
    (note,) = (note for note in fit_corners(run, metro).notes if "more than chance allows" in note)
    assert "leakage between frequencies" in note
    assert "beyond the motions show, or joints at distances that vary or are not found, may be why" in note


def test_what_runs_on_a_track_only_has_no_other_excitation() -> None:
    metro = read_vehicle("metro")
    run = simulate_drive(metro, RailDrive(duration=20.0, sampling_rate=50.0), seed=1).recording
    with pytest.raises(ParameterError, match=r"kind='road' of a vehicle on bogies must be \"rail\""):
        fit_corners(run, metro, settings=CornerSettings(kind="road"))


@pytest.mark.slow
def test_short_gaps_of_each_channel_cost_little() -> None:
    """Refused ("no stretch without a gap ...") where each of 120 gaps of 25 ms is one of all channels."""
    metro, generator = read_vehicle("metro"), np.random.default_rng(0)
    run = simulate_drive(metro, RailDrive(duration=180.0, sampling_rate=200.0, snr=30.0), seed=3).recording
    samples = run.samples.copy()
    for row in range(12):
        for first in generator.integers(100, samples.shape[1] - 100, 10):
            samples[row, first : first + 5] = np.nan
    fit = fit_corners(replace(run, samples=samples), metro)
    assert fit.n_segments > 40
    assert np.abs(fit.log_ratios / fit.log_ratios_std)[fit.is_identifiable].max() < 3
    assert fit.log_ratios_std[fit.is_identifiable].max() < 0.05


@pytest.mark.slow
def test_long_gaps_of_each_channel_cost_little() -> None:
    """Refused where a gap of one channel is one of all: each of twelve is missing for 13 of 180 seconds."""
    metro = read_vehicle("metro")
    run = simulate_drive(metro, RailDrive(duration=180.0, sampling_rate=100.0, snr=30.0), seed=3).recording
    samples = run.samples.copy()
    for row in range(12):
        samples[row, 100 * (10 + 14 * row) : 100 * (23 + 14 * row)] = np.nan
    cut = replace(run, samples=samples)
    assert sensor_faults(cut, metro) == ()
    fit = fit_corners(cut, metro)
    assert fit.n_segments == 46  # as without gaps
    assert np.abs(fit.log_ratios / fit.log_ratios_std)[fit.is_identifiable].max() < 3
    assert fit.log_ratios_std[fit.is_identifiable].max() < 0.05
