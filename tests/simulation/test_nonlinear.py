"""The nonlinear integrator against exact linear responses, closed forms and energy."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipk

from sprung.errors import ParameterError
from sprung.excitation import Potholes, SurfaceMotion, random_speed, road_class
from sprung.simulation import REALISTIC_FORCE_LAWS, ForceLaw, integrate, simulate, simulate_nonlinear
from sprung.simulation.linear import response, with_derivatives, with_polynomial_inputs
from sprung.simulation.nonlinear import steps_needed
from sprung.vehicles import Component, chain, read_vehicle, structure

RATE = 2000.0


def oscillator(mass=1.0, stiffness=400.0, damping=0.0):
    return chain(1, mass=mass, stiffness=stiffness, damping=damping)


def free(system, force_laws, *, seconds, place=0.0, speed=0.0, rate=RATE):
    """Coordinate and velocity of one mass that is let go."""
    steps = round(seconds * rate) + 1
    motion = integrate(
        system, np.zeros((1, steps)), rate=rate, force_laws=force_laws, coordinates=[place], velocities=[speed]
    )
    return np.arange(steps) / rate, motion.coordinates[0], motion.velocities[0]


@pytest.fixture(scope="module")
def car():
    return structure(read_vehicle("zafira"))


@pytest.fixture(scope="module")
def drive():
    speed = random_speed(30.0, low=6.0, high=15.0, generator=np.random.default_rng(2))
    return SurfaceMotion(road_class("C"), (1.22, -1.58), speed, obstacles=(Potholes(),))


def bushed():
    vehicle = read_vehicle("zafira")
    axles = tuple(axle.model_copy(update={"damper_bushing_stiffness": 60e3}) for axle in vehicle.axle)
    return structure(vehicle.model_copy(update={"axle": axles}))


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [structure(read_vehicle("zafira")), bushed()], ids=["rigid", "bushed"])
def test_without_force_laws_it_is_the_exact_linear_response(vehicle, drive) -> None:
    inputs = drive.samples(16_000, sampling_rate=8000.0, generator=np.random.default_rng(1))
    inputs = inputs - inputs[:, :1]
    discrete = with_polynomial_inputs(vehicle.state_space(), sampling_rate=8000.0)
    expected = response(discrete, with_derivatives(inputs))
    found = integrate(vehicle, inputs, rate=8000.0).outputs
    assert found == pytest.approx(expected, abs=1e-6 * expected.std())


def test_a_simulated_drive_without_force_laws_is_the_linear_one(car, drive) -> None:
    linear = simulate(car, drive, duration=20.0, sampling_rate=200.0, seed=3)
    found = simulate_nonlinear(car, drive, duration=20.0, sampling_rate=200.0, seed=3)
    np.testing.assert_allclose(found.samples, linear.samples, rtol=0, atol=1e-5 * linear.samples.std(), equal_nan=False)


def test_forces_on_a_loaded_body_are_the_exact_linear_response() -> None:
    plate = structure(read_vehicle("plate")).with_payload(0.3, x=0.1, y=-0.05)
    inputs = np.cumsum(np.random.default_rng(1).standard_normal((4, 4000)), axis=1)
    discrete = with_polynomial_inputs(plate.state_space(), sampling_rate=RATE)
    expected = response(discrete, with_derivatives(inputs))
    found = integrate(plate, inputs, rate=RATE).outputs
    assert found[:, :-1] == pytest.approx(expected[:, :-1], abs=1e-8 * np.abs(expected).max())


def test_error_falls_with_the_fourth_power_of_the_step() -> None:
    force_law = {"suspension": ForceLaw(cubic=3e4)}
    ends = [
        free(oscillator(), force_law, seconds=1.0, place=0.01, rate=rate)[1][-1] for rate in (1000, 2000, 4000, 64_000)
    ]
    errors = np.abs(np.array(ends[:-1]) - ends[-1])
    assert errors[:-1] / errors[1:] == pytest.approx([16, 16], rel=0.15)


def test_hardening_spring_has_the_period_of_the_elliptic_integral() -> None:
    """x'' + w^2 (x + b x^3) = 0: T = 4 K(m) / (w sqrt(1 + b A^2)), m = b A^2 / (2 (1 + b A^2))."""
    amplitude, b, w = 0.05, 300.0, 20.0
    time, place, _ = free(oscillator(), {"suspension": ForceLaw(cubic=b)}, seconds=5.0, place=amplitude)
    crossings = np.flatnonzero(np.diff(np.signbit(place)))
    at = time[crossings] + place[crossings] / (place[crossings] - place[crossings + 1]) / RATE
    hard = 1 + b * amplitude**2
    expected = 4 * ellipk((hard - 1) / (2 * hard)) / (w * math.sqrt(hard))
    assert (at[-1] - at[0]) / (len(at) - 1) * 2 == pytest.approx(expected, rel=1e-6)


def test_rubber_is_stiff_at_small_and_soft_at_large_amplitudes() -> None:
    """Frequencies sqrt((k + s) / m) and sqrt(k / m) at the two ends."""
    force_law = {"suspension": ForceLaw(rubber_stiffness=1200.0, rubber_force=1.0)}
    for start, stiffness in ((1e-6, 1600.0), (2.0, 400.0)):
        time, _, speed = free(oscillator(), force_law, seconds=0.2, speed=start)
        quarter = time[np.flatnonzero(np.diff(np.signbit(speed)))[0]]
        assert quarter == pytest.approx(math.pi / 2 / math.sqrt(stiffness), rel=0.03)


def test_work_of_the_road_is_stored_and_dissipated(car, drive) -> None:
    """Balance of power: foot forces times foot velocities = change of energy + dissipation, to 1e-6 of the work."""
    inputs = drive.samples(20_000, sampling_rate=4000.0, generator=np.random.default_rng(1))
    inputs = inputs - inputs[:, :1]
    force_laws = {"suspension": replace(REALISTIC_FORCE_LAWS["suspension"], gap=math.inf, stop_stiffness=0.0)}
    motion = integrate(car, inputs, rate=4000.0, force_laws=force_laws)
    q, v, force_law = motion.coordinates, motion.velocities, force_laws["suspension"]
    stored = np.einsum("it,ij,jt->t", v, car.mass, v) / 2
    dissipated, work = np.zeros_like(stored), np.zeros_like(stored)
    slopes = np.gradient(inputs, 1 / 4000.0, axis=1, edge_order=2)
    for element in car.elements:
        e, rate = element.elongation @ q, element.elongation @ v
        if element.foot is not None:
            foot = car.inputs.index(element.foot)
            e = e - inputs[foot]
            work -= element.stiffness * e * slopes[foot]
            stored += element.stiffness * e**2 / 2
        else:
            stored += element.stiffness * (e**2 / 2 + force_law.cubic * e**4 / 4)
            damper = (
                element.damping * (1 + force_law.asymmetry * rate / np.hypot(rate, force_law.asymmetry_velocity)) * rate
            )
            dissipated += (damper + force_law.friction * rate / np.hypot(rate, force_law.friction_velocity)) * rate
    total = np.trapezoid(work) / 4000.0
    assert total == pytest.approx(stored[-1] + np.trapezoid(dissipated) / 4000.0, rel=2e-4)
    assert total > 10 * stored[-1]


def test_nothing_moves_a_vehicle_at_rest(car) -> None:
    motion = integrate(car, np.zeros((4, 1000)), rate=1000.0, force_laws=REALISTIC_FORCE_LAWS)
    assert not motion.outputs.any()


def test_a_time_history_changes_a_component() -> None:
    """After the step the mass swings with the new frequency."""
    steps = 8001
    motion = integrate(
        oscillator(),
        np.zeros((1, steps)),
        rate=RATE,
        coordinates=[0.01],
        time_histories={Component("mass_1", "spring"): ([1.0, 1.0 + 1e-9], [1.0, 0.25])},
    )
    crossings = np.flatnonzero(np.diff(np.signbit(motion.coordinates[0]))) / RATE
    before, after = crossings[crossings < 1.0], crossings[crossings > 1.2]
    assert np.diff(before) == pytest.approx(math.pi / 20, abs=1.01 / RATE)
    assert np.diff(after) == pytest.approx(math.pi / 10, abs=1.01 / RATE)


def test_what_does_not_fit_is_refused(car) -> None:
    with pytest.raises(ParameterError, match=r"inputs has shape \(3, 10\), but must be \(4, steps\)"):
        integrate(car, np.zeros((3, 10)), rate=100.0)
    with pytest.raises(ParameterError, match="force law of 'springs' is not one of"):
        integrate(car, np.zeros((4, 10)), rate=100.0, force_laws={"springs": ForceLaw()})
    with pytest.raises(ParameterError, match=r"component 'front_left.sprung' is not one of"):
        integrate(
            car, np.zeros((4, 10)), rate=100.0, time_histories={Component("front_left", "sprung"): ([0.0], [1.0])}
        )
    time_history = {Component("front_left", "spring"): ([0.0, 1.0], [1.0, -1.0])}
    with pytest.raises(ParameterError, match="must have rising times"):
        integrate(car, np.zeros((4, 10)), rate=100.0, time_histories=time_history)


def test_wheels_that_creep_on_rails_are_the_exact_linear_response() -> None:
    """Of a coach whose wheelsets steer: damping and stiffness of rolling wheels are not those of elements."""
    coach = structure(read_vehicle("coach"), speed=30.0)
    rate = 32_000.0
    inputs = 1e-3 * np.sin(2 * math.pi * np.outer(np.arange(1.0, 9.0), np.arange(16_000) / rate))
    discrete = with_polynomial_inputs(coach.state_space(), sampling_rate=rate)
    expected = response(discrete, with_derivatives(inputs))
    found = integrate(coach, inputs, rate=rate).outputs
    assert found == pytest.approx(expected, abs=2e-6 * expected.std())


def test_friction_of_the_load_follows_the_force_of_the_spring() -> None:
    """A mass that slides down: friction of 10 % of what the spring carries, its weight less the pull of the spring."""
    share, stiffness = 0.1, 400.0
    law = {"suspension": ForceLaw(load_friction=share, friction_velocity=1e-4)}
    _, place, _ = free(oscillator(), law, seconds=0.3, place=0.01)
    turn = place.min()
    # energy from turn to turn: k (a^2 - b^2) / 2 = friction over the way, load minus k e on average
    weight = 9.80665
    assert turn < 0
    work = share * (weight - stiffness * (0.01 + turn) / 2) * (0.01 - turn)
    assert stiffness * (0.01**2 - turn**2) / 2 == pytest.approx(work, rel=2e-3)


def test_no_load_no_friction_of_the_load() -> None:
    """A spring that is pulled further than its load pressed it has none: it swings as without."""
    up = 1.2 * 9.80665 / 400.0
    _, found, _ = free(oscillator(), {"suspension": ForceLaw(load_friction=0.3)}, seconds=0.02, place=up)
    _, expected, _ = free(oscillator(), {}, seconds=0.02, place=up)
    assert found.min() > 9.80665 / 400.0
    np.testing.assert_array_equal(found, expected)


def test_equivalents_of_a_linear_law_are_the_parts_themselves(car, drive) -> None:
    inputs = drive.samples(16_000, sampling_rate=4000.0, generator=np.random.default_rng(1))
    found = integrate(car, inputs - inputs[:, :1], rate=4000.0, force_laws={"suspension": ForceLaw()}).equivalents
    values = {str(part): value for part, value in car.components().items() if part.kind in {"spring", "damper"}}
    assert found == pytest.approx(values, rel=1e-9)


def test_equivalent_of_friction_is_that_of_a_sine() -> None:
    """Describing functions at an amplitude A and that of velocity V.

    Coulomb friction F: 4 F / (pi V); a spring of cubic b: k (1 + 3 b A^2 / 4); stops K beyond a gap r A, added to k:
    K (1 - 2 / pi (asin r + r sqrt(1 - r^2))).
    """
    steps, amplitude, r = round(2 * math.pi / 20.0 * RATE * 10), 0.02, 0.6
    stops = 1 - 2 / math.pi * (math.asin(r) + r * math.sqrt(1 - r**2))
    for law, kind, expected in (
        (ForceLaw(friction=0.5, friction_velocity=1e-5), "damper", 4 * 0.5 / (math.pi * 20.0 * amplitude)),
        (ForceLaw(cubic=1.0), "spring", 4e8 * (1 + 0.75 * amplitude**2)),
        (ForceLaw(gap=r * amplitude, stop_stiffness=4e5), "spring", 4e8 + 4e5 * stops),
    ):
        system = oscillator(mass=1e6, stiffness=4e8)
        motion = integrate(
            system, np.zeros((1, steps)), rate=RATE, force_laws={"suspension": law}, coordinates=[amplitude]
        )
        assert motion.equivalents[f"mass_1.{kind}"] == pytest.approx(expected, rel=1e-3 if kind == "damper" else 1e-6)


def test_static_loads_are_the_weight_above_each_element() -> None:
    metro = read_vehicle("metro")
    loads = dict(zip(structure(metro).elements, structure(metro).static_loads, strict=True))
    by_part = {part: [load for e, load in loads.items() if e.part == part] for part in ("secondary", "primary", "tyre")}
    weight = 9.80665 * np.array([27000 / 4, (27000 / 2 + 4800) / 4, (27000 / 2 + 4800 + 2 * 1450) / 4])
    for share, part in zip(weight, by_part.values(), strict=True):
        np.testing.assert_allclose(part, share, rtol=1e-9)


def test_friction_alone_damps_a_suspension_without_a_damper() -> None:
    """The number of steps counts the friction of an element that has no damping of its own."""
    system = oscillator(damping=0.0)
    law = {"suspension": ForceLaw(load_friction=0.1, friction_velocity=1e-5)}
    assert steps_needed(system, law) > 0.1 * 9.80665 / 1e-5
