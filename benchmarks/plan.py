"""What a plan predicts, beside simulated drives: `python -m benchmarks.plan [--drives N] [--lives N]`.

With `--drives`, for each kit of sensors: the standard deviations that the fits report (median over the drives), of
values and of ratios of left to right, and the scatter of these ratios, over those predicted, as median and range over
the components that the plan calls determined (their number is in brackets), the scatter over those whose ratio is
predicted to 10 % or better. Beyond, the nominal truth is where the prior holds the estimate, and scatters less.

With `--lives`, the time until a loss is named, for kits, parts and losses that take more than one window by the plan.
Each life is twelve windows to learn from, then windows with the loss until the first finding is the part. Columns:
predicted median, median of the lives with its 95 % interval (by ranks), and lives that named another part first.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import scipy.stats
from benchmarks.measuring import print_table

from sprung.diagnosis import Observation, diagnose, learn, observe_window
from sprung.kits import kit_of, plan
from sprung.likelihood import fit_corners
from sprung.likelihood.expected import ExpectedDrive, ExpectedFit
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import Fault, Vehicle, parse_fault, read_vehicle

KITS = ("four", "three", "two", "one", "imu")
#: The simulated drives: class C, no braking or cornering, noise 34 dB below the motion.
DRIVE = RoadDrive(duration=600.0, sampling_rate=100.0, speed=(6.0, 20.0), road=RoadConditions("C"), snr=50.0)
#: Largest predicted standard deviation of a ratio of left to right whose scatter is compared.
KNOWN = 0.1
EXPECTED = ExpectedDrive(speed=(6.0, 20.0), roughness=256e-6, sampling_rate=100.0, driving=1e-5)


def kit(name: str) -> Vehicle:
    """Return the car with a kit; one: the front-left accelerometer."""
    car = read_vehicle("zafira")
    if name != "one":
        return kit_of(car, name)
    return car.model_copy(update={"sensor": kit_of(car, "four").sensor[:1]})


def fitted(name: str, minutes: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the estimates and their covariance from one drive."""
    vehicle, drive = kit(name), replace(DRIVE, duration=60 * minutes)
    fit = fit_corners(simulate_drive(vehicle, drive, seed=seed).recording, vehicle)
    rows = fit.model.rows("components")
    return fit.log_ratios, fit.covariance[np.ix_(rows, rows)]


#: Kits, parts and losses of the lives, and their windows [min] and number of windows to learn from.
LIVES = (
    ("four", "front_left.spring", 0.05),
    ("four", "rear_left.damper", 0.05),
    ("two", "front_left.spring", 0.1),
    ("two", "front_left.damper", 0.1),
    ("two", "front_left.tyre", 0.05),
    ("two", "rear_left.damper", 0.1),
)
WINDOW, LEARNING = 5.0, 12
#: Longest life that is followed, over the predicted time.
PATIENCE = 4.0


def observed(vehicle: Vehicle, seed: Sequence[int], faults: tuple[Fault, ...] = ()) -> Observation:
    """Return a window of a drive."""
    drive = replace(DRIVE, duration=60 * WINDOW, faults=faults)
    return observe_window(simulate_drive(vehicle, drive, seed=list(seed)).recording, vehicle, time=600.0 * seed[-1])


def life(name: str, part: str, loss: float, predicted: float, seed: int) -> tuple[float, bool]:
    """Return the minutes until the part is named (infinite: not in time), and whether another was named before."""
    vehicle, fault = kit(name), (parse_fault(f"{part}={-loss}"),)
    baseline = learn([observed(vehicle, (seed, number)) for number in range(LEARNING)])
    windows: list[Observation] = []
    was_wrong = False
    for number in range(1, int(np.ceil(PATIENCE * predicted / WINDOW)) + 1):
        windows.append(observed(vehicle, (seed, 100 + number), fault))
        findings = diagnose(windows, baseline, windows_per_day=24 * 60 / WINDOW).findings
        if findings and f"{findings[0].corner}.{findings[0].component}" == part:
            return number * WINDOW, was_wrong
        was_wrong |= bool(findings)
    return float("inf"), was_wrong


def print_lives(n_lives: int, jobs: int) -> None:
    """Print a row for each kit, part and loss."""
    rows = []
    with ProcessPoolExecutor(jobs) as pool:
        for name, part, loss in LIVES:
            planned = {
                str(each.component): each
                for each in plan(kit(name), drive=replace(EXPECTED, minutes=WINDOW)).components
            }
            predicted = planned[part].minutes[loss]
            if predicted is None:
                raise ValueError(f"{name}: {part} is not found in time")
            lives = list(pool.map(partial(life, name, part, loss, predicted), range(n_lives)))
            times = np.sort([time for time, _ in lives])
            low, high = (int(rank) for rank in scipy.stats.binom.interval(0.95, n_lives, 0.5))
            interval = f"{times[low]:.0f} to {times[min(high, n_lives - 1)]:.0f}"
            median = float(np.median(times))
            wrong = sum(was_wrong for _, was_wrong in lives)
            row = [name, part, f"{100 * loss:.0f}", f"{predicted:.0f}", f"{median:.0f}", interval]
            rows.append([*row, f"{median / predicted:.2f}", f"{wrong} of {n_lives}"])
            print(*rows[-1], file=sys.stderr, flush=True)
    heads = ["kit", "part", "loss [%]", "predicted [min]", "lives [min]", "95 %", "ratio", "another first"]
    print_table(f"`python -m benchmarks.plan --lives {n_lives}`, windows of {WINDOW:g} min", heads, rows)


def main() -> None:
    """Print a row for each kit."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--drives", type=int, default=200)
    arguments.add_argument("--kits", default=",".join(KITS))
    arguments.add_argument("--minutes", type=float, default=10.0)
    arguments.add_argument("--jobs", type=int, default=1)
    arguments.add_argument("--lives", type=int, default=0)
    given = arguments.parse_args()
    if given.lives:
        print_lives(given.lives, given.jobs)
        return
    rows = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for name in given.kits.split(","):
            planned = plan(kit(name), drive=replace(EXPECTED, minutes=given.minutes)).components
            parts = tuple(each.component for each in planned)
            results = list(pool.map(partial(fitted, name, given.minutes), range(given.drives)))
            reported = [ExpectedFit(parts, covariance, 0.7) for _, covariance in results]
            stds = np.median([list(each.std.values()) for each in reported], axis=0) / [each.std for each in planned]
            contrasts = np.median([list(each.contrast_std.values()) for each in reported], axis=0)
            predicted = np.array([each.contrast_std for each in planned])
            others = [parts.index(replace(part, corner=_other(part.corner))) for part in parts]
            values = np.array([values for values, _ in results])
            errors = np.sqrt(np.mean((values - values[:, others]) ** 2, axis=0))
            determined = np.array([each.is_identifiable for each in planned])
            known = determined & (predicted <= KNOWN)
            ratios = (
                stds[determined],
                (contrasts / predicted)[determined & determined[others]],
                (errors / predicted)[known],
            )
            rows.append([f"{name} ({determined.sum()})", *map(_range, ratios)])
    print_table(
        f"`python -m benchmarks.plan --drives {given.drives} --minutes {given.minutes:g} --kits {given.kits}`",
        ["kit", "reported std", "reported std, left over right", "error, left over right"],
        rows,
    )


def _other(corner: str) -> str:
    return corner.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")


def _range(ratios: np.ndarray) -> str:
    if not ratios.size:
        return "none"
    return f"{np.median(ratios):.2f} ({ratios.min():.2f} to {ratios.max():.2f})"


if __name__ == "__main__":
    main()
