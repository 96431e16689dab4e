"""CPU time of a vehicle: analysis of windows in this process, frames through real processes."""

import argparse
import threading
import time
from pathlib import Path
from statistics import median

from measuring import print_table
from programs import HOUR, WINDOW, Course, Monitor, Parts, course, cpu, mosquitto, publisher, until

IDENTIFYING = ("search for harmonics", "other preparation", "poles and selection", "correlations, merging, labels")


def measure_cpu(given: argparse.Namespace, folder: Path) -> None:
    """CPU time of a vehicle: analysis of windows in this process, frames through real processes."""
    hourly = analysed(given.windows, folder)
    taken = intake(folder)
    lives = [live(n_vehicles, folder) for n_vehicles in given.live]
    print_table(
        "The station and a worker, live: a frame a second of each vehicle, no window complete",
        (
            "vehicles",
            "frames/s stored",
            "backlog, frames",
            "later",
            "monitor, s per vehicle-hour",
            "worker",
            "of a core",
        ),
        [(str(n), *each) for n, (each, _) in zip(given.live, lives, strict=True)],
    )
    station, worker = lives[-1][1]
    identification = sum(hourly[part] for part in IDENTIFYING)
    rows = [
        ("intake: frames decoded, stored, acknowledged", taken),
        ("station: link, dispatch, housekeeping", station - taken),
        ("station: results and state stored, alerts", hourly["results"]),
        ("station: samples archived", hourly["archive"]),
        ("worker: frames received, decoded, kept", worker),
        ("identification every minute", identification),
        ("observation: checks of the sensors", hourly["sensors"]),
        ("observation: fit of the corners, conditions", hourly["observation"]),
        ("diagnosis, looking back on 96 windows", hourly["diagnosis"]),
        ("state after every window", hourly["state"]),
    ]
    print_table("CPU of a vehicle", ("part", "s per vehicle-hour"), [(name, f"{value:.2f}") for name, value in rows])
    rest = sum(value for _, value in rows) - identification
    cases = {"every minute": identification, "every ten minutes": hourly["every ten minutes"], "never": 0.0}
    print_table(
        "Vehicles of a core (goal: 2,000)",
        ("modes identified", "s per vehicle-hour", "vehicles per core", "of the goal"),
        [
            (case, f"{rest + more:.2f}", f"{HOUR / (rest + more):.0f}", f"{HOUR / (rest + more) / 2000:.0%}")
            for case, more in cases.items()
        ],
    )
    print_table(
        "Where an identification goes",
        ("part", "share"),
        [(part, f"{hourly[part] / identification:.0%}") for part in sorted(IDENTIFYING, key=lambda p: -hourly[p])],
    )


def analysed(n_windows: int, folder: Path) -> dict[str, float]:
    """Return CPU seconds per hour of the parts of the analysis of windows, by a station in this process."""
    from sprung.diagnosis import observation
    from sprung.identification import METHODS, methods, preparation
    from sprung.link import decode, frame_block, joined
    from sprung.monitor import VehicleMonitor, engine
    from sprung.monitor.ledger import Ledger

    prepared, parts, inline = course(3), Parts(), Inline()
    station = here(folder, inline, learning_windows=6)
    describe(station, prepared, 1)
    places = (
        (preparation, "find_harmonics", IDENTIFYING[0]),
        (methods, "prepare", IDENTIFYING[1]),
        (methods, "_subset_modes", IDENTIFYING[2]),
        (VehicleMonitor, "_identify", IDENTIFYING[3]),
        (observation, "check_sensors", "sensors"),
        (engine, "observe", "observation"),
        (VehicleMonitor, "_diagnose", "diagnosis of few windows"),
        (VehicleMonitor, "state", "state"),
        (Ledger, "_archive", "archive"),
        (Ledger, "commit", "results"),
        (Ledger, "update_alerts", "results"),
    )
    with parts.of(*places):
        for number in range(6 + n_windows):
            if number == 6:
                parts.seconds.clear()
            for seq in range(number * WINDOW, (number + 1) * WINDOW):
                station.receive("sprung/v1/car-0/raw", prepared.payload("car-0", 1, seq))
            until(lambda: station.step() or station.is_idle, patience=600.0, every=0.0)
    hourly = {part: seconds * HOUR / WINDOW / n_windows for part, seconds in parts.seconds.items()}
    watched, quantities = inline.watched["car-0"]
    whole = joined([frame_block(decode(prepared.payload("car-0", 1, seq)), quantities) for seq in range(WINDOW)])
    hourly["every ten minutes"] = HOUR / WINDOW * seconds_of(lambda: METHODS["cov"](whole, vehicle=watched.vehicle))
    state = watched.state()
    state["observations"] = (state["observations"] * 96)[:96]
    old = VehicleMonitor.from_state(watched.vehicle, state)
    hourly["diagnosis"] = HOUR / WINDOW * seconds_of(old._diagnose)
    station.close()
    return hourly


def seconds_of(act: object, *, repeats: int = 5) -> float:
    """Return the median CPU seconds of an act."""
    found = []
    for _ in range(repeats):
        begin = time.process_time()
        act()
        found.append(time.process_time() - begin)
    return median(found)


class Inline:
    """The work of workers in this process."""

    is_busy = False

    def __init__(self) -> None:
        self.watched, self._outcomes = {}, []

    def is_open(self, vehicle: str) -> bool:
        return vehicle in self.watched

    def is_free(self, _vehicle: str) -> bool:
        return True

    def is_misplaced(self, _vehicle: str) -> bool:
        return False

    @property
    def figures(self) -> dict[str, float]:
        return {}

    def open(self, opening: object) -> None:
        from sprung.monitor.jobs import open_monitor

        self.watched[opening.vehicle] = open_monitor(opening)

    def close_vehicle(self, vehicle: str) -> None:
        self.watched.pop(vehicle, None)

    def submit(self, vehicle: str, frames: list[bytes], *, learn: str = "") -> None:
        from sprung.monitor.jobs import analyse

        self._outcomes.append(analyse(vehicle, self.watched[vehicle], frames, learn=learn))

    def outcomes(self, *, timeout: float = 0.0) -> list[object]:
        found, self._outcomes = self._outcomes, []
        return found

    def close(self) -> None:
        """Nothing to stop."""


class NoLink:
    """Takes what a station publishes."""

    is_connected, problem = True, ""

    def __init__(self, **_given: object) -> None:
        """Nothing to remember."""

    def open(self, *, timeout: float = 0.0) -> None:
        """Nothing to connect."""

    def close(self) -> None:
        """Nothing to disconnect."""

    def publish(self, _topic: str, _payload: bytes) -> bool:
        return True


def here(folder: Path, workers: object, **watch: float) -> object:
    """Return a station in this process without a link."""
    from sprung.monitor import Site, Station
    from sprung.storage import open_store

    url = f"sqlite:///{folder}/here.sqlite"
    site = Site.model_validate({"store": url, "http": "127.0.0.1:0", "watch": watch})
    station = Station(site, open_store(url), connect=NoLink, workers=workers)
    station.open()
    return station


def described(vehicle: str, prepared: Course) -> tuple[str, bytes]:
    """Return topic and payload of the announcement of a vehicle."""
    from sprung.link import VERSION, Key, message, topic
    from sprung.vehicles import read_vehicle, vehicle_text
    from sprung.vehicles.sensor_layout import quantities_of

    car = read_vehicle("zafira")
    quantities = quantities_of(prepared.first, car.sensor)
    document = {
        Key.VERSION: VERSION,
        Key.CONFIGURATION: "",
        "description": vehicle_text(car),
        "quantities": quantities,
    }
    return topic(vehicle, "meta"), message(document)


def describe(station: object, prepared: Course, n_vehicles: int) -> None:
    """Let vehicles announce themselves."""
    for k in range(n_vehicles):
        station.receive(*described(f"car-{k}", prepared))


def intake(folder: Path, *, n_vehicles: int = 50, seconds: int = 100) -> float:
    """Return CPU seconds per hour of the intake of a vehicle, where a frame of each of 50 comes at once."""
    from sprung.monitor import Intake
    from sprung.storage import open_store

    prepared = course()
    taking = Intake(open_store(f"sqlite:///{folder}/intake.sqlite"), lambda _topic, _payload: True)
    taking.take([described(f"car-{k}", prepared) for k in range(n_vehicles)], now=1)
    spent = 0.0
    for seq in range(seconds):
        batch = [(f"sprung/v1/car-{k}/raw", prepared.payload(f"car-{k}", 1, seq)) for k in range(n_vehicles)]
        begin = time.process_time()
        taking.take(batch, now=2 + seq)
        spent += time.process_time() - begin
    return spent * HOUR / n_vehicles / seconds


def live(n_vehicles: int, folder: Path, *, seconds: float = 20.0) -> tuple[tuple[str, ...], list[float]]:
    """Return cells, and CPU seconds per vehicle-hour of `sprung monitor` and its worker, while frames only come in."""
    prepared, stopping, place = course(), threading.Event(), folder / f"live-{n_vehicles}"
    place.mkdir()
    with mosquitto(place) as broker:
        monitor = Monitor(broker, place)
        sender = publisher(broker)
        for k in range(n_vehicles):
            sender.publish(*described(f"car-{k}", prepared))

        def send() -> None:
            begun, seq = time.monotonic(), 0
            while not stopping.wait(max(0.0, begun + seq - time.monotonic())):
                for k in range(n_vehicles):
                    sender.publish(f"sprung/v1/car-{k}/raw", prepared.payload(f"car-{k}", 1, seq))
                seq += 1

        sending = threading.Thread(target=send)
        sending.start()
        until(lambda: monitor.figures()["sprung_frames_total"] > 5 * n_vehicles, patience=120.0, every=0.5)
        (worker,) = monitor.workers
        pids = (monitor.pid, worker)
        before, begin = [cpu(pid) for pid in pids], time.monotonic()
        first = monitor.figures()
        time.sleep(seconds)
        spent = [cpu(pid) - at for pid, at in zip(pids, before, strict=True)]
        lasted, last = time.monotonic() - begin, monitor.figures()
        stopping.set()
        sending.join()
        sender.close()
        monitor.close()
    came = (last["sprung_frames_total"] - first["sprung_frames_total"]) / lasted
    hourly = [each * HOUR / came / lasted for each in spent]
    waiting = (f"{figures['sprung_backlog_frames']:.0f}" for figures in (first, last))
    return (f"{came:.0f}", *waiting, *(f"{each:.2f}" for each in hourly), f"{sum(spent) / lasted:.0%}"), hourly
