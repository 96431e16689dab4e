"""Time of ten minutes of a nonlinear drive with seven degrees of freedom, and of its linear limit; one thread."""

import argparse
import os
import subprocess
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--repeats", type=int, default=5)
    arguments.add_argument("--one", choices=["linear", "nonlinear", "road"], help="run one case and print its seconds")
    given = arguments.parse_args()
    if given.one:
        print(measured(given.one))
        return
    print("| case | first call in a process, s | second call, s |\n|---|---|---|")
    for case in ("road", "linear", "nonlinear"):
        first, second = [], []
        for _ in range(given.repeats):
            output = subprocess.run(
                [sys.executable, __file__, "--one", case], capture_output=True, text=True, check=True
            )
            times = output.stdout.split()
            first.append(float(times[0]))
            second.append(float(times[1]))
        print(f"| {case} | {sorted(first)[given.repeats // 2]:.2f} | {sorted(second)[given.repeats // 2]:.2f} |")


def measured(case):
    """Return the seconds of the first and the second call, without imports."""
    import numpy as np

    from sprung.excitation import Potholes, SurfaceMotion, random_speed, road_class
    from sprung.simulation import REALISTIC_FORCE_LAWS, simulate, simulate_nonlinear
    from sprung.vehicles import read_vehicle, structure

    car = structure(read_vehicle("zafira"))
    speed = random_speed(600.0, low=5.5, high=20.0, n_stops=2, generator=np.random.default_rng(1))
    road = SurfaceMotion(road_class("C"), (1.22, -1.58), speed, obstacles=(Potholes(),))
    options = {"duration": 600.0, "sampling_rate": 200.0, "seed": 1}
    calls = {
        "road": lambda: road.samples(600_000, sampling_rate=1000.0, generator=np.random.default_rng(1)),
        "linear": lambda: simulate(car, road, **options),
        "nonlinear": lambda: simulate_nonlinear(car, road, force_laws=REALISTIC_FORCE_LAWS, **options),
    }
    times = []
    for _ in range(2):
        begin = time.perf_counter()
        calls[case]()
        times.append(time.perf_counter() - begin)
    return f"{times[0]:.3f} {times[1]:.3f}"


if __name__ == "__main__":
    main()
