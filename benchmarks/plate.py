"""Inspection figures from ten minutes of driving, beside a simulated suspension tester that shakes the same vehicle.

    python -m benchmarks.plate [--vehicles N] [--minutes M] [--seed S] [--friction F] [--roads CLASSES] [--linear]
                               [--loads] [--knee V]

Each car has dampers of its own (15 to 130 % of the nominal ones, each corner by itself), asymmetric ones (35 % more in
rebound, 35 % less in bump), hardening springs and F newton of dry friction a corner (25, as `REALISTIC_FORCE_LAWS`). It
drives on a road of class C, and `plate_tests` gives the smallest phase shift and the adhesion of every corner. With
`--roads ABD` it has driven on roads of these classes as well, and friction is that of all drives (`common_friction`). A
plate of 6 mm from end to end runs down from 25 Hz in four minutes under one wheel after another of the same nonlinear
car, and phase and force are read from the motion as a tester does. With `--linear`, cars have linear suspensions. With
`--loads`, masses differ from the vehicle file as a fit supposes: 20 % for the body and its inertias (a load), 7 % for
the wheels of an axle. With `--knee`, valves open at V metres a second, to 0.4 of their damping.
Columns: mean and RMS of the difference, share of corners within 3 degrees (or percent), share of 95 % intervals that
hold, and share of right verdicts (pass or fail) among corners more than 5 degrees (or percent) from the limit.
"""

import argparse
import os
from dataclasses import replace
from itertools import pairwise

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.measuring import print_table

from sprung.likelihood import fit_corners
from sprung.likelihood.dry_friction import common_friction
from sprung.likelihood.plate_test import PLATE, Corner, plate_tests, tyres
from sprung.simulation import ForceLaw, RoadConditions, RoadDrive, SuspensionConditions, simulate_drive
from sprung.simulation.conditions import REALISTIC_FORCE_LAWS
from sprung.simulation.nonlinear import integrate
from sprung.vehicles import Fault, Structure, Vehicle, read_vehicle, structure
from sprung.vehicles.structure import with_faults

RATE = 2000.0
#: Duration of the run from the highest frequency to 1 Hz [s].
RUN = 240.0


def shaken(car: Structure, corner: str, laws: dict[str, ForceLaw]) -> tuple[float, float]:
    """Return the smallest phase shift [degrees] and the adhesion of one corner on a plate that runs down."""
    tyre = tyres(car)[corner]
    times = np.arange(round((RUN + 2) * RATE)) / RATE
    rate = np.clip(1 - (times - 2) / RUN, 1 / PLATE.highest, 1)  # two seconds at the highest frequency first
    angle = 2 * np.pi * np.cumsum(PLATE.highest * rate) / RATE
    inputs = np.zeros((len(car.inputs), times.size))
    inputs[car.inputs.index(tyre.foot)] = PLATE.amplitude * np.sin(angle)
    motion = integrate(car, inputs, rate=RATE, force_laws=laws)
    plate = inputs[car.inputs.index(tyre.foot)]
    force = tyre.stiffness * (plate - tyre.elongation @ motion.coordinates)
    whole = np.floor(angle / (2 * np.pi)).astype(int)
    first = np.flatnonzero(np.diff(whole)) + 1
    static = Corner(car, tyre)
    body, wheel = (np.sqrt(static.spring / mass) / (2 * np.pi) for mass in (static.sprung, static.unsprung))
    phases, peaks = [], []
    for begin, end in pairwise(first.tolist()):
        turn, part = angle[begin:end], force[begin:end]
        frequency = RATE / (end - begin)
        harmonic = np.mean(part * np.exp(-1j * turn)) / np.mean(plate[begin:end] * np.exp(-1j * turn))
        peaks.append(np.max(-part))
        if body <= frequency <= wheel:
            phases.append(abs(np.degrees(np.angle(harmonic))))
    return float(np.min(phases)), max(0.0, 1 - float(np.max(peaks)) / static.load)


def loaded(car: Vehicle, generator: np.random.Generator) -> Vehicle:
    """Return a car whose masses differ from its file as a fit supposes, by two standard deviations at most."""

    def times(value: float, std: float) -> float:
        return value * (1 + std * float(np.clip(generator.standard_normal(), -2, 2)))

    names = ("mass", "pitch_inertia", "roll_inertia")
    body = car.body.model_copy(update={name: times(getattr(car.body, name), 0.2) for name in names})
    axles = tuple(axle.model_copy(update={"unsprung_mass": times(axle.unsprung_mass, 0.07)}) for axle in car.axle)
    return car.model_copy(update={"body": body, "axle": axles})


def cases(given: argparse.Namespace, law: ForceLaw | None) -> np.ndarray:
    """Return rows of estimate, its standard deviation and truth, of phase and of adhesion, of all corners."""
    car, generator = read_vehicle("zafira"), np.random.default_rng(given.seed)
    rows = []
    for number in range(given.vehicles):
        own = loaded(car, np.random.default_rng([given.seed, number])) if given.loads else car
        healthy = structure(own)
        corners = tuple(tyres(healthy))
        factors = np.exp(generator.uniform(np.log(0.15), np.log(1.3), len(corners)))
        faults = tuple(
            Fault(component, float(factor) - 1)
            for component in healthy.components()
            for corner, factor in zip(corners, factors, strict=True)
            if str(component) == f"{corner}.damper"
        )
        laws = {} if law is None else {"suspension": law}
        drive = RoadDrive(
            duration=60 * given.minutes,
            sampling_rate=100.0,
            speed=(12.0, 22.0),
            road=RoadConditions("C"),
            snr=50.0,
            faults=faults,
            suspension=SuspensionConditions(force_laws=laws),
        )
        drives = [drive, *(replace(drive, road=RoadConditions(other)) for other in given.roads)]
        fits = [
            fit_corners(simulate_drive(own, one, seed=[given.seed, number, road]).recording, car)
            for road, one in enumerate(drives)
        ]
        friction = common_friction(fits) if given.roads else None
        tests = plate_tests(fits[0], friction=friction)
        true = with_faults(healthy, faults)
        for corner, test in tests.items():
            phase, adhesion = shaken(true, corner, laws)
            rows.append([test.phase_shift, test.phase_shift_std, phase, test.adhesion, test.adhesion_std, adhesion])
        print(f"car {number}: " + ", ".join(f"{row[0]:.1f} ± {row[1]:.1f} for {row[2]:.1f}" for row in rows[-4:]))
    return np.array(rows)


def main() -> None:
    """Print a row for each figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=25)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--friction", type=float, default=25.0)
    parser.add_argument("--roads", default="", help="classes of further roads")
    parser.add_argument("--linear", action="store_true")
    parser.add_argument("--loads", action="store_true", help="masses other than those of the vehicle file")
    parser.add_argument("--knee", type=float, default=np.inf, help="velocity at which valves open [m/s]")
    given = parser.parse_args()
    usual = replace(REALISTIC_FORCE_LAWS["suspension"], friction=given.friction, knee=given.knee, knee_slope=0.4)
    law = None if given.linear else usual
    found = cases(given, law)
    table = []
    for name, values, scale, near in (
        ("phase [deg]", found[:, :3], 1.0, 3.0),
        ("adhesion [%]", found[:, 3:], 100, 3.0),
    ):
        estimate, std, true = scale * values.T
        error = estimate - true
        holds = np.mean(np.abs(error) <= 1.96 * std)
        row = [name, len(error), error.mean(), np.sqrt(np.mean(error**2)), np.mean(np.abs(error) < near), holds]
        limit = PLATE.phase_limit if scale == 1 else 100 * PLATE.adhesion_limit
        clear = np.abs(true - limit) > 5
        row += [np.mean((estimate < limit)[clear] == (true < limit)[clear]), int(clear.sum())]
        table.append([row[0], f"{row[1]}", *(f"{value:.3g}" for value in row[2:7]), f"{row[7]}"])
    print_table(
        "Inspection figures",
        ["figure", "corners", "mean", "RMS", "within 3", "95 % holds", "right verdict", "of"],
        table,
    )


if __name__ == "__main__":
    main()
