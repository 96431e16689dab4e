"""Drives, frames, and a station without processes and network."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from tests.conftest import once
from tests.online.store.conftest import postgresql_server, postgresql_url

from sprung.calibration import calibrated_if_imperfect
from sprung.diagnosis import Baseline
from sprung.link import Frame, encode, quantised
from sprung.online.box import blocks_of
from sprung.online.monitor import Site, Station, VehicleMonitor, assessment, engine
from sprung.online.monitor.jobs import Opening, Outcome
from sprung.online.monitor.workers import Workers, answer
from sprung.online.store import open_store
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle, vehicle_text
from sprung.vehicles.sensor_layout import quantities_of

__all__ = ["postgresql_server", "postgresql_url"]

#: 2026-11-21, UTC ns.
BEGUN = 1_795_219_200_000_000_000


@pytest.fixture(autouse=True, scope="session")
def _fits_of_a_window_once(fits_once):
    """Let monitors in this process fit windows of equal samples once; tests fit what they compare with anew.

    Whether the file of a vehicle is imperfect is computed once for equal spectra and files, too.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assessment, "observe_window", fits_once["observe_window"])
        patch.setattr(assessment, "calibrated_if_imperfect", once(calibrated_if_imperfect))
        patch.setattr(engine, "METHODS", fits_once)
        yield


@pytest.fixture(scope="session")
def car():
    return read_vehicle("zafira")


@pytest.fixture(scope="session")
def drive(car):
    """Ten minutes of a number, healthy or not, at its place in time."""
    kept = {}

    def driven(number, fault=None):
        if (number, fault) not in kept:
            faults = () if fault is None else (parse_fault(fault),)
            settings = RoadDrive(snr=50.0, faults=faults)
            run = simulate_drive(car, settings, seed=number).recording
            kept[number, fault] = replace(run, start=BEGUN + number * 600 * 10**9, history=())
        return kept[number, fault]

    return driven


def frames(recording, vehicle="car-1", *, boot=1, first=0, length=1.0, previous=None):
    """Frames of a recording, one block each."""
    payloads = []
    for seq, block in enumerate(blocks_of(recording, length=length), start=first):
        assert block.start is not None, "a frame has a time"
        counts, scale, flags = quantised(block.samples)
        payloads.append(
            encode(
                Frame(
                    vehicle,
                    boot,
                    seq,
                    block.start,
                    round(1e9 / block.sampling_rate),
                    block.names,
                    scale,
                    counts,
                    2,
                    flags,
                    previous=previous,
                )
            )
        )
    return payloads


@pytest.fixture(scope="session")
def frames_of():
    return frames


class NoLink:
    """Takes what a station publishes."""

    def __init__(self, *, topics, on_message, will):
        self.topics, self.on_message, self.will = topics, on_message, will
        self.published, self.is_connected, self.problem = [], True, ""

    def open(self, *, timeout=0.0):
        """Nothing to connect."""

    def close(self):
        """Nothing to disconnect."""

    def publish(self, topic, payload, *, is_retained=False):
        self.published.append((topic, payload))
        return True


class Inline(Workers):
    """The workers' code in this process; it has no processes of its own."""

    def __init__(self) -> None:
        super().__init__(0, limit=1.0, clock=lambda: 0.0)
        self.watched: dict[str, tuple[VehicleMonitor, dict[str, str]]] = {}
        self.done: list[Outcome] = []

    @property
    def is_busy(self) -> bool:
        return False

    def is_open(self, vehicle: str) -> bool:
        return vehicle in self.watched

    def open(self, opening: Opening) -> None:
        self._keep(answer(("open", opening), self.watched))

    def close_vehicle(self, vehicle: str) -> None:
        self.watched.pop(vehicle, None)

    def is_free(self, vehicle: str) -> bool:
        return True

    def submit(self, vehicle: str, frames: Sequence[bytes], *, learn: str | Baseline = "") -> None:
        self._keep(answer(("work", vehicle, frames, learn), self.watched))

    def _keep(self, outcome: Outcome | None) -> None:
        self.done += [] if outcome is None else [outcome]

    def outcomes(self, *, timeout: float = 0.0) -> list[Outcome]:
        outcomes, self.done = self.done, []
        return outcomes


class Bench:
    """A station on a store in a folder, fed by hand."""

    def __init__(self, folder, car, recording, *, workers=None, url=None, **site):
        url = url or f"sqlite:///{folder}/store.sqlite"
        self.store = open_store(url)
        self.now, self.seconds = BEGUN, 0.0
        self.workers = workers or Inline()
        settings = Site.model_validate({"store": url, "http": "127.0.0.1:0", **site})
        self.station = Station(
            settings,
            self.store,
            connect=self._linked,
            workers=self.workers,
            clock=lambda: self.now,
            timer=lambda: self.seconds,
        )
        self.station.open()
        self.car, self.quantities = car, quantities_of(recording, car.sensor)

    def _linked(self, **given):
        self.link = NoLink(**given)
        return self.link

    def describe(self, vehicle="car-1"):
        from sprung.link import message, topic

        document = {0: 1, 14: "c", "description": vehicle_text(self.car), "quantities": self.quantities}
        self.link.on_message(topic(vehicle, "meta"), message(document))

    def send(self, payloads, vehicle="car-1"):
        from sprung.link import topic

        for payload in payloads:
            self.link.on_message(topic(vehicle, "raw"), payload)
        self.work()

    def work(self):
        self.station.step()
        for _ in range(10_000):
            self.station.step()
            if self.station.is_idle:
                return
        raise AssertionError("the station is never idle")

    def look(self, seconds=1.0):
        """Let time pass on the station's timer, and work: after 1 s it looks around, after 60 s it sweeps the disk."""
        self.seconds += seconds
        self.work()

    def close(self):
        self.station.close()
        self.store.close()


def alike(one: object, other: object) -> bool:
    """Return whether documents are alike but for last digits, which depend on where arrays lie in memory."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(alike(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    if isinstance(one, float):
        return bool(one == pytest.approx(other, rel=1e-8, abs=1e-12))
    return one == other


@pytest.fixture(scope="session", name="alike")
def alike_():
    return alike


@pytest.fixture
def store(sqlite_url: str):
    """An empty store."""
    with open_store(sqlite_url) as opened:
        yield opened


@pytest.fixture(scope="session")
def new_bench():
    return Bench


@pytest.fixture
def bench(sqlite_url: str, tmp_path: Path, car, drive):
    made = []

    def begun(folder=tmp_path, **site):
        made.append(Bench(folder, car, drive(0), **site))
        return made[-1]

    yield begun
    for one in made:
        one.close()
