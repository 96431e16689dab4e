"""Faults found, at the right part, after 10, 30 and 120 minutes, and false alarms, over many simulated vehicles.

Beside it, for every fifth pair of vehicles, the thesis' own way on the same drives: modes by CoSS-SSI, and how far
frequencies and shapes (MAC) are from those of the learning windows.
"""

import argparse
import json
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

SIZES = (0.02, 0.05, 0.1, 0.2, 0.5)
MINUTES = (10, 20, 30, 60, 120)
OF_THESIS = (10, 30, 120)
LEARNING = 12


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--vehicles", type=int, default=400)
    arguments.add_argument("--healthy", type=int, default=30, help="healthy windows of ten minutes of each vehicle")
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--lives", type=Path, help="file of vehicles done, to go on from; a line is added for each")
    given = arguments.parse_args()
    from rich.progress import Progress

    lives = [json.loads(line) for line in given.lives.open()] if given.lives and given.lives.exists() else []
    done = {life["seed"] for life in lives}
    seeds = [seed for seed in range(given.vehicles) if seed not in done]
    with ProcessPoolExecutor(given.jobs) as pool, Progress() as progress:
        task = progress.add_task("vehicles", total=len(seeds))
        waiting = [pool.submit(partial(vehicle_life, given.healthy), seed) for seed in seeds]
        for one in as_completed(waiting):
            progress.advance(task)
            if one.exception() is not None:
                print(f"a vehicle failed: {one.exception()!r}", flush=True)
                continue
            lives.append(one.result())
            if given.lives:
                with given.lives.open("a") as file:
                    file.write(json.dumps(lives[-1]) + "\n")
    tables(lives)


def described(seed):
    """Return a vehicle as its file says, and as it is: for every other one with parts that the file does not have."""
    import numpy as np

    from sprung.vehicles import MountedMass, read_vehicle

    generator = np.random.default_rng([seed, 3])
    file = read_vehicle("zafira")
    spread = generator.normal(1.0, 0.08, 8)
    body = file.body.model_copy(
        update={
            "mass": file.body.mass * spread[0],
            "pitch_inertia": file.body.pitch_inertia * spread[1],
            "roll_inertia": file.body.roll_inertia * spread[2],
        }
    )
    axles = tuple(
        axle.model_copy(
            update={
                "spring_stiffness": axle.spring_stiffness * spread[3 + k],
                "damping": axle.damping * spread[5 + k],
                "x": axle.x * spread[7],
            }
        )
        for k, axle in enumerate(file.axle)
    )
    file = file.model_copy(update={"body": body, "axle": axles})
    if seed % 2 == 0:
        return file, file
    kind = ("engine", "anti-roll bars", "geometry", "wheel lines")[seed // 2 % 4]
    if kind == "engine":
        engine = MountedMass(mass=180.0, x=1.1, frequency=11.0, damping_ratio=0.08)
        return file, file.model_copy(update={"mounted_mass": (engine,)})
    if kind == "anti-roll bars":
        bars = tuple(a.model_copy(update={"anti_roll_stiffness": k}) for a, k in zip(axles, (12e3, 6e3), strict=True))
        return file, file.model_copy(update={"axle": bars})
    if kind == "geometry":
        moved = tuple(a.model_copy(update={"half_track": 1.03 * a.half_track, "x": 1.03 * a.x}) for a in axles)
        return file, file.model_copy(update={"axle": moved})
    return file, file


def window(file, real, seed, number, faults):
    """Return what ten minutes of driving say: the observation, and the modes as the thesis finds them."""
    import numpy as np

    from sprung.diagnosis import observe
    from sprung.simulation import DriveSettings, simulate_drive

    generator = np.random.default_rng([seed, 4, number])
    settings = DriveSettings(
        "road",
        road=str(generator.choice(["A", "B", "C", "D"], p=[0.1, 0.35, 0.4, 0.15])),
        n_stops=int(generator.integers(0, 3)),
        payload=float(generator.uniform(0, 300)),
        temperature=float(generator.uniform(0, 40)),
        snr=float(generator.uniform(30, 80)),
        is_nonlinear=True,
        faults=faults,
    )
    run = simulate_drive(real, settings, seed=[seed, 5, number]).recording
    if seed % 8 == 7:
        run = with_wheel_lines(run, generator)
    return observe(run, file, time=600.0 * number), body_modes(run, file) if is_thesis(seed) else {}


def is_thesis(seed):
    """Tell whether the thesis' way runs beside ours: for pairs of vehicles that take turns over all sizes."""
    return seed // 10 % 5 == 0


def body_modes(run, file):
    """Return natural frequency and mode shape of the body modes that CoSS-SSI finds, by label."""
    from sprung.errors import SprungError
    from sprung.identification import coss_ssi
    from sprung.preparation import IdentificationSettings

    try:
        modes = coss_ssi([run], settings=IdentificationSettings(band=(0.5, 8.0)), vehicle=file).modes
    except SprungError:
        return {}
    return {
        label: (float(frequency), shape)
        for label, frequency, shape in zip(modes.labels, modes.natural_frequency, modes.mode_shapes, strict=True)
        if label in {"bounce", "pitch", "roll"}
    }


def compared(before, after):
    """Return how far the mean modes of windows are from those before: largest change of ln f, and of 1 - MAC."""
    import numpy as np

    from sprung.modal import mac

    shifts, unlike = [0.0], [0.0]
    for label in ("bounce", "pitch", "roll"):
        pair = [[modes[label] for modes in windows if label in modes] for windows in (before, after)]
        if not all(pair):
            continue
        frequencies = [np.mean(np.log([one[0] for one in some])) for some in pair]
        shapes = []
        for some in pair:
            rows = np.array([shape / np.linalg.norm(shape) for _, shape in some])
            shapes.append(np.linalg.eigh(np.einsum("wi,wj->ij", rows, rows.conj()))[1][:, -1])
        shifts.append(abs(frequencies[1] - frequencies[0]))
        unlike.append(1 - float(mac(np.array(shapes[:1]), np.array(shapes[1:]))[0, 0]))
    return max(shifts), max(unlike)


def with_wheel_lines(run, generator):
    """Add lines at one and two cycles per turn of the wheels."""
    from dataclasses import replace

    import numpy as np

    way = np.cumsum(run.samples[-1]) / run.sampling_rate
    samples = run.samples.copy()
    for order, size in ((1, 0.15), (2, 0.08)):
        for row in range(4):
            samples[row] += size * np.sin(2 * np.pi * 0.516 * order * way + generator.uniform(0, 6.28))
    return replace(run, samples=samples)


def vehicle_life(n_healthy, seed):
    """Return a vehicle's fault, what was found after 10, 30 and 120 minutes with it, and false alarms before."""
    import numpy as np

    from sprung.diagnosis import detect, diagnose, learn
    from sprung.errors import DataError
    from sprung.vehicles import Fault

    file, real = described(seed)
    generator = np.random.default_rng([seed, 6])
    name = str(generator.choice([f"{e}_{s}.{k}" for e in ("front", "rear") for s in ("left", "right") for k in KINDS]))
    size = SIZES[seed // 2 % len(SIZES)]
    taught, taught_modes = several(window(file, real, seed, k, ()) for k in range(LEARNING))
    try:
        baseline = learn(taught, vehicle=file.name)
    except DataError as error:
        return {"seed": seed, "name": name, "size": size, "error": str(error)}
    healthy, healthy_modes = several(window(file, real, seed, LEARNING + k, ()) for k in range(n_healthy))
    calm = detect(baseline, healthy)
    fault = (Fault(name, -size),)
    faulty, faulty_modes = several(window(file, real, seed, 1000 + k, fault) for k in range(MINUTES[-1] // 10))
    found, said = {}, {}
    for minutes in MINUTES:
        findings = diagnose([*healthy[:3], *faulty[: minutes // 10]], baseline).findings
        found[str(minutes)] = f"{findings[0].corner}.{findings[0].component}" if findings else ""
        for one in findings:
            onset = [(time - faulty[0].time) / 60 for time in (one.since, *one.since_interval)]
            said[str(minutes)] = {"change": one.change, "interval": one.interval, "onset": onset}
    late = detect(baseline, [*healthy[:3], *faulty])
    life = {
        "seed": seed,
        "name": name,
        "size": size,
        "found": found,
        "said": said,
        "alarm": calm is not None and calm.first_alarm is not None,
        "hours": len([one for one in healthy if one.can_tell]) / 6,
        "mute": sum(not one.can_tell for one in [*healthy, *faulty]),
        "delay": None if late is None or late.first_alarm is None else (late.first_alarm - faulty[0].time) / 60 + 10,
    }
    if is_thesis(seed):
        counts = [n // 10 for n in OF_THESIS]
        life["thesis"] = {
            "healthy": [compared(taught_modes, healthy_modes[:n]) for n in counts],
            "faulty": [compared(taught_modes, faulty_modes[:n]) for n in counts],
            "modes": sum(len(modes) for modes in [*healthy_modes, *faulty_modes]),
            "windows": len(healthy_modes) + len(faulty_modes),
        }
    return life


def several(pairs):
    """Return observations and modes of windows."""
    observations, modes = zip(*pairs, strict=True)
    return list(observations), list(modes)


KINDS = ("spring", "damper", "tyre")


def tables(lives):
    """Print detection, confusion and false alarms."""
    import numpy as np

    bad = [life for life in lives if "error" in life]
    good = [life for life in lives if "error" not in life]
    for title, some in (
        ("parts all in the file", [life for life in good if life["seed"] % 2 == 0]),
        ("parts unknown to the file", [life for life in good if life["seed"] % 2 == 1]),
    ):
        print(f"\nFound at the right part, of vehicles with {title} (found at a wrong one)\n")
        print("| size | " + " | ".join(f"{m} min" for m in MINUTES) + " | vehicles |\n|" + "---|" * (len(MINUTES) + 2))
        for size in SIZES:
            here = [life for life in some if life["size"] == size]
            cells = []
            for minutes in MINUTES:
                right = sum(life["found"][str(minutes)] == life["name"] for life in here)
                wrong = sum(life["found"][str(minutes)] not in {"", life["name"]} for life in here)
                cells.append(f"{right} ({wrong})")
            print(f"| {100 * size:.0f} % | " + " | ".join(cells) + f" | {len(here)} |")
    print("\nWhat 120 minutes said of faults of 10 % or more\n\n| fault | spring | damper | tyre | other part | none |")
    print("|" + "---|" * 6)
    for kind in KINDS:
        here = [life for life in good if life["name"].endswith(kind) and life["size"] >= 0.1]
        answers = [life["found"]["120"] for life in here]
        right = [a == life["name"] for a, life in zip(answers, here, strict=True)]
        counts = [sum(r for r, life in zip(right, here, strict=True) if kind == other) for other in KINDS]
        wrong = sum(a not in {"", life["name"]} for a, life in zip(answers, here, strict=True))
        print(f"| {kind} | " + " | ".join(map(str, counts)) + f" | {wrong} | {answers.count('')} |")
    hours, alarms = sum(life["hours"] for life in good), sum(life["alarm"] for life in good)
    upper = np.round(
        (alarms + 3.0 if alarms == 0 else alarms + 1.96 * np.sqrt(alarms) + 1.92) / max(hours, 1e-9) * 8, 4
    )
    delays = [life["delay"] for life in good if life["delay"] is not None and life["size"] >= 0.1]
    print(f"\n{alarms} false alarms in {hours:.0f} healthy vehicle-hours: at most {upper} per day of 8 h (95 %).")
    if delays:
        median, most = np.quantile(delays, [0.5, 0.95])
        print(f"Median delay of faults of 10 % or more: {median:.0f} min, 95 %: {most:.0f} min.")
    print(f"{len(bad)} vehicles could not learn; {sum(life['mute'] for life in good)} windows could not tell.")
    for life in bad[:5]:
        print(f"- {life['error']}")
    thesis_table([life for life in good if "thesis" in life])


def thesis_table(lives):
    """Print what the thesis' way finds where one healthy vehicle in twenty is called changed."""
    import numpy as np

    if not lives:
        return
    share = sum(life["thesis"]["modes"] for life in lives) / sum(3 * life["thesis"]["windows"] for life in lives)
    print(f"\nThe thesis' way, {len(lives)} vehicles: CoSS-SSI found {share:.0%} of the body modes of single windows.")
    print("Called changed (any part), where the threshold lets one healthy vehicle in twenty pass\n")
    print(
        "| size | " + " | ".join(f"{what}, {m} min" for what in ("frequency", "MAC") for m in OF_THESIS) + " | vehicles |"
    )
    print("|" + "---|" * (2 * len(OF_THESIS) + 2))
    values = {state: np.array([life["thesis"][state] for life in lives]) for state in ("healthy", "faulty")}
    limits = np.quantile(values["healthy"], 0.95, axis=0)
    for size in SIZES:
        rows = np.array([life["size"] == size for life in lives])
        counts = (values["faulty"][rows] > limits).sum(axis=0).T
        print(f"| {100 * size:.0f} % | " + " | ".join(map(str, counts.ravel())) + f" | {rows.sum()} |")


if __name__ == "__main__":
    main()
