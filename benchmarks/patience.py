"""False names on the lists of simulated fleets, and faults found: vehicles from the state model of the change test.

Baselines of 6 and 12 windows; parts of unequal scatter, serial correlation, conditions beyond those of the baseline.
Somebody looks at a fleet after 6, 12, 24 and 48 windows and stops at the first look that names a healthy vehicle: the
worst for the promise, which is proportional to the patience; here that is the simulated time. Power is over a year.
A fleet is 100 vehicles of one type. Estimates of windows are drawn, not recordings: `patience_vectors.py` computes
their evidence as `sprung` does.
"""

import argparse
import os
from dataclasses import replace
from itertools import pairwise

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.patience_vectors import COMMON, CONDITIONS, KINDS, OWN, PARTS, REPORTED, baselines, evidence
from scipy.stats import binomtest

from sprung.diagnosis import false_discoveries
from sprung.diagnosis.changes import PATIENCE_DAYS
from sprung.diagnosis.scatter import pooled

LOOKS = (6, 12, 24, 48)
ONSET = 3
N_VEHICLES = 100
RATE = 0.05
#: Evidence by some of the correlations and one size at and above which it is computed, ln, of vehicles whose fleet is
#: known and of others: a list of one needs 6.9.
ABOVE, ABOVE_ALONE = 6.0, 1.5
#: Serial correlation, logarithmic standard deviation of the scatter of parts, whether conditions leave those met.
WORLDS = {
    "as the model says": (0.0, 0.0, False),
    "serial correlation of 0.3": (0.3, 0.0, False),
    "serial correlation of 0.6": (0.6, 0.0, False),
    "unequal scatter of parts": (0.0, 0.4, False),
    "conditions beyond the baseline's": (0.0, 0.0, True),
    "unequal scatter, correlation of 0.3": (0.3, 0.4, False),
    "unequal scatter, new conditions": (0.0, 0.4, True),
    "all three, correlation of 0.3": (0.3, 0.4, True),
    "all three, correlation of 0.6": (0.6, 0.4, True),
}


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--fleets", type=int, default=100, help=f"healthy fleets of {N_VEHICLES} simulated per row")
    arguments.add_argument("--faulty", type=int, default=1000, help="vehicles with a fault simulated per row")
    arguments.add_argument("--worlds", nargs="*", default=list(WORLDS), choices=list(WORLDS))
    arguments.add_argument("--windows", type=int, nargs="*", default=[6, 12], help="windows of a baseline")
    arguments.add_argument("--loss", type=float, default=0.05, help="share of its stiffness that a spring loses")
    arguments.add_argument("--among", choices=list(WORLDS), help="world of the other vehicles of each vehicle's fleet")
    arguments.add_argument("--alone", action="store_true", help="know nothing of the other vehicles of a fleet")
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    heads = (
        "vehicles",
        "baseline",
        *(f"fleets of {n} [%]" for n in (1, 10, 100)),
        "faults named [%]",
    )
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for name in given.worlds:
        for n_learning in given.windows:
            seed = [given.seed, list(WORLDS).index(name), n_learning]
            cases = (0.0, N_VEHICLES * given.fleets), (-given.loss, given.faulty)
            healthy, faulty = (
                simulated(
                    WORLDS[name],
                    n_learning,
                    change,
                    count,
                    [*seed, k],
                    among=WORLDS.get(given.among),
                    alone=given.alone,
                )
                for k, (change, count) in enumerate(cases)
            )
            print(row(f"{name} | {n_learning}", healthy, faulty), flush=True)


def simulated(world, n_learning, change, count, seed, *, among=None, alone=False):
    """Return ln of the e-detector of vehicles at each look, shape (vehicles, looks).

    The scatter of parts and the correlation are those of a fleet, those of a fleet of another world to which each
    vehicle belongs, or those of each vehicle alone. Of a vehicle of which too few windows are alike no baseline is
    learnt; there is another one in its place.
    """
    generator, found, n_found = np.random.default_rng(seed), [], 0
    while n_found < count:
        units, values = drawn(world, n_learning, change, generator)
        learnt = [each for each in baselines(units[:, :n_learning], values[:, :n_learning]) if len(each[0])]
        fleet = learnt
        if among is not None:
            others = [each[:, :n_learning] for each in drawn(among, n_learning, 0.0, generator)]
            fleet = [each for each in baselines(*others) if len(each[0])]
        together = pooled([own for _, baseline in fleet for own in baseline.weights])
        of_fleet, above = np.full((N_VEHICLES, len(LOOKS)), np.nan), ABOVE_ALONE if alone else ABOVE
        for which, baseline in learnt:
            weights = np.broadcast_to(together, baseline.weights.shape)
            if alone or among is not None:
                weights = np.array([pooled([own, *([] if alone else [together])]) for own in baseline.weights])
            own = replace(baseline, weights=weights)
            of_fleet[which] = evidence(own, units[which, n_learning:], values[which, n_learning:], LOOKS, above)
        found.append(of_fleet[np.isfinite(of_fleet[:, 0])])
        n_found += len(found[-1])
    return np.concatenate(found)[:count]


def drawn(world, n_learning, change, generator):
    """Return conditions in units, shape (vehicles, windows, conditions), and ln values, (vehicles, windows, parts)."""
    correlation, unequal, is_beyond = world
    count, n_windows = N_VEHICLES, n_learning + LOOKS[-1]
    alike = np.array([[part.kind == kind for part in PARTS] for kind in KINDS], dtype=float)
    slopes = np.sqrt(OWN) * generator.standard_normal((count, len(CONDITIONS), len(PARTS)))
    slopes += np.sqrt(COMMON)[:, None] * generator.standard_normal((count, len(CONDITIONS), len(KINDS))) @ alike
    scatter = REPORTED * np.exp(unequal * generator.standard_normal((count, 1, len(PARTS))))
    mean = 0.05 * generator.standard_normal((count, 1, len(PARTS)))
    noise = generator.standard_normal((n_windows, count, len(PARTS)))
    for before, now in pairwise(noise):
        now[:] = correlation * before + np.sqrt(1 - correlation**2) * now
    units = generator.uniform(-1, 1, (count, n_windows, len(CONDITIONS)))
    units[:, n_learning:] += 1.5 * is_beyond
    values = mean + units @ slopes + scatter * noise.swapaxes(0, 1)
    values[:, n_learning + ONSET :, 0] += np.log1p(change)
    return units, values


def row(heading, healthy, faulty):
    """Return the share of fleets with a healthy vehicle on the list, with its exact interval, and the power.

    All vehicles of these fleets are healthy, so that this is the expected share of healthy ones on the list.
    """
    shares = []
    for size in (1, 10, N_VEHICLES):
        fleets = healthy[: len(healthy) // size * size].reshape(-1, size, len(LOOKS)) - np.log(LOOKS[-1])
        # A list may have every vehicle of the fleet: only fleets in which one is above 1 / rate need be looked at.
        named = sum(
            any(false_discoveries(fleet[:, look], rate=RATE) for look in range(len(LOOKS)))
            for fleet in fleets[np.any(fleets >= -np.log(RATE), axis=(1, 2))]
        )
        interval = binomtest(int(named), len(fleets)).proportion_ci()
        low, high = 100 * interval.low, 100 * interval.high
        shares.append(f"{named} of {len(fleets)}: {100 * named / len(fleets):.2f} ({low:.2f} to {high:.2f})")
    named = faulty >= np.log(N_VEHICLES * 48 * PATIENCE_DAYS / RATE)
    power = ", ".join(f"{100 * value:.0f}" for value in np.mean(named, axis=0))
    return f"| {heading} | {' | '.join(shares)} | {power} |"


if __name__ == "__main__":
    main()
