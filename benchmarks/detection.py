"""Faults found, at the right part, after 10, 30 and 120 minutes, and false alarms, over many simulated vehicles.

Beside it, for forty vehicles, the thesis' own way on the same drives: modes by CoSS-SSI, and how far
frequencies and shapes (MAC) are from those of the learning windows.
"""

import argparse
import gzip
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
KINDS = ("spring", "damper", "tyre")
CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
PARTS = tuple(f"{corner}.{kind}" for corner in CORNERS for kind in KINDS)
UNKNOWN = ("engine", "anti-roll bars", "geometry", "wheel lines")


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--vehicles", type=int, default=400)
    arguments.add_argument("--seeds", type=int, nargs="+", help="these vehicles and no others")
    arguments.add_argument("--healthy", type=int, default=30, help="healthy windows of ten minutes of each vehicle")
    arguments.add_argument(
        "--faulty", type=int, default=MINUTES[-1] // 10, help="windows with the fault of each vehicle"
    )
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--lives", type=Path, help="file of vehicles done, to go on from; a line is added for each")
    arguments.add_argument("--windows", type=Path, help="folder to keep what windows say, and to judge them again from")
    given = arguments.parse_args()
    from rich.progress import Progress

    lives = list(map(json.loads, given.lives.read_text().splitlines())) if given.lives and given.lives.exists() else []
    done = {life["seed"] for life in lives}
    seeds = [seed for seed in given.seeds or range(given.vehicles) if seed not in done]
    with ProcessPoolExecutor(given.jobs) as pool, Progress() as progress:
        task = progress.add_task("vehicles", total=len(seeds))
        waiting = [
            pool.submit(partial(vehicle_life, given.healthy, given.faulty, given.windows), seed) for seed in seeds
        ]
        for one in as_completed(waiting):
            progress.advance(task)
            error = one.exception()
            lives.append({"seed": seeds[waiting.index(one)], "error": repr(error)} if error else one.result())
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
    kind = UNKNOWN[seed // 2 % 4]
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
    """Return the observation of ten minutes of driving, and its modes as the thesis identifies them."""
    from dataclasses import replace

    import numpy as np

    from sprung.diagnosis import observe_window
    from sprung.simulation import (
        FEW_POTHOLES,
        REALISTIC_SUSPENSION,
        Payload,
        RoadConditions,
        RoadDrive,
        simulate_drive,
    )

    generator = np.random.default_rng([seed, 4, number])
    road = RoadConditions(str(generator.choice(["A", "B", "C", "D"], p=[0.1, 0.35, 0.4, 0.15])), potholes=FEW_POTHOLES)
    settings = RoadDrive(
        road=road,
        n_stops=int(generator.integers(0, 3)),
        payload=Payload(float(generator.uniform(0, 300))),
        suspension=replace(REALISTIC_SUSPENSION, temperature=float(generator.uniform(0, 40))),
        snr=float(generator.uniform(30, 80)),
        faults=faults,
    )
    run = simulate_drive(real, settings, seed=[seed, 5, number]).recording
    if seed % 8 == 7:
        run = with_wheel_lines(run, generator)
    return observe_window(run, file, time=600.0 * number), body_modes(run, file) if is_thesis(seed) else {}


def is_thesis(seed):
    """Return whether the thesis' way runs too: for forty vehicles, as many of every size."""
    return seed // 10 % 5 == 0 and seed < 200


def body_modes(run, file):
    """Return natural frequency and mode shape of the body modes that CoSS-SSI finds, by label."""
    from sprung.errors import SprungError
    from sprung.identification import IdentificationSettings, coss_ssi

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


def vehicle_life(n_healthy, n_faulty, folder, seed):
    """Return a vehicle's fault, the findings a number of minutes after it, and false alarms before."""
    import numpy as np

    from sprung.diagnosis import detect, diagnose, learn
    from sprung.errors import DataError

    name = str(np.random.default_rng([seed, 6]).choice(PARTS))
    life = {"seed": seed, "name": name, "size": SIZES[seed // 2 % len(SIZES)]}
    taught, healthy, faulty, modes = windows(n_healthy, n_faulty, folder, life)
    try:
        baseline = learn(taught)
    except DataError as error:
        return {**life, "error": str(error)}
    calm = detect(baseline, healthy)
    found, said = {}, {}
    for minutes in MINUTES:
        findings = diagnose([*healthy[:3], *faulty[: minutes // 10]], baseline).findings
        found[str(minutes)] = f"{findings[0].corner}.{findings[0].component}" if findings else ""
        for one in findings:
            onset = [(time - faulty[0].time) / 60 for time in (one.since, *one.since_interval)]
            said[str(minutes)] = {"change": one.change, "interval": one.interval, "onset": onset}
    late = detect(baseline, [*healthy[:3], *faulty])
    life |= {
        "found": found,
        "said": said,
        "alarm": calm is not None and calm.first_alert is not None,
        "hours": len([one for one in healthy if one.is_conclusive]) / 6,
        "mute": sum(not one.is_conclusive for one in [*healthy, *faulty]),
        "delay": None if late is None or late.first_alert is None else (late.first_alert - faulty[0].time) / 60 + 10,
    }
    return life | ({"thesis": by_modes(*modes)} if modes else {})


def windows(n_healthy, n_faulty, folder, life):
    """Return the observations of learning, healthy and faulty windows, and their modes where the thesis' way runs."""
    from sprung.results.documents import observation_document, observation_from_document
    from sprung.vehicles import Component, Fault

    seed = life["seed"]
    kept = folder / f"{seed}.json.gz" if folder else None
    if kept and kept.exists():
        document = json.loads(gzip.decompress(kept.read_bytes()))
        return [*([observation_from_document(one) for one in part] for part in document), None]
    file, real = described(seed)
    fault = (Fault(Component.parse(life["name"]), -life["size"]),)
    numbers = (range(LEARNING), range(LEARNING, LEARNING + n_healthy), range(1000, 1000 + n_faulty))
    parts = [
        [window(file, real, seed, k, faults) for k in some]
        for some, faults in zip(numbers, ((), (), fault), strict=True)
    ]
    observations, modes = ([[pair[k] for pair in part] for part in parts] for k in range(2))
    if kept:
        folder.mkdir(parents=True, exist_ok=True)
        document = [[observation_document(one) for one in part] for part in observations]
        kept.write_bytes(gzip.compress(json.dumps(document).encode()))
    return [*observations, modes if is_thesis(seed) else None]


def by_modes(taught, healthy, faulty):
    """Return how far the modes of healthy and of faulty windows are from those before, and how many were found."""
    counts = [n // 10 for n in OF_THESIS]
    return {
        "healthy": [compared(taught, healthy[:n]) for n in counts],
        "faulty": [compared(taught, faulty[:n]) for n in counts],
        "modes": sum(len(modes) for modes in [*healthy, *faulty]),
        "windows": len(healthy) + len(faulty),
    }


def tables(lives):
    """Print detection by size, by part, what was named in place of what, sizes and onsets, and false alarms."""
    bad = [life for life in lives if "error" in life]
    good = [life for life in lives if "error" not in life]
    complete = [life for life in good if life["seed"] % 2 == 0]
    print("Found at the right part (found at a wrong one), with 95 % intervals of the share found")
    size_table("all parts in the file", complete)
    size_table("parts that the file does not know", [life for life in good if life["seed"] % 2 == 1])
    for kind, name in enumerate(UNKNOWN):
        size_table(f"of these: {name}", [x for x in good if x["seed"] % 2 == 1 and x["seed"] // 2 % 4 == kind])
    part_table(good)
    confusion(good)
    delays(good)
    sizes_and_onsets(good)
    hours, alarms = sum(life["hours"] for life in good), sum(life["alarm"] for life in good)
    low, high = (8 * limit / max(hours, 1e-9) for limit in poisson_interval(alarms))
    print(f"\n{alarms} false alarms in {hours:.0f} healthy hours: {low:.4f} to {high:.4f} per day of 8 h (95 %).")
    print(
        f"{len(bad)} vehicles failed or could not be learnt from; "
        f"{sum(life['mute'] for life in good)} windows were inconclusive."
    )
    for life in bad[:5]:
        print(f"- {life['error']}")
    thesis_table([life for life in good if "thesis" in life])


def size_table(title, lives):
    """Print how many faults of each size were found after 10, 30 and 120 minutes with them."""
    print(f"\n{title}\n\n| size | " + " | ".join(f"{m} min" for m in MINUTES) + " |\n|" + "---|" * (len(MINUTES) + 1))
    for size in SIZES:
        here = [life for life in lives if life["size"] == size]
        print(f"| {100 * size:.0f} % | " + " | ".join(share(here, str(minutes)) for minutes in MINUTES) + " |")


def share(lives, minutes):
    """Return how many faults had the right part named after a number of minutes, and how many a wrong one."""
    asked = [life for life in lives if minutes in life["found"]]
    right = sum(life["found"][minutes] == life["name"] for life in asked)
    wrong = sum(life["found"][minutes] not in {"", life["name"]} for life in asked)
    if not asked:
        return ""
    low, high = binomial_interval(right, len(asked))
    return f"{right} of {len(asked)}{f' ({wrong})' if wrong else ''}, {100 * low:.0f} to {100 * high:.0f} %"


def part_table(lives):
    """Print how many faults of each part were found after 30 minutes."""
    print("\nFound at the right part after 30 minutes, by part\n\n| part | " + " | ".join(map("{:.0%}".format, SIZES)))
    print("|" + "---|" * (len(SIZES) + 1))
    for part in PARTS:
        cells = []
        for size in SIZES:
            here = [life["found"]["30"] == part for life in lives if (life["name"], life["size"]) == (part, size)]
            cells.append(f"{sum(here)} of {len(here)}")
        print(f"| {part.replace('_', ' ').replace('.', ' ')} | " + " | ".join(cells) + " |")


def confusion(lives):
    """Print which corner and which component 120 minutes named in place of which, for faults of 5 % and more."""
    lives = [life for life in lives if life["size"] >= 0.05]
    for what, number, names in (("corner", 0, CORNERS), ("component", 1, KINDS)):
        columns = [*names, "both of an axle", "all corners", "unmodelled", "none"]
        print(f"\nNamed after 120 minutes, faults of 5 % and more, by {what}\n\n| {what} | " + " | ".join(columns))
        print("|" + "---|" * (len(columns) + 1))
        for name in names:
            said = [named(life["found"]["120"], number) for life in lives if life["name"].split(".")[number] == name]
            print(f"| {name} | " + " | ".join(str(said.count(column)) for column in columns) + " |")


def named(answer, number):
    """Return the column of an answer in the matrix of corners (0) or components (1)."""
    corner, _, component = answer.partition(".")
    groups = {"": "none", "vehicle": "unmodelled", "all": "all corners"}
    if corner in groups:
        return groups[corner]
    return (corner, component)[number] if corner in CORNERS else "both of an axle"


def delays(lives):
    """Print after how many minutes with a fault the first alarm came."""
    import numpy as np

    for words, low, high in (("10 % and more", 0.1, 1.0), ("5 %", 0.05, 0.05), ("2 %", 0.02, 0.02)):
        here = [life["delay"] for life in lives if low <= life["size"] <= high]
        found = [delay for delay in here if delay is not None]
        if found:
            median, most = np.quantile(
                [np.inf if delay is None else delay for delay in here], [0.5, 0.95], method="higher"
            )
            print(f"\nFaults of {words}: alarm after {median:.0f} min in the median, {most:.0f} min in 95 %; ", end="")
            print(f"none within 120 min in {len(here) - len(found)} of {len(here)}.")


def sizes_and_onsets(lives):
    """Print how often the intervals of size and onset hold the truth, where the right part was named."""
    import numpy as np

    right = [life for life in lives if "said" in life and life["found"]["120"] == life["name"]]
    if not right:
        return
    said = [life["said"]["120"] for life in right]
    covered = sum(
        one["interval"][0] <= -life["size"] <= one["interval"][1] for one, life in zip(said, right, strict=True)
    )
    errors = [abs(one["change"] + life["size"]) for one, life in zip(said, right, strict=True)]
    started = sum(one["onset"][1] <= 0 <= one["onset"][2] for one in said)
    median, most = 100 * np.quantile(errors, [0.5, 0.95])
    print(
        f"\nRight part after 120 minutes, {len(right)} vehicles: the 95 % interval holds the size {covered} times "
        f"(error {median:.1f} percentage points in the median, 95 % below {most:.1f}), and the onset {started} times."
    )


def binomial_interval(count, total):
    """Return the exact 95 % interval of a share (Clopper and Pearson)."""
    from scipy.stats import binomtest

    interval = binomtest(count, total).proportion_ci(0.95)
    return interval.low, interval.high


def poisson_interval(count):
    """Return the exact 95 % interval of a number of events (Garwood)."""
    from scipy.stats import chi2

    return (chi2.ppf(0.025, 2 * count) / 2 if count else 0.0), chi2.ppf(0.975, 2 * count + 2) / 2


def thesis_table(lives):
    """Print what the thesis' way finds where one healthy vehicle in twenty is called changed."""
    import numpy as np

    if not lives:
        return
    share = sum(life["thesis"]["modes"] for life in lives) / sum(3 * life["thesis"]["windows"] for life in lives)
    print(f"\nThe thesis' way, {len(lives)} vehicles: CoSS-SSI found {share:.0%} of the body modes of single windows.")
    print("Called changed (any part), where the threshold lets one healthy vehicle in twenty pass\n")
    columns = [f"{what}, {m} min" for what in ("frequency", "MAC") for m in OF_THESIS]
    print("| size | " + " | ".join(columns) + " | vehicles |")
    print("|" + "---|" * (2 * len(OF_THESIS) + 2))
    values = {state: np.array([life["thesis"][state] for life in lives]) for state in ("healthy", "faulty")}
    limits = np.quantile(values["healthy"], 0.95, axis=0)
    for size in SIZES:
        rows = np.array([life["size"] == size for life in lives])
        counts = (values["faulty"][rows] > limits).sum(axis=0).T
        print(f"| {100 * size:.0f} % | " + " | ".join(map(str, counts.ravel())) + f" | {rows.sum()} |")


if __name__ == "__main__":
    main()
