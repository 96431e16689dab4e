"""Which effect makes a load on the left read as stiffer left springs: the car with and without it, effect by effect.

    python -m benchmarks.multibody.load
    python -m benchmarks.multibody.load --stops

Drives of five minutes on road C with the driver alone, and with a passenger behind him and 120 kg on the left, fitted
with the file of the data sheet: change of ln(left / right) of the springs of each axle from the one to the other.

With `--stops`: how the rear-right spring reads that is weak or whose bump stop is farther away, against the healthy one
in the same drive, in ordinary drives and with 180 kg over the rear axle; calibrated file, two drives each.
"""

import argparse
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.multibody.__main__ import (
    KINDS,
    Study,
    calibrated_file,
    observed,
    ordinary,
    recording,
    seat,
    seats,
    sheet_file,
    unmet,
)
from benchmarks.multibody.design import DESIGNS, Effects, Faults, Rider
from benchmarks.multibody.drive import Drive

from sprung.likelihood import CornerFit
from sprung.likelihood.fitting import fit_windows
from sprung.vehicles.window import window_of

EVERY = Effects()
CASES = {
    "all": EVERY,
    "no bump stops": replace(EVERY, bump_stops=False),
    "no side forces of tyres, no curves": replace(EVERY, side_forces=False),
    "none of these": replace(EVERY, side_forces=False, bump_stops=False),
}
SEEDS = (500, 501)
CORNER = "rear_right"
#: Factors on the rate of its spring and on the travel to its bump stop, which is 60 mm.
STOPS = {
    "weak by 20 %": (0.8, 1.0),
    "weak by 20 %, stop 6 mm farther away": (0.8, 1.1),
    "weak by 20 %, stop 12 mm farther away": (0.8, 1.2),
    "healthy, stop 6 mm farther away": (1.0, 1.1),
}


def fitted(study: Study, seed: int, *, is_loaded: bool) -> CornerFit:
    """Return the fit to a drive with the driver alone, or with a load on the left."""
    driver, _, behind, _ = seats(study.design)
    load = (seat(75, *behind), Rider(120.0, -0.3, 0.45)) if is_loaded else ()
    drive = Drive(duration=300.0, road="C", speed=(8.0, 22.0), riders=(seat(75, *driver), *load))
    return fit_windows([window_of(recording(study, drive, seed), sheet_file(study.design))])


def left_over_right(fit: CornerFit, axle: str) -> float:
    """Return ln(left / right) of the springs of an axle."""
    values = dict(zip(map(str, fit.components), fit.log_ratios.tolist(), strict=True))
    return values[f"{axle}_left.spring"] - values[f"{axle}_right.spring"]


def stops(study: Study) -> None:
    """Print how a spring reads that is weak or has another bump stop."""
    vehicle = calibrated_file(study)
    print("| rear-right spring | against the healthy one, ordinary drives, % | 180 kg over the rear axle, % |")
    print("|---|---|---|")
    for name, (rate, travel) in STOPS.items():
        faults = Faults({f"{CORNER}.rate": rate, f"{CORNER}.stop": travel})
        cells = []
        for drive_of, numbers in ((ordinary, (0, 1)), (unmet, (2, 2 + KINDS))):
            readings = []
            for seed, number in enumerate(numbers, start=900):
                drive = drive_of(study.design, number)
                pair = (observed(study, vehicle, each, seed, 0.0) for each in (replace(drive, faults=faults), drive))
                changed, healthy = (dict(zip(map(str, one.components), one.log_ratios, strict=True)) for one in pair)
                spring = f"{CORNER}.spring"
                readings.append(f"{100 * np.expm1(changed[spring] - healthy[spring]):+.0f}")
            cells.append(", ".join(readings))
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path.home() / ".cache" / "sprung-multibody")
    parser.add_argument("--stops", action="store_true", help="a weak spring, and another bump stop, under a load")
    given = parser.parse_args()
    if given.stops:
        stops(Study(DESIGNS["car"], given.folder))
        return
    print("| effects | front springs, left over right, % | rear | model error without and with the load |")
    print("|---|---|---|---|")
    for name, effects in CASES.items():
        study = Study(DESIGNS["car"], given.folder, effects)
        pairs = [[fitted(study, seed, is_loaded=is_loaded) for is_loaded in (False, True)] for seed in SEEDS]
        changes = [
            ", ".join(
                f"{100 * (left_over_right(after, axle) - left_over_right(before, axle)):+.0f}"
                for before, after in pairs
            )
            for axle in ("front", "rear")
        ]
        errors = ", ".join(f"{np.mean([fit.model_error for fit in column]):.2f}" for column in zip(*pairs, strict=True))
        print(f"| {name} | {' | '.join(changes)} | {errors} |", flush=True)


if __name__ == "__main__":
    main()
