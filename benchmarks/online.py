"""The monitor of a fleet: CPU and memory of a vehicle, latency, catch-up, a soak, the box, and delivery."""

import argparse
import os
import pickle
import subprocess
import sys
import tempfile
import threading
import time
from functools import partial
from pathlib import Path
from statistics import median

from measuring import ONE_THREAD, print_circumstances, print_table

os.environ.update(ONE_THREAD)

from programs import Course, Monitor, Parts, Program, Vehicle, course, cpu, memory, mosquitto, n_files, until

#: Seconds of an hour, and frames of a window, one a second.
HOUR, WINDOW = 3600, 600


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("what", nargs="*", metavar="WHAT", help=f"of {', '.join(MEASUREMENTS)}; without: all")
    arguments.add_argument("--windows", type=int, default=9, help="of the CPU and the latency")
    arguments.add_argument(
        "--live", type=int, nargs="+", default=[500, 2000], help="vehicles of the station's overhead"
    )
    arguments.add_argument("--soak-minutes", type=float, default=2.0)
    arguments.add_argument("--soak-vehicles", type=int, default=2)
    arguments.add_argument("--workers", type=int, default=2, help="of the soak")
    arguments.add_argument("--memory-of", nargs=3, help=argparse.SUPPRESS)
    given = arguments.parse_args()
    if given.memory_of:
        n_vehicles, seconds, file = given.memory_of
        print(memory_of(int(n_vehicles), int(seconds), Path(file)))
        return
    unknown = sorted(set(given.what) - MEASUREMENTS.keys())
    if unknown:
        arguments.error(f"{unknown[0]} is none of {', '.join(MEASUREMENTS)}")
    print_circumstances(peers=())
    for name in given.what or MEASUREMENTS:
        with tempfile.TemporaryDirectory() as folder:
            MEASUREMENTS[name](given, Path(folder))


def measure_cpu(given: argparse.Namespace, folder: Path) -> None:
    """CPU of a vehicle: work on windows in this process, the way of frames through real programs."""
    hourly = worked_up(given.windows, folder)
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
        ("station: link, dispatch, looks", station - taken),
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


IDENTIFYING = ("search for harmonics", "other preparation", "poles and selection", "correlations, merging, labels")


def worked_up(n_windows: int, folder: Path) -> dict[str, float]:
    """Return CPU seconds per hour of the parts of the work on windows, by a station in this process."""
    from sprung import identification, preparation
    from sprung.diagnosis import observation
    from sprung.identification import METHODS
    from sprung.monitor import Station, VehicleMonitor, engine, frame_block, joined
    from sprung.monitor.workers import decode

    prepared, parts, inline = course(3), Parts(), Inline()
    station = here(folder, inline, learning_windows=6)
    describe(station, prepared, 1)
    places = (
        (preparation, "find_harmonics", IDENTIFYING[0]),
        (identification, "prepare", IDENTIFYING[1]),
        (identification, "_subset_modes", IDENTIFYING[2]),
        (VehicleMonitor, "_identify", IDENTIFYING[3]),
        (observation, "sensor_faults", "sensors"),
        (engine, "observe", "observation"),
        (VehicleMonitor, "_diagnose", "diagnosis of few windows"),
        (VehicleMonitor, "state", "state"),
        (Station, "_archived", "archive"),
        (Station, "_commit", "results"),
    )
    with parts.of(*places):
        for number in range(6 + n_windows):
            if number == 6:
                parts.seconds.clear()
            for seq in range(number * WINDOW, (number + 1) * WINDOW):
                station._arrived("sprung/v1/car-0/raw", prepared.payload("car-0", 1, seq))
            until(lambda: station.step() or station.is_idle(), patience=600.0, every=0.0)
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

    def open(self, opening: object) -> None:
        from sprung.monitor.workers import _opened

        self.watched[opening.vehicle] = _opened(opening)

    def close_vehicle(self, vehicle: str) -> None:
        self.watched.pop(vehicle, None)

    def submit(self, vehicle: str, frames: list[bytes], *, learn: str = "") -> None:
        from sprung.monitor.workers import _worked

        self._outcomes.append(_worked(vehicle, self.watched[vehicle], frames, learn, ""))

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
    from sprung.link import message, topic
    from sprung.vehicles import read_vehicle, vehicle_text
    from sprung.vehicles.sensor_layout import quantities_of

    car = read_vehicle("zafira")
    quantities = quantities_of(prepared.first, car.sensor)
    return topic(vehicle, "meta"), message({0: 1, 14: "", "description": vehicle_text(car), "quantities": quantities})


def describe(station: object, prepared: Course, n_vehicles: int) -> None:
    """Let vehicles announce themselves."""
    for k in range(n_vehicles):
        station._arrived(*described(f"car-{k}", prepared))


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


def publisher(broker: str, **given: object) -> object:
    """Return a link that is connected."""
    from sprung.link import Address, Link

    link = Link(Address.parse(broker), "publisher", **{"topics": [], "on_message": lambda *_: None, **given})
    link.open(timeout=10.0)
    return link


def measure_memory(_given: argparse.Namespace, folder: Path) -> None:
    """Memory of watched vehicles, each number of them in a process of its own."""
    from sprung.vehicles import read_vehicle
    from sprung.vehicles.sensor_layout import quantities_of

    prepared, file = course(), folder / "frames"
    file.write_bytes(pickle.dumps((prepared.documents, quantities_of(prepared.first, read_vehicle("zafira").sensor))))

    def measured(n_vehicles: int, seconds: int) -> float:
        command = [sys.executable, __file__, "--memory-of", str(n_vehicles), str(seconds), str(file)]
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
    from sprung.link import decode
    from sprung.monitor import MonitorSettings, VehicleMonitor, frame_block
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


def measure_latency(given: argparse.Namespace, folder: Path) -> None:
    """From the last frame of a window in the box to the observation in the store."""
    rows = []
    for every, others in ((1, 0), (0, 0), (0, 50)):
        place = folder / f"{every}-{others}"
        place.mkdir()
        times = latencies(place, every, others, given.windows)
        said = "every minute" if every else "never"
        rows.append((said, str(others), str(len(times)), f"{median(times):.3f}", f"{quantile(times, 0.95):.3f}"))
    print_table(
        "From the last frame of a window in the spool of the box to its observation in the store",
        ("modes identified", "other vehicles, one frame a second each", "windows", "median, s", "95 %, s"),
        rows,
    )


def quantile(values: list[float], share: float) -> float:
    """Return the value that a share of values does not exceed."""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def latencies(folder: Path, every: int, n_others: int, n_windows: int) -> list[float]:
    """Return the latencies of windows after the two that teach."""
    from sprung.storage import open_store

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
        for number in range(2 + n_windows):
            car.drive((number + 1) * WINDOW - 1 - car.seconds)
            until(partial(is_worked_up, car, monitor, n_others), patience=300.0)
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
    return times[2:]


def is_worked_up(car: Vehicle, monitor: Monitor, most: int = 0) -> bool:
    """Tell whether what a vehicle has sent is worked up, but for so many frames, and let its box look."""
    car.box.step()
    return car.has_sent and monitor.figures()["sprung_backlog_frames"] <= most


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
            "all worked up, s",
            "times real time",
            "CPU of monitor, s",
            "of worker, s",
            "errors",
        ),
        rows,
    )


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
        until(lambda: [is_worked_up(car, monitor) for car in cars] == [True] * len(cars), patience=600.0, every=0.1)
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
            ("windows worked up of those sent", f"{figures['sprung_windows_total']:.0f} of {windows}"),
            ("frames stored", f"{figures['sprung_frames_total']:.0f} of {sum(car.seconds for car in cars)}"),
            ("refused, lost, failures", " ".join(f"{figures[f'sprung_{name}_total']:.0f}" for name in TROUBLES)),
            ("warnings and errors in the log", str(len(monitor.errors))),
            ("store, KiB per vehicle-hour", f"{(samples[-1][5] - late[0][5]) / 1024 / hours * 1.5:.0f}"),
        ],
    )
    for line in monitor.errors[:5]:
        print(line)


TROUBLES = ("messages_refused", "frames_lost", "failures")


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


def measure_box(_given: argparse.Namespace, folder: Path) -> None:
    """A box that sends eight channels at 1 kHz as they were recorded."""
    from sprung.formats import write
    from sprung.link import checked_map, message

    recording = eight_channels(40.0)
    file = folder / "drive.npz"
    write(recording, file)
    n_bytes, n_samples = 0, 0
    with mosquitto(folder) as broker:

        def came(name: str, payload: bytes) -> None:
            nonlocal n_bytes, n_samples
            document = checked_map(payload)
            n_bytes += len(payload)
            n_samples += document[7] * len(document[8])
            monitor.publish(name.replace("raw", "ack"), message({0: 1, 2: document[2], 3: document[3]}))

        monitor = publisher(broker, topics=["sprung/v1/+/raw"], on_message=came)
        options = ["--vehicle-id", "car", "--vehicle", "zafira", "--broker", broker, "--spool", str(folder / "spool")]
        box = Program(["box", str(file), *options, "--pace", "1"], folder)
        until(lambda: n_samples, patience=30.0)
        start_up = cpu(box.pid)
        time.sleep(3.0)
        before, begin = cpu(box.pid), time.monotonic()
        time.sleep(20.0)
        share = (cpu(box.pid) - before) / (time.monotonic() - begin)
        size = memory(box.pid)
        box.close()
        monitor.close()
    print_table(
        "The box: 8 channels at 1 kHz from a file, in real time",
        ("what", "value", "goal"),
        [
            ("CPU, share of a core", f"{share:.1%}", "below 5 %"),
            ("memory, MiB", f"{size:.0f}", "below 150 MB"),
            ("CPU until the first frame has come, s", f"{start_up:.1f}", ""),
            ("bytes per sample on the wire", f"{n_bytes / n_samples:.2f}", ""),
            ("errors", str(len(box.errors)), "0"),
        ],
    )


def eight_channels(duration: float) -> object:
    """Return the accelerations of two drives at 1 kHz."""
    from dataclasses import replace

    import numpy as np

    from sprung.recording import Channel
    from sprung.simulation import DriveSettings, simulate_drive
    from sprung.vehicles import read_vehicle

    settings = DriveSettings("road", duration=duration, sampling_rate=1000.0, snr=50.0)
    runs = [simulate_drive(read_vehicle("zafira"), settings, seed=seed).recording for seed in range(2)]
    return replace(
        runs[0],
        samples=np.concatenate([run.samples[:4] for run in runs]),
        channels=tuple(Channel(f"a{k}", "acceleration") for k in range(8)),
        history=(),
    )


def measure_delivery(_given: argparse.Namespace, folder: Path) -> None:
    """What each step of the way of a frame can do."""
    from sprung.box import blocks_of
    from sprung.link import Frame, Spool, decode, encode, quantised
    from sprung.storage import open_store

    prepared, large = course(), list(blocks_of(eight_channels(30.0), length=1.0))
    small = [prepared.first]
    payloads = [prepared.payload("car", 1, seq) for seq in range(2000)]

    def encoded(blocks: list[object]) -> list[bytes]:
        found = []
        for seq, block in enumerate(blocks):
            counts, scale, flags = quantised(block.samples)
            found.append(encode(Frame("car", 1, seq, 0, 5_000_000, block.names, scale, counts, 2, flags)))
        return found

    def spooled(name: str, *, is_synced: bool) -> None:
        spool = Spool(folder / name, is_synced=is_synced)
        for payload in payloads[:500]:
            spool.append(lambda _boot, _seq, payload=payload: payload)
        spool.close()

    def stored(step: int) -> None:
        store = open_store(f"sqlite:///{folder}/{step}.sqlite")
        frames = [("car", 1, seq, 0, payload) for seq, payload in enumerate(payloads[:1000])]
        for first in range(0, 1000, step):
            store.inbox.add_frames(frames[first : first + step], now=1)
        store.close()

    steps = [
        ("quantised and encoded, 5 channels at 200 Hz", 500, lambda: encoded(small * 500)),
        ("quantised and encoded, 8 channels at 1 kHz", 30, lambda: encoded(large)),
        ("decoded, 5 channels at 200 Hz", 2000, lambda: [decode(payload) for payload in payloads]),
        ("into the spool, each on the disk", 500, lambda: spooled("synced", is_synced=True)),
        ("into the spool, not synced", 500, lambda: spooled("loose", is_synced=False)),
        ("into the store, one in a transaction", 1000, lambda: stored(1)),
        ("into the store, 100 in a transaction", 1000, lambda: stored(100)),
    ]
    rows = []
    for name, count, act in steps:
        wall, used = time.perf_counter(), time.process_time()
        act()
        wall, used = time.perf_counter() - wall, time.process_time() - used
        rows.append((name, f"{count / wall:.0f}", f"{1e3 * used / count:.3f}"))
    print_table("Delivery, frames of a second", ("step", "frames/s", "CPU, ms per frame"), rows)


MEASUREMENTS = {
    "cpu": measure_cpu,
    "memory": measure_memory,
    "latency": measure_latency,
    "catch-up": measure_catch_up,
    "soak": measure_soak,
    "box": measure_box,
    "delivery": measure_delivery,
}

if __name__ == "__main__":
    main()
