"""Figures of a suspension tester against a quarter vehicle in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import fit_corners
from sprung.likelihood.plate_test import PLATE, Corner, low_phase_shifts, plate_tests, tyres
from sprung.simulation import ForceLaw, RoadDrive, simulate_drive
from sprung.simulation.nonlinear import integrate
from sprung.vehicles import Component, parse_fault, read_vehicle, structure

CAR = read_vehicle("zafira")


def quarter() -> Corner:
    """Return a corner of a vehicle whose body is too heavy to move."""
    vehicle = structure(CAR)
    tyre = tyres(vehicle)["front_left"]
    mass = vehicle.mass.copy()
    mass[0, 0] = mass[1, 1] = mass[2, 2] = 1e9
    return Corner(replace(vehicle, mass=mass), tyre)


def test_a_wheel_under_a_body_at_rest(conforms) -> None:
    parts = {
        component.kind: value
        for component, value in structure(CAR).components().items()
        if component.corner == "front_left"
    }
    frequencies = np.array([3.0, 8.0, 12.0, 20.0])
    w = 2 * np.pi * frequencies
    spring, tyre = parts["spring"] + 1j * w * parts["damper"], parts["tyre"]
    wheel = tyre / (tyre + spring - 40.5 * w**2)
    force, expected = quarter().forces(frequencies)[0], tyre * (1 - wheel)
    source, clause = "SPECSUS2018 (EGEA), EUSAMA TS-02-76", "contact force on a vibrating plate"
    what = "magnitude of the force under one wheel, 3 to 20 Hz, against the quarter vehicle in closed form"
    conforms(source, clause, what, abs(force), abs(expected), rel=1e-5, rounding=1e-7)
    what = "its phase shift from the plate"
    phases = [np.degrees(np.angle(each)) for each in (force, expected)]
    conforms(source, clause, what, *phases, absolute=1e-3, unit="degrees", rounding=1e-5)


@pytest.mark.parametrize("frequency", [3.0, 4.0])
def test_friction_and_unlike_valves_on_the_plate_are_those_of_the_integrated_vehicle(frequency) -> None:
    """Friction that builds up at once and valves that are alike would be 0.7 to 1.4 degrees more."""
    vehicle = structure(CAR)
    law, dampers = ForceLaw(friction=25.0, asymmetry=0.35, asymmetry_velocity=1e-4), vehicle.components()
    corner = "rear_right"
    tyre = tyres(vehicle)[corner]
    uneven = {name: 0.35 * dampers[Component(name, "damper")] for name in tyres(vehicle)}
    rate = 3000.0
    times = np.arange(round(6.0 * rate)) / rate
    inputs = np.zeros((len(vehicle.inputs), times.size))
    row = vehicle.inputs.index(tyre.foot)
    inputs[row] = PLATE.amplitude * np.sin(2 * np.pi * frequency * times)
    motion = integrate(vehicle, inputs, rate=rate, force_laws={"suspension": law}).coordinates
    force = (tyre.stiffness * (inputs[row] - tyre.elongation @ motion))[-round(rate) :]
    turn = np.exp(-2j * np.pi * frequency * times[-force.size :])
    first, second = (2 * np.mean(force * turn**k) / PLATE.amplitude for k in (1, 2))
    tested = Corner(vehicle, tyre, friction=dict.fromkeys(uneven, 25.0), uneven=uneven)
    [by_plate], [at_twice] = tested.forces(np.array([frequency]))
    assert np.degrees(abs(np.angle(by_plate * 1j**-1 / first))) < 0.2
    assert abs(by_plate) == pytest.approx(abs(first), rel=0.01)
    assert abs(at_twice) == pytest.approx(abs(second), rel=0.1)
    assert np.degrees(abs(np.angle(at_twice * 1j**-2 / second))) < 5.0


def test_friction_that_vanishes_leaves_the_linear_corner() -> None:
    vehicle, frequencies = structure(CAR), np.linspace(1.0, 25.0, 9)
    tyre = tyres(vehicle)["front_left"]
    rubbing = Corner(vehicle, tyre, friction=dict.fromkeys(tyres(vehicle), 1e-6))
    assert np.allclose(Corner(vehicle, tyre).forces(frequencies), rubbing.forces(frequencies), rtol=1e-6)


def test_the_limit_is_that_of_the_specification(conforms) -> None:
    source, clause = "SPECSUS2018 (EGEA), EUSAMA TS-02-76", "limits"
    conforms(source, clause, "smallest phase shift that passes", PLATE.phase_limit, 35.0, absolute=0, unit="degrees")
    plate, what = [2 * PLATE.amplitude, PLATE.highest], "stroke [m] and highest frequency [Hz] of the plate"
    conforms(source, clause, what, plate, [6e-3, 25.0], rel=1e-9)


def test_the_static_loads_are_the_weight() -> None:
    vehicle = structure(CAR)
    loads = sum(Corner(vehicle, tyre).load for tyre in tyres(vehicle).values())
    assert loads == pytest.approx(9.80665 * (CAR.body.mass + 4 * 40.5), rel=1e-9)


def test_phase_and_adhesion_fall_with_the_damper() -> None:
    vehicle, found = structure(CAR), []
    for factor in (1.0, 0.6, 0.3, 0.1):
        changed = vehicle.changed({Component("front_left", "damper"): factor})
        corner = Corner(changed, tyres(changed)["front_left"])
        found.append(corner.figures(*corner.extremes()))
    phases, adhesions, damping, _, _ = zip(*found, strict=True)
    assert list(phases) == sorted(phases, reverse=True)
    assert list(adhesions) == sorted(adhesions, reverse=True)
    assert damping[2] == pytest.approx(0.3 * damping[0])
    assert phases[0] > PLATE.phase_limit > phases[2]


@pytest.mark.slow
def test_a_weak_damper_is_seen_with_its_interval() -> None:
    weak = parse_fault("rear_left.damper=-0.5")
    drive = RoadDrive(duration=300.0, sampling_rate=80.0, snr=50.0, faults=(weak,))
    tests = plate_tests(fit_corners(simulate_drive(CAR, drive, seed=2).recording, CAR))
    true = structure(CAR).changed({Component("rear_left", "damper"): 0.5})
    for corner, test in tests.items():
        exact = Corner(true, tyres(true)[corner])
        phase, adhesion, damping, wheel, damper = exact.figures(*exact.extremes())
        assert abs(test.phase_shift - phase) < 3.5 * test.phase_shift_std
        assert abs(test.adhesion - adhesion) < 3.5 * test.adhesion_std
        assert abs(test.damping_ratio - damping) < 3.5 * test.damping_ratio_std
        assert abs(test.wheel_damping_ratio - wheel) < 3.5 * test.wheel_damping_ratio_std
        assert abs(test.viscous_damping - damper) < 3.5 * test.viscous_damping_std
        assert test.friction < 3.5 * test.friction_std
    assert tests["rear_left"].asymmetry > PLATE.asymmetry_limit


def test_an_axle_that_carries_no_body_has_figures() -> None:
    """As a fit to a recording with a wrong sign leaves it: the body on its spring is then faster than the wheel."""
    vehicle = structure(CAR)
    mass = vehicle.mass.copy()
    mass[0, 0] = 1e-3 * mass[0, 0]
    corner = Corner(replace(vehicle, mass=mass), tyres(vehicle)["front_left"])
    assert np.all(np.isfinite(corner.figures(*corner.extremes())))


@pytest.mark.slow
def test_corners_that_one_accelerometer_leaves_unknown_have_no_figures() -> None:
    """The damper of the other side is unknown, so that its phase shift would be 12 +- 83 degrees, near the limit."""
    settings = RoadDrive(duration=300.0, sampling_rate=60.0, snr=50.0)
    run = simulate_drive(CAR, settings, seed=4).recording.select(["acc_fl", "speed"])
    fit = fit_corners(run, CAR, allow_missing=True)
    known = dict(zip(map(str, fit.components), fit.is_identifiable.tolist(), strict=True))
    tests = plate_tests(fit)
    assert 0 < len(tests) < 4
    assert set(tests) == {corner for corner in tyres(fit.model.structure) if known[f"{corner}.damper"]}
    assert np.isnan(tests["front_left"].asymmetry)
    assert max(test.phase_shift_std for test in tests.values()) < 30


@pytest.mark.slow
def test_a_window_states_the_phase_shift_of_weak_corners_alone() -> None:
    settings = RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0, faults=(parse_fault("rear_left.damper=-0.7"),))
    weak = fit_corners(simulate_drive(CAR, settings, seed=2).recording, CAR)
    test = plate_tests(weak)["rear_left"]
    assert low_phase_shifts(weak)["rear_left"] == (test.phase_shift, test.phase_shift_std)
    assert "rear_right" not in low_phase_shifts(weak)
    healthy = fit_corners(simulate_drive(CAR, replace(settings, faults=()), seed=2).recording, CAR)
    assert low_phase_shifts(healthy) == {
        c: (t.phase_shift, t.phase_shift_std) for c, t in plate_tests(healthy).items() if t.phase_shift < 55
    }
