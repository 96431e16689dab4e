"""Faults of a metro car on bogies, found with two accelerometers, speed and load unmeasured, over simulated drives.

One accelerometer is on the frame of the first bogie above an axle box, one on the car body above its secondary spring.
Each car differs from its vehicle file by production scatter, mass and inertias. Its baseline is learnt from drives on
tracks of ERRI B176 low and high, with a random load and random speeds; then drives with one weaker spring of the first
bogie, and healthy ones, are diagnosed one by one or some together. Printed are the shares of drives of which the most
likely change is of the right stage and of the right part, of those with a finding, and the mean absolute error of the
size, with 95 % intervals; beside it the error by the information in the drives (Fisher, Whittle's likelihood, load,
speed and track unknown) about that part if all others are as they were: no unbiased estimate has a smaller one.
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

SENSORS = ("bogie1_fl", "body_fl")
SIDES = ("left", "right")
PARTS = {
    "primary": [f"bogie1_{end}_{side}.primary_spring" for end in ("front", "rear") for side in SIDES],
    "secondary": [f"bogie1_{side}.secondary_spring" for side in SIDES],
}
LEARNING = 12


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--cars", type=int, default=10)
    arguments.add_argument("--drives", type=int, default=12, help="drives of each stage and healthy ones, of each car")
    arguments.add_argument("--together", type=int, default=1, help="drives that are diagnosed together")
    arguments.add_argument("--minutes", type=float, default=5.0, help="length of a drive")
    arguments.add_argument("--sizes", type=float, nargs=2, default=(0.1, 0.4), help="range of the loss of stiffness")
    arguments.add_argument("--joints", action="store_true", help="rails have joints every 18 m")
    arguments.add_argument("--exact", action="store_true", help="cars are as in the vehicle file")
    arguments.add_argument("--first", type=int, default=0, help="number of the first car")
    arguments.add_argument("--jobs", type=int, default=1)
    given = arguments.parse_args()
    cars = range(given.first, given.first + given.cars)
    with ProcessPoolExecutor(given.jobs) as pool:
        rows = [row for life in pool.map(partial(life_of, given), cars) for row in life]
    for stage in PARTS:
        report(stage, [row for row in rows if row["stage"] == stage])
    healthy = [row for row in rows if row["stage"] == "healthy"]
    print(f"healthy: {share([row['is_found'] for row in healthy])} with a finding (false alarms)")
    print(f"inconclusive: {sum(row['reason'] != '' for row in rows)} of {len(rows)}")


def life_of(given, number):
    """Return what the diagnosis says of each drive of a car."""
    import numpy as np

    from sprung.diagnosis import diagnose, learn
    from sprung.vehicles import parse_fault, read_vehicle

    metro = read_vehicle("metro")
    metro = metro.model_copy(update={"sensor": tuple(one for one in metro.sensor if one.channel in SENSORS)})
    generator = np.random.default_rng([number, 1])
    drive = partial(observed, Car(number, metro, generator, given))
    healthy = [drive(count, ()) for count in range(LEARNING)]
    baseline = learn(healthy)
    rows = []
    for stage in [*PARTS, "healthy"]:
        for _ in range(given.drives):
            change = -float(generator.uniform(*given.sizes))
            part = None if stage == "healthy" else str(generator.choice(PARTS[stage]))
            faults = () if part is None else (parse_fault(f"{part}={change}"),)
            first = LEARNING + given.together * len(rows)
            windows = [drive(first + count, faults) for count in range(given.together)]
            reasons = [window.reason for window in windows if window.reason]
            rows.append({"stage": stage, "part": part, "change": change, "reason": "", "is_found": False})
            if len(reasons) == given.together:
                rows[-1]["reason"] = reasons[0]
                continue
            result = diagnose(windows, baseline)
            best = next(one for one in result.detection.candidates if one.hypothesis.scope == "single")
            rows[-1] |= {"is_found": bool(result.findings), "best": best.hypothesis.name, "size": best.sizes[0].change}
            if part is not None:
                row = list(map(str, baseline.components)).index(part)
                known = (
                    sum(np.linalg.inv(one.covariance)[row, row] for one in each if one.is_valid)
                    for each in (windows, healthy)
                )
                rows[-1]["bound"] = (1 + change) * float(np.sqrt(2 / np.pi * sum(1 / one for one in known)))
            print(number, rows[-1], flush=True)
    return rows


class Car(NamedTuple):
    """A car with its vehicle file, the random numbers of its drives, and the options of the benchmark."""

    number: int
    file: Any
    generator: Any
    given: Any


def observed(car, count, faults):
    """Return the observation of a drive of a car."""
    import numpy as np

    from sprung.diagnosis import observe_window
    from sprung.simulation import Deviations, PartScatter, Payload, RailDrive, simulate_drive

    given, generator = car.given, car.generator
    low = float(generator.uniform(12.0, 20.0))
    spread = np.random.default_rng([car.number, 3]).normal(0.0, 0.05, 3).tolist()
    values = dict(zip(("mass", "pitch_inertia", "roll_inertia"), spread, strict=True))
    settings = RailDrive(
        duration=60 * given.minutes,
        sampling_rate=100.0,
        speed=(low, low + float(generator.uniform(4.0, 10.0))),
        quality=str(generator.choice(["good", "bad"])),
        welded=not given.joints,
        payload=Payload(*(float(generator.uniform(*ends)) for ends in ((0.0, 6000.0), (-2.0, 2.0), (-0.2, 0.2)))),
        snr=30.0,
        faults=faults,
        deviations=Deviations() if given.exact else Deviations(values, scatter=PartScatter(), individual=car.number),
    )
    run = simulate_drive(car.file, settings, seed=[car.number, 2, count]).recording
    return observe_window(run.select(list(SENSORS)), car.file, time=60 * given.minutes * count)


def report(stage, rows):
    """Print how faults of a stage were found."""
    import numpy as np

    usable = [row for row in rows if "best" in row]
    print(f"{stage} springs, {len(rows)} drives, {len(rows) - len(usable)} of them inconclusive")
    print(f"  right stage        {share([f'.{stage}_' in row['best'] for row in usable])}")
    print(f"  right part         {share([row['best'] == row['part'] for row in usable])}")
    print(f"  with a finding     {share([row['is_found'] for row in usable])}")
    errors = [100 * abs(row["size"] - row["change"]) for row in usable if row["best"] == row["part"]]
    if errors:
        mean, half = np.mean(errors), 1.96 * np.std(errors) / np.sqrt(len(errors))
        print(
            f"  error of the size  {mean:.2f} +- {half:.2f} points of a per cent, of {len(errors)} with the right part"
        )
        print(f"  by the information {100 * np.mean([row['bound'] for row in usable]):.2f}")


def share(flags):
    """Return a share in per cent with its 95 % interval (Clopper and Pearson) and its count."""
    from scipy.stats import beta

    k, n = sum(flags), len(flags)
    low = 0.0 if k == 0 else beta.ppf(0.025, k, n - k + 1)
    high = 1.0 if k == n else beta.ppf(0.975, k + 1, n - k)
    return f"{100 * k / max(n, 1):.1f} % ({100 * low:.1f} to {100 * high:.1f} %, {k} of {n})"


if __name__ == "__main__":
    main()
