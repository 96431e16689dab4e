"""Body of a vehicle over a road: the model with the true numbers of a multibody engine's vehicle beside the engine.

    python -m benchmarks.multibody.response                 car, van and larger car at 15 m/s
    python -m benchmarks.multibody.response car --speed 25

Accelerations above the wheels for the height of the road under each, both linear: steps of the engine differentiated at
rest, and `sprung.vehicles.structure` with the masses, inertias and rates of the engine's vehicle. The table shows the
RMS deviation over that of the engine by motion and band: bounce and pitch from both, roll from a road that rolls and
from one that twists. Tyres of the engine have a damping that the model lacks.
"""

import argparse
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.multibody.__main__ import VEHICLES, Study
from benchmarks.multibody.design import QUIET, sensor_places
from benchmarks.multibody.drive import STEP, Car
from benchmarks.multibody.sway import true_file
from benchmarks.multibody.truth import one_step

from sprung.vehicles.models import structure

BANDS = ((0.5, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0))  # [Hz]
#: Both ends and sides alike, ends opposed, sides opposed, and both: bounce, pitch, roll and twist.
PATTERNS = 0.5 * np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]])
#: Motions of the body, and the patterns of the road that they answer.
MOTIONS = {"bounce": (0, (0, 1)), "pitch": (1, (0, 1)), "roll over roll": (2, (2,)), "roll over twist": (2, (3,))}


def of_engine(study: Study, speed: float, frequencies: np.ndarray) -> np.ndarray:
    """Return the accelerations at the sensors for the road under each wheel, shape (frequencies, 4, 4)."""
    car = Car(study.design, study.effects)
    by_state, by_road = one_step(car, speed)
    steps = np.exp(2j * np.pi * frequencies * STEP)
    states = np.array([np.linalg.solve(step * np.eye(len(by_state)) - by_state, by_road) for step in steps])
    at_sensors = np.array([[0, 0, 1, 0, -x, y] for x, y, _ in sensor_places(study.design).values()])
    omega = 2 * np.pi * frequencies[:, None, None]
    return -(omega**2) * (at_sensors @ states[:, :6]) * (1 + 1j * omega * car.tyre_ratio)


def of_model(study: Study, speed: float, frequencies: np.ndarray) -> np.ndarray:
    """Return the same by the model, with the true numbers of the vehicle."""
    vehicle = true_file(study, has_rigid_axles=True, has_side_forces=True)
    body = vehicle.body.model_copy(update={"mass": study.design.mass})
    model = structure(vehicle.model_copy(update={"body": body}), speed=speed)
    omega, s = 2 * np.pi * frequencies[:, None, None], 2j * np.pi * frequencies
    z = np.array([element.dynamic_stiffness(s) for element in model.elements])
    stiffness = np.einsum("ef,ei,ej->fij", z, model.elongations, model.elongations) + model.rolling_at(s)
    drive = np.einsum("ef,ei,ej->fij", z, model.elongations, model.feet)
    return -(omega**2) * (model.outputs.acceleration @ np.linalg.solve(stiffness - omega**2 * model.mass, drive))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = sorted(name for name, design in VEHICLES.items() if len(design.axles) == 2)
    parser.add_argument("vehicles", nargs="*", metavar="VEHICLE", help=", ".join(names))
    parser.add_argument("--speed", type=float, default=15.0)
    given = parser.parse_args()
    frequencies = np.arange(0.5, 16.0, 0.1)
    print(f"| vehicle | motion | {' | '.join(f'{low:g} to {high:g} Hz' for low, high in BANDS)} [%] |")
    print(f"|---|---|{'---|' * len(BANDS)}")
    for name in given.vehicles or names:
        study = Study(VEHICLES[name], Path(), replace(QUIET, side_forces=True))
        true, ours = (PATTERNS @ make(study, given.speed, frequencies) @ PATTERNS.T for make in (of_engine, of_model))
        for motion, (row, columns) in MOTIONS.items():
            cells = []
            for low, high in BANDS:
                inside = (low <= frequencies) & (frequencies < high)
                error, size = ((np.abs(each[inside, row][:, columns]) ** 2).sum() for each in (ours - true, true))
                cells.append(f"{100 * np.sqrt(error / size):.0f}")
            print(f"| {name} | {motion} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
