"""False names among those of a fleet, and faults found: fleets of 100 vehicles from the state model of the change test.

Baselines of 6 and 12 windows; parts of unequal scatter, serial correlation, conditions beyond those of the baseline.
Somebody looks after 6, 12, 24 and 48 windows and stops at the first look that names a healthy vehicle: the worst for
the promise, which is proportional to the patience; here this is the simulated time. Power is that over a year.
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

LOOKS = (6, 12, 24, 48)
ONSET = 3
CHANGE = -0.05
N_VEHICLES = 100
N_FAULTY = 5
RATE = 0.05
#: Serial correlation, logarithmic standard deviation of the scatter of parts, whether conditions leave those met.
WORLDS = {
    "as the model says": (0.0, 0.0, False),
    "unequal scatter of parts": (0.0, 0.4, False),
    "serial correlation of 0.3": (0.3, 0.0, False),
    "conditions beyond the baseline's": (0.0, 0.0, True),
    "all three": (0.3, 0.4, True),
}


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--vehicles", type=int, default=1000, help="healthy vehicles simulated per row")
    arguments.add_argument("--fleets", type=int, default=10000, help="fleets of 100 drawn from them")
    arguments.add_argument("--jobs", type=int, default=1)
    given = arguments.parse_args()
    print(f"{given.vehicles} healthy and {given.vehicles // 5} faulty vehicles per row, {given.fleets} fleets of them")
    print("| vehicles | baseline | rule | false share x patience / time [%] | 95 % | faults named at the looks [%] |")
    print("|---|---|---|---|---|---|")
    with ProcessPoolExecutor(given.jobs) as pool:
        for name, world in WORLDS.items():
            for n_learning in (6, 12):
                healthy = list(pool.map(partial(evidence, world, n_learning, 0.0), range(given.vehicles), chunksize=20))
                seeds = range(10**6, 10**6 + given.vehicles // 5)
                faulty = list(pool.map(partial(evidence, world, n_learning, CHANGE), seeds, chunksize=20))
                rows(name, n_learning, healthy, faulty, given.fleets)


def evidence(world, n_learning, change, seed):
    """Return ln of the e-detector of a simulated vehicle at each look."""
    import numpy as np

    import sprung
    from sprung.diagnosis.baseline import CONDITIONS, slope_covariances
    from sprung.diagnosis.changes import ChangeDetector
    from sprung.diagnosis.ratios import evidence_of

    correlation, unequal, is_beyond = world
    generator = np.random.default_rng([seed, n_learning])
    parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    names = ("payload", "roughness", "speed", "temperature")
    middle = dict(zip(names, (100.0, 1e-5, 20.0, 290.0), strict=True))
    slopes = [generator.multivariate_normal(np.zeros(len(parts)), c) for c in slope_covariances(parts)[: len(names)]]
    scatter = 0.02 * np.exp(unequal * generator.standard_normal(len(parts)))
    mean, noise = 0.05 * generator.standard_normal(len(parts)), np.zeros(len(parts))
    windows = []
    for k in range(-n_learning, LOOKS[-1]):
        fresh = generator.standard_normal(len(parts))
        noise = fresh if not windows else correlation * noise + np.sqrt(1 - correlation**2) * fresh
        units = generator.uniform(-1, 1, len(names)) + (1.5 if is_beyond and k >= 0 else 0.0)
        values = mean + units @ np.array(slopes) + scatter * noise
        values[0] += np.log1p(change) * (k >= ONSET)
        met = {n: middle[n] * np.exp(u * CONDITIONS[n]) if n == "roughness" else middle[n] + u * CONDITIONS[n]
               for n, u in zip(names, units, strict=True)}  # fmt: skip
        covariance = 0.02**2 * np.eye(len(parts))
        windows.append(sprung.Observation(600.0 * (k + n_learning), parts, values, covariance, met, {}, ()))
    detector = ChangeDetector(sprung.learn(windows[:n_learning]))
    for window in windows[n_learning:]:
        detector._take(window)
    return [evidence_of(detector._table_of(look), detector._hypotheses) for look in LOOKS]


def rows(name, n_learning, healthy, faulty, n_fleets):
    """Print the promise and the power of the former rule, e-values at one look, and of e-d-BH over a patience."""
    import numpy as np

    from sprung.diagnosis.changes import PATIENCE_DAYS, false_discoveries

    looks = np.array(LOOKS)
    generator = np.random.default_rng(1)
    of_healthy, of_faulty = np.array(healthy), np.array(faulty)
    n_healthy = N_VEHICLES - N_FAULTY
    rules = {"e-BH at one look": (looks, looks), "e-d-BH": (looks[-1], 48 * PATIENCE_DAYS)}
    shares, times, found = ({rule: [] for rule in rules} for _ in range(3))
    for _ in range(n_fleets):
        some = of_healthy[generator.integers(len(of_healthy), size=n_healthy)]
        fleet = np.vstack([of_faulty[generator.integers(len(of_faulty), size=N_FAULTY)], some])
        for rule, (simulated, real) in rules.items():
            named = [np.array(false_discoveries(at, rate=RATE)) for at in (fleet - np.log(simulated)).T]
            false = [np.sum(at >= N_FAULTY) / max(len(at), 1) for at in named]
            stop = next((k for k, share in enumerate(false) if share), len(LOOKS) - 1)
            shares[rule].append(false[stop])
            times[rule].append(LOOKS[stop])
            over = [np.array(false_discoveries(at, rate=RATE)) for at in (fleet - np.log(real)).T]
            found[rule].append([np.sum(at < N_FAULTY) / N_FAULTY for at in over])
    for rule in rules:
        scale = LOOKS[-1] / np.mean(times[rule])
        # Vehicles are drawn again and again: the interval is that of their number, by fleets of disjoint vehicles.
        half = 1.96 * np.std(shares[rule]) / np.sqrt(len(of_healthy) / n_healthy)
        mean = np.mean(shares[rule])
        low, high = (100 * scale * max(mean + side * half, 0) for side in (-1, 1))
        power = ", ".join(f"{100 * value:.0f}" for value in np.mean(found[rule], axis=0))
        print(
            f"| {name} | {n_learning} | {rule} | {100 * scale * mean:.2f} | {low:.2f} to {high:.2f} | {power} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
