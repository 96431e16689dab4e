"""Corners from levelling sensors and from accelerometers on the wheels, without a sensor on the body."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import observe_window
from sprung.likelihood import ClassSpectra, CornerSettings, fit_corners, rigid_layout, vehicle_model
from sprung.likelihood.search import minimised
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import Sensor, Vehicle, corner_names, structure

CORNERS = corner_names(2)
TRAVELS = tuple(Sensor(channel=f"level_{corner}", quantity="travel", unit="mm", between=corner) for corner in CORNERS)
WHEELS = tuple(
    Sensor(channel=f"acc_{corner}", quantity="acceleration", unit="g", on=f"wheel_{corner}") for corner in CORNERS
)


def with_sensors(car: Vehicle, sensors: tuple[Sensor, ...]) -> Vehicle:
    return car.model_copy(update={"sensor": sensors})


@pytest.mark.parametrize("sensors", [TRAVELS, WHEELS], ids=["travels", "wheels"])
def test_exact_spectra_give_the_components_back(car, sensors) -> None:
    """The spectra of changed components, a load and a road, with so much weight that the prior does not count."""
    vehicle = with_sensors(car, sensors)
    nominal = structure(vehicle)
    layout = rigid_layout(nominal)
    assert len(layout.rows) == 4
    f, speeds = np.arange(4, 160, 4) / 10.24, np.array([8.0, 14.0, 22.0])
    unit = np.broadcast_to(np.eye(4, dtype=complex), (3, f.size, 4, 4))
    empty = ClassSpectra(f, np.full(3, 40.0), speeds, np.full(3, 0.01), unit, 10.24, np.full((3, f.size), 1e6))
    model = vehicle_model(empty, layout, vehicle, nominal, settings=CornerSettings(), kind="road")
    model = replace(model, blocks=tuple(block for block in model.blocks if block.group != "unsprung"))  # the scale
    truth = model.start.copy()
    components = model.rows("components")
    truth[components] = np.random.default_rng(2).normal(0.0, 0.15, components.size)
    truth[model.rows("payload")[:2]] = 0.08, -0.03
    exact = replace(model, spectra=replace(empty, matrices=model.matrix(truth)))
    fitted = minimised(exact, exact.scaled_start())
    assert fitted[components] == pytest.approx(truth[components], abs=2e-3)


@pytest.mark.slow
def test_a_drive_with_four_travels_alone(car) -> None:
    vehicle = with_sensors(car, TRAVELS)
    drive = simulate_drive(vehicle, RoadDrive(duration=600.0, snr=100.0, n_stops=1), seed=3)
    fit = fit_corners(drive.recording, vehicle)
    true = [drive.truth["components"][component.corner][component.kind]["value"] for component in fit.components]
    errors = np.log(fit.values / true)
    assert fit.is_identifiable.all()
    assert np.abs(errors).max() < 0.06
    assert np.abs(errors / fit.log_ratios_std).max() < 3.5
    window = observe_window(drive.recording, vehicle)
    assert (window.is_conclusive, window.sensor_faults) == (True, ())
    assert window.log_ratios == pytest.approx(fit.log_ratios)
