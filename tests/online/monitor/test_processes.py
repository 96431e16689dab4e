"""Answers of a process that are too large, truncated, or not an outcome: the process is lost."""

import os
import pickle
import struct
from multiprocessing import Pipe

import numpy as np
import pytest

from sprung.online.monitor import workers
from sprung.online.monitor.jobs import Failure, Limits, failed, limited_memory
from sprung.online.monitor.workers import Lost, answer, received


@pytest.fixture
def pipe():
    here, there = Pipe()
    yield here, there
    here.close()
    there.close()


def test_an_answer_that_ends_midway_is_lost(pipe) -> None:
    here, there = pipe
    whole = pickle.dumps(failed("car-1", "it fails", Failure.FRAME))
    os.write(there.fileno(), struct.pack("!i", len(whole)) + whole[:9])
    there.close()
    found = received(here)
    assert isinstance(found, Lost)
    assert "unreadable" in found.reason


@pytest.mark.parametrize(
    ("message", "words"),
    [(b"no pickle", "unreadable"), (pickle.dumps("text"), "not an outcome"), (bytes(101), "unreadable")],
)
def test_what_is_no_outcome_is_lost(pipe, monkeypatch: pytest.MonkeyPatch, message, words) -> None:
    monkeypatch.setattr(workers, "_MAX_BYTES", 100)
    here, there = pipe
    there.send_bytes(message)
    found = received(here)
    assert isinstance(found, Lost)
    assert words in found.reason


def test_a_job_of_a_vehicle_that_could_not_be_opened_has_no_outcome_of_its_own() -> None:
    assert answer(("work", "car-1", [b""], "", False), {}, limits=Limits()) is None
    assert answer(("close", "car-1"), {}) is None


def test_memory_beyond_the_limit_is_an_error_and_the_limit_ends() -> None:
    with limited_memory(5e7):
        assert np.ones(1_000_000).sum() == 1e6
        with pytest.raises(MemoryError):
            np.ones(20_000_000)
    assert np.ones(20_000_000).sum() == 2e7
