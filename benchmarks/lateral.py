"""Lateral and vertical faults of a coach, diagnosed together: `python -m benchmarks.lateral`.

The coach has four lateral accelerometers on its frames, lateral parts that differ from its file by production scatter,
loads up to 4 t, speeds up to 33 to 44 m/s, and tracks of ERRI B176 low and high with joints. Its baseline is learnt
from drives of five minutes; then drives with a fault, and healthy ones, are diagnosed three together. At the end stands
how many of the faults and of the healthy sets came to what; 15 % of conicity are the wear of wheels, which need not be
named but must not be called a spring.
"""

import argparse
import os
from collections import Counter

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from sprung.diagnosis import diagnose, learn, observe_window
from sprung.simulation import Payload, RailDrive, simulate_drive
from sprung.vehicles import Sensor, parse_fault, read_vehicle
from sprung.vehicles.lateral import lateral_parts

ROWS = (
    {},
    {"bogie1.lateral_damper": -0.4},
    {"wheelsets.conicity": 0.6},
    {"bogie2.lateral_spring": -0.25},
    {"bogie1.primary_longitudinal_spring": -0.2},
    {"bogie2_rear_left.primary_spring": -0.2},
    {"bogie1_left.secondary_damper": -0.4},
    {},
    {"wheelsets.conicity": 0.15},
)
OUTCOMES = ("right part", "wrong part", "inconclusive", "no change detected")
#: Drives that are diagnosed together; production scatter of lateral parts.
TOGETHER, SCATTER = 3, 0.06


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--learning", type=int, default=8, help="drives of the baseline")
    parser.add_argument("--minutes", type=float, default=5.0, help="length of a drive")
    parser.add_argument("--car", type=int, default=5, help="number of the coach")
    parser.add_argument("--healthy", type=int, default=0, help="further healthy sets")
    parser.add_argument("--on-body", action="store_true", help="with a lateral accelerometer on the body, too")
    given = parser.parse_args()
    coach = with_lateral_sensors(read_vehicle("coach"), on_body=given.on_body)
    parts = [str(part) for part in lateral_parts(coach)][1:]
    own = dict(zip(parts, np.random.default_rng(given.car).normal(0, SCATTER, len(parts)), strict=True))

    def observed(number, faults):
        run = drive(coach, number, own, faults, given.minutes)
        return observe_window(run, coach, time=600.0 * number)

    baseline = learn([observed(number, {}) for number in range(given.learning)])
    counts = {"faults": Counter(), "healthy": Counter()}
    for row, faults in enumerate((*ROWS, *({},) * given.healthy)):
        found = diagnose([observed(100 + 10 * row + k, faults) for k in range(TOGETHER)], baseline)
        named = {f"{finding.corner}.{finding.component}" for finding in found.findings}
        outcome = found.verdict.replace("_", " ") if not named else OUTCOMES[named != set(faults)]
        counts["faults" if faults else "healthy"][outcome] += 1
        print(
            faults or "healthy",
            found.verdict,
            *(finding.sentence for finding in found.findings),
            *found.doubts,
            flush=True,
        )
    print("", *OUTCOMES, sep=" | ")
    for drives, count in counts.items():
        print(drives, *(count[outcome] for outcome in OUTCOMES), sep=" | ")


def with_lateral_sensors(coach, *, on_body=False):
    """Return the coach with lateral accelerometers at both ends of its frames, and above the first one on the body."""
    common = {"quantity": "acceleration", "unit": "m/s^2", "direction": (0.0, 1.0, 0.0)}
    sensors = [
        Sensor(channel=f"bogie{number}_{end}y", position=(x, 0.0, 0.0), on=f"bogie{number}", **common)
        for number in (1, 2)
        for end, x in (("f", 1.28), ("r", -1.28))
    ]
    if on_body:
        sensors.append(Sensor(channel="body_fy", position=(9.5, 0.0, -0.7), **common))
    return coach.model_copy(update={"sensor": (*coach.sensor, *sensors)})


def drive(coach, number, own, faults, minutes):
    """Return a drive of the coach with its own parts and faults."""
    generator = np.random.default_rng([number, 7])
    changes = own | {name: (1 + own.get(name, 0.0)) * (1 + change) - 1 for name, change in faults.items()}
    top = float(generator.uniform(33, 44))
    settings = RailDrive(
        duration=60.0 * minutes,
        sampling_rate=100.0,
        speed=(top - 6, top),
        snr=20.0,
        quality=str(generator.choice(["good", "bad"])),
        payload=Payload(float(generator.uniform(0, 4000))),
        faults=tuple(parse_fault(f"{name}={change:.4f}") for name, change in changes.items()),
    )
    return simulate_drive(coach, settings, seed=number).recording


if __name__ == "__main__":
    main()
