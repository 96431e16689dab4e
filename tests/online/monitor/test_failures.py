"""What the monitor does about failures of the analysis, of attempts, of the store and of its loops."""

import pytest

from sprung.online.monitor.failures import CircuitBreaker, Failures, Heartbeats, Loop
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


def test_values_that_the_store_refuses_do_not_close_it(breaker, caplog) -> None:
    def refuse():
        raise RefusedError("the store cannot hold this: a number of 65 bits")

    assert breaker.call(refuse) is None
    assert (breaker.allows_work, breaker.problem) == (True, "")
    assert caplog.messages == ["the store cannot hold this: a number of 65 bits"]


@pytest.fixture
def heartbeats(seconds):
    loops = {"station": Loop(15.0, "the loop stands still: restart it"), "post": Loop(300.0, "no notification is sent")}
    return Heartbeats(loops, lambda: seconds[0])


def test_loops_that_stand_still_are_named_with_the_time(heartbeats, seconds) -> None:
    seconds[0] += 16.0
    assert heartbeats.problems == ["the loop stands still: restart it (last pass 16 s ago)"]
    seconds[0] += 300.0
    assert len(heartbeats.problems) == 2
    heartbeats.on_heartbeat("station")
    assert heartbeats.problems == ["no notification is sent (last pass 316 s ago)"]


def test_the_time_between_attempts_doubles_up_to_five_minutes() -> None:
    failures = Failures()
    waits = []
    for number in range(1, 14):
        assert failures.fail(100.0) == number
        waits.append(failures.retry_at - 100.0)
    assert waits == [0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 300, 300, 300]
    failures.succeed()
    assert failures.retry_at < 0
    assert failures.fail(100.0) == 1


def test_a_frame_that_fails_twice_is_left_out_then_the_window_of_a_later_one() -> None:
    failures = Failures()
    assert [failures.fail_on(1, 7, done=4) for _ in range(2)] == [None, 7]
    failures.leave_out()
    assert failures.fail_on(1, 6, done=4) is None, "an earlier one, which is analysed again"
    assert failures.fail_on(1, 9, done=4) == 5
    assert failures.fail_on(1, 9, done=4) == 5, "the store refused"
    failures.leave_out()
    assert failures.fail_on(1, 12, done=9) is None, "begun anew"
