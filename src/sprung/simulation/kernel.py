"""Inner loops of the nonlinear integration, compiled by numba; imported only where they run.

State of a vehicle with n coordinates and m elements: coordinates q, velocities v, elongations z of dampers behind
bushings and forces r of rubber, in one vector [q, v, z, r].
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit


class Loops(NamedTuple):
    """Arrays of a vehicle: n coordinates, m elements, channels, inputs."""

    inverse_mass: Any  # (n, n)
    elongations: Any  # (m, n)
    feet: Any  # (m,): input that moves the lower end of each element, -1 for none
    input_forces: Any  # (n, inputs)
    stiffness: Any  # (m,)
    damping: Any  # (m,)
    bushings: Any  # (m,): stiffness in series with each damper, 0 for none
    force_laws: Any  # (m,): records with the fields of `sprung.simulation.ForceLaw`
    by_acceleration: Any  # (channels, n)
    by_velocity: Any
    by_displacement: Any
    rolling_damping: Any  # (n, n) of wheels that roll on rails, or (0, n) of none
    rolling_stiffness: Any
    loads: Any  # (m,): static load of each element


@njit(cache=True, error_model="numpy")
def forces(law: Any, e: Any, rate: Any, z: Any, r: Any, k: Any, c: Any, bushing: Any, load: Any) -> Any:
    """Return the tension of an element, and the rates of its damper's elongation and of its rubber's force."""
    tension = k * (e + law.cubic * e * e * e) + r
    if abs(e) > law.gap:
        tension += law.stop_stiffness * (e - law.gap if e > 0 else e + law.gap)
    z_rate = 0.0
    if bushing > 0 and c > 0:
        arm = bushing * (e - z)
        tension += arm
        z_rate = arm / c
    else:
        bent = rate
        if abs(rate) > law.knee:
            beyond = (abs(rate) - law.knee) * law.knee_slope + law.knee
            bent = beyond if rate > 0 else -beyond
        damping = c
        if law.asymmetry != 0:
            damping = c * (1 + law.asymmetry * rate / np.sqrt(rate * rate + law.asymmetry_velocity**2))
        tension += damping * bent
    friction = law.friction + law.load_friction * max(load - k * e, 0.0)
    if friction > 0:
        tension += friction * rate / np.sqrt(rate * rate + law.friction_velocity**2)
    r_rate = 0.0
    if law.rubber_stiffness > 0:
        sign = 1.0 if rate > 0 else -1.0
        r_rate = law.rubber_stiffness * rate * (1 - sign * r / law.rubber_force)
    return tension, z_rate, r_rate


@njit(cache=True, error_model="numpy")
def product(row: Any, values: Any) -> Any:
    """Return the sum of products, added one after the other, so that it is the same on every machine."""
    total = 0.0
    for i in range(row.size):
        total += row[i] * values[i]
    return total


@njit(cache=True, error_model="numpy")
def rates(state: Any, u: Any, loops: Any, k: Any, c: Any, seen: Any) -> Any:
    """Return the time derivative of the state for the inputs u, stiffnesses k and dampings c.

    `seen` receives 1, elongation, its rate and tension of each element, (m, 4).
    """
    m, n = loops.elongations.shape
    out = np.empty(state.size)
    force = np.empty(n)
    for i in range(n):
        force[i] = product(loops.input_forces[i], u)
        out[i] = state[n + i]
    for i in range(loops.rolling_damping.shape[0]):
        force[i] -= product(loops.rolling_stiffness[i], state[:n]) + product(loops.rolling_damping[i], state[n : 2 * n])
    for row in range(m):
        elongation = loops.elongations[row]
        e, rate = product(elongation, state[:n]), product(elongation, state[n:])
        if loops.feet[row] >= 0:
            e -= u[loops.feet[row]]
        z, r = state[2 * n + row], state[2 * n + m + row]
        law, bushing, load = loops.force_laws[row], loops.bushings[row], loops.loads[row]
        tension, z_rate, r_rate = forces(law, e, rate, z, r, k[row], c[row], bushing, load)
        seen[row, 1], seen[row, 2], seen[row, 3] = e, rate, tension
        out[2 * n + row] = z_rate
        out[2 * n + m + row] = r_rate
        for i in range(n):
            force[i] -= elongation[i] * tension
    for i in range(n):
        out[n + i] = product(loops.inverse_mass[i], force)
    return out


@njit(cache=True, error_model="numpy")
def integrate(
    loops: Any, knots: Any, factors: Any, inputs: Any, step: Any, start: Any, coordinates: Any, velocities: Any
) -> Any:
    """Return outputs (steps, channels), coordinates and velocities (steps, n), and the moments of the elements.

    Moments are the sums over times from 0 on of the products of 1, elongation, its rate and tension, (m, 4, 4).
    """
    m, n = loops.elongations.shape
    n_steps, n_channels = inputs.shape[0], loops.by_acceleration.shape[0]
    outputs = np.zeros((n_steps, n_channels))
    places = np.zeros((n_steps, n))
    speeds = np.zeros((n_steps, n))
    moments, seen = np.zeros((m, 4, 4)), np.ones((m, 4))
    state = np.zeros(2 * n + 2 * m)
    state[:n] = coordinates
    state[n : 2 * n] = velocities
    k = loops.stiffness * factors[:, 0, 0]
    c = loops.damping * factors[:, 1, 0]
    knot = 0
    for number in range(n_steps):
        if knots.size > 1:
            time = start + number * step
            while knot < knots.size - 2 and time >= knots[knot + 1]:
                knot += 1
            share = min(max((time - knots[knot]) / (knots[knot + 1] - knots[knot]), 0.0), 1.0)
            k = loops.stiffness * (factors[:, 0, knot] * (1 - share) + factors[:, 0, knot + 1] * share)
            c = loops.damping * (factors[:, 1, knot] * (1 - share) + factors[:, 1, knot + 1] * share)
        first = rates(state, inputs[number], loops, k, c, seen)
        if start + number * step > -step / 2:
            for row in range(m):
                for i in range(4):
                    for j in range(4):
                        moments[row, i, j] += seen[row, i] * seen[row, j]
        for channel in range(n_channels):
            for i in range(n):
                outputs[number, channel] += (
                    loops.by_displacement[channel, i] * state[i]
                    + loops.by_velocity[channel, i] * state[n + i]
                    + loops.by_acceleration[channel, i] * first[n + i]
                )
        places[number] = state[:n]
        speeds[number] = state[n : 2 * n]
        if number == n_steps - 1:
            break
        between = (inputs[number] + inputs[number + 1]) / 2
        second = rates(state + step / 2 * first, between, loops, k, c, seen)
        third = rates(state + step / 2 * second, between, loops, k, c, seen)
        fourth = rates(state + step * third, inputs[number + 1], loops, k, c, seen)
        state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    return outputs, places, speeds, moments
