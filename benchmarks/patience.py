"""False names among those of a fleet, and faults found: vehicles from the state model of the change test.

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
RATE = 0.05
#: Serial correlation, logarithmic standard deviation of the scatter of parts, whether conditions leave those met.
WORLDS = {
    "as the model says": (0.0, 0.0, False),
    "serial correlation of 0.3": (0.3, 0.0, False),
    "serial correlation of 0.6": (0.6, 0.0, False),
    "unequal scatter of parts": (0.0, 0.4, False),
    "conditions beyond the baseline's": (0.0, 0.0, True),
    "all three, 0.3": (0.3, 0.4, True),
    "all three, 0.6": (0.6, 0.4, True),
}


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--vehicles", type=int, default=1000, help="healthy vehicles simulated per row")
    arguments.add_argument("--jobs", type=int, default=1)
    arguments.add_argument("--worlds", nargs="*", default=list(WORLDS))
    given = arguments.parse_args()
    print(f"{given.vehicles} healthy and {given.vehicles // 5} faulty vehicles per row")
    print("| vehicles | baseline | fleets of 1 [%] | fleets of 10 [%] | fleets of 100 [%] | faults named [%] |")
    print("|---|---|---|---|---|---|")
    with ProcessPoolExecutor(given.jobs) as pool:
        for name in given.worlds:
            for n_learning in (6, 12):
                simulate = partial(evidence, WORLDS[name], n_learning)
                healthy = list(pool.map(simulate, [0.0] * given.vehicles, range(given.vehicles), chunksize=20))
                seeds = range(10**6, 10**6 + given.vehicles // 5)
                faulty = list(pool.map(simulate, [CHANGE] * len(seeds), seeds, chunksize=20))
                row(name, n_learning, healthy, faulty)


def evidence(world, n_learning, change, seed):
    """Return ln of the e-detector of a simulated vehicle at each look."""
    import numpy as np

    import sprung
    from sprung.diagnosis.baseline import CONDITIONS, slope_covariances
    from sprung.diagnosis.changes import ChangeDetector
    from sprung.diagnosis.ratios import lasting_evidence

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
    windows, hypotheses = detector._compared, detector._hypotheses
    return [lasting_evidence(windows[:look], detector.baseline, hypotheses) for look in LOOKS]


def row(name, n_learning, healthy, faulty):
    """Print the expected share of healthy vehicles on the list of fleets, with its interval, and the power.

    Of n vehicles the one on a list of one has at least n windows / rate; longer lists divide by their length what they
    need and what a name counts.
    """
    import numpy as np
    from scipy.stats import binomtest

    from sprung.diagnosis.changes import PATIENCE_DAYS

    largest = np.max(healthy, axis=1)
    shares = []
    for size in (1, 10, N_VEHICLES):
        found = binomtest(int(np.sum(largest >= np.log(size * LOOKS[-1] / RATE))), len(largest))
        interval = found.proportion_ci()
        share, low, high = (100 * size * each for each in (found.statistic, interval.low, interval.high))
        shares.append(f"{share:.1f} ({low:.1f} to {high:.1f})")
    named = np.array(faulty) >= np.log(N_VEHICLES * 48 * PATIENCE_DAYS / RATE)
    power = ", ".join(f"{100 * value:.0f}" for value in np.mean(named, axis=0))
    print(f"| {name} | {n_learning} | {' | '.join(shares)} | {power} |", flush=True)


if __name__ == "__main__":
    main()
