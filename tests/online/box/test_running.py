"""A live source and a replay, with a box whose monitor is played."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.link import Loss
from sprung.online.box.running import replay, send_live
from sprung.recording import Channel, Recording


class PlayedBox:
    """A box whose frames are acknowledged after some waits, never where that is None."""

    def __init__(self, waits: int | None = 0) -> None:
        self.taken: list[Recording] = []
        self.is_open, self.problem, self.n_waiting, self._waits = False, "", 0, waits
        self.losses: tuple[Loss, ...] = ()

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def take(self, block: Recording) -> None:
        assert self.is_open
        self.taken.append(block)
        self.n_waiting += 1

    def step(self) -> None:
        assert self.is_open

    def drain(self, *, timeout: float) -> bool:
        assert timeout > 0
        if self._waits:
            self._waits -= 1
            return False
        return self._waits is not None


def played(waits=0):
    return PlayedBox(waits)


def blocks(count):
    channels = (Channel("acc", "acceleration"),)
    return [Recording(np.full((1, 500), float(number)), 100.0, channels) for number in range(count)]


def test_a_source_is_sent_until_everything_is_acknowledged():
    box, stopping = played(waits=3), threading.Event()
    assert send_live(box, blocks(4), stopping=stopping, on_problem=lambda problem: None) == 20.0
    assert [block.samples[0, 0] for block in box.taken] == [0.0, 1.0, 2.0, 3.0]
    assert not box.is_open
    assert stopping.is_set()


def test_a_box_that_is_stopped_takes_no_more_blocks():
    box, stopping = played(waits=None), threading.Event()

    def source():
        for number, block in enumerate(blocks(5)):
            if number == 2:
                stopping.set()
            yield block

    assert send_live(box, source(), stopping=stopping, on_problem=lambda problem: None) is None
    assert len(box.taken) == 2
    assert not box.is_open


def test_each_problem_is_reported_once_and_its_end():
    box, stopping, problems = played(), threading.Event(), []
    reported = threading.Event()

    def report(problem):
        problems.append(problem)
        reported.set()

    def source():
        for problem in ("connection refused", ""):
            box.problem = problem
            assert reported.wait(30.0)
            reported.clear()
            yield from blocks(1)

    send_live(box, source(), stopping=stopping, on_problem=report)
    assert problems == ["connection refused", ""]


def test_a_replay_without_acknowledgements_says_what_is_missing():
    box = played(waits=1)
    box.open()
    with pytest.raises(DataError, match=r"2 frames not acknowledged after 0\.5 s: check that a monitor runs"):
        replay(box, blocks(2), pace=None, patience=0.5)


def test_a_replay_returns_the_time_of_its_samples():
    box = played()
    box.open()
    timed = [replace(block, start=10**18 + 5 * k * 10**9) for k, block in enumerate(blocks(3))]
    assert replay(box, timed, pace=None, patience=1.0) == (15.0, 10**18, 10**18 + 15 * 10**9)


BEGIN = 1_795_219_200_000_000_000
LOSSES = (Loss(1, 0, 99, 100, BEGIN, BEGIN + 100 * 10**9), Loss(2, 0, 8, 9, BEGIN + 10**12, BEGIN + 10**12 + 10**9))
SENTENCE = "109 frames, 2026-11-21 00:00 to 00:16 UTC, were dropped before the monitor had acknowledged"


def test_a_loss_ends_a_replay_and_a_source_with_an_error():
    box = played()
    box.losses = LOSSES
    box.open()
    with pytest.raises(DataError, match=f"^{SENTENCE} .*; all others are acknowledged$"):
        replay(box, blocks(2), pace=None, patience=1.0)
    with pytest.raises(DataError, match=f"^{SENTENCE} .*; all others are acknowledged$"):
        send_live(box, blocks(2), stopping=threading.Event(), on_problem=lambda problem: None)
    assert not box.is_open


def test_a_loss_is_named_besides_frames_that_are_not_acknowledged():
    box = played(waits=1)
    box.losses = LOSSES[:1]
    box.open()
    with pytest.raises(DataError, match=r"^2 frames not acknowledged .*; 100 frames, 2026-.* were dropped"):
        replay(box, blocks(2), pace=None, patience=0.5)


def test_a_box_that_is_stopped_names_its_losses():
    problems: list[str] = []
    box, stopping = played(waits=None), threading.Event()
    box.losses = (Loss(1, 0, 0, 1),)
    stopping.set()
    assert send_live(box, blocks(1), stopping=stopping, on_problem=problems.append) is None
    assert [problem.partition(" as ")[0] for problem in problems] == [
        "1 frame was dropped before the monitor had acknowledged them,"
    ]
