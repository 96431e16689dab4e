"""Alerts that the monitor and people change at the same time."""

import threading
from pathlib import Path

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import operations
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.store import open_store

BEGUN = 1_795_219_200_000_000_000
INTAKE = "monitor:intake"


@pytest.fixture(params=["file", "server"])
def store(request, tmp_path: Path):
    url = f"sqlite:///{tmp_path}/store.sqlite" if request.param == "file" else request.getfixturevalue("postgresql_url")
    with open_store(url) as opened:
        yield opened


@pytest.fixture
def books(store):
    return [AlertBook(store, AlertSettings()) for _ in range(2)]


def active(store):
    return {(row.vehicle, row.cause): row.text for row in store.alerts.find(is_active=True)}


def events(store, vehicle, cause):
    (row,) = [row for row in store.alerts.find(vehicle=vehicle) if row.cause == cause]
    return [event.what for event in store.alerts.history(row.number)]


def soft_spring(text):
    return Report("car-1", "front_left.spring", 700, text)


@pytest.mark.slow
def test_an_act_waits_for_a_monitor_that_is_changing_the_alert(store, books) -> None:
    """The monitor updates the text while a person acknowledges: both changes stay."""
    first = reported(None, soft_spring("20 % softer"), AlertSettings(), BEGUN)
    books[0].put(first, now=BEGUN)
    act = threading.Thread(target=operations.acknowledge, args=(store, 1), kwargs={"who": "anna", "now": BEGUN + 1})
    with store.alerts.locked_of("car-1") as (row,):
        act.start()
        act.join(0.3)
        assert act.is_alive()
        books[0].put(reported(row, soft_spring("25 % softer"), AlertSettings(), BEGUN + 2), now=BEGUN + 2)
    act.join()
    (row,) = store.alerts.find()
    assert (row.text, row.is_acknowledged) == ("25 % softer", True)
    assert [event.what for event in store.alerts.history(1)] == ["raised", "updated", "acknowledged"]


def test_a_monitor_waits_for_an_act_on_the_alert(store, books) -> None:
    """A person acknowledges while the monitor clears the alert: it is normal, and not waiting for anybody."""
    books[0].report("car-1", "silent", "car-1 has sent nothing", now=BEGUN)
    clear = threading.Thread(target=books[1].clear, args=("car-1", "silent"), kwargs={"now": BEGUN + 2})
    with store.alerts.locked("car-1", "silent"):
        clear.start()
        clear.join(0.3)
        assert clear.is_alive()
        operations.acknowledge(store, 1, who="anna", now=BEGUN + 1)
    clear.join()
    (row,) = store.alerts.find()
    assert (row.is_active, row.is_acknowledged) == (False, True)


def test_an_act_that_fails_stores_nothing_of_a_verdict(store, books) -> None:
    """The vehicle of the alert is unknown, so that no baseline can be requested: nothing of the act is kept."""
    books[0].report("car-1", "silent", "car-1 has sent nothing", now=BEGUN)
    with pytest.raises(ParameterError, match="unknown vehicle 'car-1'"):
        operations.add_verdict(store, 1, verdict="confirmed", new_baseline=True, who="anna", now=BEGUN + 1)
    assert store.verdicts.all() == []
    assert [event.what for event in store.alerts.history(1)] == ["raised"]
