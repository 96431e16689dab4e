"""A vehicle of 48 channels among nine of four: how long these wait for it, and how many processes it costs."""

import argparse
import time
from pathlib import Path
from statistics import median
from typing import Any

from measuring import print_table
from programs import WINDOW, Monitor, Vehicle, course, mosquitto, until

#: Neighbours, windows of each, and accelerometers at each corner of the wide vehicle.
_NEIGHBOURS, _WINDOWS, _COPIES = 9, 4, 12
_FRAME = 10.0


def measure_slow(given: argparse.Namespace, folder: Path) -> None:
    """Nine vehicles alone, then next to one of 48 channels."""
    rows = []
    for has_wide in (True, False):
        place = folder / ("wide" if has_wide else "alone")
        place.mkdir()
        n_windows = 3 if given.quick else _WINDOWS
        watch = {"seconds_per_job": given.seconds_per_job, "identify_every_minutes": 0 if given.quick else 1}
        waits, windows, figures = waits_of(place, has_wide=has_wide, n_windows=n_windows, **watch)
        lost, slow = figures["sprung_workers_replaced_total"], figures["sprung_vehicles_slow"]
        counts = (str(windows), f"{lost:.0f}", f"{slow:.0f}")
        seconds = (f"{median(waits):.1f}", f"{max(waits):.1f}")
        rows.append(("with 48 channels" if has_wide else "alone", str(len(waits)), *seconds, *counts))
    print_table(
        f"{_NEIGHBOURS} vehicles of 4 channels, each with a window at once, one worker: from last frame in the spool "
        "to observation in the store",
        ("", "windows", "median, s", "longest, s", "windows of the wide one", "processes lost", "slow vehicles"),
        rows,
    )


def waits_of(
    folder: Path, *, has_wide: bool, n_windows: int, **watch: float
) -> tuple[list[float], int, dict[str, float]]:
    """Return the waits of all windows of the neighbours, the number of windows of the wide vehicle, and figures."""
    from sprung.online.store import open_store

    car = wide_car()
    wide_course = course(length=_FRAME, car=car) if has_wide else None
    prepared, n_frames, waits = course(length=_FRAME), round(WINDOW / _FRAME), []
    with mosquitto(folder) as broker:
        monitor = Monitor(broker, folder, **watch)
        store = open_store(monitor.store)
        cars = [Vehicle(f"car-{k}", broker, folder, prepared) for k in range(_NEIGHBOURS)]
        wide = [] if wide_course is None else [Vehicle("wide", broker, folder, wide_course, car)]
        for vehicle in (*wide, *cars):
            vehicle.box.open(timeout=10.0)
        for number in range(n_windows):
            for vehicle in (*wide, *cars):
                vehicle.drive(n_frames)
            begin, missing = time.monotonic(), {vehicle.name for vehicle in cars}

            def arrived(waiting: set[str], number: int, begin: float) -> bool:
                for vehicle in (*wide, *cars):
                    vehicle.box.step()
                for name in sorted(waiting):
                    if (last := store.results.observations(name, limit=1)) and last[0].number >= number:
                        waits.append(time.monotonic() - begin)
                        waiting.discard(name)
                return not waiting

            until(lambda: arrived(missing, number, begin), patience=900.0)  # noqa: B023
        windows, figures = store.results.n_observations("wide"), monitor.figures()
        for vehicle in (*wide, *cars):
            vehicle.box.close()
        store.close()
        monitor.close()
    return waits, windows, figures


def wide_car() -> Any:
    """Return the car with 48 accelerometers, twelve at each corner, ten centimetres apart."""
    from sprung.vehicles import read_vehicle

    car = read_vehicle("zafira")
    sensors = []
    for sensor in car.sensor:
        x, y, z = sensor.position
        for copy in range(_COPIES):
            place = (x - 0.1 * copy * (1 if x > 0 else -1), y, z)
            sensors.append(sensor.model_copy(update={"channel": f"{sensor.channel}_{copy}", "position": place}))
    return car.model_copy(update={"sensor": tuple(sensors)})
