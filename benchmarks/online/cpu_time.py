"""CPU time of a vehicle: the analysis of windows, and the station for many vehicles, both in this process.

CPU seconds of this process are counted, so that the load of the machine matters little.
"""

import argparse
import pickle
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from measuring import print_table
from memory_use import measure_memory
from programs import HOUR, WINDOW, Course, course, memory, until
from sampling import ANALYSIS, STATION, Sampler, reference

#: Hours of driving of a vehicle in a year, and vehicles that a core is to serve.
YEAR, GOAL = 2000, 2000
#: Seconds between two identifications, and between two reports of a box.
_STEP, _REPORT = 120, 5


def measure_cpu(given: argparse.Namespace, folder: Path) -> None:
    """CPU time, memory and storage of a vehicle."""
    before = reference()
    hourly, recorded = analysed(given, folder)
    after = reference()
    print(f"\nTen million additions in Python: {before:.2f} s before, {after:.2f} s after (0.4 s on an idle machine).")
    print_parts(f"The analysis of a vehicle, s per vehicle-hour, frames of {given.frame_seconds:g} s", {"": hourly})
    analysis = sum(hourly.values())
    station = [sum(load.values()) for load in measured_station(given, recorded, folder).values()]
    print_table(
        f"A vehicle in all (goal: {HOUR / GOAL:g} s, {GOAL} vehicles a core)",
        ("", *(f"{n} vehicles" for n in live(given))),
        [
            ("analysis, s per vehicle-hour", *(f"{analysis:.2f}" for _ in station)),
            ("station, s per vehicle-hour", *(f"{value:.2f}" for value in station)),
            ("vehicles per core", *(f"{HOUR / (analysis + value):.0f}" for value in station)),
        ],
    )
    measure_memory(given, folder)


def measure_station(given: argparse.Namespace, folder: Path) -> None:
    """CPU time of the station, and bytes of the store, without the analysis."""
    kept = given.recorded
    if kept is not None and kept.exists():
        recorded = pickle.loads(kept.read_bytes())
    else:
        _, recorded = analysed(given, folder)
        if kept is not None:
            kept.write_bytes(pickle.dumps(recorded))
    print(f"\nTen million additions in Python: {reference():.2f} s (0.4 s on an idle machine).")
    measured_station(given, recorded, folder)


def measured_station(given: argparse.Namespace, recorded: "Recorded", folder: Path) -> dict[int, dict[str, float]]:
    """Print what the station costs; return CPU seconds of its parts per vehicle-hour by number of vehicles."""
    prepared = course(length=given.frame_seconds)
    before = memory()
    loads = {n: station_load(prepared, recorded, n, folder, seconds=given.station_seconds) for n in live(given)}
    named = {f"{n} vehicles": load.hourly for n, load in loads.items()}
    print_table(
        "The station beside what vehicles send",
        ("", *named),
        [
            ("CPU to open a vehicle, ms", *(f"{1000 * load.opening / n:.1f}" for n, load in loads.items())),
            ("longest of a second of driving, s of CPU", *(f"{load.longest:.2f}" for load in loads.values())),
            (
                "memory beyond that at the start, MiB",
                *(f"{load.memory - before:.0f}" for load in loads.values()),
            ),
        ],
    )
    print_parts(f"The station, s per vehicle-hour, frames of {given.frame_seconds:g} s", named)
    print_table(
        "Bytes of the store after the analysis (goal: 50 MB per vehicle-year of 2,000 h)",
        ("table or index", "bytes per vehicle-hour", "MB per vehicle-year"),
        [(name, f"{size:.0f}", f"{size * YEAR / 1e6:.1f}") for name, size in bytes_stored(recorded, folder).items()],
    )
    return {n: load.hourly for n, load in loads.items()}


def live(given: argparse.Namespace) -> list[int]:
    """Return the numbers of vehicles of the station's load."""
    return given.live or ([200] if given.quick else [200, 1000, 2000])


def print_parts(title: str, columns: Mapping[str, Mapping[str, float]]) -> None:
    """Print CPU seconds of parts, and their sum."""
    names = next(iter(columns.values()))
    rows = [(name, *(f"{column[name]:.3f}" for column in columns.values())) for name in names]
    sums = ("in all", *(f"{sum(column.values()):.3f}" for column in columns.values()))
    print_table(title, ("part", *columns), [*rows, sums])


@dataclass(frozen=True)
class Recorded:
    """Outcomes of a vehicle with a baseline: of an identification within a window, and of the one that completes it."""

    minute: Any
    window: Any


def analysed(given: argparse.Namespace, folder: Path) -> tuple[dict[str, float], Recorded]:
    """Return CPU seconds per hour of the parts of the analysis of windows, and outcomes."""
    prepared = course(1 if given.quick else 3, length=given.frame_seconds)
    # The third window completes the vehicle file, once for a vehicle.
    n_learning, n_windows = (3, 2) if given.quick else (6, given.windows)
    sampler, inline = Sampler(), Inline()
    station = here(folder / "analysed", inline, learning_windows=n_learning)
    describe(station, prepared, 1)
    per_step, n_frames = round(_STEP / prepared.length), round(WINDOW / prepared.length)
    begun = time.process_time()
    for number in range(n_learning):
        drive(station, prepared, range(number * n_frames, (number + 1) * n_frames))
    learning = time.process_time() - begun
    print(f"\nThe first {n_learning} windows of a vehicle, with its file and its baseline: {learning:.1f} s in all.")
    inline.kept.clear()
    with sampler.running():
        for number in range(n_learning, n_learning + n_windows):
            for seq in range(number * n_frames, (number + 1) * n_frames, per_step):
                drive(station, prepared, range(seq, seq + per_step))
    station.close()
    minutes = [outcome for outcome in inline.kept if len(outcome.events) == 1 and outcome.state is None]
    windows = [outcome for outcome in inline.kept if outcome.state is not None]
    hourly = sampler.per_hour(ANALYSIS, n_windows * WINDOW / HOUR)
    if not any(hourly.values()) or len(windows) != n_windows:
        raise SystemExit(f"{len(windows)} of {n_windows} windows were analysed in {sum(hourly.values()):g} s")
    return hourly, Recorded(minutes[-1], windows[-1])


def drive(station: Any, prepared: Course, numbers: Sequence[int]) -> None:
    """Let a station take frames of one vehicle, and analyse them."""
    for seq in numbers:
        station.receive("sprung/v1/car-0/raw", prepared.payload("car-0", 1, seq))
    until(lambda: station.step() or station.is_idle, patience=600.0, every=0.0)


@dataclass(frozen=True)
class Load:
    """What a number of vehicles costs the station.

    Parameters
    ----------
    hourly
        CPU seconds per vehicle-hour of its parts.
    opening
        CPU seconds until the first frame of each vehicle is analysed.
    longest
        CPU seconds of the second of driving that takes longest.
    memory
        Of this process at the end [MiB].
    """

    hourly: dict[str, float]
    opening: float
    longest: float
    memory: float


def station_load(prepared: Course, recorded: Recorded, n_vehicles: int, folder: Path, *, seconds: float) -> Load:
    """Return what vehicles cost the station.

    A second at a time, by a clock that is played: frames and reports of vehicles are spread over their periods, and
    windows over ten minutes, so that the station has the same work all the time. Outcomes are recorded ones. Measured
    after a warm-up of as many seconds.
    """
    from sprung.link import message, topic

    sampler, n_frames = Sampler(), round(WINDOW / prepared.length)
    opening, spent = 0.0, []
    echo = Echo(recorded, prepared.length, {f"car-{k}": k % n_frames for k in range(n_vehicles)})
    second = 0
    station = here(
        folder / f"station-{n_vehicles}",
        echo,
        clock=lambda: prepared.begin + second * 10**9,
        timer=lambda: float(second),
    )
    describe(station, prepared, n_vehicles)
    until(lambda: station.step() or station.is_idle, patience=600.0, every=0.0)
    period = max(1, round(prepared.length))
    state = message({0: 1, 2: 1, "boots": [[1, 0, -1]], "dropped": 0, "spooled": 0, "is_leaving": False})
    for second in range(2 * round(seconds)):
        sending = [k for k in range(n_vehicles) if k % period == second % period]
        messages = [(topic(f"car-{k}", "raw"), prepared.payload(f"car-{k}", 1, second // period)) for k in sending]
        reporting = [k for k in range(n_vehicles) if k % _REPORT == second % _REPORT]
        messages += [(topic(f"car-{k}", "state"), state) for k in reporting]
        if second == round(seconds):
            sampler.seconds.clear()
            spent.clear()
        begun = time.process_time()
        with sampler.running():
            for name, payload in messages:
                station.receive(name, payload)
            until(lambda: station.step() or station.is_idle, patience=600.0, every=0.0)
        spent.append(time.process_time() - begun)
        if second == period - 1:
            opening = sum(spent)
    load = Load(sampler.per_hour(STATION, n_vehicles * round(seconds) / HOUR), opening, max(spent), memory())
    station.close()
    return load


def bytes_stored(recorded: Recorded, folder: Path, *, hours: int = 50) -> dict[str, float]:
    """Return bytes of the store per vehicle-hour by table and index, from outcomes stored over and over."""
    import sqlite3

    from sprung.online.monitor import Site
    from sprung.online.monitor.alert_book import Context
    from sprung.online.monitor.ledger import Ledger
    from sprung.online.store import StoredFrame, open_store

    file = folder / "bytes.sqlite"
    store = open_store(f"sqlite:///{file}")
    site = Site.model_validate({"store": f"sqlite:///{file}", "keep": {"raw_days": 0}})
    ledger = Ledger(Context(site, store))
    per_window = WINDOW // _STEP

    def sizes() -> dict[str, int]:
        with sqlite3.connect(file) as connection:
            connection.execute("VACUUM")
            return dict(connection.execute("SELECT name, sum(pgsize) FROM dbstat GROUP BY name").fetchall())

    empty = sizes()
    for number in range(hours * HOUR // WINDOW):
        store.inbox.add_frames([StoredFrame("car-0", 1, number, 0, b"")], now=1)
        for k in range(per_window - 1):
            ledger.commit(_numbered(recorded.minute, number * per_window + k), 1, number)
        ledger.commit(_numbered(recorded.window, number * per_window + per_window - 1), 1, number)
    full = sizes()
    store.close()
    grown = {name: (size - empty.get(name, 0)) / hours for name, size in full.items()}
    shown = {name: size for name, size in sorted(grown.items(), key=lambda item: -item[1]) if size > 0}
    return {**shown, "in all": sum(grown.values())}


def _numbered(outcome: Any, number: int) -> Any:
    """Return an outcome at the place of an identification of a number, without frames."""
    from sprung.online.monitor import Identified

    start = time.time_ns() + number * _STEP * 10**9
    events = []
    for event in outcome.events:
        if isinstance(event, Identified):
            events.append(replace(event, number=number, start=start))
        else:
            recording = replace(event.recording, start=start)
            events.append(replace(event, number=number * _STEP // WINDOW, recording=recording))
    return replace(outcome, events=tuple(events), state=None if outcome.state is None else b"")


class Inline:
    """The work of workers in this process."""

    is_busy = False

    def __init__(self) -> None:
        self.watched, self.kept, self._outcomes = {}, [], []

    def is_open(self, vehicle: str) -> bool:
        return vehicle in self.watched

    def is_free(self, _vehicle: str) -> bool:
        return True

    def is_misplaced(self, _vehicle: str) -> bool:
        return False

    @property
    def figures(self) -> dict[str, float]:
        return {}

    def open(self, opening: Any) -> None:
        from sprung.online.monitor.jobs import open_monitor

        self.watched[opening.vehicle] = open_monitor(opening)

    def close_vehicle(self, vehicle: str) -> None:
        self.watched.pop(vehicle, None)

    def submit(self, vehicle: str, frames: list[bytes], **given: Any) -> None:
        from sprung.online.monitor.jobs import analyse

        self._outcomes.append(analyse(vehicle, self.watched[vehicle], frames, **given))
        self.kept.append(self._outcomes[-1])

    def outcomes(self, *, timeout: float = 0.0) -> list[Any]:
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def close(self) -> None:
        """Nothing to stop."""


class Echo(Inline):
    """Workers that answer with recorded outcomes, by the number of frames that a vehicle was given."""

    def __init__(self, recorded: Recorded, length: float, phases: dict[str, int]) -> None:
        super().__init__()
        self._recorded, self._given = recorded, phases
        self._step, self._window = round(_STEP / length), round(WINDOW / length)

    def open(self, opening: Any) -> None:
        self.watched[opening.vehicle] = opening

    def submit(self, vehicle: str, frames: list[bytes], **given: Any) -> None:
        self._outcomes.append(self.echoed(vehicle, len(frames)))

    def echoed(self, vehicle: str, n_frames: int) -> Any:
        """Return the recorded outcome of a vehicle and a number of frames."""
        before, after = self._given[vehicle], self._given[vehicle] + n_frames
        self._given[vehicle] = after
        if after // self._window > before // self._window:
            base, number = self._recorded.window, after // self._step - 1
        elif after // self._step > before // self._step:
            base, number = self._recorded.minute, after // self._step - 1
        else:
            base, number = replace(self._recorded.minute, events=()), 0
        numbered = _numbered(base, number) if base.events else base
        return replace(numbered, vehicle=vehicle, n_consumed=n_frames, state=base.state)


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


def here(
    folder: Path, workers: object, *, clock: Any = time.time_ns, timer: Any = time.monotonic, **watch: float
) -> Any:
    """Return a station in this process without a link."""
    from sprung.online.monitor import Site, Station
    from sprung.online.store import open_store

    url = f"sqlite:///{folder}/here.sqlite"
    site = Site.model_validate({"store": url, "http": "127.0.0.1:0", "watch": watch})
    station = Station(site, open_store(url), connect=NoLink, workers=workers, clock=clock, timer=timer)
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


def describe(station: Any, prepared: Course, n_vehicles: int) -> None:
    """Let vehicles announce themselves."""
    topic, payload = described("car-0", prepared)
    for k in range(n_vehicles):
        station.receive(topic.replace("car-0", f"car-{k}"), payload)
