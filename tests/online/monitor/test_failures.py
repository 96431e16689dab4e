"""What the monitor does about failures of the analysis, of attempts, of the store and of its loops."""

import pytest

from sprung.online.monitor.failures import Backoff, CircuitBreaker, FailureCounts, Heartbeats, Loop
from sprung.online.store import RefusedError, StoreError


@pytest.fixture
def seconds():
    return [0.0]


@pytest.fixture
def breaker(seconds):
    return CircuitBreaker(lambda: seconds[0])


def test_closed_for_two_seconds_after_an_error(breaker, seconds) -> None:
    assert (breaker.allows_work, breaker.problem) == (True, "")
    breaker.refuse(StoreError("the store cannot write"))
    assert (breaker.allows_work, breaker.problem) == (False, "the store cannot write")
    seconds[0] = 2.0
    assert (breaker.allows_work, breaker.problem) == (True, "the store cannot write")
    breaker.succeed()
    assert breaker.problem == ""


def test_closed_while_space_is_short(breaker, seconds) -> None:
    breaker.set_shortage("only 5 MB are free")
    seconds[0] = 1e6
    assert (breaker.allows_work, breaker.problem) == (False, "only 5 MB are free")
    breaker.set_shortage("")
    assert (breaker.allows_work, breaker.problem) == (True, "")


def test_values_that_the_store_refuses_do_not_close_it(breaker, caplog) -> None:
    def refuse():
        raise RefusedError("the store cannot hold this: a number of 65 bits")

    assert breaker.call(refuse) is None
    assert (breaker.allows_work, breaker.problem) == (True, "")
    assert caplog.messages == ["the store cannot hold this: a number of 65 bits"]


def test_guarded_acts_close_it(breaker) -> None:
    def fail():
        raise StoreError("the store is busy")

    breaker.call(fail)
    assert breaker.problem == "the store is busy"
    with pytest.raises(ZeroDivisionError):
        breaker.call(lambda: 1 / 0)


@pytest.fixture
def heartbeats(seconds):
    loops = {"station": Loop(15.0, "the loop stands still: restart it"), "post": Loop(300.0, "no notification is sent")}
    return Heartbeats(loops, lambda: seconds[0])


def test_a_loop_that_turns_is_no_problem(heartbeats, seconds) -> None:
    for _ in range(100):
        seconds[0] += 14.0
        heartbeats.on_heartbeat("station")
        heartbeats.on_heartbeat("post")
        assert heartbeats.problems == []
    seconds[0] += 5.0
    assert heartbeats.ages == {"station": 5.0, "post": 5.0}


def test_loops_that_stand_still_are_named_with_the_time(heartbeats, seconds) -> None:
    seconds[0] += 16.0
    assert heartbeats.problems == ["the loop stands still: restart it (last pass 16 s ago)"]
    seconds[0] += 300.0
    assert len(heartbeats.problems) == 2
    heartbeats.on_heartbeat("station")
    assert heartbeats.problems == ["no notification is sent (last pass 316 s ago)"]


def test_the_time_between_attempts_doubles_up_to_five_minutes() -> None:
    now = [0.0]
    backoff = Backoff(lambda: now[0])
    assert backoff.is_due("a")
    waits = []
    for number in range(1, 14):
        assert backoff.fail("a") == number
        begun = now[0]
        while not backoff.is_due("a"):
            now[0] += 0.5
        waits.append(now[0] - begun)
    assert waits == [0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 300, 300, 300]
    assert (backoff.is_due("b"), backoff.n_waiting) == (True, 1)


def test_success_starts_anew() -> None:
    backoff = Backoff(lambda: 0.0)
    for _ in range(5):
        backoff.fail("a")
    assert not backoff.is_due("a")
    backoff.succeed("a")
    assert (backoff.is_due("a"), backoff.n_waiting) == (True, 0)
    assert backoff.fail("a") == 1
    assert backoff.is_due("a")


def test_a_frame_that_fails_twice_is_left_out_then_the_window_of_a_later_one() -> None:
    counts = FailureCounts()
    assert counts.add("car-1", 1, 7, done=4) is None
    assert counts.add("car-2", 1, 7, done=4) is None
    assert counts.add("car-1", 1, 7, done=4) == 7
    counts.leave_out("car-1")
    assert counts.add("car-1", 1, 9, done=4) == 5
    assert counts.add("car-1", 1, 9, done=4) == 5, "the store refused"
    counts.leave_out("car-1")
    assert counts.add("car-1", 1, 12, done=9) is None, "begun anew"


def test_one_failure_before_a_frame_that_was_left_out_costs_no_frame() -> None:
    counts = FailureCounts()
    assert [counts.add("car-1", 1, 9, done=4) for _ in range(2)] == [None, 9]
    counts.leave_out("car-1")
    assert [counts.add("car-1", 1, 7, done=4) for _ in range(2)] == [None, 7]
    counts.leave_out("car-1")
    assert counts.add("car-1", 1, 8, done=4) is None
    assert counts.add("car-1", 1, 12, done=4) == 5, "a later one"


def test_failures_in_different_places_or_of_different_boots_are_no_row() -> None:
    counts = FailureCounts()
    places = [(1, 7), (1, 8), (2, 8), (1, 8), (1, 8)]
    assert [counts.add("car-1", boot, seq, done=-1) for boot, seq in places] == [None] * 4 + [8]


def test_a_stored_state_ends_the_row() -> None:
    counts = FailureCounts()
    counts.add("car-1", 1, 7, done=-1)
    counts.forget("car-1")
    counts.forget("car-9")
    assert counts.add("car-1", 1, 7, done=-1) is None
