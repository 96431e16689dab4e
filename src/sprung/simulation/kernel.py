"""Inner loops of the nonlinear integration, compiled by numba; imported only where they run.

State of a vehicle with n coordinates and m elements: coordinates q, velocities v, elongations z of dampers behind
bushings and forces r of rubber, in one vector [q, v, z, r].
"""

from typing import Any

import numpy as np
from numba import njit

# Columns of the table of force laws; in the order of the fields of `sprung.simulation.conditions.ForceLaw`.
ASYMMETRY, ASYMMETRY_VELOCITY, KNEE, KNEE_SLOPE, FRICTION, FRICTION_VELOCITY = 0, 1, 2, 3, 4, 5
CUBIC, GAP, STOP_STIFFNESS, RUBBER_STIFFNESS, RUBBER_FORCE = 6, 7, 8, 9, 10


@njit(cache=True, error_model="numpy")
def forces(e: Any, rate: Any, z: Any, r: Any, k: Any, c: Any, bushing: Any, force_laws: Any, row: Any) -> Any:
    """Return the tension of an element, and the rates of its damper's elongation and of its rubber's force."""
    tension = k * (e + force_laws[row, CUBIC] * e * e * e) + r
    if abs(e) > force_laws[row, GAP]:
        tension += force_laws[row, STOP_STIFFNESS] * (e - force_laws[row, GAP] if e > 0 else e + force_laws[row, GAP])
    if bushing > 0 and c > 0:
        arm = bushing * (e - z)
        tension += arm
        z_rate = arm / c
    else:
        z_rate = 0.0
        speed = abs(rate)
        bent = rate
        if speed > force_laws[row, KNEE]:
            beyond = (speed - force_laws[row, KNEE]) * force_laws[row, KNEE_SLOPE] + force_laws[row, KNEE]
            bent = beyond if rate > 0 else -beyond
        damping = c
        if force_laws[row, ASYMMETRY] != 0:
            damping = c * (
                1 + force_laws[row, ASYMMETRY] * rate / np.sqrt(rate * rate + force_laws[row, ASYMMETRY_VELOCITY] ** 2)
            )
        tension += damping * bent
    if force_laws[row, FRICTION] > 0:
        tension += force_laws[row, FRICTION] * rate / np.sqrt(rate * rate + force_laws[row, FRICTION_VELOCITY] ** 2)
    r_rate = 0.0
    if force_laws[row, RUBBER_STIFFNESS] > 0:
        sign = 1.0 if rate > 0 else -1.0
        r_rate = force_laws[row, RUBBER_STIFFNESS] * rate * (1 - sign * r / force_laws[row, RUBBER_FORCE])
    return tension, z_rate, r_rate


@njit(cache=True, error_model="numpy")
def rates(
    state: Any,
    u: Any,
    inverse_mass: Any,
    elongations: Any,
    feet: Any,
    input_forces: Any,
    k: Any,
    c: Any,
    bushings: Any,
    force_laws: Any,
    force: Any,
    out: Any,
) -> None:
    """Write the time derivative of the state for the inputs u; `force` is room for the generalised forces."""
    n = inverse_mass.shape[0]
    m = elongations.shape[0]
    for i in range(n):
        force[i] = 0.0
        for j in range(u.size):
            force[i] += input_forces[i, j] * u[j]
    for row in range(m):
        e = 0.0
        rate = 0.0
        for i in range(n):
            e += elongations[row, i] * state[i]
            rate += elongations[row, i] * state[n + i]
        if feet[row] >= 0:
            e -= u[feet[row]]
        tension, z_rate, r_rate = forces(
            e, rate, state[2 * n + row], state[2 * n + m + row], k[row], c[row], bushings[row], force_laws, row
        )
        out[2 * n + row] = z_rate
        out[2 * n + m + row] = r_rate
        for i in range(n):
            force[i] -= elongations[row, i] * tension
    for i in range(n):
        out[i] = state[n + i]
        acceleration = 0.0
        for j in range(n):
            acceleration += inverse_mass[i, j] * force[j]
        out[n + i] = acceleration


@njit(cache=True, error_model="numpy")
def integrate(
    inverse_mass: Any,
    elongations: Any,
    feet: Any,
    input_forces: Any,
    stiffness: Any,
    damping: Any,
    bushings: Any,
    force_laws: Any,
    knots: Any,
    factors: Any,
    inputs: Any,
    step: Any,
    start: Any,
    coordinates: Any,
    velocities: Any,
    by_acceleration: Any,
    by_velocity: Any,
    by_displacement: Any,
) -> Any:
    """Return outputs (steps, channels), coordinates and velocities (steps, n)."""
    n, m = inverse_mass.shape[0], elongations.shape[0]
    n_steps, n_channels = inputs.shape[0], by_acceleration.shape[0]
    outputs = np.zeros((n_steps, n_channels))
    places = np.zeros((n_steps, n))
    speeds = np.zeros((n_steps, n))
    state = np.zeros(2 * n + 2 * m)
    state[:n] = coordinates
    state[n : 2 * n] = velocities
    first = np.zeros(state.size)
    second = np.zeros(state.size)
    third = np.zeros(state.size)
    fourth = np.zeros(state.size)
    between = np.zeros(inputs.shape[1])
    trial = np.zeros(state.size)
    force = np.zeros(n)
    k = stiffness * factors[:, 0, 0]
    c = damping * factors[:, 1, 0]
    knot = 0
    for number in range(n_steps):
        if knots.size > 1:
            time = start + number * step
            while knot < knots.size - 2 and time >= knots[knot + 1]:
                knot += 1
            share = min(max((time - knots[knot]) / (knots[knot + 1] - knots[knot]), 0.0), 1.0)
            for row in range(m):
                k[row] = stiffness[row] * (factors[row, 0, knot] * (1 - share) + factors[row, 0, knot + 1] * share)
                c[row] = damping[row] * (factors[row, 1, knot] * (1 - share) + factors[row, 1, knot + 1] * share)
        u = inputs[number]
        rates(state, u, inverse_mass, elongations, feet, input_forces, k, c, bushings, force_laws, force, first)
        for channel in range(n_channels):
            reading = 0.0
            for i in range(n):
                reading += (
                    by_displacement[channel, i] * state[i]
                    + by_velocity[channel, i] * state[n + i]
                    + by_acceleration[channel, i] * first[n + i]
                )
            outputs[number, channel] = reading
        for i in range(n):
            places[number, i] = state[i]
            speeds[number, i] = state[n + i]
        if number == n_steps - 1:
            break
        later = inputs[number + 1]
        for j in range(between.size):
            between[j] = (u[j] + later[j]) / 2
        for i in range(state.size):
            trial[i] = state[i] + step / 2 * first[i]
        rates(trial, between, inverse_mass, elongations, feet, input_forces, k, c, bushings, force_laws, force, second)
        for i in range(state.size):
            trial[i] = state[i] + step / 2 * second[i]
        rates(trial, between, inverse_mass, elongations, feet, input_forces, k, c, bushings, force_laws, force, third)
        for i in range(state.size):
            trial[i] = state[i] + step * third[i]
        rates(trial, later, inverse_mass, elongations, feet, input_forces, k, c, bushings, force_laws, force, fourth)
        for i in range(state.size):
            state[i] += step / 6 * (first[i] + 2 * second[i] + 2 * third[i] + fourth[i])
    return outputs, places, speeds
