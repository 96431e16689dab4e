"""Which process gets which vehicle, where some hang, die or are slow: processes are played by hand, time is set."""

from collections import deque
from typing import Any

import numpy as np
import pytest

from sprung.diagnosis import Observation
from sprung.online.monitor import MonitorSettings, Observed, VehicleStatus, Workers
from sprung.online.monitor.jobs import Failure, Opening, Outcome
from sprung.online.monitor.workers import Answer, Lost
from sprung.recording import Channel, Recording
from sprung.vehicles import Component

WINDOW = Observed(
    0,
    Recording(np.zeros((1, 2)), 1.0, (Channel("a"),), 0),
    Observation(0.0, (Component("front_left", "spring"),), np.zeros(1), np.eye(1), {}, {}, ()),
    None,
    None,
)


class Played:
    """A process with prescribed answers to jobs, which answers openings and closings by itself if it is willing."""

    is_willing = True

    def __init__(self, limits, notify, clock) -> None:
        self.clock, self.is_starved = clock, False
        self.limits, self.notify = limits, notify
        self.requests: list[Any] = []
        self.waiting: deque[Any] = deque()
        self.replies: deque[Answer] = deque([None])
        self.is_alive, self.n_consumed, self.pid = True, 0, id(self)

    def send(self, request):
        self.requests.append(request)
        if request[0] != "work" and not self.waiting and self.is_willing:
            self.replies.append(None)
        else:
            self.waiting.append(request)

    def answers(self):
        replies, self.replies = list(self.replies), deque()
        return replies

    def answer(self, *, seconds=0.1, is_window=False, error="", failure=Failure.FRAME):
        """Answer the next request, and the openings and closings before it."""
        while (request := self.waiting.popleft())[0] != "work":
            self.replies.append(None)
        events, state = ((WINDOW,), b"state") if is_window else ((), None)
        n_frames = len(request[2])
        status = VehicleStatus()
        self.replies.append(Outcome(request[1], n_frames, events, state, status, error, failure, seconds))

    @property
    def seconds(self):
        """Processor time: all of the time, unless it is starved."""
        return 0.0 if self.is_starved else self.clock()

    def kill(self):
        self.is_alive = False

    def join(self, timeout):
        self.is_alive = False

    @property
    def vehicles(self):
        """Vehicles that were opened here."""
        return [request[1].vehicle for request in self.requests if request[0] == "open"]


class Bench:
    """Workers of a limit of 180 s, the processes in order of their start, and the time."""

    def __init__(self, count=2):
        self.now, self.processes = 0.0, []
        self.workers = Workers(count, limit=180.0, clock=lambda: self.now, start=self._start)
        self.workers.outcomes()

    def _start(self, limits, notify):
        self.processes.append(Played(limits, notify, lambda: self.now))
        return self.processes[-1]

    def give(self, *vehicles, n_frames=3, state=None):
        """Give vehicles jobs, opened if they are not; return those that could not have one."""
        left = []
        for vehicle in vehicles:
            if not self.workers.is_free(vehicle):
                left.append(vehicle)
                continue
            if not self.workers.is_open(vehicle):
                self.workers.open(Opening(vehicle, "", {}, state, MonitorSettings()))
            self.workers.submit(vehicle, [b""] * n_frames)
        assert self.workers.outcomes() == []
        return left

    def window(self, process, *, seconds=0.1):
        """Let a process complete a window, and return what came of it."""
        process.answer(seconds=seconds, is_window=True)
        (outcome,) = self.workers.outcomes()
        if self.workers.is_misplaced(outcome.vehicle):
            self.workers.close_vehicle(outcome.vehicle)
        assert self.workers.outcomes() == []
        return outcome


def test_vehicles_are_shared_out_among_idle_processes() -> None:
    bench = Bench()
    assert bench.give("a", "b", "c") == ["c"]
    first, second = bench.processes
    assert (first.vehicles, second.vehicles) == (["a"], ["b"])
    assert bench.workers.is_busy
    second.answer()
    assert [outcome.vehicle for outcome in bench.workers.outcomes()] == ["b"]
    assert bench.give("c") == []
    assert second.vehicles == ["b", "c"]


@pytest.mark.parametrize("is_lost", [True, False])
def test_neighbours_of_a_vehicle_that_blocks_its_process_go_on_elsewhere(is_lost) -> None:
    """Dead, or after a sixth of the limit; from then on it has a process of its own, and the full limit."""
    bench = Bench()
    bench.give("bad", "b")
    first, second = bench.processes
    first.n_consumed = 2
    if is_lost:
        first.replies.append(Lost("the process of its analysis died"))
    bench.now = 30.1
    second.answer()
    bad, other = sorted(bench.workers.outcomes(), key=lambda outcome: outcome.vehicle, reverse=True)
    assert (bad.vehicle, bad.failure, bad.n_consumed) == ("bad", Failure.FRAME, 2)
    slow = "its analysis took longer than 30 s of processor time"
    assert bad.error == ("the process of its analysis died" if is_lost else slow)
    assert (other.vehicle, other.error) == ("b", "")
    assert not first.is_alive
    assert bench.workers.figures == {"sprung_vehicles_slow": 1, "sprung_workers_replaced_total": 1}
    bench.workers.outcomes()
    assert bench.give("bad", "b", "c") == []
    _, second, third, apart = bench.processes
    assert (second.vehicles, third.vehicles, apart.vehicles) == (["b"], ["c"], ["bad"])
    for process in (second, third):
        process.answer()
    bench.workers.outcomes()
    bench.now += 179.0
    assert bench.give("b", "c") == []
    bench.workers.outcomes()
    for process in (second, third):
        process.answer()
    assert [outcome.error for outcome in bench.workers.outcomes()] == ["", ""]
    bench.now += 2.0
    (bad,) = bench.workers.outcomes()
    assert (bad.vehicle, bad.error) == ("bad", "its analysis took longer than 180 s")
    assert (second.is_alive, third.is_alive, apart.is_alive) == (True, True, False)


def test_vehicles_on_a_busy_computer_have_the_whole_limit() -> None:
    bench = Bench(1)
    bench.processes[0].is_starved = True
    bench.give("a")
    bench.now = 179.0
    assert bench.workers.outcomes() == []
    bench.now = 181.0
    (outcome,) = bench.workers.outcomes()
    assert outcome.error == "its analysis took longer than 180 s"


def test_a_vehicle_whose_jobs_are_long_moves_with_its_state_and_returns_after_three_quick_windows() -> None:
    """Nothing is stopped or analysed again; the processor time counts, and so does a job before the window."""
    bench = Bench(1)
    (first,) = bench.processes
    bench.give("heavy")
    first.answer(seconds=10.1)
    bench.workers.outcomes()
    assert not bench.workers.is_misplaced("heavy")
    bench.give("heavy")
    bench.window(first)
    assert not bench.workers.is_open("heavy")
    for seconds in (0.1, 0.1, 11.0, 0.1, 0.1, 9.9):
        assert bench.give("heavy", state=b"state") == []
        bench.workers.outcomes()
        bench.window(bench.processes[1], seconds=seconds)
    assert not bench.workers.is_open("heavy")
    bench.give("heavy", state=b"state")
    assert [process.vehicles for process in bench.processes] == [["heavy", "heavy"], ["heavy"]]
    assert bench.workers.figures == {"sprung_vehicles_slow": 0, "sprung_workers_replaced_total": 0}


def test_a_state_that_loses_two_processes_is_not_tried_a_third_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Played, "is_willing", False)
    bench = Bench(1)
    failures = []
    for _ in range(2):
        bench.give("bad", state=b"state")
        bench.workers.outcomes()
        bench.processes[-1].replies.append(Lost("the process of its analysis died"))
        (outcome,) = bench.workers.outcomes()
        bench.workers.outcomes()
        assert outcome.error == "while it was opened: the process of its analysis died"
        failures.append(outcome.failure)
    assert failures == [Failure.VEHICLE, Failure.STATE]


def test_a_process_that_dies_idle_or_does_not_start_accuses_nobody() -> None:
    bench = Bench(1)
    bench.give("a")
    bench.processes[0].answer()
    bench.workers.outcomes()
    bench.processes[0].is_alive = False
    assert bench.workers.outcomes() == []
    assert not bench.workers.is_open("a")
    bench.processes[1].is_willing = False
    bench.processes[1].replies.clear()
    bench.workers.open(Opening("a", "", {}, None, MonitorSettings()))
    bench.workers.submit("a", [])
    bench.now += 121.0
    (outcome,) = bench.workers.outcomes()
    assert (outcome.vehicle, outcome.failure) == ("a", Failure.VEHICLE)
    assert bench.workers.figures["sprung_vehicles_slow"] == 0
    bench.workers.outcomes()
    assert bench.give("a") == []
    assert len(bench.processes) == 3
