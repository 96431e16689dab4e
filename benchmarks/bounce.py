"""Simulated hand pushes of every shipped vehicle: `python -m benchmarks.bounce [--draws N] [--json FILE]`.

A hand presses each corner of the body in turn with half a sine and lets go; the vehicle swings for three seconds. A
phone on the body measures vertical acceleration, roll and pitch rate with the noise of its sensors (chain and quarter
vehicle: their own accelerometers with the same noise). The table compares the body modes of `sprung.bounce` with the
exact ones: error of frequency and damping ratio, and how many 95 % intervals hold the truth.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.measuring import print_circumstances, print_table
from scipy.optimize import linear_sum_assignment

import sprung
from sprung.modal import INTERVAL_95
from sprung.vehicles import Structure, discretised, read_description, sensor_outputs, structure
from sprung.vehicles.models import VEHICLES

#: Noise of a phone [m/s^2, rad/s], RMS at its rate; free motion after each push [s].
ACCELERATION_NOISE, RATE_NOISE, SWING = 0.02, 0.001, 3.0


def pushed(name: str, seed: int) -> tuple[list[sprung.Recording], Any]:
    """Return a recording of each push of a shipped vehicle, and its exact modes."""
    description = read_description(name)
    vehicle = structure(description)
    exact = vehicle.modes()
    body = [k for k, label in enumerate(exact.labels) if label != "wheel_hop"]
    middle, fastest = np.median(exact.natural_frequency[body]), exact.natural_frequency[body[-1]]
    rate = max(100.0, 8 * fastest, *(2.5 * f for f in exact.natural_frequency if f < 100))
    rng = np.random.default_rng(seed)
    if "bounce" in vehicle.coordinates and "pitch" in vehicle.coordinates:
        reach = np.abs([channel.position or (0.0,) * 3 for channel in vehicle.outputs.channels]).max(axis=0)
        rows = [[1.0, -x * reach[0], y * reach[1]] for x in (1, -1) for y in (1, -1)]
        hands = np.zeros((len(vehicle.coordinates), 4))
        hands[[vehicle.coordinates.index(each) for each in ("bounce", "pitch", "roll")]] = np.array(rows).T
        place = (0.3 * reach[0], 0.4 * reach[1], 0.0)
        channels = [sprung.Channel("acc_z", "acceleration", place, (0.0, 0.0, 1.0))]
        channels += [sprung.Channel(f"gyro_{x}", "angular_velocity", place, axis) for x, axis in _AXES]
        outputs = sensor_outputs(vehicle.coordinates, sensors=channels, carriers=["body"] * 3, shapes=vehicle.shapes)
    else:
        hands, outputs = np.eye(len(vehicle.coordinates)), vehicle.outputs
        hands = hands[:, [vehicle.coordinates.index("bounce")] if "bounce" in vehicle.coordinates else slice(None)]
    changed = _with_hands(vehicle, hands, outputs)
    press = round(0.6 / middle * rate)
    swing, wait = round(SWING * rate), round(0.5 * rate)
    n_hands = hands.shape[1]
    noise = [RATE_NOISE if each.quantity == "angular_velocity" else ACCELERATION_NOISE for each in outputs.channels]
    measured = tuple(sprung.Channel(each.name, each.quantity) for each in outputs.channels)
    size = 0.6 * float(vehicle.mass[0, 0])
    recordings = []
    for k in range(n_hands):
        force = np.zeros((len(changed.inputs), wait + press + swing))
        force[len(vehicle.inputs) + k, wait : wait + press] = -size * np.sin(np.pi * np.arange(press) / press)
        motion = _response(changed, force, rate)
        samples = motion + np.array(noise)[:, None] * rng.standard_normal(motion.shape)
        recordings.append(sprung.Recording(samples, rate, measured))
    return recordings, exact


_AXES = (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)))


def _with_hands(vehicle: Structure, hands: Any, outputs: Any) -> Structure:
    """Return a vehicle with forces of hands as further inputs, and other sensors."""
    names = tuple(f"hand_{k}" for k in range(hands.shape[1]))
    forces = np.hstack([vehicle.forces, hands])
    return Structure(vehicle.coordinates, vehicle.mass, vehicle.elements, vehicle.inputs + names, forces, outputs)


def _response(vehicle: Structure, force: Any, rate: float) -> Any:
    """Return the motion of the sensors, forces held between samples."""
    system = discretised(vehicle.state_space(), sampling_rate=rate)
    state, motion = np.zeros(len(system.state_matrix)), np.empty((len(system.output_matrix), force.shape[1]))
    for k in range(force.shape[1]):
        motion[:, k] = system.output_matrix @ state + system.feedthrough @ force[:, k]
        state = system.state_matrix @ state + system.input_matrix @ force[:, k]
    return motion


def paired(found: Any, exact: Any) -> list[tuple[int, int]]:
    """Return the pairs of found and exact poles that are nearest, of frequencies within 8 % of each other.

    Notes
    -----
    Frequencies alone do not distinguish modes: bounce and roll of a coach without sway are 0.2 % apart, damping 8 %.
    """
    ratios = found[:, None] / exact
    is_near = np.abs(np.abs(ratios) - 1) <= 0.08
    rows, columns = linear_sum_assignment(np.where(is_near, np.abs(ratios - 1), 9.0))
    return [(j, k) for j, k in zip(rows.tolist(), columns.tolist(), strict=True) if is_near[j, k]]


def case(name: str, draws: int) -> dict[str, Any]:
    """Return errors and coverage over draws of the noise."""
    errors: list[float] = []
    frequency_errors: list[float] = []
    n_covered = n_intervals = n_found = n_spurious = 0
    for seed in range(draws):
        recordings, exact = pushed(name, seed)
        wanted = [k for k, label in enumerate(exact.labels) if label != "wheel_hop"]
        try:
            modes = sprung.bounce(recordings).modes
        except sprung.DataError:
            continue
        left = set(range(len(modes)))
        for j, k in paired(modes.poles, exact.poles[wanted]):
            f, xi = exact.natural_frequency[wanted[k]], exact.damping_ratio[wanted[k]]
            left.remove(j)
            n_found += 1
            errors.append(modes.damping_ratio[j] / xi - 1)
            frequency_errors.append(modes.natural_frequency[j] / f - 1)
            n_intervals += 2
            n_covered += abs(modes.natural_frequency[j] - f) < INTERVAL_95 * modes.natural_frequency_std[j]
            n_covered += abs(modes.damping_ratio[j] - xi) < INTERVAL_95 * modes.damping_ratio_std[j]
        hops = exact.natural_frequency[[k for k in range(len(exact.labels)) if k not in wanted]]
        n_spurious += sum(not np.any(np.abs(modes.natural_frequency[j] / hops - 1) < 0.3) for j in left)
    return {
        "vehicle": name,
        "modes": draws * len(wanted),
        "found": n_found,
        "spurious": int(n_spurious),
        "rms_damping_error": float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        "max_damping_error": float(np.max(np.abs(errors))) if errors else None,
        "rms_frequency_error": float(np.sqrt(np.mean(np.square(frequency_errors)))) if errors else None,
        "coverage": float(n_covered / n_intervals) if n_intervals else None,
        "intervals": n_intervals,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="vehicles; default: all that are shipped")
    parser.add_argument("--draws", type=int, default=50, help="draws of the noise")
    parser.add_argument("--json", type=Path, help="file for the figures")
    arguments = parser.parse_args()
    print_circumstances(peers=[])
    cases = [case(name, arguments.draws) for name in arguments.names or VEHICLES]
    heads = [
        "vehicle",
        "modes found",
        "spurious",
        "damping: rms, largest error",
        "frequency: rms error",
        "95 % intervals",
    ]
    rows = [
        [
            each["vehicle"],
            f"{each['found']} of {each['modes']}",
            str(each["spurious"]),
            f"{100 * each['rms_damping_error']:.2f} %, {100 * each['max_damping_error']:.1f} %"
            if each["found"]
            else "-",
            f"{100 * each['rms_frequency_error']:.2f} %" if each["found"] else "-",
            f"{100 * each['coverage']:.1f} % of {each['intervals']}" if each["found"] else "-",
        ]
        for each in cases
    ]
    print_table("Hand pushes, three seconds of motion, noise of a phone", heads, rows)
    total = sum(each["intervals"] for each in cases)
    held = sum((each["coverage"] or 0) * each["intervals"] for each in cases)
    print(f"\nAll 95 % intervals: {100 * held / max(total, 1):.1f} % of {total} hold the truth.")
    if arguments.json:
        command = f"python -m benchmarks.bounce --draws {arguments.draws}"
        arguments.json.write_text(json.dumps({"command": command, "cases": cases}, indent=1) + "\n")


if __name__ == "__main__":
    main()
