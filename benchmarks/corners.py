"""Springs, dampers and tyres of every corner from simulated drives: bias, spread, coverage, time, memory."""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

KINDS = ("spring", "damper", "tyre")


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--drives", type=int, default=200, help="of the linear case")
    arguments.add_argument("--each", type=int, default=24, help="drives of every other case")
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--one", action="store_true", help="print seconds and memory of one fit")
    arguments.add_argument("--json", type=Path, help="file for errors and coverage")
    given = arguments.parse_args()
    if given.one:
        print(one_fit())
        return
    with ProcessPoolExecutor(given.jobs) as pool:
        linear = list(pool.map(partial(drive, "linear"), range(given.drives)))
        coverage(linear)
        print()
        print(
            "| case | springs, bias ± std % | dampers | tyres | left/right contrasts, std % | front/rear | "
            "f of body modes, worst bias % | damping | model error |\n|" + "---|" * 9
        )
        cases = {}
        for case in CASES:
            runs = linear if case == "linear" else list(pool.map(partial(drive, case), range(given.each)))
            row(case, runs)
            cases[case] = summary(runs)
    if given.json:
        command = f"python benchmarks/corners.py --drives {given.drives} --each {given.each}"
        given.json.write_text(json.dumps({"command": command, "cases": cases}, indent=1) + "\n")
    output = subprocess.run([sys.executable, __file__, "--one"], capture_output=True, text=True, check=True)
    print("\n" + output.stdout.strip())


def settings(case, seed):
    """Return the options of a drive."""
    from dataclasses import replace

    import numpy as np

    from sprung.simulation import FEW_POTHOLES, REALISTIC_SUSPENSION, Payload, RoadConditions

    generator = np.random.default_rng([seed, 1])
    options = {"n_stops": 1, "snr": 50.0}
    if case in {"A", "B", "C", "D"} or case.startswith("C,"):
        options |= {
            "road": RoadConditions(case[0], potholes=FEW_POTHOLES),
            "payload": Payload(float(generator.uniform(0, 300))),
            "suspension": replace(REALISTIC_SUSPENSION, temperature=float(generator.uniform(0, 40))),
        }
    return options


def vehicle(case):
    """Return the vehicle that drives and the one of the file."""
    from sprung.vehicles import MountedMass, read_vehicle

    file = read_vehicle("zafira")
    if case.endswith("engine unknown"):
        engine = MountedMass(mass=180.0, x=1.1, frequency=11.0, damping_ratio=0.08)
        return file.model_copy(update={"mounted_mass": (engine,)}), file
    if case.endswith("anti-roll bars unknown"):
        axles = zip(file.axle, (12e3, 6e3), strict=True)
        stiff = tuple(axle.model_copy(update={"anti_roll_stiffness": k}) for axle, k in axles)
        return file.model_copy(update={"axle": stiff}), file
    if case.endswith("geometry 3 % wrong"):
        moved = {"half_track": 1.03, "x": 1.03}
        axles = tuple(
            axle.model_copy(update={k: factor * getattr(axle, k) for k, factor in moved.items()}) for axle in file.axle
        )
        return file.model_copy(update={"axle": axles}), file
    if case.endswith("mass 10 % wrong"):
        body = file.body.model_copy(update={"mass": 0.9 * file.body.mass})
        return file, file.model_copy(update={"body": body})
    return file, file


CASES = (
    "linear",
    "A",
    "B",
    "C",
    "D",
    "C, geometry 3 % wrong",
    "C, mass 10 % wrong",
    "C, anti-roll bars unknown",
    "C, engine unknown",
)


def drive(case, seed):
    """Return errors of ln values and reported deviations, errors of body modes, and the model_error."""
    import numpy as np

    from sprung.likelihood import fit_corners
    from sprung.simulation import RoadDrive, simulate_drive

    real, file = vehicle(case)
    run = simulate_drive(real, RoadDrive(**settings(case, seed)), seed=[seed, 0])
    fit = fit_corners(run.recording, file)
    true = [run.truth["components"][part.corner][part.kind]["value"] for part in fit.components]
    modes = fit.modes()
    body = [mode for mode in run.truth["modes"] if mode["label"] in {"bounce", "pitch", "roll"}]
    at = [modes.labels.index(mode["label"]) if mode["label"] in modes.labels else 0 for mode in body]
    frequency = modes.natural_frequency[at] / [mode["natural_frequency"] for mode in body] - 1
    damping = modes.damping_ratio[at] / [mode["damping_ratio"] for mode in body] - 1
    return np.log(fit.values / true), fit.log_ratios_std, frequency, damping, fit.model_error


def coverage(runs):
    """Print what share of 95 % intervals holds the truth."""
    import numpy as np

    errors, deviations = (np.array([run[k] for run in runs]) for k in (0, 1))
    inside = np.mean(np.abs(errors) < 1.96 * deviations, axis=0).reshape(4, 3)
    print(f"Coverage of 95 % intervals over {len(runs)} linear drives, %\n")
    print("| corner | " + " | ".join(KINDS) + " |\n|" + "---|" * 4)
    for corner, values in zip(("front left", "front right", "rear left", "rear right"), inside, strict=True):
        print(f"| {corner} | " + " | ".join(f"{100 * value:.1f}" for value in values) + " |")
    print(f"| all | {100 * inside.mean():.1f} | | |")


def row(case, runs):
    """Print bias and spread of a case."""
    import numpy as np

    errors = np.array([run[0] for run in runs]).reshape(-1, 2, 2, 3)
    sides = (errors[:, :, 0] - errors[:, :, 1]).std(axis=0).max(axis=0)
    ends = (errors[:, 0].mean(axis=1) - errors[:, 1].mean(axis=1)).std(axis=0)
    flat = errors.reshape(-1, 4, 3)
    values = [f"{100 * b:+.1f} ± {100 * s:.1f}" for b, s in zip(flat.mean((0, 1)), flat.std(0).mean(0), strict=True)]
    frequency, damping = (np.array([run[k] for run in runs]).mean(axis=0) for k in (2, 3))
    modes = [f"{100 * value[np.argmax(np.abs(value))]:+.1f}" for value in (frequency, damping)]
    contrasts = [" / ".join(f"{100 * value:.1f}" for value in each) for each in (sides, ends)]
    model_error = f"{np.median([run[4] for run in runs]):.3f}"
    print("| " + " | ".join([case, *values, *contrasts, *modes, model_error]) + " |", flush=True)


def summary(runs):
    """Return bias and spread of ln values by kind, spread of left against right, and coverage of 95 % intervals."""
    import numpy as np

    errors, deviations = (np.array([run[k] for run in runs]) for k in (0, 1))
    by_corner = errors.reshape(-1, 2, 2, 3)
    sides = by_corner[:, :, 0] - by_corner[:, :, 1]
    return {
        "drives": len(runs),
        "bias": dict(zip(KINDS, by_corner.mean(axis=(0, 1, 2)).round(5).tolist(), strict=True)),
        "spread": dict(zip(KINDS, by_corner.std(axis=0, ddof=1).mean(axis=(0, 1)).round(5).tolist(), strict=True)),
        "contrast": dict(zip(KINDS, np.sqrt((sides**2).mean(axis=(0, 1))).round(5).tolist(), strict=True)),
        "intervals": int(errors.size),
        "intervals_held": int(np.sum(np.abs(errors) < 1.96 * deviations)),
    }


def one_fit():
    """Return seconds of one fit, and the peak memory of the process."""
    from sprung.likelihood import fit_corners
    from sprung.simulation import RoadDrive, simulate_drive
    from sprung.vehicles import read_vehicle

    car = read_vehicle("zafira")
    run = simulate_drive(car, RoadDrive(snr=50.0), seed=1).recording
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    times = []
    for _ in range(7):
        begin = time.perf_counter()
        fit_corners(run, car)
        times.append(time.perf_counter() - begin)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (
        "| one fit, 600 s at 200 Hz, 12 components | memory of process, before fits |\n|---|---|\n"
        f"| {sorted(times)[3]:.3f} s | {peak / 1024:.0f}, {before / 1024:.0f} MiB |"
    )


if __name__ == "__main__":
    main()
