"""Make the lake of a fleet: every vehicle drives each window on a road of its own; some change half-way.

    python benchmarks/fleet/make.py FOLDER --vehicles 200 --windows 20

writes FOLDER/lake, FOLDER/vehicles and FOLDER/faults.json.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from sprung.fleet.lake import Lake, LakeWindow, window_of_recording
from sprung.recording import Channel, Recording
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle, vehicle_text

START = 1_767_225_600 * 10**9  # 2026-01-01
BETWEEN = 1800 * 10**9
FAULTS = ("front_left.spring=-0.3", "rear_right.damper=-0.5", "rear_left.tyre=-0.3", "front_right.damper=-0.5")


def fault_of(vehicle: int, every: int) -> str | None:
    """Change of a vehicle: one in `every` has one."""
    return FAULTS[(vehicle // every) % len(FAULTS)] if every and vehicle % every == 0 else None


@lru_cache(maxsize=256)
def driven(seed: tuple[int, ...], minutes: float, rate: float, fault: str | None) -> Recording:
    """The recording of a drive."""
    faults = () if fault is None else (parse_fault(fault),)
    settings = RoadDrive(duration=60 * minutes, sampling_rate=rate, snr=50.0, faults=faults)
    recording = simulate_drive(read_vehicle("zafira"), settings, seed=list(seed)).recording
    # As files are, which seldom state the places of sensors.
    channels = tuple(Channel(channel.name, channel.quantity) for channel in recording.channels)
    return replace(recording, history=(), channels=channels)


def windows_of(case: tuple[int, int, int, float, float, int, int]) -> list[LakeWindow]:
    """The windows of a vehicle; on `roads` different roads, if that is not 0, so that drives repeat."""
    vehicle, first, n_windows, minutes, rate, every, roads = case
    fault = fault_of(vehicle, every)
    made = []
    for number in range(first, n_windows):
        seed = (11, vehicle, number) if not roads else (11, 0, (vehicle * n_windows + number) % roads)
        recording = driven(seed, minutes, rate, fault if number >= n_windows // 2 else None)
        stamped = replace(recording, start=START + number * BETWEEN)
        made.append(window_of_recording(f"car{vehicle:05d}", stamped, source="simulation"))
    return made


def make(
    folder: Path,
    *,
    vehicles: int,
    windows: int,
    first: int = 0,
    minutes: float = 2.0,
    rate: float = 100.0,
    every: int = 20,
    roads: int = 0,
    processes: int = 2,
) -> Lake:
    """Make the lake and the vehicle files, or add the windows from `first` on."""
    (folder / "vehicles").mkdir(parents=True, exist_ok=True)
    text = vehicle_text(read_vehicle("zafira"))
    for vehicle in range(vehicles):
        (folder / "vehicles" / f"car{vehicle:05d}.toml").write_text(text)
    faults = {f"car{k:05d}": fault for k in range(vehicles) if (fault := fault_of(k, every))}
    (folder / "faults.json").write_text(json.dumps(faults))
    lake = Lake(folder / "lake")
    cases = [(vehicle, first, windows, minutes, rate, every, roads) for vehicle in range(vehicles)]
    with ProcessPoolExecutor(processes) as pool:
        lake.write(window for made in pool.map(windows_of, cases, chunksize=4) for window in made)
    return lake


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--vehicles", type=int, default=200)
    parser.add_argument("--windows", type=int, default=20)
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--rate", type=float, default=100.0, help="samples per second")
    parser.add_argument("--every", type=int, default=20, help="number of vehicles of which one changes half-way")
    parser.add_argument("--roads", type=int, default=0, help="number of different drives; 0: all different")
    chosen = parser.parse_args()
    made = make(
        chosen.folder,
        vehicles=chosen.vehicles,
        windows=chosen.windows,
        minutes=chosen.minutes,
        rate=chosen.rate,
        every=chosen.every,
        roads=chosen.roads,
    )
    print(made.facts)
