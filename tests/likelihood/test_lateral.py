"""Fits of lateral motion: derivatives, exact spectra, drives with a weak damper, refusals."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.formats import write
from sprung.likelihood import lateral
from sprung.likelihood.lateral import LateralModel, fit_lateral, fit_lateral_under
from sprung.likelihood.search import minimised
from sprung.likelihood.spectra import ClassSpectra
from sprung.recording import Channel, Recording
from sprung.simulation import RailDrive, simulate_drive
from sprung.vehicles import Vehicle, critical_speed, lateral_modes, parse_fault, write_vehicle
from sprung.vehicles.lateral import lateral_components, lateral_outputs, lateral_system, with_lateral
from sprung.vehicles.window import window_of


@pytest.fixture(scope="module")
def model(coach) -> LateralModel:
    """Return a model with the exact spectra of a vehicle with other values."""
    outputs, frequencies = lateral_outputs(coach), np.arange(0.5, 8.0, 0.1)
    speeds, size = np.array([25.0, 40.0]), len(lateral_outputs(coach).channels)
    spectra = ClassSpectra(
        frequencies=frequencies,
        counts=np.array([60.0, 60.0]),
        speeds=speeds,
        spreads=np.array([0.01, 0.0]),
        matrices=np.broadcast_to(np.eye(size, dtype=np.complex128), (2, frequencies.size, size, size)),
        segment_length=10.0,
        weights=np.full((2, frequencies.size), 60.0),
    )
    empty = LateralModel(coach, outputs, spectra)
    exact = empty.matrix(exact_parameters(empty))
    return LateralModel(coach, outputs, replace(spectra, matrices=exact))


def exact_parameters(model: LateralModel) -> np.ndarray:
    """Return other values than those of the file, a track of ERRI B176 low, and sensors of little noise."""
    track, noise = np.log([9.05, 30.6]), np.full(len(model.outputs.channels), -3.0)
    return np.concatenate([np.linspace(-0.3, 0.3, len(model.components)), track, noise])


@pytest.mark.slow
def test_gradient_is_that_of_finite_differences(model) -> None:
    parameters = 0.1 * np.cos(np.arange(model.prior_std.size))
    _, gradient = model.objective(parameters)
    for row, step in enumerate(1e-5 * np.eye(parameters.size)):
        ends = [model.objective(parameters + sign * step)[0] for sign in (1, -1)]
        assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(gradient[row], rel=1e-4, abs=1e-2)


def test_the_model_of_each_class_is_that_at_its_speed(model) -> None:
    parameters = exact_parameters(model)
    for system, speed in zip(model._systems(parameters), (25.0, 40.0), strict=True):
        exact = lateral_system(model.changed(parameters), speed=speed)
        for name in ("mass", "damping", "stiffness", "input_matrix"):
            assert getattr(system, name) == pytest.approx(getattr(exact, name), rel=1e-9), name


@pytest.mark.slow
def test_exact_spectra_give_the_vehicle_that_made_them(model) -> None:
    loose = replace(model)  # without a prior
    object.__setattr__(loose, "prior_std", np.full(model.prior_std.size, 1e6))
    parameters = minimised(loose, model.start())
    for _ in range(8):
        parameters = parameters - np.linalg.solve(loose.information(parameters), loose.objective(parameters)[1])
    n = len(model.components)
    assert np.abs(parameters[:n] - exact_parameters(model)[:n]).max() < 1e-9
    exact, found = (lateral_modes(model.changed(each), speed=40.0) for each in (exact_parameters(model), parameters))
    assert np.abs(found.poles / exact.poles - 1).max() < 1e-9


def drive(vehicle: Vehicle, *, seed: int, speed: tuple[float, float], fault: str | None = None) -> Recording:
    faults = () if fault is None else (parse_fault(fault),)
    settings = RailDrive(speed=speed, duration=300.0, sampling_rate=100.0, snr=20.0, welded=True, faults=faults)
    simulated = simulate_drive(vehicle, settings, seed=seed)
    assert simulated.truth["faults"] == ({} if fault is None else {fault.partition("=")[0]: pytest.approx(-0.4)})
    return simulated.recording


@pytest.mark.slow
def test_a_weak_lateral_damper_and_the_critical_speed_are_found(coach, tmp_path, sprung, monkeypatch) -> None:
    fault = "bogie1.lateral_damper=-0.4"
    write_vehicle(coach, tmp_path / "coach.toml")
    paths = [tmp_path / f"drive-{k}.npz" for k in range(2)]
    for k, path in enumerate(paths):
        write(drive(coach, seed=k, speed=(30.0 + 6 * k, 33.0 + 7 * k), fault=fault), path)
    fits = []

    def kept(*given):
        fits.append(fit_lateral(*given))
        return fits[0]

    monkeypatch.setattr(lateral, "fit_lateral", kept)
    outcome = sprung("stability", *paths, "--vehicle", tmp_path / "coach.toml", "--json", "-")
    assert outcome.code == 0, outcome.err
    (fit,) = fits
    true = dict.fromkeys(lateral_components(coach), 0.0) | {"bogie1.lateral_damper": np.log(0.6)}
    score = (fit.log_ratios - [true[name] for name in fit.components]) / fit.log_ratios_std
    assert fit.model_error < 0.1
    assert np.abs(score).max() < 4
    stds = dict(zip(fit.components, fit.log_ratios_std, strict=True))
    assert stds["bogie1.lateral_spring"] < 0.04  # 0.048 with speeds of 5 % in one class
    assert stds["bogie2.lateral_damper"] < 0.02
    exact = critical_speed(with_lateral(coach, {"bogie1.lateral_damper": np.log(0.6)}))
    assert fit.critical_speed is not None
    assert exact is not None
    speed, low, high = fit.critical_speed
    assert abs(speed / exact - 1) < 0.03
    assert high - low < 0.1 * speed
    document = json.loads(outcome.out)
    assert document["schema"] == "sprung.stability/1"
    assert document["critical_speed"] == pytest.approx(speed, rel=1e-3)
    assert document["components"]["bogie1.lateral_damper"]["nominal"] == 32000.0


@pytest.fixture(scope="module")
def minute(coach) -> Recording:
    """A minute at 30 m/s."""
    settings = RailDrive(speed=(30.0, 30.0), duration=60.0, sampling_rate=50.0, snr=20.0, welded=True)
    return simulate_drive(coach, settings, seed=1).recording


@pytest.mark.slow
@pytest.mark.parametrize(
    ("missing", "message"), [("speed", "record the speed"), ("bogie1_fy", "lacks the lateral channels bogie1_fy")]
)
def test_what_a_recording_lacks_is_said(coach, minute, missing, message) -> None:
    with pytest.raises(DataError, match=message):
        fit_lateral(minute.select([name for name in minute.names if name != missing]), coach)


@pytest.mark.slow
def test_values_that_a_lateral_channel_lacks_are_a_gap(coach, minute) -> None:
    """They made all values NaN; a gap of a channel that is not lateral is none here."""
    samples = minute.samples.copy()
    samples[minute.index("bogie1_fy"), 1000:1500] = np.nan
    samples[minute.index("bogie1_fl"), 2000:2400] = np.nan
    fit = fit_lateral(replace(minute, samples=samples), coach)
    pieces = fit_lateral([minute.part(0, 1000), minute.part(1500, minute.n_samples)], coach)
    assert fit.log_ratios == pytest.approx(pieces.log_ratios, rel=1e-9)
    assert fit.n_segments == pieces.n_segments


def test_gains_of_sensors_are_applied_once(coach, monkeypatch) -> None:
    first, *others = lateral_outputs(coach).names
    sensors = tuple(each.model_copy(update={"scale": 2.0 if each.channel == first else 1.0}) for each in coach.sensor)
    vehicle = coach.model_copy(update={"sensor": sensors})
    channels = (*(sensor.as_channel() for sensor in sensors), Channel("speed", "speed"))
    window = window_of(Recording(np.full((len(channels), 100), 3.0), 100.0, channels), vehicle)

    def kept(records, *_):
        (record,) = records
        assert record[first].tolist() == [6.0] * 100
        assert record[others[0]].tolist() == [3.0] * 100
        raise DataError("placed once")

    monkeypatch.setattr(lateral, "_segments", kept)
    with pytest.raises(DataError, match="placed once"):
        fit_lateral_under(SimpleNamespace(payload={}), [window])  # type: ignore[arg-type]


def test_a_lateral_fault_that_grows_is_refused(coach) -> None:
    growing = parse_fault("bogie1.lateral_damper=-0.4@60")
    with pytest.raises(ParameterError, match=r"bogie1\.lateral_damper begins later or grows"):
        simulate_drive(coach, RailDrive(duration=5.0, faults=(growing,)))
