"""Windows per second of a run on Spark beside a plain pool of processes on the same windows, with one core and two.

    python benchmarks/fleet/speed.py --vehicles 20 --windows 10

Prints a table. Both analyse every window with `sprung.fleet.jobs.analysis.analyse`; the run also plans, commits and
assesses vehicles, and starts Java, which is stated apart.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from make import make

from sprung.fleet.jobs.analysis import WindowSettings, Work, analyse
from sprung.fleet.lake import Lake
from sprung.vehicles import read_vehicle, vehicle_text

ONE_RUN = """
import json, sys, time
begin = time.perf_counter()
from sprung.fleet.jobs import FleetSettings, Results, run, spark_session
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.lake import Lake
folder, results, cores, learn = sys.argv[1:]
session = spark_session(f"local[{cores}]")
session.range(1).count()
ready = time.perf_counter()
settings = FleetSettings(steps=("baseline", "diagnose"), assessment=AssessmentSettings(learning_windows=int(learn)))
marks = []
done = run(session, Lake(f"{folder}/lake"), f"{folder}/vehicles", Results(results), settings=settings,
           report=lambda step, share: marks.append((time.perf_counter(), step)))
assessing = next(moment for moment, step in marks if step == "learning baselines")
whole = time.perf_counter()
again = run(session, Lake(f"{folder}/lake"), f"{folder}/vehicles", Results(results), settings=settings)
print(json.dumps({"start": ready - begin, "windows": assessing - ready, "vehicles": whole - assessing,
                  "again": again.elapsed, "cpu": sum(done.analysis_time.values())}))
"""


def analysed(row: dict[str, Any], text: str) -> float:
    """Analyse a window, and return the processor time."""
    _, seconds = analyse(row, Work(text, "file", steps=("observe",), has_segments=True), WindowSettings())
    return sum(seconds.values())


def pool_seconds(rows: list[dict[str, Any]], text: str, cores: int) -> float:
    """Time of a pool of processes that are up already."""
    with ProcessPoolExecutor(cores) as pool:
        list(pool.map(analysed, rows[: 2 * cores], [text] * 2 * cores))
        begin = time.perf_counter()
        list(pool.map(analysed, rows, [text] * len(rows), chunksize=4))
        return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--windows", type=int, default=10)
    parser.add_argument("--minutes", type=float, default=2.0)
    chosen = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lake = make(folder, vehicles=chosen.vehicles, windows=chosen.windows, minutes=chosen.minutes, every=5)
        rows = Lake(lake.location).table.rows().to_pylist()
        text = vehicle_text(read_vehicle("zafira"))
        print(f"{len(rows)} windows of {chosen.minutes:g} min, {chosen.vehicles} vehicles\n")
        print("| cores | pool [windows/s] | run [windows/s] | overhead | vehicles [s] | again [s] | start [s] |")
        print("|---|---|---|---|---|---|---|")
        for cores in (1, 2):
            of_pool = pool_seconds(rows, text, cores)
            arguments = [str(folder), str(folder / f"results-{cores}"), str(cores), str(max(2, chosen.windows // 2))]
            done = subprocess.run(
                [sys.executable, "-c", ONE_RUN, *arguments], stdout=subprocess.PIPE, text=True, check=True
            )
            found = json.loads(done.stdout.splitlines()[-1])
            rates = len(rows) / of_pool, len(rows) / found["windows"]
            print(
                f"| {cores} | {rates[0]:.2f} | {rates[1]:.2f} | {100 * (rates[0] / rates[1] - 1):.0f} % | "
                f"{found['vehicles']:.1f} | {found['again']:.1f} | {found['start']:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
