"""CPU time of observing a window of ten minutes, and of `sprung corners` on a file of ten minutes.

With `--against SRC`, the folder `src` of another checkout, both are timed alternately, and the ratio is printed: it
holds on a machine that does other things meanwhile, too.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from statistics import median

from measuring import ONE_THREAD, print_table

OWN = Path(__file__).resolve().parents[1] / "src"
WINDOWS = ("complete file", "engine missing in the file", "sensors exchanged")
COMMAND = "sprung corners"


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--against", type=Path, help="folder src of another checkout")
    arguments.add_argument("--repeats", type=int, default=3)
    arguments.add_argument("--keep", type=Path, help="folder to keep the recordings in")
    arguments.add_argument("--window", nargs=2, help=argparse.SUPPRESS)
    given = arguments.parse_args()
    if given.window:
        observe(*given.window)
        return
    with tempfile.TemporaryDirectory() as folder:
        kept = given.keep or Path(folder)
        kept.mkdir(parents=True, exist_ok=True)
        files = {window: recorded(window, kept) for window in WINDOWS}
        trees = [OWN] if given.against is None else [OWN, given.against.resolve()]
        cases = {window: partial(window_seconds, files[window]) for window in WINDOWS}
        cases[COMMAND] = partial(command_seconds, files[WINDOWS[0]])
        rows = []
        for name, seconds in cases.items():
            runs = [[seconds(tree) for tree in trees] for _ in range(given.repeats)]
            middle = [median(column) for column in zip(*runs, strict=True)]
            ratio = [f"{median(after / before for after, before in runs):.2f}"] if len(trees) > 1 else []
            rows.append([name, *(f"{value:.2f}" for value in middle), *ratio])
    header = ["CPU time [s], one thread", "now", *(["before", "now / before"] if len(trees) > 1 else [])]
    print_table("Cost of a window of ten minutes", header, rows)


def recorded(window, folder):
    """Return the file of a recording of ten minutes with potholes, payload and a nonlinear suspension."""
    from dataclasses import replace

    from sprung.formats import write
    from sprung.simulation import (
        FEW_POTHOLES,
        REALISTIC_SUSPENSION,
        Payload,
        RoadConditions,
        RoadDrive,
        simulate_drive,
    )
    from sprung.vehicles import MountedMass, read_vehicle

    path = folder / f"{window.replace(' ', '-')}.npz"
    if path.exists():
        return path
    real = read_vehicle("zafira")
    if window == WINDOWS[1]:
        engine = MountedMass(mass=180.0, x=1.1, frequency=11.0, damping_ratio=0.08)
        real = real.model_copy(update={"mounted_mass": (engine,)})
    settings = RoadDrive(
        n_stops=1,
        snr=50.0,
        road=RoadConditions(potholes=FEW_POTHOLES),
        suspension=REALISTIC_SUSPENSION,
        payload=Payload(120.0, -0.3, 0.0),
    )
    recording = simulate_drive(real, settings, seed=WINDOWS.index(window)).recording
    if window == WINDOWS[2]:
        samples = recording.samples.copy()
        first, second = recording.index("acc_fl"), recording.index("acc_rr")
        samples[[first, second]] = samples[[second, first]]
        recording = replace(recording, samples=samples)
    write(recording, path)
    return path


def observe(path, repeats):
    """Print the CPU time of observing a recording, the smallest of some repeats in this process."""
    import time

    from sprung.diagnosis import observe_window
    from sprung.formats import read
    from sprung.vehicles import read_vehicle

    recording, vehicle, seconds = read(path), read_vehicle("zafira"), []
    for _ in range(int(repeats)):
        start = time.process_time()
        observe_window(recording, vehicle)
        seconds.append(time.process_time() - start)
    print(json.dumps(min(seconds)))


def window_seconds(path, tree):
    """Return the CPU time of observing a window with the package of a tree."""
    return json.loads(child([__file__, "--window", str(path), "2"], tree))


def command_seconds(path, tree):
    """Return the CPU time of the command in a process of its own: interpreter, imports, reading, modes and fit."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = "import sys; from sprung.cli import main; sys.exit(main())"
    child(["-c", run, "corners", str(path), "--vehicle", "zafira"], tree)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def child(arguments, tree):
    """Return what a process with the package of a tree prints."""
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(tree)}
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False, timeout=600
    )
    if done.returncode:
        raise SystemExit(done.stderr[-2000:])
    return done.stdout


if __name__ == "__main__":
    main()
