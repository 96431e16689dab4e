"""Exact spectra of windows of a hatchback with numbers that its file does not state."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sprung._arrays import Real
from sprung.calibration.draft import Draft, VehicleNumber, explicit
from sprung.calibration.joint import JointModel, WindowSpectra, joint_of, of_all_channels, window_model
from sprung.likelihood import ClassSpectra, CornerSettings, Model, SegmentSpectra, rigid_layout
from sprung.vehicles import Vehicle, parse_vehicle

SEGMENT = 5.12
PLACES = {"fl": [1.02, 0.74], "fr": [1.02, -0.74], "rl": [-1.53, 0.73], "rr": [-1.53, -0.73]}


@pytest.fixture(scope="session")
def hatchback() -> Vehicle:
    """A small car with an accelerometer above every wheel."""
    axle = {"half_track": 0.74, "unsprung_mass": 38.0, "damping": 1500.0, "tyre_stiffness": 185e3}
    sensor = {"quantity": "acceleration", "unit": "m/s^2", "direction": [0.0, 0.0, 1.0]}
    description = parse_vehicle(
        {
            "name": "hatchback",
            "kind": "road",
            "body": {"mass": 1050.0, "pitch_inertia": 1400.0, "roll_inertia": 300.0},
            "axle": [
                {**axle, "x": 1.02, "spring_stiffness": 22e3},
                {**axle, "x": -1.53, "half_track": 0.73, "unsprung_mass": 34.0, "spring_stiffness": 24e3},
            ],
            "sensor": [
                {**sensor, "channel": f"acc_{name}", "position": [*place, 0.0]} for name, place in PLACES.items()
            ],
        }
    )
    assert isinstance(description, Vehicle)
    return description


@pytest.fixture(scope="session")
def window_of_data() -> Callable[[ClassSpectra | None, Draft, tuple[VehicleNumber, ...]], Model]:
    """Return a function that makes the model of a window; without spectra, of many segments without data."""

    def model(spectra: ClassSpectra | None, draft: Draft, numbers: tuple[VehicleNumber, ...]) -> Model:
        return _model(_classes(len(draft.vehicle.sensor)) if spectra is None else spectra, draft, numbers)

    return model


@pytest.fixture(scope="session")
def exact_windows() -> Callable[..., tuple[JointModel, Real]]:
    """Return a function that makes the joint model of windows with exact spectra, and its true parameters."""

    def windows(
        vehicle: Vehicle, numbers: tuple[VehicleNumber, ...], true: dict[str, float], *, n_windows: int = 2
    ) -> tuple[JointModel, Real]:
        draft = explicit(vehicle)
        spectra = _classes(len(vehicle.sensor))
        joint = joint_of([_model(spectra, draft, numbers) for _ in range(n_windows)])
        parameters = joint.start.copy()
        for row, name in enumerate(joint.names):
            parameters[row] = true.get(name, parameters[row])
        data = [
            replace(spectra, matrices=model.matrix(joint.of_window(number, parameters)))
            for number, model in enumerate(joint.models)
        ]
        return joint_of([_model(one, draft, numbers) for one in data]), parameters

    return windows


def _model(spectra: ClassSpectra, draft: Draft, numbers: tuple[VehicleNumber, ...]) -> Model:
    """The model of a window."""
    layout = of_all_channels(rigid_layout(draft.structure()))
    nothing = SegmentSpectra(
        spectra.frequencies, np.zeros((0, spectra.frequencies.size, 4), complex), np.zeros(0), np.zeros(0), SEGMENT, 0
    )
    return window_model(spectra, WindowSpectra(nothing, layout, layout, "road"), draft, numbers, CornerSettings())


def _classes(n_channels: int, *, count: float = 1e5, n_classes: int = 4) -> ClassSpectra:
    """Speed classes of many segments."""
    f = np.arange(4, 100, 2) / SEGMENT
    unit = np.broadcast_to(np.eye(n_channels, dtype=complex), (n_classes, f.size, n_channels, n_channels))
    counts, spreads = np.full(n_classes, count), np.full(n_classes, 0.02)
    return ClassSpectra(
        f,
        counts,
        np.geomspace(6, 25, n_classes),
        spreads,
        unit,
        SEGMENT,
        np.full(unit.shape[:2], count),
    )
