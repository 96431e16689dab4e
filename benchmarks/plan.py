"""Precision that a plan predicts, beside that of fits to simulated drives: `python -m benchmarks.plan [--drives N]`.

For each kit of sensors: the standard deviations that the fits report (median over the drives) and the scatter of the
ratios of left to right, over those predicted, as median and range over the components.
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.measuring import print_table

from sprung.kits import kit_of
from sprung.likelihood import fit_corners
from sprung.likelihood.expected import ExpectedDrive, ExpectedFit, expected_fit
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import Vehicle, read_vehicle

KITS = ("four", "three", "two", "one", "imu")
#: The simulated drives: class C, no braking or cornering, noise 34 dB below the motion.
DRIVE = RoadDrive(duration=600.0, sampling_rate=100.0, speed=(6.0, 20.0), road=RoadConditions("C"), snr=50.0)
EXPECTED = ExpectedDrive(speed=(6.0, 20.0), roughness=256e-6, sampling_rate=100.0, driving=1e-5)


def kit(name: str) -> Vehicle:
    """Return the car with a kit; one: the front-left accelerometer."""
    car = read_vehicle("zafira")
    if name != "one":
        return kit_of(car, name)
    return car.model_copy(update={"sensor": kit_of(car, "four").sensor[:1]})


def fitted(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the estimates and their covariance from one drive."""
    vehicle = kit(name)
    fit = fit_corners(simulate_drive(vehicle, DRIVE, seed=seed).recording, vehicle)
    rows = fit.model.rows("components")
    return fit.log_ratios, fit.covariance[np.ix_(rows, rows)]


def main() -> None:
    """Print a row for each kit."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--drives", type=int, default=200)
    arguments.add_argument("--jobs", type=int, default=1)
    given = arguments.parse_args()
    rows = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for name in KITS:
            expected = expected_fit(kit(name), EXPECTED)
            results = list(pool.map(partial(fitted, name), range(given.drives)))
            reported = [ExpectedFit(expected.components, covariance, 0.7) for _, covariance in results]
            stds = np.median([list(each.std.values()) for each in reported], axis=0) / list(expected.std.values())
            contrasts = np.median([list(each.contrast_std.values()) for each in reported], axis=0)
            predicted = np.array(list(expected.contrast_std.values()))
            index = {part: row for row, part in enumerate(expected.components)}
            others = [index[type(part)(_other(part.corner), part.kind)] for part in expected.contrast_std]
            values = np.array([values for values, _ in results])
            errors = np.sqrt(np.mean((values - values[:, others]) ** 2, axis=0))
            rows.append([name, *(_range(each) for each in (stds, contrasts / predicted, errors / predicted))])
    print_table(
        f"`python -m benchmarks.plan --drives {given.drives}`",
        ["kit", "reported std", "reported std, left over right", "error, left over right"],
        rows,
    )


def _other(corner: str) -> str:
    return corner.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")


def _range(ratios: np.ndarray) -> str:
    return f"{np.median(ratios):.2f} ({ratios.min():.2f} to {ratios.max():.2f})"


if __name__ == "__main__":
    main()
