"""Kill executors, Python workers and drivers of a run on a cluster: the tables must be those of an undisturbed run.

    python benchmarks/fleet/storm.py --vehicles 20 --windows 10

Windows also arrive late, and twice. Prints what was killed, and what differs.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from cluster import Cluster, kill
from make import make

from sprung.fleet.jobs import Results
from sprung.fleet.jobs.results import SCHEMAS
from sprung.fleet.lake import Lake, LakeWindow

PROGRAM = "import sys; from sprung.cli import main; sys.exit(main())"


def command(folder: Path, lake: str, results: str, master: str, learn: int) -> list[str]:
    """The command that analyses a lake."""
    return [
        *(sys.executable, "-c", PROGRAM, "fleet", "run", str(folder / lake)),
        *("--vehicles", str(folder / "vehicles"), "--out", str(folder / results)),
        *("--steps", "baseline,diagnose", "--learn", str(learn), "--master", master, "--json", "-"),
    ]


def tables(place: Path) -> dict[str, list[str]]:
    """Rows of all tables, sorted, but those of the table of runs."""
    results = Results(place)
    return {
        name: sorted(repr(sorted(row.items())) for row in results[name].rows().to_pylist())
        for name in SCHEMAS
        if name != "runs"
    }


def disturbed(arguments: list[str], cluster: Cluster, generator: random.Random, *, every: float) -> dict[str, int]:
    """Run a command to its end, killing processes of it at random; a killed driver is started again."""
    killed = {"executors": 0, "python_workers": 0, "drivers": 0}
    while True:
        environment = {**os.environ, "PYSPARK_PYTHON": sys.executable}
        driver = subprocess.Popen(arguments, stdout=subprocess.PIPE, env=environment, start_new_session=True)
        end = time.monotonic() + 8 + every * generator.random()
        while driver.poll() is None:
            time.sleep(0.2)
            if time.monotonic() < end or sum(killed.values()) >= 9:
                continue
            kind = generator.choice(["executors", "python_workers", "executors", "python_workers", "drivers"])
            if kind == "drivers" and killed["drivers"] < 2:
                os.killpg(driver.pid, signal.SIGKILL)
                killed["drivers"] += 1
            elif kind != "drivers" and killed[kind] < 4:
                pids = cluster.executors() if kind == "executors" else cluster.python_workers()
                killed[kind] += kill(pids)
            end = time.monotonic() + every * (0.5 + generator.random())
        output = driver.communicate()[0]
        if driver.returncode == 0:
            return killed | {"windows": max(json.loads(output)["windows"].values())}
        if driver.returncode != -signal.SIGKILL:
            raise RuntimeError(f"the run ended with {driver.returncode}")


def storm(folder: Path, *, vehicles: int, windows: int, every: float, seed: int) -> dict[str, Any]:
    """An undisturbed run over all windows, and a disturbed one whose windows arrive late, in disorder and twice."""
    generator = random.Random(seed)
    lake = make(folder, vehicles=vehicles, windows=windows, every=4)
    learn = max(2, windows // 2)
    subprocess.run(command(folder, "lake", "calm", "local[2]", learn), check=True, stdout=subprocess.DEVNULL)
    rows = lake.table.rows().to_pylist()
    generator.shuffle(rows)
    every_window = [LakeWindow(row["vehicle"], row) for row in rows]
    killed: dict[str, int] = {}
    with Cluster(folder / "cluster") as cluster:
        for part in (every_window[: len(rows) // 2], every_window):
            Lake(folder / "late").write(part)
            # A file that a writer stored twice.
            Lake(folder / "late").table.append(Lake(folder / "late").table.rows().slice(0, 3), largest_group=4)
            for kind, count in disturbed(
                command(folder, "late", "stormy", cluster.url, learn), cluster, generator, every=every
            ).items():
                killed[kind] = count if kind == "windows" else killed.get(kind, 0) + count
    calm, stormy = tables(folder / "calm"), tables(folder / "stormy")
    return {
        "killed": killed,
        "rows": {name: len(own) for name, own in calm.items()},
        "differs": [name for name in calm if calm[name] != stormy[name]],
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--windows", type=int, default=10)
    parser.add_argument("--every", type=float, default=10.0, help="mean time between kills [s]")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = storm(
            Path(folder), vehicles=chosen.vehicles, windows=chosen.windows, every=chosen.every, seed=chosen.seed
        )
    print(json.dumps(found, indent=2))
    sys.exit(1 if found["differs"] else 0)
