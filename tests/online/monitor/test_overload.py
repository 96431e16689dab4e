"""A worker that is too slow for a while: what waits, what is left out, which alerts are raised; the clock is set."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest

from sprung.diagnosis import Baseline, Observation
from sprung.online.alerts import AlertSettings
from sprung.online.monitor import AlertBook, MonitorSettings, Observed, Opening, Outcome, Site, VehicleStatus, Workers
from sprung.online.monitor.dispatch import Dispatch
from sprung.online.monitor.engine import Identified
from sprung.online.monitor.ledger import Ledger
from sprung.online.monitor.overload import OVERLOAD, Overload
from sprung.online.store import StoredFrame, open_store
from sprung.recording import Channel, Recording
from sprung.vehicles import Component

BEGUN = 1_795_219_200_000_000_000
SPRINGS = (Component("front_left", "spring"),)
#: Frames of a window of each vehicle, one a second, and of an identification.
WINDOW, MINUTE = 20, 4
VEHICLES = [f"car-{k}" for k in range(5)]


class Slow(Workers):
    """One worker, which needs a time for each frame and identification; the observation is the frames of the window."""

    def __init__(self) -> None:
        super().__init__(0, limit=1.0, clock=lambda: 0.0)
        self.now, self.free_at = 0.0, 0.0
        self.of_frame, self.of_modes = 0.01, 0.4
        self.frames: dict[str, list[bytes]] = {}
        self.served: list[str] = []
        self.under_way: Outcome | None = None

    @property
    def is_busy(self) -> bool:
        return self.under_way is not None

    def is_open(self, vehicle: str) -> bool:
        return vehicle in self.frames

    def is_free(self, vehicle: str) -> bool:
        return not self.is_busy

    def open(self, opening: Opening) -> None:
        self.frames[opening.vehicle] = []

    def close_vehicle(self, vehicle: str) -> None:
        raise AssertionError(f"{vehicle} is closed, and nothing failed")

    def submit(self, vehicle: str, frames: Sequence[bytes], *, learn: str | Baseline = "") -> None:
        events: list[Observed | Identified] = []
        n_consumed = n_thinned = 0
        for frame in frames:
            seen = self.frames[vehicle]
            seen.append(frame)
            n_consumed += 1
            is_complete = len(seen) % WINDOW == 0
            if len(seen) % MINUTE == 0 and self.skips_modes and not is_complete:
                n_thinned += 1
            elif len(seen) % MINUTE == 0:
                events.append(Identified(len(seen) // MINUTE - 1, BEGUN, ({"natural_frequency": 1.0},)))
            if is_complete:
                events.append(observed(len(seen) // WINDOW - 1, b" ".join(seen[-WINDOW:]).decode()))
                break
        n_modes = sum(isinstance(event, Identified) for event in events)
        self.free_at = self.now + n_consumed * self.of_frame + n_modes * self.of_modes
        state = b"state" if any(isinstance(event, Observed) for event in events) else None
        self.under_way = Outcome(vehicle, n_consumed, tuple(events), state, VehicleStatus(), n_thinned=n_thinned)
        self.served.append(vehicle)

    def outcomes(self, *, timeout: float = 0.0) -> list[Outcome]:
        if self.under_way is None or self.now < self.free_at:
            return []
        outcome, self.under_way = self.under_way, None
        return [outcome]


def observed(number: int, frames: str) -> Observed:
    window = Observation(float(number), SPRINGS, np.zeros(1), np.eye(1), {}, {}, (), notes=(frames,))
    return Observed(number, Recording(np.zeros((1, 2)), 1.0, (Channel("a"),), BEGUN + number), window, None, None)


class Drive:
    """Five vehicles that send a frame a second each, to one worker; time passes in tenths of a second."""

    def __init__(self, folder: Path) -> None:
        url = f"sqlite:///{folder}/store.sqlite"
        self.store, self.workers, self.ticks = open_store(url), Slow(), 0
        self.ages: list[float] = []
        self.alerts: list[bool] = []  # once a second, as the ages
        book = AlertBook(self.store, AlertSettings())
        ledger = Ledger(
            Site.model_validate({"store": url, "keep": {"raw_days": 0}}), self.store, alerts=book, clock=self.now
        )
        overload = Overload(book, limit=10.0, clock=self.now)
        self.dispatch = Dispatch(self.store, self.workers, ledger, MonitorSettings(), overload=overload, clock=self.now)
        for vehicle in VEHICLES:
            self.store.inbox.put_vehicle(vehicle, configuration="", description="text", channels=[], now=BEGUN)

    def now(self) -> int:
        return BEGUN + self.ticks * 10**8

    def run(self, seconds: int) -> None:
        for _ in range(10 * seconds):
            if self.ticks % 10 == 0:
                self.send(self.ticks // 10)
            self.work()

    def send(self, seq: int) -> None:
        for vehicle in VEHICLES:
            self.arrive(vehicle, [seq])

    def arrive(self, vehicle: str, numbers: Iterable[int]) -> None:
        frames = [StoredFrame(vehicle, 1, seq, self.now(), b"%d" % seq) for seq in numbers]
        reached = self.store.inbox.add_frames(frames, now=self.now())
        self.dispatch.hold(frames)
        self.dispatch.add(vehicle, 1, reached[vehicle, 1])

    def work(self) -> None:
        self.workers.now = self.ticks / 10
        for outcome in self.dispatch.collect(timeout=0.0):
            self.dispatch.settle(outcome)
        self.dispatch.give()
        if self.ticks % 10 == 0:
            self.ages.append(self.dispatch.figures["sprung_backlog_age_seconds"])
            self.alerts.append(any(row.cause == OVERLOAD for row in self.store.alerts.find(is_active=True)))
        self.ticks += 1

    def windows(self) -> list[list[object]]:
        return [[row.document for row in self.store.results.observations(vehicle)] for vehicle in VEHICLES]


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory):
    """Runs with enough capacity, perhaps too little of it for half a minute, and enough again."""
    runs: dict[float, Drive] = {}

    def drive(slow: float) -> Drive:
        if slow not in runs:
            one = runs[slow] = Drive(tmp_path_factory.mktemp("drive"))
            for modes, seconds in ((0.1, 15), (slow, 35), (0.1, 70)):
                one.workers.of_modes = modes
                one.run(seconds)
            while not one.dispatch.is_idle or one.dispatch.figures["sprung_backlog_frames"]:
                one.work()
        return runs[slow]

    yield drive
    for one in runs.values():
        one.store.close()


@pytest.mark.slow
def test_overload_is_said_and_over_when_caught_up(driven) -> None:
    one = driven(2.0)
    assert max(one.ages[:15]) < 3
    assert not any(one.alerts[:15])
    first, last = one.alerts.index(True), len(one.alerts) - 1 - one.alerts[::-1].index(True)
    assert all(one.alerts[first:last])
    # At the look that follows, every second; and after 30 s without falling behind again.
    assert 10.0 <= one.ages[first] <= 12.0
    assert max(one.ages[last - 28 :]) <= 10.0
    (row,) = [row for row in one.store.alerts.find(vehicle="monitor") if row.cause == OVERLOAD]
    history = [event.what for event in one.store.alerts.history(row.id)]
    assert (history[0], history[-1]) == ("raised", "cleared")
    assert "frames of 5 vehicles wait" in row.text


@pytest.mark.slow
def test_modes_are_thinned_and_no_window_is(driven) -> None:
    """Every window has the same result as without overload; the identifications left out are exactly those missing."""
    slow, ample = driven(2.0), driven(0.1)
    assert slow.windows() == ample.windows()
    assert [len(windows) for windows in slow.windows()] == [120 // WINDOW] * len(VEHICLES)
    assert ample.dispatch.figures["sprung_identifications_thinned_total"] == 0
    thinned = slow.dispatch.figures["sprung_identifications_thinned_total"]
    kept = slow.dispatch.figures["sprung_identifications_total"]
    assert thinned > 0
    assert thinned + kept == ample.dispatch.figures["sprung_identifications_total"]
    assert slow.dispatch.figures["sprung_identifications_thinned_ratio"] == thinned / (thinned + kept)
    for vehicle in VEHICLES:
        numbers = {row.number for row in slow.store.results.modes(vehicle)}
        of_windows = {(number + 1) * WINDOW // MINUTE - 1 for number in range(120 // WINDOW)}
        assert of_windows <= numbers < set(range(120 // MINUTE))


def test_who_waits_longest_is_next(tmp_path: Path) -> None:
    """By the arrival of the oldest frame; a vehicle with hours of frames comes again after all that wait."""
    one = Drive(tmp_path)
    order = ["car-3", "car-0", "car-4"]
    for vehicle in order:
        one.arrive(vehicle, range(3 * WINDOW if vehicle == "car-3" else 2))
        one.ticks += 10
    one.workers.of_frame = 1.0
    one.work()  # car-3 does not wait now
    assert one.dispatch.figures["sprung_backlog_age_seconds"] == pytest.approx(2.1)
    one.arrive("car-1", range(2))
    for _ in range(2000):
        one.work()
    assert one.workers.served == [*order, "car-1", "car-3", "car-3"]
    assert one.dispatch.figures["sprung_backlog_age_seconds"] == 0
    one.store.close()


def test_frames_in_memory_are_not_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from sprung.online.store.inbox import Inbox

    read: list[str] = []

    def pending(_inbox: Inbox, vehicle: str, _boot: int, *, after: int, limit: int) -> list[StoredFrame]:
        read.append(vehicle)
        return []

    monkeypatch.setattr(Inbox, "pending", pending)
    one = Drive(tmp_path)
    one.workers.of_modes = 0.1
    one.run(WINDOW + 2)
    assert read == []
    assert [len(windows) for windows in one.windows()] == [1] * len(VEHICLES)
    one.store.close()
