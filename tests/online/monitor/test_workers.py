"""Worker processes that are killed, slow or faced with nonsense: replaced, and the vehicle is named."""

import os
import signal
import time

import pytest

from sprung.online.monitor import MonitorSettings, Observed, Workers
from sprung.online.monitor.assessment import History
from sprung.online.monitor.jobs import Failure, Opening
from sprung.vehicles import vehicle_text
from sprung.vehicles.sensor_layout import quantities_of

SETTINGS = MonitorSettings(window=120.0, identify_every=0.0, learning_windows=2)


@pytest.fixture
def workers():
    made = []

    def begun(count=2, *, clock=lambda: 0.0, **limits):
        made.append(Workers(count, limit=180.0, clock=clock, **limits))
        return made[-1]

    yield begun
    for one in made:
        one.close()


def outcome(workers):
    end = time.monotonic() + 200
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
    vehicles = ("car-1", "car-2")
    for vehicle in vehicles:
        some.open(opening(vehicle))
    for vehicle in vehicles:
        some.submit(vehicle, [])
    assert [outcome(some).error for _ in vehicles] == ["", ""]
    pids = some.pids
    some.submit("car-1", frames_of(drive(0)))
    os.kill(pids[0], signal.SIGKILL)
    found = outcome(some)
    assert found.vehicle == "car-1"
    assert "died" in found.error
    assert not some.is_open("car-1")
    assert some.is_open("car-2")
    assert (len(some.pids), some.pids[0] != pids[0], some.pids[1] == pids[1]) == (2, True, True)
    some.open(opening("car-1"))
    assert len(some.pids) == 3
    some.submit("car-1", frames_of(drive(0)))
    assert outcome(some).error == ""


@pytest.mark.slow
def test_a_hanging_vehicle_is_stopped_and_tried_again_in_a_process_of_its_own(workers, opening, drive, frames_of):
    now = [0.0]
    some = workers(1, clock=lambda: now[0])
    for vehicle in ("car-1", "car-2"):
        some.open(opening(vehicle))
    some.submit("car-1", [])
    assert outcome(some).error == ""
    (pid,) = some.pids
    os.kill(pid, signal.SIGSTOP)
    some.submit("car-1", frames_of(drive(0))[:9])
    now[0] = 179.0
    assert some.outcomes() == []
    now[0] = 181.0
    found = outcome(some)
    assert (found.vehicle, found.failure, found.n_consumed) == ("car-1", Failure.FRAME, 0)
    assert found.error == "its analysis took longer than 180 s"
    assert not some.is_open("car-2")
    some.open(opening("car-1"))
    some.open(opening("car-2"))
    assert len({pid, *some.pids}) == 3
    for vehicle in ("car-1", "car-2"):
        some.submit(vehicle, frames_of(drive(0))[:9])
    assert {outcome(some).vehicle, outcome(some).vehicle} == {"car-1", "car-2"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fields", "frames", "expected"),
    [
        ({"description": "kind = 1"}, [], ("vehicle file of car-1", Failure.VEHICLE)),
        ({"state": b"\xa0"}, [], ("the saved state is damaged", Failure.STATE)),
        ({"history": History({"schema": "other"})}, [], ("start from scratch", Failure.STATE)),
        ({}, [b"no frame at all"], ("checksum", Failure.FRAME)),
    ],
)
def test_nonsense_is_an_outcome_with_a_reason(workers, opening, fields, frames, expected) -> None:
    some = workers(1)
    some.open(opening("car-1", **fields))
    some.submit("car-1", frames)
    found = outcome(some)
    assert expected[0] in found.error
    assert found.failure is expected[1]
    some.open(opening("car-1"))
    some.submit("car-1", [])
    assert outcome(some).error == ""


@pytest.mark.slow
def test_a_window_that_takes_too_much_memory_costs_its_own_job_only(workers, opening, drive, frames_of) -> None:
    some = workers(1, job_bytes=2e7)
    for vehicle in ("car-1", "car-2"):
        some.open(opening(vehicle))
    pids = some.pids
    some.submit("car-1", frames_of(drive(0)))
    found = outcome(some)
    assert (found.vehicle, found.failure) == ("car-1", Failure.FRAME)
    assert found.error == "its analysis needs more memory than 20 MB"
    assert 0 < found.n_consumed < 120
    some.submit("car-2", [])
    assert (outcome(some).error, some.pids) == ("", pids)


@pytest.mark.slow
def test_a_window_beyond_the_quota_is_refused_before_it_is_held(workers, opening, drive, frames_of) -> None:
    """2 minutes of 5 channels at 200 Hz are 0.96 MB in float64."""
    some = workers(1, vehicle_bytes=9e5)
    some.open(opening("car-1"))
    some.submit("car-1", frames_of(drive(0))[:7])
    found = outcome(some)
    assert (found.failure, found.n_consumed) == (Failure.QUOTA, 7)
    assert found.error.startswith(
        "a window of 2 min of 5 channels at 200 Hz takes 1 MB, more than the 1 MB allowed per vehicle: send"
    )
    some.submit("car-1", [])
    assert outcome(some).status.share == 0.0


@pytest.mark.slow
def test_processes_end_with_the_workers(workers) -> None:
    some = workers(2)
    pids = some.pids
    some.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
