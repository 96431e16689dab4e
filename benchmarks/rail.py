"""Faults of a metro car on bogies, found with two accelerometers, speed and load unmeasured, over simulated drives.

Unless `--sensors` names others, one accelerometer is on the frame of the first bogie above an axle box, one on the car
body above its secondary spring. Each car differs from its vehicle file by production scatter, mass and inertias. Its
baseline is learnt from drives on tracks of ERRI B176 low and high, with a random load and random speeds; then drives
with one weaker spring of the first bogie, and healthy ones, are diagnosed one by one or some together. Printed are the
shares of drives of which the most likely change is of the right stage and of the right part, of all parts and of the
six springs of that bogie, of those with a finding, and the mean absolute error of the size, with 95 % intervals.

Beside them are bounds by the information in the same drives (Fisher, Whittle's likelihood, load, speed and track
unknown) if all other parts are exactly as they were. The error: no unbiased estimate has a smaller one. The right part:
of the six springs, equally likely to change by sizes of the given range, no rule names more; the same where each part
of the car may be the one that changed, and where windows differ in what the baseline allows for, such as dampers of
unknown temperature; and the least number of drives together that reach `GOALS` by these.

`--drawn` adds drives that are not simulated: the estimates of a healthy drive, drawn anew by their covariance, and a
change. They try baseline, test and naming alone, thousands of times.
"""

import argparse
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.special import logsumexp
from scipy.stats import beta

from sprung._arrays import Real
from sprung.diagnosis import Baseline, Observation, diagnose, learn, observe_window
from sprung.simulation import Deviations, PartScatter, Payload, RailDrive, simulate_drive
from sprung.vehicles import Vehicle, parse_fault, read_vehicle

#: What the diagnosis says of one set of drives; a part and its relative change.
Row = dict[str, Any]
Change = tuple[str, float]

SENSORS = ("bogie1_fl", "body_fl")
SIDES = ("left", "right")
PARTS = {
    "primary": [f"bogie1_{end}_{side}.primary_spring" for end in ("front", "rear") for side in SIDES],
    "secondary": [f"bogie1_{side}.secondary_spring" for side in SIDES],
}
SPRINGS = [part for parts in PARTS.values() for part in parts]
LEARNING = 12
#: Shares of right parts wanted, and numbers of drives together by which the information is tried for them.
GOALS = {"primary": 0.97, "secondary": 0.99}
TOGETHER = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--cars", type=int, default=10)
    arguments.add_argument("--drives", type=int, default=12, help="drives of each stage and healthy ones, of each car")
    arguments.add_argument("--drawn", type=int, default=0, help="the same, drawn by the covariance of healthy drives")
    arguments.add_argument("--together", type=int, default=1, help="drives that are diagnosed together")
    arguments.add_argument("--minutes", type=float, default=5.0, help="length of a drive")
    arguments.add_argument("--sizes", type=float, nargs=2, default=(0.1, 0.4), help="range of the loss of stiffness")
    arguments.add_argument(
        "--sensors", nargs="+", default=SENSORS, metavar="CHANNEL", help="sensors of the metro's file"
    )
    arguments.add_argument("--joints", action="store_true", help="rails have joints every 18 m")
    arguments.add_argument("--exact", action="store_true", help="cars are as in the vehicle file")
    arguments.add_argument("--first", type=int, default=0, help="number of the first car")
    arguments.add_argument("--jobs", type=int, default=1)
    given = arguments.parse_args()
    cars = range(given.first, given.first + given.cars)
    with ProcessPoolExecutor(given.jobs) as pool:
        lives = list(pool.map(partial(lives_of, given), cars))
    for title, rows in zip(("simulated", "drawn"), zip(*lives, strict=True), strict=True):
        if every := [row for life in rows for row in life]:
            print(f"\n{title} drives")
            summarise(every, given)


def lives_of(given: argparse.Namespace, number: int) -> tuple[list[Row], list[Row]]:
    """Return what the diagnosis says of each simulated drive of a car, and of each drawn one."""
    metro = read_vehicle("metro")
    metro = metro.model_copy(update={"sensor": tuple(one for one in metro.sensor if one.channel in given.sensors)})
    generator = np.random.default_rng([number, 1])
    car = Car(number, metro, generator, given)
    healthy = [simulated(car, count) for count in range(LEARNING)]
    rows = watched(car, healthy, partial(simulated, car), given.drives, has_bounds=True)
    if not given.drawn:
        return rows, []
    drive = partial(drawn, car, [window for window in healthy if window.is_valid], learn(healthy).mean)
    return rows, watched(car, [drive(count) for count in range(LEARNING)], drive, given.drawn)


class Car(NamedTuple):
    """A car with its vehicle file, the random numbers of its drives, and the options of the benchmark."""

    number: int
    file: Vehicle
    generator: np.random.Generator
    given: argparse.Namespace


def watched(
    car: Car,
    healthy: Sequence[Observation],
    drive: Callable[[int, Change | None], Observation],
    n_drives: int,
    *,
    has_bounds: bool = False,
) -> list[Row]:
    """Return what the diagnosis says of drives after a baseline of healthy ones."""
    given, generator = car.given, car.generator
    rows: list[Row] = []
    baseline = learn(healthy)
    for stage in [*PARTS, "healthy"]:
        for _ in range(n_drives):
            change = -float(generator.uniform(*given.sizes))
            part = None if stage == "healthy" else str(generator.choice(PARTS[stage]))
            first = LEARNING + given.together * len(rows)
            fault = None if part is None else (part, change)
            windows = [drive(first + count, fault) for count in range(given.together)]
            reasons = [window.reason for window in windows if window.reason]
            rows.append({"stage": stage, "part": part, "change": change, "reason": "", "is_found": False})
            if len(reasons) == given.together:
                rows[-1]["reason"] = reasons[0]
                continue
            result = diagnose(windows, baseline)
            candidates = result.detection.candidates if result.detection else ()
            single = [one for one in candidates if one.hypothesis.scope == "single"]
            spring = next(one for one in single if one.hypothesis.name in SPRINGS)
            rows[-1] |= {"is_found": bool(result.findings), "best": single[0].hypothesis.name}
            rows[-1] |= {"spring": spring.hypothesis.name, "size": spring.sizes[0].change}
            print(car.number, rows[-1], flush=True)
            if fault is not None and has_bounds:
                rows[-1] |= bounds(windows, healthy, baseline, fault, given.sizes)
    return rows


def simulated(car: Car, count: int, fault: Change | None = None) -> Observation:
    """Return the observation of a simulated drive of a car, with a change of a part or without."""
    given, generator = car.given, car.generator
    low = float(generator.uniform(12.0, 20.0))
    spread = np.random.default_rng([car.number, 3]).normal(0.0, 0.05, 3).tolist()
    values = dict(zip(("mass", "pitch_inertia", "roll_inertia"), spread, strict=True))
    settings = RailDrive(
        duration=60 * given.minutes,
        sampling_rate=100.0,
        speed=(low, low + float(generator.uniform(4.0, 10.0))),
        quality="bad" if generator.choice(["good", "bad"]) == "bad" else "good",
        welded=not given.joints,
        payload=Payload(*(float(generator.uniform(*ends)) for ends in ((0.0, 6000.0), (-2.0, 2.0), (-0.2, 0.2)))),
        snr=30.0,
        faults=() if fault is None else (parse_fault("{}={}".format(*fault)),),
        deviations=Deviations() if given.exact else Deviations(values, scatter=PartScatter(), individual=car.number),
    )
    run = simulate_drive(car.file, settings, seed=[car.number, 2, count]).recording
    return observe_window(run.select(list(given.sensors)), car.file, time=60 * given.minutes * count)


def drawn(car: Car, pool: Sequence[Observation], truth: Real, count: int, fault: Change | None = None) -> Observation:
    """Return a drive with estimates drawn about the truth and a change by the covariance of a drive of the pool."""
    part, change = fault or ("", 0.0)
    window = pool[int(car.generator.integers(len(pool)))]
    moved = np.array([np.log1p(change) * (str(component) == part) for component in window.components])
    values = car.generator.multivariate_normal(truth + moved, window.covariance)
    return replace(window, time=window.time + 1e5 * count, log_ratios=values, residuals=None)


def bounds(
    windows: Sequence[Observation],
    healthy: Sequence[Observation],
    baseline: Baseline,
    fault: Change,
    sizes: tuple[float, float],
) -> dict[str, Any]:
    """Return the least error of the size, and the shares named right by numbers of drives and sets of parts."""
    part, change = fault
    names = list(map(str, baseline.components))
    row, springs, every = names.index(part), [names.index(spring) for spring in SPRINGS], list(range(len(names)))
    used, usual = ([window.covariance for window in each if window.is_valid] for each in (windows, healthy))
    known = [sum(np.linalg.inv(covariance)[row, row] for covariance in each) for each in (used, usual)]

    def information(count: int, nuisance: Real | float) -> Real:
        """Information about a change in a number of drives such as these after the baseline."""
        now, before = (np.sum([np.linalg.inv(each + nuisance) for each in own], axis=0) for own in (used, usual))
        return np.asarray(np.linalg.inv(np.linalg.inv(now * count / len(used)) + np.linalg.inv(before)))

    of_sets: list[tuple[list[int], Real | float]] = [(springs, 0.0), (every, 0.0), (every, baseline.nuisance)]
    rates = np.empty((len(of_sets), len(TOGETHER)))
    for place, (parts, nuisance) in enumerate(of_sets):
        for column, count in enumerate(TOGETHER):
            own = information(count, nuisance)[np.ix_(parts, parts)]
            rates[place, column] = named_right(own, parts.index(row), change, sizes)
    return {"bound": (1 + change) * float(np.sqrt(2 / np.pi * sum(1 / one for one in known))), "rates": rates}


def named_right(information: Real, row: int, change: float, sizes: tuple[float, float]) -> float:
    """Return the probability that a part that changed is the most likely one, sizes being uniform in a range.

    With the information I about a change the score of part k after a change d of part j is d I_kj and chance of the
    covariance I; a size s of part k has the log likelihood ratio s score_k - s^2 I_kk / 2.
    """
    chance = np.random.default_rng(0).standard_normal((1000, len(information)))
    scores = np.log1p(change) * information[row] + chance @ np.linalg.cholesky(information).T
    losses = np.log1p(-np.linspace(sizes[0], sizes[1], 31))[:, None, None]
    likelihoods = logsumexp(losses * scores - losses**2 / 2 * np.diag(information), axis=0)
    return float(np.mean(np.argmax(likelihoods, axis=1) == row))


def summarise(rows: Sequence[Row], given: argparse.Namespace) -> None:
    """Print how faults of either stage were found, and what healthy drives were called."""
    for stage in PARTS:
        report(stage, [row for row in rows if row["stage"] == stage])
    healthy = [row for row in rows if row["stage"] == "healthy"]
    hours = len(healthy) * given.together * given.minutes / 60
    print(f"healthy, {hours:.0f} h: {share([row['is_found'] for row in healthy])} with a finding (false alarms)")
    print(f"inconclusive: {sum(row['reason'] != '' for row in rows)} of {len(rows)}")


def report(stage: str, rows: Sequence[Row]) -> None:
    """Print how faults of a stage were found."""
    usable = [row for row in rows if "best" in row]
    print(f"{stage} springs, {len(rows)} drives, {len(rows) - len(usable)} of them inconclusive")
    print(f"  right stage        {share([f'.{stage}_' in row['best'] for row in usable])}")
    print(f"  right part         {share([row['best'] == row['part'] for row in usable])}")
    print(f"  of the six springs {share([row['spring'] == row['part'] for row in usable])}")
    print(f"  with a finding     {share([row['is_found'] for row in usable])}")
    errors = [100 * abs(row["size"] - row["change"]) for row in usable if row["spring"] == row["part"]]
    if errors:
        mean, half = np.mean(errors), 1.96 * np.std(errors) / np.sqrt(len(errors))
        print(f"  error of the size  {mean:.2f} +- {half:.2f} points, of {len(errors)} with the right spring")
    if bounded := [row for row in usable if "bound" in row]:
        print(f"  by the information {100 * np.mean([row['bound'] for row in bounded]):.2f}")
        rates = np.mean([row["rates"] for row in bounded], axis=0)
        for each, parts in zip(rates, ("of the six springs", "of all parts", "as the baseline allows"), strict=True):
            enough = [n for n, rate in zip(TOGETHER, each, strict=True) if rate >= GOALS[stage]]
            needed = f"{enough[0]} together" if enough else f"more than {TOGETHER[-1]} together"
            print(f"    {parts:22} {100 * each[0]:.1f} % by such a drive, {100 * GOALS[stage]:.0f} % by {needed}")


def share(flags: Sequence[bool]) -> str:
    """Return a share in per cent with its 95 % interval (Clopper and Pearson) and its count."""
    k, n = sum(flags), len(flags)
    low = 0.0 if k == 0 else beta.ppf(0.025, k, n - k + 1)
    high = 1.0 if k == n else beta.ppf(0.975, k + 1, n - k)
    return f"{100 * k / max(n, 1):.1f} % ({100 * low:.1f} to {100 * high:.1f} %, {k} of {n})"


if __name__ == "__main__":
    main()
