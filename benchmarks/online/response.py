"""Latency of a window, and catching up after an outage."""

import argparse
import threading
import time
from functools import partial
from pathlib import Path
from statistics import median

from measuring import print_table
from programs import HOUR, WINDOW, Monitor, Vehicle, course, cpu, is_analysed, mosquitto, until
from viewing import Viewers


def measure_latency(given: argparse.Namespace, folder: Path) -> None:
    """From the last frame of a window in the box to the observation in the store."""
    rows = []
    for every, others, viewers in ((1, 0, 0), (0, 0, 0), (0, 50, 0), (0, 50, 20)):
        place = folder / f"{every}-{others}-{viewers}"
        place.mkdir()
        times, pages, n_failed = latencies(place, every, others, given.windows, n_viewers=viewers)
        said = "every minute" if every else "never"
        seconds = (f"{median(times):.3f}", f"{quantile(times, 0.95):.3f}")
        shown = (f"{median(pages):.3f}", f"{quantile(pages, 0.95):.3f}", str(n_failed)) if viewers else ("", "", "")
        rows.append((said, str(others), str(viewers), str(len(times)), *seconds, *shown))
    print_table(
        "From the last frame of a window in the spool of the box to its observation in the store",
        (
            "modes identified",
            "other vehicles, one frame a second each",
            "viewers, one page in 2 s each",
            "windows",
            "median, s",
            "95 %, s",
            "page: median, s",
            "95 %, s",
            "failed",
        ),
        rows,
    )


def quantile(values: list[float], share: float) -> float:
    """Return the value that a share of values does not exceed."""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def latencies(
    folder: Path, every: int, n_others: int, n_windows: int, *, n_viewers: int = 0
) -> tuple[list[float], list[float], int]:
    """Return the latencies of windows after the two that are learnt from, and the times of pages and their failures."""
    from sprung.online.store import open_store

    prepared, times, stopping = course(3), [], threading.Event()
    with mosquitto(folder) as broker:
        monitor = Monitor(broker, folder, identify_every_minutes=every, learning_windows=2)
        store = open_store(monitor.store)
        car = Vehicle("car", broker, folder, prepared)
        others = [Vehicle(f"other-{k}", broker, folder, prepared) for k in range(n_others)]
        for vehicle in (car, *others):
            vehicle.box.open(timeout=10.0)

        def drive_others() -> None:
            while not stopping.wait(1.0):
                for other in others:
                    other.drive(1)
                    other.box.step()

        driving = threading.Thread(target=drive_others)
        driving.start()
        with Viewers(monitor.address, n_viewers) as viewers:
            for number in range(2 + n_windows):
                car.drive((number + 1) * WINDOW - 1 - car.seconds)
                until(partial(is_analysed, car, monitor, n_others), patience=300.0)
                time.sleep(0.2)
                begin = time.perf_counter()
                car.drive(1)
                while not (last := store.results.observations("car", limit=1)) or last[0].number < number:
                    car.box.step()
                    time.sleep(0.002)
                times.append(time.perf_counter() - begin)
        stopping.set()
        driving.join()
        for vehicle in (car, *others):
            vehicle.box.close()
        store.close()
        monitor.close()
    return times[2:], viewers.times, viewers.n_failed


def measure_catch_up(_given: argparse.Namespace, folder: Path) -> None:
    """An hour of eight vehicles after an outage: spools that are full, one worker."""
    n_vehicles, prepared, rows = 8, course(3), []
    for every in (1, 0):
        place = folder / str(every)
        place.mkdir()
        with mosquitto(place) as broker:
            cars = [Vehicle(f"car-{k}", broker, place, prepared) for k in range(n_vehicles)]
            for car in cars:
                car.drive(HOUR - 1)
            monitor = Monitor(broker, place, identify_every_minutes=every, learning_windows=2)
            (worker,) = monitor.workers
            begin = time.monotonic()
            for car in cars:
                car.box.open()
            while not all(car.has_sent for car in cars):
                for car in cars:
                    car.box.step()
                time.sleep(0.02)
            sent = time.monotonic() - begin
            windows = n_vehicles * HOUR // WINDOW
            until(lambda: monitor.figures()["sprung_windows_total"] == windows, patience=900.0, every=0.2)  # noqa: B023
            done = time.monotonic() - begin
            spent = cpu(monitor.pid), cpu(worker)
            for car in cars:
                car.box.close()
            monitor.close()
        said = "every minute" if every else "never"
        cells = (f"{sent:.0f}", f"{HOUR / sent:.0f}", f"{done:.0f}", f"{HOUR / done:.0f}")
        rows.append((said, *cells, *(f"{each:.0f}" for each in spent), str(len(monitor.errors))))
    print_table(
        f"An hour of {n_vehicles} vehicles after an outage, one worker (goal: 20 times real time)",
        (
            "modes identified",
            "all acknowledged, s",
            "times real time",
            "all analysed, s",
            "times real time",
            "CPU of monitor, s",
            "of worker, s",
            "errors",
        ),
        rows,
    )
