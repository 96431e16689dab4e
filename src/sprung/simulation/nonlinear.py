"""Nonlinear and time-varying vehicles, integrated by a compiled Runge-Kutta method."""

from collections.abc import Mapping
from dataclasses import astuple, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung._checks import check_number, check_one_of, required
from sprung.errors import ParameterError
from sprung.excitation import Excitation
from sprung.recording import Recording
from sprung.simulation.conditions import ForceLaw
from sprung.simulation.linear import SMOOTH_RATE, check_fits, linear_rate, sampled_inputs
from sprung.simulation.sensors import with_noise
from sprung.vehicles import Component, Structure

#: Times [s] and the factors of a component at them; linear between them, constant outside.
TimeHistory = tuple[ArrayLike, ArrayLike]

#: Record of a force law.
_LAW = np.dtype([(field.name, np.float64) for field in fields(ForceLaw)])
#: Step times the fastest rate of the vehicle: the limit of stability of the method is near 2.8.
_STEP = 0.5


class Motion(NamedTuple):
    """Motion at every step: sensor signals (channels, steps), coordinates and velocities (n, steps).

    `equivalents` has the springs and dampers by component whose linear force is nearest to that of each force law, by
    least squares over the times from 0 on: statistical linearisation (J. B. Roberts and P. D. Spanos, Random Vibration
    and Statistical Linearization, Dover, 2003, chapter 5).
    """

    outputs: Real
    coordinates: Real
    velocities: Real
    equivalents: dict[str, float]


def simulate_nonlinear(
    vehicle: Structure,
    excitation: Excitation,
    *,
    duration: float,
    sampling_rate: float,
    force_laws: Mapping[str, ForceLaw] | None = None,
    time_histories: Mapping[Component, TimeHistory] | None = None,
    snr: float | None = None,
    lead_in: float | None = None,
    seed: int | np.random.Generator = 0,
) -> Recording:
    """Simulate the signals of the sensors of a nonlinear or time-varying vehicle.

    Parameters
    ----------
    vehicle
        Structure with at least one sensor.
    excitation
        Excitation of its inputs; sampled at the steps of the integration and linear between them.
    duration
        Recorded time [s], after a lead-in that is discarded.
    sampling_rate
        Sampling rate of the recording [Hz]; the integration takes at least 1000 steps per second, more if the vehicle
        needs them.
    force_laws
        Force laws by part ("suspension", "tyre", "mount") or by owner and part ("front_left.suspension"); parts
        without one are linear.
    time_histories
        Factors of components over time, such as {Component("front_left", "spring"): ([60, 120], [1.0, 0.8])}.
    snr
        Signal-to-noise ratio of the sensors, see `with_noise`; None: no noise.
    lead_in
        Time before the recording [s]; None: the vehicle's settling time. With the same lead-in, vehicles that differ
        slightly drive on the same road.
    seed
        Seed of the random numbers, or their generator.

    Returns
    -------
    Recording
        Signals in SI units.

    Raises
    ------
    ParameterError
        If the vehicle has no sensors, differs from the excitation in the number of inputs, or lacks a named part or
        component.
    MissingPackageError
        If numba is not installed.

    Examples
    --------
    >>> from sprung.simulation import usual_excitation
    >>> from sprung.vehicles import read_vehicle, structure
    >>> zafira = structure(read_vehicle("zafira"))
    >>> given = {"duration": 5.0, "sampling_rate": 100.0, "seed": 1}
    >>> linear = simulate_nonlinear(zafira, usual_excitation(zafira), **given)
    >>> friction = {"suspension": ForceLaw(friction=100.0, friction_velocity=0.01)}
    >>> rough = simulate_nonlinear(zafira, usual_excitation(zafira), force_laws=friction, **given)
    >>> bool(rough.samples.std() > 1.5 * linear.samples.std())
    True
    """
    generator = np.random.default_rng(seed)
    recording, _ = nonlinear_drive(
        vehicle,
        excitation,
        duration=duration,
        sampling_rate=sampling_rate,
        suspension=(force_laws or {}, time_histories or {}),
        lead_in=lead_in,
        generator=generator,
    )
    return recording if snr is None else with_noise(recording, snr=snr, generator=generator)


def nonlinear_drive(
    vehicle: Structure,
    excitation: Excitation,
    *,
    duration: float,
    sampling_rate: float,
    suspension: tuple[Mapping[str, ForceLaw], Mapping[Component, TimeHistory]],
    lead_in: float | None,
    generator: np.random.Generator,
) -> tuple[Recording, dict[str, float]]:
    """Return the recording of `simulate_nonlinear`, without noise, and the `Motion.equivalents` over its time.

    Parameters
    ----------
    suspension
        Force laws and time histories.
    """
    check_number("duration", duration, above=0)
    check_number("sampling_rate", sampling_rate, above=0)
    check_fits(vehicle, excitation)
    force_laws, time_histories = suspension
    drive = sampled_inputs(
        vehicle,
        excitation,
        duration=duration,
        sampling_rate=sampling_rate,
        least_rate=max(SMOOTH_RATE, steps_needed(vehicle, force_laws), linear_rate(vehicle)),
        lead_in=lead_in,
        generator=generator,
    )
    motion = integrate(
        vehicle,
        drive.inputs,
        rate=drive.rate,
        force_laws=force_laws,
        time_histories=time_histories,
        start=-drive.n_lead / drive.rate,
    )
    return drive.recorded(motion.outputs, vehicle, "integrated"), motion.equivalents


def steps_needed(vehicle: Structure, force_laws: Mapping[str, ForceLaw]) -> float:
    """Return the steps per second that the integration of a vehicle with force laws needs."""
    elements, fastest = list(vehicle.elements), 0.0
    for number, (element, load) in enumerate(zip(vehicle.elements, vehicle.static_loads.tolist(), strict=True)):
        force_law = _force_law(force_laws, element.owner, element.part)
        if force_law is not None:
            fastest = max(fastest, force_law.fastest)
            stiffness, damping = force_law.steepest(load)
            damping = 0.0 if element.foot else element.damping * (1 + force_law.asymmetry) + damping
            elements[number] = replace(element, stiffness=element.stiffness + stiffness, damping=damping)
    stiffest = replace(vehicle, elements=tuple(elements))
    return max(float(np.max(np.abs(np.linalg.eigvals(stiffest.system.state_matrix())))), fastest) / _STEP


def integrate(
    vehicle: Structure,
    inputs: Real,
    *,
    rate: float,
    force_laws: Mapping[str, ForceLaw] | None = None,
    time_histories: Mapping[Component, TimeHistory] | None = None,
    start: float = 0.0,
    coordinates: ArrayLike | None = None,
    velocities: ArrayLike | None = None,
) -> Motion:
    """Integrate the motion of a vehicle in fixed steps (classical Runge-Kutta method of order 4).

    Parameters
    ----------
    vehicle
        Structure with any sensors.
    inputs
        Inputs at every step, shape (inputs, steps); linear between them.
    rate
        Number of steps per second.
    force_laws, time_histories
        As for `simulate_nonlinear`.
    start
        Time of the first step [s], from which the time histories count.
    coordinates, velocities
        Coordinates and velocities at the first step, shape (n,); None: zero.

    Returns
    -------
    Motion
        Sensor signals, coordinates and velocities at every step.

    Raises
    ------
    ParameterError
        If the inputs have the wrong shape, or a force law or a time history names a part that the vehicle lacks.
    MissingPackageError
        If numba is not installed.

    References
    ----------
    E. Hairer, S. P. Norsett and G. Wanner (1993), Solving Ordinary Differential Equations I, 2nd edition, Springer,
    section II.1.

    Examples
    --------
    >>> from sprung.vehicles import chain
    >>> oscillator = chain(1, mass=1.0, stiffness=100.0, damping=5.0)
    >>> motion = integrate(oscillator, np.ones((1, 10_001)), rate=1000.0)
    >>> print(f"{motion.coordinates[0, -1]:.4f}")  # static deflection of 1 N on 100 N/m
    0.0100
    """
    n = len(vehicle.coordinates)
    if inputs.ndim != 2 or inputs.shape[0] != len(vehicle.inputs):
        raise ParameterError(f"inputs has shape {inputs.shape}, but must be ({len(vehicle.inputs)}, steps)")
    check_number("rate", rate, above=0)
    elements, none = vehicle.elements, np.zeros((0, n))
    rolling_damping, rolling_stiffness = vehicle.rolling or (none, none)
    _check_force_laws(vehicle, force_laws or {})
    laws = [_force_law(force_laws or {}, e.owner, e.part) or ForceLaw() for e in elements]
    times, factors = _factors(vehicle, time_histories or {})
    state = [
        np.zeros(n) if values is None else np.array(values, dtype=np.float64) for values in (coordinates, velocities)
    ]
    required("numba", purpose="nonlinear simulation", extra="simulate")
    from sprung.simulation import kernel

    loops = kernel.Loops(
        inverse_mass=np.linalg.inv(vehicle.mass),
        elongations=vehicle.elongations,
        feet=np.array([vehicle.inputs.index(e.foot) if e.foot is not None else -1 for e in elements]),
        input_forces=np.ascontiguousarray(vehicle.forces),
        stiffness=np.array([e.stiffness for e in elements]),
        damping=np.array([e.damping for e in elements]),
        bushings=np.array([e.series_stiffness or 0.0 for e in elements]),
        force_laws=np.array([astuple(law) for law in laws], dtype=_LAW),
        by_acceleration=np.ascontiguousarray(vehicle.outputs.acceleration),
        by_velocity=np.ascontiguousarray(vehicle.outputs.velocity),
        by_displacement=np.ascontiguousarray(vehicle.outputs.displacement),
        rolling_damping=np.ascontiguousarray(rolling_damping),
        rolling_stiffness=np.ascontiguousarray(rolling_stiffness),
        loads=vehicle.static_loads,
    )
    outputs, places, speeds, moments = kernel.integrate(
        loops, times, factors, np.ascontiguousarray(inputs.T), 1 / rate, start, *state
    )
    outputs, places, speeds = (np.ascontiguousarray(result.T) for result in (outputs, places, speeds))
    return Motion(outputs, places, speeds, _equivalents(vehicle, force_laws or {}, moments))


def _equivalents(vehicle: Structure, force_laws: Mapping[str, ForceLaw], moments: Real) -> dict[str, float]:
    """Return stiffness and damping nearest to each force law, from the sums of products of 1, e, e' and the force."""
    found: dict[str, float] = {}
    for element, sums in zip(vehicle.elements, moments, strict=True):
        if _force_law(force_laws, element.owner, element.part) is not None and sums[0, 0] > 0:
            scatter = sums - np.outer(sums[0], sums[0]) / sums[0, 0]
            values = np.linalg.lstsq(scatter[1:3, 1:3], scatter[1:3, 3])[0].tolist()
            found |= {str(part): value for part, value in zip(element.components, values, strict=True) if part}
    return found


def _check_force_laws(vehicle: Structure, force_laws: Mapping[str, ForceLaw]) -> None:
    """Reject force laws of parts that the vehicle does not have."""
    known = {e.part for e in vehicle.elements} | {f"{e.owner}.{e.part}" for e in vehicle.elements}
    for name in force_laws:
        check_one_of("force law of", name, known)


def _force_law(force_laws: Mapping[str, ForceLaw], owner: str, part: str) -> ForceLaw | None:
    """Return the force law of an element, its own before that of its part."""
    return force_laws.get(f"{owner}.{part}", force_laws.get(part))


def _factors(vehicle: Structure, time_histories: Mapping[Component, TimeHistory]) -> tuple[Real, Real]:
    """Return the common knots (knots,) and the factors of stiffness and damping there (elements, 2, knots)."""
    known = {str(component) for component in vehicle.components()}
    for component, (times, values) in time_histories.items():
        check_one_of("component", str(component), known)
        if np.shape(times) != np.shape(values) or np.any(np.diff(np.asarray(times)) < 0) or np.min(values) < 0:
            raise ParameterError(
                f"the time history of {component} must have rising times and factors of at least 0: correct it"
            )
    every = [np.asarray(times, dtype=np.float64) for times, _ in time_histories.values()]
    knots = np.unique(np.concatenate([[0.0], *every]))
    factors = np.ones((len(vehicle.elements), 2, knots.size))
    for number, element in enumerate(vehicle.elements):
        for row, part in enumerate(element.components):
            time_history = None if part is None else time_histories.get(part)
            if time_history is not None:
                factors[number, row] = np.interp(knots, np.asarray(time_history[0]), np.asarray(time_history[1]))
    return knots, factors
