"""Memory of monitored vehicles."""

import argparse
import pickle
import subprocess
import sys
from pathlib import Path

from measuring import print_table
from programs import WINDOW, Course, course, memory


def measure_memory(given: argparse.Namespace, folder: Path) -> None:
    """Memory of watched vehicles, each number of them in a process of its own."""
    sizes = memories(folder, quick=given.quick, length=given.frame_seconds)
    print_table(
        "Memory of vehicles (goal: below 1 MB of each)",
        ("window", "MB of each vehicle"),
        [(name, f"{size:.2f}") for name, size in sizes.items()],
    )


def memories(folder: Path, *, quick: bool, length: float) -> dict[str, float]:
    """Return the memory of a vehicle in a worker by the fill of its window [MB]."""
    from sprung.vehicles import read_vehicle
    from sprung.vehicles.sensor_layout import quantities_of

    prepared, file = course(length=length), folder / "frames"
    quantities = quantities_of(prepared.first, read_vehicle("zafira").sensor)
    file.write_bytes(pickle.dumps((prepared.documents, quantities, length)))

    def measured(n_vehicles: int, seconds: int) -> float:
        command = [sys.executable, Path(__file__).parent, "--memory-of", str(n_vehicles), str(seconds), str(file)]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    n = 50 if quick else 200
    fills = {"half full": WINDOW // 2, "full": round(WINDOW - length)}
    alone = measured(0, 0)
    return {name: (measured(n, seconds) - alone) * 1.048576 / n for name, seconds in fills.items()}


def memory_of(n_vehicles: int, seconds: int, file: Path) -> float:
    """Return the memory of a process that watches vehicles whose windows hold some seconds [MiB]."""
    from sprung.link import decode, frame_block
    from sprung.online.monitor import MonitorSettings, VehicleMonitor
    from sprung.vehicles import read_vehicle, vehicle_from_text, vehicle_text

    documents, quantities, length = pickle.loads(file.read_bytes())
    prepared, text = Course(documents, None, 0, length), vehicle_text(read_vehicle("zafira"))
    watched = []
    for k in range(n_vehicles):
        watched.append(
            VehicleMonitor(vehicle_from_text(text, source="car"), settings=MonitorSettings(identify_every=0))
        )
        for seq in range(round(seconds / length)):
            watched[-1].update(frame_block(decode(prepared.payload(f"car-{k}", 1, seq)), quantities))
    return memory()
