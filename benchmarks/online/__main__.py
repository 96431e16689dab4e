"""The monitor of a fleet: CPU and memory of a vehicle, latency, catch-up, a slow one, a soak, the box, and delivery.

Run as `python benchmarks/online WHAT..`.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from measuring import ONE_THREAD, print_circumstances

os.environ.update(ONE_THREAD)

from cpu_time import measure_cpu, measure_station
from delivery import measure_box, measure_delivery
from memory_use import measure_memory, memory_of
from response import measure_catch_up, measure_latency
from slow import measure_slow
from soak import measure_soak

MEASUREMENTS = {
    "cpu": measure_cpu,
    "station": measure_station,
    "memory": measure_memory,
    "latency": measure_latency,
    "catch-up": measure_catch_up,
    "slow": measure_slow,
    "soak": measure_soak,
    "box": measure_box,
    "delivery": measure_delivery,
}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument(
        "what",
        nargs="*",
        metavar="WHAT",
        help=f"of {', '.join(MEASUREMENTS)}; without: all of them (station is part of cpu)",
    )
    arguments.add_argument("--windows", type=int, default=9, help="of the CPU and the latency")
    arguments.add_argument("--live", type=int, nargs="+", help="vehicles of the station's load; without: 200 1000 2000")
    arguments.add_argument("--quick", action="store_true", help="fewer windows and vehicles of the CPU and the memory")
    arguments.add_argument("--frame-seconds", type=float, default=10.0, help="of the CPU and the memory")
    arguments.add_argument("--station-seconds", type=float, default=100.0, help="driving of the station's load")
    arguments.add_argument("--recorded", type=Path, help="file of outcomes that the station's load repeats")
    arguments.add_argument("--soak-minutes", type=float, default=2.0)
    arguments.add_argument("--soak-vehicles", type=int, default=2)
    arguments.add_argument("--seconds-per-job", type=float, default=180.0, help="of the slow vehicle")
    arguments.add_argument("--workers", type=int, default=2, help="of the soak")
    arguments.add_argument("--memory-of", nargs=3, help=argparse.SUPPRESS)
    given = arguments.parse_args()
    if given.memory_of:
        n_vehicles, seconds, file = given.memory_of
        print(memory_of(int(n_vehicles), int(seconds), Path(file)))
        return
    unknown = sorted(set(given.what) - MEASUREMENTS.keys())
    if unknown:
        arguments.error(f"{unknown[0]} is none of {', '.join(MEASUREMENTS)}")
    print_circumstances(peers=())
    for name in given.what or [name for name in MEASUREMENTS if name != "station"]:
        with tempfile.TemporaryDirectory() as folder:
            MEASUREMENTS[name](given, Path(folder))


if __name__ == "__main__":
    main()
