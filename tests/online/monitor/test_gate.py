"""Nothing is taken in for a while after the store could not write, and while disk space is short."""

import pytest

from sprung.online.monitor.gate import Gate
from sprung.online.store import RefusedError, StoreError


@pytest.fixture
def seconds():
    return [0.0]


@pytest.fixture
def gate(seconds):
    return Gate(lambda: seconds[0])


def test_closed_for_two_seconds_after_an_error(gate, seconds) -> None:
    assert (gate.is_open, gate.trouble) == (True, "")
    gate.refuse(StoreError("the store cannot write"))
    assert (gate.is_open, gate.trouble) == (False, "the store cannot write")
    seconds[0] = 2.0
    assert (gate.is_open, gate.trouble) == (True, "the store cannot write")
    gate.succeed()
    assert gate.trouble == ""


def test_closed_while_space_is_short(gate, seconds) -> None:
    gate.set_shortage("only 5 MB are free")
    seconds[0] = 1e6
    assert (gate.is_open, gate.trouble) == (False, "only 5 MB are free")
    gate.set_shortage("")
    assert (gate.is_open, gate.trouble) == (True, "")


def test_values_that_the_store_refuses_do_not_close_it(gate, caplog) -> None:
    def refuse():
        raise RefusedError("the store cannot hold this: a number of 65 bits")

    assert gate.guard(refuse) is None
    assert (gate.is_open, gate.trouble) == (True, "")
    assert caplog.messages == ["the store cannot hold this: a number of 65 bits"]


def test_guarded_acts_close_it(gate) -> None:
    def fail():
        raise StoreError("the store is busy")

    gate.guard(fail)
    assert gate.trouble == "the store is busy"
    with pytest.raises(ZeroDivisionError):
        gate.guard(lambda: 1 / 0)
