"""Which frames a worker gets, and what happens where its jobs fail; the analysis itself is played by hand."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from sprung.diagnosis import Baseline, Observation
from sprung.online.monitor import Observed, Site, VehicleStatus, Workers
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.dispatch import Dispatch
from sprung.online.monitor.jobs import Failure, Opening, Outcome
from sprung.online.monitor.ledger import Ledger
from sprung.online.store import Progress, RefusedError, StoredFrame
from sprung.recording import Channel, Recording
from sprung.results.documents import observation_document
from sprung.vehicles import Component, read_vehicle, vehicle_text

NOW = 1_795_219_200_000_000_000
SPRINGS = (Component("front_left", "spring"), Component("front_right", "spring"))
WINDOW = Observation(NOW / 1e9, SPRINGS, np.zeros(2), 1e-4 * np.eye(2), {}, {}, ())


WINDOW_EVENT = Observed(0, Recording(np.zeros((1, 2)), 1.0, (Channel("a"),), NOW), WINDOW, None, None)


class Played(Workers):
    """Workers without processes, which keep what they are given."""

    def __init__(self) -> None:
        super().__init__(0, limit=1.0, clock=lambda: 0.0)
        self.opened: dict[str, Opening] = {}
        self.jobs: list[tuple[str, list[bytes], str | Baseline]] = []

    @property
    def is_busy(self) -> bool:
        return False

    def is_open(self, vehicle: str) -> bool:
        return vehicle in self.opened

    def is_free(self, vehicle: str) -> bool:
        return True

    def open(self, opening: Opening) -> None:
        self.opened[opening.vehicle] = opening

    def close_vehicle(self, vehicle: str) -> None:
        self.opened.pop(vehicle, None)

    def submit(self, vehicle: str, frames: Sequence[bytes], *, learn: str | Baseline = "") -> None:
        self.jobs.append((vehicle, list(frames), learn))


@pytest.fixture
def workers():
    return Played()


@pytest.fixture
def dispatch(store, workers, timer, tmp_path: Path):
    site = Site.model_validate({"store": f"sqlite:///{tmp_path}/store.sqlite"})
    context = Context(site, store, lambda: NOW, timer)
    return Dispatch(context, workers, Ledger(context))


def arrive(store, dispatch, vehicle, first, last, *, boot=1) -> None:
    frames = [StoredFrame(vehicle, boot, seq, NOW, b"%d" % seq) for seq in range(first, last)]
    dispatch.add(vehicle, boot, store.inbox.add_frames(frames, now=NOW)[vehicle, boot])


def describe(store, vehicle, description="text") -> None:
    store.inbox.put_vehicle(vehicle, configuration="c", description=description, channels=[["a", "speed"]], now=NOW)


def done(vehicle, n_consumed, state=None) -> Outcome:
    return Outcome(vehicle, n_consumed, (), state, VehicleStatus())


def failed(vehicle, n_consumed=0, failure=Failure.FRAME) -> Outcome:
    return Outcome(vehicle, n_consumed, (), None, VehicleStatus(), "it fails", failure)


class Timer:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def timer():
    return Timer()


@pytest.mark.parametrize("is_learning", [True, False])
def test_after_a_restart_the_type_is_learnt_for_vehicles_that_learn_alone(
    dispatch, workers, store, monkeypatch: pytest.MonkeyPatch, is_learning
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(
        "sprung.online.monitor.dispatch.type_of_others", lambda _store, vehicle, types: asked.append(vehicle)
    )
    describe(store, "car-1")
    arrive(store, dispatch, "car-1", 0, 3)
    status = VehicleStatus(is_learning=is_learning)._asdict()
    store.results.commit(Progress("car-1", 1, done_seq=1, delete_through_seq=1, snapshot=b"state", status=status))
    dispatch.give()
    assert list(workers.opened) == ["car-1"]
    assert asked == (["car-1"] if is_learning else [])


def aside(store, vehicle="car-1"):
    return [(row.kind, row.seq) for row in store.quarantine.find(vehicle)]


def test_frames_of_windows_that_are_too_large_are_set_aside_at_once(dispatch, workers, store) -> None:
    describe(store, "car-1")
    arrive(store, dispatch, "car-1", 0, 4)
    dispatch.give()
    dispatch.settle(failed("car-1", 3, Failure.QUOTA))
    assert aside(store) == [("raw", seq) for seq in (0, 1, 2)]
    assert workers.is_open("car-1")
    dispatch.give()
    assert workers.jobs[-1] == ("car-1", [b"3"], "")


@pytest.mark.parametrize("failure", [Failure.STATE, Failure.VEHICLE, Failure.FRAME])
def test_a_vehicle_that_cannot_be_opened_waits_longer_each_time(dispatch, workers, store, timer, failure) -> None:
    """Also with a request to learn and no frames; nothing is quarantined, and there is one alert."""
    describe(store, "car-1")
    arrive(store, dispatch, "car-1", 0, 1)
    dispatch.give()
    dispatch.settle(done("car-1", 1, None if failure is Failure.STATE else b"state"))
    number = store.requests.add_command("anna", "car-1", "learn", "new dampers", now=NOW)
    dispatch.relearn(store.requests.command(number))
    times = []
    for _ in range(2500):
        if dispatch.give():
            times.append(timer.now)
            dispatch.settle(failed("car-1", 0, failure))
        timer.now += 0.5
    assert times == [0.0, 0.5, 1.5, 3.5, 7.5, 15.5, 31.5, 63.5, 127.5, 255.5, 511.5, 811.5, 1111.5]
    assert aside(store) == []
    (row,) = store.alerts.find(vehicle="car-1")
    assert (row.cause, row.text) == ("monitor:opening", "frames wait, as the vehicle cannot be opened: it fails")
    describe(store, "car-1", "another text")
    dispatch.describe("car-1")
    assert dispatch.give() == 1


def test_results_that_the_store_refuses_are_a_failure_of_their_vehicle(
    dispatch, workers, store, monkeypatch: pytest.MonkeyPatch
) -> None:
    commit = store.results.commit

    def refuse(progress):
        if progress.snapshot is not None:
            raise RefusedError("the store cannot hold this: a number of 65 bits")
        commit(progress)

    monkeypatch.setattr(store.results, "commit", refuse)
    describe(store, "car-1")
    arrive(store, dispatch, "car-1", 0, 2)
    for _ in range(2):
        dispatch.give()
        dispatch.settle(done("car-1", 2, b"state"))
        assert not workers.is_open("car-1")
    assert aside(store) == [("raw", 1)]
    (row,) = store.alerts.find(vehicle="car-1")
    assert row.text.endswith("were quarantined: the store cannot hold this: a number of 65 bits")


def test_a_request_to_roll_back_to_nothing_leaves_the_baseline(dispatch, workers, store) -> None:
    describe(store, "car-1")
    number = store.requests.add_command("anna", "car-1", "roll back", {"version": 3, "reason": "x"}, now=NOW)
    arrive(store, dispatch, "car-1", 0, 1)
    dispatch.relearn(store.requests.command(number))
    dispatch.give()
    assert workers.jobs == [("car-1", [b"0"], "")]


def test_a_request_to_learn_that_comes_during_a_job_waits_for_the_next(dispatch, workers, store) -> None:
    describe(store, "car-1")
    arrive(store, dispatch, "car-1", 0, 2)
    dispatch.give()
    number = store.requests.add_command("anna", "car-1", "learn", "new dampers", now=NOW)
    dispatch.relearn(store.requests.command(number))
    dispatch.settle(done("car-1", 1, b"state"))
    assert [command.id for command in store.requests.open_commands()] == [number]
    dispatch.give()
    assert workers.jobs[-1] == ("car-1", [b"1"], "new dampers")
    dispatch.settle(done("car-1", 1, b"state"))
    assert store.requests.open_commands() == []


def test_a_learning_vehicle_is_opened_with_the_type_of_the_others(dispatch, workers, store) -> None:
    """After each of its windows, from the state just stored, and no longer once it has a baseline."""
    text = vehicle_text(read_vehicle("zafira"))
    for number in range(5):
        store.inbox.put_vehicle(f"car-{number}", configuration="c", description=text, channels=[["a", ""]], now=NOW)
        store.inbox.add_frames([StoredFrame(f"car-{number}", 1, 0, NOW, b"")], now=NOW)
        entry = (0, NOW, observation_document(WINDOW))
        store.results.commit(Progress(f"car-{number}", 1, done_seq=0, observations=(entry,)))
    arrive(store, dispatch, "car-0", 1, 4)
    for is_learning in (True, False):
        dispatch.give()
        of_type = workers.opened["car-0"].type_baseline
        assert of_type is not None
        assert (of_type.name, of_type.n_vehicles) == ("zafira", 4)
        dispatch.settle(Outcome("car-0", 1, (WINDOW_EVENT,), b"state", VehicleStatus(is_learning=is_learning)))
        assert workers.is_open("car-0") is not is_learning
