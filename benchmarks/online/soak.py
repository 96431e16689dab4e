"""A fleet at a hundred times real time."""

import argparse
import time
from pathlib import Path
from statistics import median

from measuring import print_table
from programs import HOUR, WINDOW, Monitor, Vehicle, course, is_analysed, memory, mosquitto, n_files, until

TROUBLES = ("messages_refused", "frames_lost", "failures")


def measure_soak(given: argparse.Namespace, folder: Path) -> None:
    """A fleet at a hundred times real time."""
    pace, prepared, samples = 100, course(3), []
    with mosquitto(folder) as broker:
        monitor = Monitor(broker, folder, workers=given.workers, learning_windows=6)
        cars = [Vehicle(f"car-{k}", broker, folder, prepared) for k in range(given.soak_vehicles)]
        for car in cars:
            car.box.open(timeout=10.0)
        begin = time.monotonic()
        while (now := time.monotonic() - begin) < 60 * given.soak_minutes:
            for car in cars:
                car.drive(max(0, round(pace * now) - car.seconds))
                car.box.step()
            if not samples or now > samples[-1][0] + 2:
                samples.append((now, *state_of(monitor)))
            time.sleep(0.02)
        windows = sum(car.seconds // WINDOW for car in cars)
        until(lambda: [is_analysed(car, monitor) for car in cars] == [True] * len(cars), patience=600.0, every=0.1)
        samples.append((time.monotonic() - begin, *state_of(monitor)))
        figures = monitor.figures()
        for car in cars:
            car.box.close()
        monitor.close()
    late = [sample for sample in samples[:-1] if sample[0] > samples[-2][0] / 3]
    hours = pace * samples[-2][0] / HOUR * len(cars)
    rows = [
        (
            name,
            *(f"{value:.1f}" for value in (samples[0][k], late[0][k], samples[-1][k])),
            f"{HOUR * slope(late, k):+.0f}",
            f"{HOUR * slope(late, k) / pace / len(cars):+.3f}",
        )
        for name, k in (("monitor", 1), ("workers together", 2))
    ]
    print_table(
        f"Soak: {len(cars)} vehicles at {pace} times real time for {given.soak_minutes:g} min, {given.workers} workers",
        ("", "MiB at the start", "after a third", "at the end", "slope, MiB per hour", "MiB per vehicle-hour"),
        rows,
    )
    print_table(
        f"Soak, {hours:.1f} vehicle-hours",
        ("what", "value"),
        [
            ("open files, start, after a third, end", f"{samples[0][3]}, {late[0][3]}, {samples[-1][3]}"),
            ("backlog, frames: median, most, end", " ".join(f"{value:.0f}" for value in backlog(samples))),
            ("windows analysed of those sent", f"{figures['sprung_windows_total']:.0f} of {windows}"),
            ("frames stored", f"{figures['sprung_frames_total']:.0f} of {sum(car.seconds for car in cars)}"),
            ("refused, lost, failures", " ".join(f"{figures[f'sprung_{name}_total']:.0f}" for name in TROUBLES)),
            ("warnings and errors in the log", str(len(monitor.errors))),
            ("store, KiB per vehicle-hour", f"{(samples[-1][5] - late[0][5]) / 1024 / hours * 1.5:.0f}"),
        ],
    )
    for line in monitor.errors[:5]:
        print(line)


def state_of(monitor: Monitor) -> tuple[float, ...]:
    """Return memory of the monitor and of its workers [MiB], open files, backlog, and bytes of the store."""
    figures, workers = monitor.figures(), monitor.workers
    files = n_files(monitor.pid) + sum(map(n_files, workers))
    backlog, size = figures["sprung_backlog_frames"], figures["sprung_store_bytes"]
    return memory(monitor.pid), sum(map(memory, workers)), files, backlog, size


def backlog(samples: list[tuple[float, ...]]) -> tuple[float, float, float]:
    """Return the median, the largest and the last backlog."""
    values = [sample[4] for sample in samples]
    return median(values), max(values), values[-1]


def slope(samples: list[tuple[float, ...]], column: int) -> float:
    """Return the change of a column per second, by least squares."""
    import numpy as np

    table = np.array(samples, dtype=float)
    return float(np.polyfit(table[:, 0], table[:, column], 1)[0])
