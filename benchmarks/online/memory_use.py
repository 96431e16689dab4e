"""Memory of monitored vehicles."""

import argparse
import pickle
import subprocess
import sys
from pathlib import Path

from measuring import print_table
from programs import Course, course, memory


def measure_memory(_given: argparse.Namespace, folder: Path) -> None:
    """Memory of watched vehicles, each number of them in a process of its own."""
    from sprung.vehicles import read_vehicle
    from sprung.vehicles.sensor_layout import quantities_of

    prepared, file = course(), folder / "frames"
    file.write_bytes(pickle.dumps((prepared.documents, quantities_of(prepared.first, read_vehicle("zafira").sensor))))

    def measured(n_vehicles: int, seconds: int) -> float:
        command = [sys.executable, Path(__file__).parent, "--memory-of", str(n_vehicles), str(seconds), str(file)]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    cases = [(0, 0), (50, 300), (200, 300), (200, 599)]
    sizes = [measured(*case) for case in cases]
    print_table(
        "Memory of vehicles (goal: below 1 MB of each)",
        ("vehicles", "of a window of 600 s", "MiB of the process", "MB of each vehicle"),
        [
            (str(n), f"{s} s" if n else "", f"{size:.0f}", f"{(size - sizes[0]) * 1.048576 / n:.2f}" if n else "")
            for (n, s), size in zip(cases, sizes, strict=True)
        ],
    )


def memory_of(n_vehicles: int, seconds: int, file: Path) -> float:
    """Return the memory of a process that watches vehicles whose windows hold some seconds [MiB]."""
    from sprung.link import decode, frame_block
    from sprung.monitor import MonitorSettings, VehicleMonitor
    from sprung.vehicles import read_vehicle, vehicle_from_text, vehicle_text

    documents, quantities = pickle.loads(file.read_bytes())
    prepared, text = Course(documents, None, 0), vehicle_text(read_vehicle("zafira"))
    watched = []
    for k in range(n_vehicles):
        watched.append(
            VehicleMonitor(vehicle_from_text(text, source="car"), settings=MonitorSettings(identify_every=0))
        )
        for seq in range(seconds):
            watched[-1].update(frame_block(decode(prepared.payload(f"car-{k}", 1, seq)), quantities))
    return memory()
