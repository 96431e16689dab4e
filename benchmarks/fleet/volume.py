"""What a run moves and keeps when a fleet grows: bytes to the driver and between tasks, memory, files of the tables.

    python benchmarks/fleet/volume.py --vehicles 50 1000 --windows 20
    python benchmarks/fleet/volume.py --vehicles 20 --windows 40 160 --more 1

Prints a table with a column for each size of the fleet and its history. With `--more`, the columns are of a second run,
when each vehicle has some windows more. Bytes are those of Spark's own log of events.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import psutil

sys.path.insert(0, str(Path(__file__).parent))

from make import make

from sprung.fleet.jobs import Results

ONE_RUN = """
import json, sys
from sprung.fleet.jobs import FleetSettings, Results, run, spark_session
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.lake import Lake
folder, learn, steps = sys.argv[1:]
session = spark_session("local[2]", settings={
    "spark.eventLog.enabled": "true", "spark.eventLog.dir": f"file:{folder}/events", "spark.eventLog.compress": "false",
    "spark.driver.memory": "2g"})
settings = FleetSettings(steps=tuple(steps.split(",")), assessment=AssessmentSettings(learning_windows=int(learn)))
done = run(session, Lake(f"{folder}/lake"), f"{folder}/vehicles", Results(f"{folder}/results"), settings=settings)
print(json.dumps({"elapsed": done.elapsed, "seconds": sum(done.analysis_time.values()), "vehicles": done.n_vehicles}))
session.stop()
"""
TABLES = ("windows", "baselines", "types", "diagnoses", "findings")


def measured(folder: Path, learn: int, steps: str) -> dict[str, Any]:
    """Run once; what it said, and the largest resident memory of its driver and of Java [bytes]."""
    shutil.rmtree(folder / "events", ignore_errors=True)
    (folder / "events").mkdir()
    peaks = {"driver": 0, "java": 0}
    process = subprocess.Popen(
        [sys.executable, "-c", ONE_RUN, str(folder), str(learn), steps], stdout=subprocess.PIPE, text=True
    )
    ended = threading.Event()

    def watch() -> None:
        whole = psutil.Process(process.pid)
        while not ended.wait(1.0):
            try:
                java = [each for each in whole.children() if "java" in each.name()]
                peaks["driver"] = max(peaks["driver"], whole.memory_info().rss)
                peaks["java"] = max([peaks["java"], *(each.memory_info().rss for each in java)])
            except psutil.Error:
                continue

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    said, _ = process.communicate()
    ended.set()
    watcher.join()
    if process.returncode:
        sys.exit("the run failed")
    return {**json.loads(said.splitlines()[-1]), **peaks}


def moved(folder: Path) -> dict[str, int]:
    """Bytes that tasks sent to the driver and to each other, and the largest of one task, from the log of events."""
    to_driver = shuffled = largest_to_driver = largest_shuffled = 0
    for file in (each for each in (folder / "events").rglob("*") if each.is_file()):
        for line in file.read_text().splitlines():
            if '"SparkListenerTaskEnd"' not in line:
                continue
            metrics = json.loads(line).get("Task Metrics") or {}
            result = metrics.get("Result Size", 0)
            shuffle = metrics.get("Shuffle Write Metrics", {}).get("Shuffle Bytes Written", 0)
            to_driver, largest_to_driver = to_driver + result, max(largest_to_driver, result)
            shuffled, largest_shuffled = shuffled + shuffle, max(largest_shuffled, shuffle)
    return {
        "to_driver": to_driver,
        "to_driver_task": largest_to_driver,
        "shuffled": shuffled,
        "shuffled_task": largest_shuffled,
    }


def size(folder: Path, vehicles: int, windows: int, given: argparse.Namespace) -> dict[str, str]:
    """Make a fleet, run, and return the values of a column."""
    begin = time.monotonic()
    fleet = {"vehicles": vehicles, "minutes": given.minutes, "rate": given.rate, "every": 20, "roads": given.roads}
    lake = make(folder, windows=windows, **fleet)
    n_windows = vehicles * windows
    made = time.monotonic() - begin
    print(f"{n_windows} windows made in {made:.0f} s", file=sys.stderr, flush=True)
    ran = measured(folder, given.learn or windows // 4, given.steps)
    if given.more:
        lake = make(folder, first=windows, windows=windows + given.more, **fleet)
        n_windows = vehicles * given.more
        ran = measured(folder, given.learn or windows // 4, given.steps)
    bytes_of = moved(folder)
    each = f"{windows} + {given.more}" if given.more else f"{windows}"
    column = {
        "vehicles, windows of each": f"{vehicles}, {each}",
        "windows": f"{n_windows}",
        "run [s]": f"{ran['elapsed']:.0f}",
        "analysis [CPU s]": f"{ran['seconds']:.0f}",
        "windows a second": f"{n_windows / ran['elapsed']:.2f}",
        "to the driver [MB]": f"{bytes_of['to_driver'] / 1e6:.2f}",
        "to the driver, a window [B]": f"{bytes_of['to_driver'] / n_windows:.0f}",
        "largest of a task [kB]": f"{bytes_of['to_driver_task'] / 1e3:.0f}",
        "shuffled [MB]": f"{bytes_of['shuffled'] / 1e6:.1f}",
        "shuffled, a window [kB]": f"{bytes_of['shuffled'] / n_windows / 1e3:.2f}",
        "largest shuffle of a task [MB]": f"{bytes_of['shuffled_task'] / 1e6:.2f}",
        "peak of the driver's Python [MB]": f"{ran['driver'] / 1e6:.0f}",
        "peak of Java [MB]": f"{ran['java'] / 1e6:.0f}",
    }
    results = Results(folder / "results")
    for name, files in {"lake": lake.files(), **{name: results[name].files() for name in TABLES}}.items():
        sizes = [file.n_bytes for file in files]
        column[f"{name}: files, median [MB]"] = f"{len(sizes)}, {median(sizes) / 1e6:.2f}" if sizes else "0"
    return column


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, nargs="+", default=[50, 1000])
    parser.add_argument("--windows", type=int, nargs="+", default=[20])
    parser.add_argument("--more", type=int, default=0, help="number of new windows of each vehicle in a second run")
    parser.add_argument("--learn", type=int, default=0, help="windows of a baseline; 0: a quarter of them")
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--rate", type=float, default=25.0, help="samples per second")
    parser.add_argument("--roads", type=int, default=40, help="number of different drives; 0: all different")
    parser.add_argument("--steps", default="baseline,diagnose")
    given = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    columns = []
    for vehicles, windows in product(given.vehicles, given.windows):
        with tempfile.TemporaryDirectory(prefix="fleet-volume-") as name:
            columns.append(size(Path(name), vehicles, windows, given))
        print(json.dumps(columns[-1]), file=sys.stderr, flush=True)
    print("| |" + " |" * len(columns))
    print("|---|" + "---|" * len(columns))
    for row in columns[0]:
        print(f"| {row} | " + " | ".join(column[row] for column in columns) + " |")


if __name__ == "__main__":
    main()
