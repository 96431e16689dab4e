"""Results of a run beside those of the commands for single vehicles on the same windows, exported from the lake.

    python benchmarks/fleet/commands.py --vehicles 200 --windows 20

Every vehicle: `sprung baseline` on the first windows and `sprung diagnose` on the others; `sprung identify` and `sprung
corners` on its first window. Prints the largest relative difference of any number in any document.
"""

import argparse
import contextlib
import io
import json
import math
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as tasks of a run: more threads round otherwise
sys.path.insert(0, str(Path(__file__).parent))

from make import make

from sprung.fleet.jobs import Results

PROGRAM = "import sys; from sprung.cli import main; sys.exit(main())"
#: Times are counted from the first file by the commands, and from 1970 by a run; sources are files or windows.
TIMES = {
    "time",
    "times",
    "since",
    "since_interval",
    "onset",
    "onset_interval",
    "first_alert",
    "learning_times",
    "sentence",
    "advice",
    "notes",
}


def command(*arguments: str) -> dict[str, Any]:
    """The JSON of a command that runs in this process."""
    from sprung.cli import main

    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.suppress(SystemExit):
        sys.argv = ["sprung", *arguments, "--json", "-"]
        main()
    document: dict[str, Any] = json.loads(output.getvalue())
    return document


def difference(one: Any, other: Any) -> float:
    """Largest relative difference of numbers; infinite where anything else differs."""
    if isinstance(one, dict) and isinstance(other, dict):
        names = (one.keys() | other.keys()) - TIMES
        return max((difference(one.get(name), other.get(name)) for name in names), default=0.0)
    if isinstance(one, list) and isinstance(other, list):
        if len(one) != len(other):
            return math.inf
        return max((difference(*pair) for pair in zip(one, other, strict=True)), default=0.0)
    if isinstance(one, float | int) and isinstance(other, float | int):
        return abs(one - other) / max(abs(one), abs(other), 1e-12)
    return 0.0 if one == other else math.inf


def compared(case: tuple[str, list[str], str, int, dict[str, str]]) -> tuple[str, dict[str, float]]:
    """Differences of the documents of a vehicle, by the name of the table."""
    vehicle, files, description, learn, documents = case
    with tempfile.TemporaryDirectory() as folder:
        baseline = f"{folder}/b.json"
        of_vehicle = ("--vehicle", description, "--window", "2")
        commands = {
            "baselines": command(
                "baseline", *files[:learn], *of_vehicle, "--no-calibrate", "--windows", "2", "--out", baseline
            ),
            "diagnoses": command("diagnose", *files[learn:], *of_vehicle, "--baseline", baseline),
            "identifications": command("identify", files[0], "--vehicle", description),
            "corners": command("corners", files[0], "--vehicle", description),
        }
    return vehicle, {name: difference(document, json.loads(documents[name])) for name, document in commands.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=200)
    parser.add_argument("--windows", type=int, default=20)
    chosen = parser.parse_args()
    learn = chosen.windows // 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder, vehicles=chosen.vehicles, windows=chosen.windows, every=10)
        run = [
            "fleet",
            "run",
            str(folder / "lake"),
            "--vehicles",
            str(folder / "vehicles"),
            "--out",
            str(folder / "results"),
        ]
        run += ["--learn", str(learn), "--window", "2", "--master", "local[2]", "--json", "-"]
        first = ["--steps", "identify,corners", "--until", "2026-01-01T00:00:01"]
        for options in (["--steps", "baseline,diagnose"], first):
            subprocess.run([sys.executable, "-c", PROGRAM, *run, *options], check=True, stdout=subprocess.DEVNULL)
        export = ["fleet", "archive", str(folder / "lake"), "--export", str(folder / "files")]
        subprocess.run([sys.executable, "-c", PROGRAM, *export], check=True, stdout=subprocess.DEVNULL)
        results = Results(folder / "results")
        documents: dict[str, dict[str, str]] = {}
        for table in ("baselines", "diagnoses", "identifications", "corners"):
            for row in results[table].rows(["vehicle", "document"]).to_pylist():
                documents.setdefault(row["vehicle"], {})[table] = row["document"]
        cases = [
            (
                vehicle,
                sorted(map(str, (folder / "files" / vehicle).glob("*.parquet"))),
                str(folder / "vehicles" / f"{vehicle}.toml"),
                learn,
                own,
            )
            for vehicle, own in sorted(documents.items())
        ]
        with ProcessPoolExecutor(2) as pool:
            found = dict(pool.map(compared, cases))
    largest = {table: max(own[table] for own in found.values()) for table in next(iter(found.values()))}
    print(
        json.dumps({"vehicles": len(found), "windows": chosen.vehicles * chosen.windows, "largest": largest}, indent=2)
    )
    sys.exit(1 if max(largest.values()) > 1e-9 else 0)


if __name__ == "__main__":
    main()
