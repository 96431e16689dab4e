"""Faults of sensors: how many are named with their channel, and whether any becomes a finding of the suspension."""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

LEARNING, MINUTES = 8, 5


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument(
        "--drives", type=int, default=20, help="vehicles' windows that each kind of fault is put into"
    )
    arguments.add_argument("--each", type=int, default=10, help="faults of each kind in a drive")
    arguments.add_argument("--jobs", type=int, default=2)
    given = arguments.parse_args()
    with ProcessPoolExecutor(given.jobs) as pool:
        taught = list(pool.map(observed, range(LEARNING)))
        parts = list(pool.map(partial(trials, taught, given.each), range(100, 100 + given.drives)))
    print("| fault | trials | named with its channel | another word or channel | missed | suspension finding |")
    print("|" + "---|" * 6)
    for kind in parts[0][0]:
        counts = [sum(part[kind][k] for part, _ in parts) for k in range(4)]
        word = "swapped (all four sensors named)" if kind == "swapped" else kind
        print(f"| {word} | {sum(counts[:3])} | " + " | ".join(map(str, counts)) + " |")
    print(f"\nSmall faults of acc_fl, windows with each named, of {given.drives}\n")
    for kind in parts[0][1]:
        sizes = parts[0][1][kind]
        print(f"| {kind} | " + " | ".join(f"{size:g}" for size in sizes) + " |")
        print("|" + "---|" * (len(sizes) + 1))
        print("| named | " + " | ".join(str(sum(part[kind][size] for _, part in parts)) for size in sizes) + " |\n")


def drive(seed):
    """Return a nonlinear drive under changing conditions."""
    from dataclasses import replace

    import numpy as np

    from sprung.simulation import (
        FEW_POTHOLES,
        REALISTIC_SUSPENSION,
        Payload,
        RoadConditions,
        RoadDrive,
        simulate_drive,
    )
    from sprung.vehicles import read_vehicle

    generator = np.random.default_rng([seed, 8])
    settings = RoadDrive(
        duration=60.0 * MINUTES,
        road=RoadConditions(str(generator.choice(["B", "C", "D"])), potholes=FEW_POTHOLES),
        payload=Payload(float(generator.uniform(0, 300))),
        suspension=replace(REALISTIC_SUSPENSION, temperature=float(generator.uniform(0, 40))),
        snr=50.0,
    )
    return simulate_drive(read_vehicle("zafira"), settings, seed=seed).recording


def observed(seed):
    """Return the observation of a healthy window."""
    from sprung.diagnosis import observe_window
    from sprung.vehicles import read_vehicle

    return observe_window(drive(seed), read_vehicle("zafira"), time=60.0 * MINUTES * seed)


def faults(name, rms, generator):
    """Return a fault of each kind at a channel, of a random size."""
    from sprung.simulation import (
        clipped,
        dead,
        delayed,
        drifting,
        inverted,
        noisy,
        scaled,
        spiking,
        stuck,
        swapped,
        with_hum,
    )

    between = generator.uniform
    others = [other for other in ("acc_fl", "acc_fr", "acc_rl", "acc_rr") if other != name]
    gain = between(1.1, 1.5)
    return {
        "none": None,
        "dead": partial(dead, channel=name, onset=between(0, 200)),
        "stuck": partial(stuck, channel=name, onset=between(0, 200)),
        "clipped": partial(clipped, channel=name, limit=between(1.5, 3) * rms),
        "spiking": partial(spiking, channel=name, rate=between(0.02, 0.2), height=between(10, 40) * rms),
        "noisy": partial(noisy, standard_deviation=between(0.2, 1.0) * rms, channel=name),
        "drifting": partial(drifting, channel=name, per_hour=between(2, 10) * rms),
        "inverted": partial(inverted, channel=name),
        "swapped": partial(swapped, first=name, second=str(generator.choice(others))),
        "wrong_gain": partial(scaled, channel=name, factor=gain if generator.random() < 0.5 else 1 / gain),
        "time_shifted": partial(delayed, channel=name, delay=between(4e-3, 30e-3)),
        "hum": partial(with_hum, channel=name, amplitude=between(0.05, 0.3) * rms),
    }


def small_faults(rms):
    """Return faults of acc_fl by kind and size: gains, delays [ms], and noise over the signal."""
    from sprung.simulation import delayed, noisy, scaled

    name = "acc_fl"
    return {
        "wrong_gain": {gain: partial(scaled, channel=name, factor=gain) for gain in (1.02, 1.04, 1.06, 1.08, 1.1)},
        "time_shifted": {
            delay: partial(delayed, channel=name, delay=1e-3 * delay) for delay in (1.0, 1.5, 2.0, 3.0, 4.0)
        },
        "noisy": {
            share: partial(noisy, standard_deviation=share * rms, channel=name) for share in (0.02, 0.05, 0.1, 0.2)
        },
    }


def named_small(run, car):
    """Return which small faults are named."""
    from sprung.diagnosis import sensor_faults
    from sprung.simulation import with_imperfections

    every = small_faults(float(run.samples[run.index("acc_fl")].std()))
    return {
        kind: {
            size: ("acc_fl", kind)
            in {(one.channel, one.kind) for one in sensor_faults(with_imperfections(run, [fault]), car)}
            for size, fault in some.items()
        }
        for kind, some in every.items()
    }


def trials(taught, each, seed):
    """Return how many of each kind were named, given another name, missed, became a finding; and small ones."""
    import numpy as np

    from sprung.diagnosis import diagnose, learn, observe_window
    from sprung.simulation import with_imperfections
    from sprung.vehicles import read_vehicle

    car, run = read_vehicle("zafira"), drive(seed)
    baseline = learn(taught)
    generator = np.random.default_rng([seed, 9])
    counts = {}
    for number in range(each):
        name = str(generator.choice(["acc_fl", "acc_fr", "acc_rl", "acc_rr"]))
        rms = float(run.samples[run.index(name)].std())
        for kind, fault in faults(name, rms, generator).items():
            if kind == "none" and number:
                continue
            broken = run if fault is None else with_imperfections(run, [fault], seed=number)
            window = observe_window(broken, car)
            found = window.sensor_faults
            is_finding = bool(diagnose([window, window], baseline).findings)
            is_named = (name, kind) in {(one.channel, one.kind) for one in found} or (kind == "none" and not found)
            row = counts.setdefault(kind, [0, 0, 0, 0])
            row[0 if is_named else 1 if found else 2] += 1
            row[3] += is_finding
    return counts, named_small(run, car)


if __name__ == "__main__":
    main()
