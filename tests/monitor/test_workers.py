"""Worker processes that are killed, slow or faced with nonsense: replaced, and the vehicle is named."""

import os
import signal
import time

import pytest

from sprung.monitor import MonitorSettings, Observed, Opening, Workers
from sprung.vehicles import vehicle_text
from sprung.vehicles.sensor_layout import quantities_of

SETTINGS = MonitorSettings(window=120.0, identify_every=0.0, learning_windows=2)


@pytest.fixture
def workers():
    made = []

    def begun(count=2, *, limit=60.0):
        made.append(Workers(count, limit=limit, clock=time.monotonic))
        return made[-1]

    yield begun
    for one in made:
        one.close()


def outcome(workers):
    end = time.monotonic() + 60
    while time.monotonic() < end:
        for found in workers.outcomes(timeout=0.01):
            return found
    raise AssertionError("no outcome")


@pytest.fixture
def opening(car, drive):
    def of(vehicle, **fields):
        given = {"description": vehicle_text(car), "quantities": quantities_of(drive(0), car.sensor), "state": None}
        return Opening(**{"vehicle": vehicle, "settings": SETTINGS, **given, **fields})

    return of


@pytest.mark.slow
def test_a_window_comes_back_with_the_state_after_it(workers, opening, drive, frames_of) -> None:
    some = workers()
    some.open(opening("car-1"))
    frames = frames_of(drive(0))
    some.submit("car-1", frames[:200])
    first = outcome(some)
    assert (first.n_consumed, [type(event) for event in first.events]) == (120, [Observed])
    assert first.status[1:3] == (1, 2)
    some.open(opening("car-1", state=first.state))
    some.submit("car-1", frames[120:300])
    again = outcome(some)
    assert (again.n_consumed, again.events[0].number) == (120, 1)
    assert again.events[0].baseline is not None


@pytest.mark.slow
def test_a_killed_worker_is_replaced_and_its_vehicle_named(workers, opening, drive, frames_of) -> None:
    some = workers()
    for vehicle in ("car-1", "car-2"):
        some.open(opening(vehicle))
    pids = some.pids
    some.submit("car-1", frames_of(drive(0)))
    os.kill(pids[0], signal.SIGKILL)
    found = outcome(some)
    assert (found.vehicle, found.n_consumed) == ("car-1", 0)
    assert "died" in found.error
    assert not some.is_open("car-1")
    assert some.is_open("car-2")
    assert some.pids[0] != pids[0]
    some.open(opening("car-1"))
    some.submit("car-1", frames_of(drive(0)))
    assert outcome(some).error == ""


def test_a_slow_vehicle_is_stopped_and_delays_no_other(workers, opening, drive, frames_of) -> None:
    some = workers(limit=0.05)
    some.open(opening("car-1"))
    some.submit("car-1", frames_of(drive(0)))
    found = outcome(some)
    assert found.vehicle == "car-1"
    assert "longer than 0.05 s" in found.error
    assert not some.is_open("car-1")


@pytest.mark.parametrize(
    ("fields", "frames", "words"),
    [
        ({"description": "kind = 1"}, [], "vehicle file of car-1"),
        ({"state": b"\xa0"}, [], "schema"),
        ({}, [b"no frame at all"], "checksum"),
    ],
)
def test_nonsense_is_an_outcome_with_a_reason(workers, opening, fields, frames, words) -> None:
    some = workers(1)
    some.open(opening("car-1", **fields))
    some.submit("car-1", frames)
    found = outcome(some)
    assert words in found.error
    some.open(opening("car-1"))
    some.submit("car-1", [])
    assert outcome(some).error == ""


def test_processes_end_with_the_workers(workers) -> None:
    some = workers(2)
    pids = some.pids
    some.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
