"""Alerts about monitoring that several monitors on one store raise and clear, each for itself."""

import threading
from pathlib import Path

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import AlertBook, alert_of, operations
from sprung.online.monitor.overload import OVERLOAD, Overload
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
    return [AlertBook(store, AlertSettings(), monitor=name) for name in ("a", "b")]


def active(store):
    return {(row.vehicle, row.cause): row.text for row in store.alerts.find(is_active=True)}


def events(store, vehicle, cause):
    (row,) = [row for row in store.alerts.find(vehicle=vehicle) if row.cause == cause]
    return [event.what for event in store.alerts.history(row.id)]


def test_an_alert_stays_until_each_monitor_that_raised_it_has_cleared_its_own(store, books) -> None:
    a, b = books
    b.clear_own("car-1", INTAKE, now=BEGUN)
    a.report_own("car-1", INTAKE, "too much", now=BEGUN)
    assert active(store) == {("car-1", INTAKE): "too much"}
    b.clear_own("car-1", INTAKE, now=BEGUN + 1)
    assert active(store) == {("car-1", INTAKE): "too much"}
    b.report_own("car-1", INTAKE, "far too much", now=BEGUN + 2)
    b.report_own("car-1", INTAKE, "far too much", now=BEGUN + 3)
    assert active(store) == {("car-1", INTAKE): "a: too much; b: far too much"}
    a.clear_own("car-1", INTAKE, now=BEGUN + 4)
    assert active(store) == {("car-1", INTAKE): "far too much"}
    b.clear_own("car-1", INTAKE, now=BEGUN + 5)
    assert active(store) == {}
    assert events(store, "car-1", INTAKE) == ["raised", "updated", "updated", "cleared"]


def test_what_a_monitor_that_has_gone_reported_is_cleared_by_others(store, books) -> None:
    a, b = books
    a.report_own("car-1", INTAKE, "too much", now=BEGUN)
    a.report_own("car-2", INTAKE, "too much", now=BEGUN)
    b.report_own("car-2", INTAKE, "too much", now=BEGUN)
    b.report("car-3", "monitor:analysis", "a frame", now=BEGUN)
    b.keep_reports_of({"a", "b"}, now=BEGUN + 1)
    assert len(active(store)) == 3
    b.keep_reports_of({"b"}, now=BEGUN + 2)
    assert active(store) == {("car-2", INTAKE): "too much", ("car-3", "monitor:analysis"): "a frame"}


def test_an_alert_of_the_release_before_is_cleared(store, books) -> None:
    books[0].report("car-1", INTAKE, "too much", now=BEGUN)
    books[1].clear_own("car-1", INTAKE, now=BEGUN + 1)
    assert active(store) == {}


def test_a_monitor_with_time_to_spare_does_not_clear_the_overload_of_another(store, books) -> None:
    """One is behind for two minutes, the other never; both look every second."""
    seconds = [0]
    a, b = (Overload(book, limit=10.0, clock=lambda: BEGUN + seconds[0] * 10**9) for book in books)
    shown = []
    for _ in range(200):
        a.update(20.0 if seconds[0] < 120 else 0.0, n_frames=1, n_vehicles=1)
        b.update(0.0, n_frames=0, n_vehicles=0)
        shown.append(("monitor", OVERLOAD) in active(store))
        seconds[0] += 1
    assert shown == [True] * 149 + [False] * 51, "until 30 s after the last look that was behind"
    assert events(store, "monitor", OVERLOAD) == ["raised", "cleared"]


def soft_spring(text):
    return Report("car-1", "front_left.spring", 700, text)


def test_an_act_waits_for_a_monitor_that_is_changing_the_alert(store, books) -> None:
    """The monitor updates the text while a person acknowledges: both changes stay."""
    first = reported(None, soft_spring("20 % softer"), AlertSettings(), BEGUN)
    books[0].put(first, now=BEGUN)
    act = threading.Thread(target=operations.acknowledge, args=(store, 1), kwargs={"who": "anna", "now": BEGUN + 1})
    with store.alerts.locked_of("car-1") as (row,):
        act.start()
        act.join(0.3)
        assert act.is_alive()
        books[0].put(reported(alert_of(row), soft_spring("25 % softer"), AlertSettings(), BEGUN + 2), now=BEGUN + 2)
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
        operations.add_verdict(store, 1, verdict="confirmed", is_new_baseline=True, who="anna", now=BEGUN + 1)
    assert store.verdicts.all() == []
    assert [event.what for event in store.alerts.history(1)] == ["raised"]
