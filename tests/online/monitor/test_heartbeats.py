"""A loop that no longer turns is a sentence, whatever it waits for."""

import pytest

from sprung.online.monitor.heartbeats import Heartbeats, Loop


@pytest.fixture
def seconds():
    return [100.0]


@pytest.fixture
def heartbeats(seconds):
    loops = {"station": Loop(15.0, "the loop stands still: restart it"), "post": Loop(300.0, "no notification is sent")}
    return Heartbeats(loops, lambda: seconds[0])


def test_a_loop_that_turns_is_no_trouble(heartbeats, seconds) -> None:
    for _ in range(100):
        seconds[0] += 14.0
        heartbeats.beat("station")
        heartbeats.beat("post")
        assert heartbeats.troubles == []
    seconds[0] += 5.0
    assert heartbeats.ages == {"station": 5.0, "post": 5.0}


def test_loops_that_stand_still_are_named_with_the_time(heartbeats, seconds) -> None:
    seconds[0] += 16.0
    assert heartbeats.troubles == ["the loop stands still: restart it (last pass 16 s ago)"]
    seconds[0] += 300.0
    assert len(heartbeats.troubles) == 2
    heartbeats.beat("station")
    assert heartbeats.troubles == ["no notification is sent (last pass 316 s ago)"]
