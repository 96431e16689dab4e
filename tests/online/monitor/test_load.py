"""A flood of one vehicle, loops that stand still, and jobs that never end: others go on, and it is said."""

import pytest

from sprung.link import checked_map, message, topic
from sprung.online.store import StoreError

WATCH = {"watch": {"learning_windows": 2, "window_minutes": 2, "identify_every_minutes": 0}, "keep": {"raw_days": 0}}


def test_a_flood_of_one_vehicle_keeps_no_other_out(bench, drive, frames_of) -> None:
    """The first message of a vehicle is among the next ones taken, and the flood is refused, counted and an alert."""
    one = bench(**WATCH)
    flood = message({0: 1, "x": bytes(1_000_000)})
    for _ in range(100):
        one.link.on_message(topic("car-1", "health"), flood)
    for payload in frames_of(drive(0), "car-2")[:3]:
        one.link.on_message(topic("car-2", "raw"), payload)
    assert one.station.figures()["sprung_queue_bytes"] < 30e6
    one.station.step()
    assert one.store.inbox.cursor("car-2", 1).contiguous == 2
    assert 70 <= one.station.figures()['sprung_refusals_total{vehicle="car-1",reason="overload"}'] <= 80
    (row,) = one.store.alerts.find(vehicle="car-1", is_active=True)
    assert row.cause == "monitor:intake"
    assert row.text == "car-1 sends more than the monitor takes in: messages are refused"
    one.look(60.0)
    assert one.store.alerts.find(is_active=True) == []


def test_a_batch_ends_when_its_time_is_over(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading takes a second for each message here: a batch is one of them, whatever waits."""
    one = bench(**WATCH)
    one.work()
    handle = one.station._intake._handle

    def slow(*given):
        one.seconds += 1.0
        handle(*given)

    monkeypatch.setattr(one.station._intake, "_handle", slow)
    for _ in range(10):
        one.link.on_message(topic("car-1", "health"), message({"free": 5}))
    for n_messages in (1, 2, 3):
        one.station.step()
        assert one.station.figures()["sprung_messages_total"] == n_messages


def test_health_says_that_the_loop_stands_still_though_it_hangs(bench) -> None:
    """Time passes and no step ends, as in a store that hangs; /health is asked from another thread."""
    one = bench(**WATCH)
    one.work()
    assert one.station.problems() == []
    one.seconds += 16.0
    assert one.station.problems() == [
        "the main loop of the monitor has stopped: check its store and disk, restart it if it does not resume "
        "(last pass 16 s ago)"
    ]
    assert one.station.figures()['sprung_heartbeat_age_seconds{loop="station"}'] == 16.0
    one.station.step()
    assert one.station.problems() == []


def test_a_description_is_confirmed_once_the_station_goes_by_it(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """The store fails as the station reads the description: the box, which hears nothing, repeats it."""
    one = bench(**WATCH)
    one.work()
    known = one.store.inbox.vehicle

    def fails(vehicle):
        if known(vehicle) is not None:
            raise StoreError("the store does not answer")

    monkeypatch.setattr(one.store.inbox, "vehicle", fails)
    one.describe()
    one.station.step()
    assert one.link.published == []
    assert one.station.problems() == ["the store does not answer"]
    monkeypatch.setattr(one.store.inbox, "vehicle", known)
    one.seconds += 2.0
    one.describe()
    one.station.step()
    ((name, payload),) = one.link.published
    assert name == topic("car-1", "cmd")
    assert checked_map(payload)["do"] == "described"


def test_jobs_that_never_end_are_a_problem(bench, drive, frames_of, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bench(**WATCH)
    one.describe()
    monkeypatch.setattr(one.workers, "submit", lambda *_, **__: None)
    one.link.on_message(topic("car-1", "raw"), frames_of(drive(0))[0])
    one.station.step()
    for _ in range(2):
        one.seconds += 120.5
        one.station.step()
    assert one.station.problems() == ["no analysis job finishes: restart the monitor (last pass 241 s ago)"]
