"""Residuals against a rigid body, from the exact spectra of cars on a road."""

import numpy as np
import pytest

from sprung._arrays import Complex
from sprung.signals.spectrum import SpectralMatrix
from sprung.vehicles import FlexibleMode, Vehicle, frequency_response, parse_vehicle, structure
from sprung.vehicles.rigid_body import rigid_body_faults

NAMES = ("fl", "fr", "rl", "rr")


def car(**changes) -> Vehicle:
    """An estate car with anti-roll bars and accelerometers on the body."""
    axle = {"half_track": 0.78, "unsprung_mass": 48.0, "tyre_stiffness": 230e3, "damping": 1900.0}
    places = [(1.45, 0.75), (1.45, -0.75), (-1.3, 0.72), (-1.3, -0.72)]
    sensors = [
        {
            "channel": name,
            "quantity": "acceleration",
            "unit": "g",
            "position": (x, y, 0.1),
            "direction": (0.0, 0.0, 1.0),
        }
        for name, (x, y) in zip(NAMES, places, strict=True)
    ]
    vehicle = parse_vehicle(
        {
            "name": "estate",
            "kind": "road",
            "body": {"mass": 1650.0, "pitch_inertia": 2900.0, "roll_inertia": 620.0},
            "axle": [
                {"x": 1.3, "spring_stiffness": 29e3, "anti_roll_stiffness": 12e3, **axle},
                {"x": -1.5, "spring_stiffness": 33e3, "anti_roll_stiffness": 6e3, **axle},
            ],
            "sensor": sensors,
            **changes,
        }
    )
    assert isinstance(vehicle, Vehicle)
    return vehicle


def spectra(vehicle: Vehicle, *speeds: float) -> SpectralMatrix:
    """Mean exact spectral matrix of drives at some speeds."""
    first, *others = (_spectra(vehicle, speed) for speed in speeds or (8.0, 15.0, 30.0))
    return sum(others, start=first)


def _spectra(vehicle: Vehicle, speed: float, snr: float = 50.0) -> SpectralMatrix:
    """Exact spectral matrix on a road G(n) ~ n^-2 with tracks of coherence exp(-8 n), with white sensor noise."""
    frequencies = np.arange(0.0, 100.0, 0.5)
    response = frequency_response(structure(vehicle), frequencies)
    n = np.maximum(frequencies, 0.5) / speed
    coherence = np.exp(-8 * n)[:, None, None]
    tracks = coherence + (1 - coherence) * np.eye(2)
    delay = np.exp(-2j * np.pi * frequencies * 2.8 / speed)
    axles: Complex = np.stack([np.ones(delay.shape), delay], axis=-1).astype(np.complex128)
    road = np.einsum("fa,fb,fij->faibj", axles, axles.conj(), tracks).reshape(-1, 4, 4) * (1e-6 * n**-2)[:, None, None]
    S = response @ road @ response.conj().swapaxes(1, 2)
    noise = np.trace(S.sum(axis=0)).real / 4 / len(frequencies) / snr**2
    return SpectralMatrix(frequencies, (S + noise * np.eye(4)).transpose(1, 2, 0), NAMES, 2.0, 200)


def through(measured: SpectralMatrix, *, gain: float = 1.0, delay: float = 0.0) -> SpectralMatrix:
    """The spectra with the first channel scaled and late."""
    response = np.ones((4, measured.frequencies.size), dtype=complex)
    response[0] = gain * np.exp(-2j * np.pi * measured.frequencies * delay)
    matrix = measured.matrix * response[:, None] * response.conj()[None]
    return SpectralMatrix(measured.frequencies, matrix, NAMES, 2.0, 200)


def twisting(frequency: float) -> Vehicle:
    return car(flexible_mode=[{"shape": "torsion", "frequency": frequency, "damping_ratio": 0.02}])


@pytest.mark.parametrize("frequency", [16.0, 18.0, 22.0, 26.0, 30.0])
@pytest.mark.parametrize("speed", [8.0, 15.0, 30.0])
def test_a_body_that_twists_is_no_fault_of_a_sensor(frequency, speed) -> None:
    """The file knows nothing of the torsion, whose peak is above everything else in the channels."""
    measured = spectra(twisting(frequency), speed)
    assert rigid_body_faults(measured, structure(car())) == ([], 0.0)


def test_torsion_in_the_file_leaves_the_checks_as_they_are() -> None:
    """Four accelerometers would have no residual left if the shape were counted among the rigid motions."""
    flexible = twisting(22.0)
    assert isinstance(flexible.flexible_mode[0], FlexibleMode)
    measured = through(spectra(flexible), gain=-1.0)
    ((fault,), disagreement) = rigid_body_faults(measured, structure(flexible))
    assert (fault.channel, fault.kind, disagreement) == ("fl", "inverted", 0.0)


@pytest.mark.parametrize("frequency", [None, 18.0, 24.0])
@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        ({"gain": -1.0}, "inverted"),
        ({"gain": 1.08}, "wrong_gain"),
        ({"gain": 0.8}, "wrong_gain"),
        ({"delay": 5e-3}, "time_shifted"),
        ({"delay": 30e-3}, "time_shifted"),
    ],
)
def test_faults_are_found_in_a_body_that_twists(frequency, fault, kind) -> None:
    measured = through(spectra(car() if frequency is None else twisting(frequency)), **fault)
    (found, disagreement) = rigid_body_faults(measured, structure(car()))
    assert ([(one.channel, one.kind) for one in found], disagreement) == ([("fl", kind)], 0.0)


@pytest.mark.parametrize("error", [0.05, 0.1])
def test_misplaced_sensors_do_not_disagree(error) -> None:
    """Places off by as much in each direction and with any signs; the file has the wrong ones."""
    vehicle, generator = car(), np.random.default_rng(0)
    measured = spectra(vehicle)
    for _ in range(10):
        moved = [
            sensor.model_copy(
                update={"position": tuple(np.array(sensor.position) + error * generator.choice([-1, 1], 3))}
            )
            for sensor in vehicle.sensor
        ]
        assert rigid_body_faults(measured, structure(vehicle.model_copy(update={"sensor": tuple(moved)}))) == ([], 0.0)


def test_sensors_exchanged_side_to_side_are_no_error_of_places() -> None:
    measured = spectra(car())
    order = [1, 0, 2, 3]
    exchanged = SpectralMatrix(measured.frequencies, measured.matrix[order][:, order], NAMES, 2.0, 200)
    faults, _ = rigid_body_faults(exchanged, structure(car()))
    assert {fault.kind for fault in faults} == {"swapped"}


def test_other_sensors_leave_the_accelerometers_comparable() -> None:
    """A travel and a gyroscope next to four accelerometers, one of which is inverted."""
    more = [
        {"channel": "level", "quantity": "travel", "unit": "mm", "between": "rear_left"},
        {"channel": "wx", "quantity": "angular_velocity", "unit": "deg/s", "direction": (1.0, 0.0, 0.0)},
    ]
    vehicle = car(sensor=[*car().model_dump()["sensor"], *more])
    measured = through(spectra(car()), gain=-1.0)
    matrix = np.zeros((6, 6, measured.frequencies.size), dtype=complex)
    matrix[:4, :4], matrix[4, 4], matrix[5, 5] = measured.matrix, 1e-4, 1e-4
    everything = SpectralMatrix(measured.frequencies, matrix, (*NAMES, "level", "wx"), 2.0, 200)
    faults, _ = rigid_body_faults(everything, structure(vehicle))
    assert [(fault.channel, fault.kind) for fault in faults] == [("fl", "inverted")]
