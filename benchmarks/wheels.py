"""Run-out of every wheel from drives: `python -m benchmarks.wheels [--drives N] [NAMES]`.

Wheels of a car (four accelerometers on the body, ten minutes on roads of class A to C) and of rail vehicles (sensors of
the shipped files, five minutes on tracks of ERRI B176 low and high, with and without joints) have 0.3 to 1.7 times the
usual run-out, and radii that differ by 0.2 %. Columns: drives whose worst wheel has the largest estimate, or one within
its interval of that; errors of the worst wheel and of all, over the worst (RMS); 95 % intervals that hold; largest
model error.
"""

import argparse
import os
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.measuring import print_table

from sprung.likelihood import fit_corners, run_out
from sprung.modal import INTERVAL_95
from sprung.simulation import Deviations, RailDrive, RoadConditions, RoadDrive, WheelOrders, simulate_drive
from sprung.vehicles import read_vehicle

NAMES = ("zafira", "y25", "metro", "coach")


def drive(name, seed):
    """Return the settings of a drive: what differs between the wheels is that of the vehicle's individual."""
    size = (1e-4, 3e-4, 1e-3)[seed % 3]
    if name == "zafira":
        orders, speeds = WheelOrders(run_out=(3 * size, size)), (12.0, 25.0)
        road = RoadConditions("ABC"[seed % 3])
        return RoadDrive(duration=600.0, sampling_rate=100.0, speed=speeds, snr=50.0, road=road, wheel_orders=orders)
    orders, quality = WheelOrders(run_out=(size, size / 2), radius=0.46), ("good", "bad")[seed % 2]
    return RailDrive(
        duration=300.0, sampling_rate=200.0, snr=50.0, quality=quality, welded=seed % 4 > 1, wheel_orders=orders
    )


def case(name, seed):
    """Return true and estimated run-out of all wheels, their deviations, and the model error."""
    vehicle = read_vehicle(name)
    vehicle = vehicle if vehicle.kind == "road" else vehicle.model_copy(update={"kind": "rail"})
    settings = replace(drive(name, seed), deviations=Deviations(individual=seed))
    simulated = simulate_drive(vehicle, settings, seed=seed)
    fit = fit_corners(simulated.recording, vehicle)
    lines = simulated.truth["conditions"]["wheel_orders"].values()
    true = np.array([np.sqrt(sum(line["amplitude"] ** 2 for line in each) / 2) for each in lines])
    found = run_out(fit)
    return true, None if found is None else (found.values, found.stds), fit.model_error


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=NAMES, help="vehicles")
    parser.add_argument("--drives", type=int, default=12, help="drives of each vehicle")
    given = parser.parse_args()
    rows = []
    for name in given.names:
        cases = [case(name, seed) for seed in range(given.drives)]
        known = [(true, *found) for true, found, _ in cases if found is not None]
        right = within = 0
        of_worst, of_all, held = [], [], []
        for true, values, stds in known:
            worst, largest = int(np.argmax(true)), int(np.argmax(values))
            right += worst == largest
            within += values[worst] + INTERVAL_95 * stds[worst] >= values[largest]
            of_worst.append(values[worst] / true[worst] - 1)
            of_all += ((values - true) / true[worst]).tolist()
            held += (np.abs(values - true) < INTERVAL_95 * stds).tolist()
        rms = [100 * float(np.sqrt(np.mean(np.square(each)))) for each in (of_worst, of_all)]
        rows.append(
            (
                name,
                f"{len(known)} of {given.drives}",
                f"{right}, {within}",
                *(f"{value:.0f} %" for value in rms),
                f"{100 * np.mean(held):.0f} % of {len(held)}",
                f"{100 * max(error for _, _, error in cases):.0f} %",
            )
        )
    columns = ("vehicle", "with lines", "worst wheel", "its error", "errors of all", "intervals", "model error")
    print_table("Run-out of the wheels", columns, rows)


if __name__ == "__main__":
    main()
