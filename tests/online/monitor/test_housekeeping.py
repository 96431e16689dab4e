"""Samples that people ask for: until they have come; and a broker that is away, in the log."""

import logging
from pathlib import Path

import pytest

from sprung.link import checked_map, message, topic
from sprung.online.alerts import AlertSettings
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.store import Delivery

BEGUN = 1_795_219_200_000_000_000
SECOND = 10**9
TIMES: dict[object, object] = {"from": BEGUN - 600 * SECOND, "to": BEGUN}
ANSWER: dict[str, object] = {
    "boot": 1,
    "last": 4,
    "frames": 5,
    "from": BEGUN - 600 * SECOND,
    "to": BEGUN - 595 * SECOND,
    "reason": "",
}


def look(one):
    """Let the monitor see to what is due, whatever its clock says."""
    one.look()


def wishes(one):
    """What the box of car-1 was asked since the last time."""
    found = [checked_map(payload) for name, payload in one.link.published if name == topic("car-1", "cmd")]
    one.link.published.clear()
    return [wish for wish in found if wish["do"] != "described"]


def say(one, what, vehicle="car-1", **document):
    one.now += 15 * SECOND
    one.link.on_message(topic(vehicle, what), message({0: 1, 1: vehicle, **document}))
    one.work()


def answer(one, number, vehicle="car-1", **changes):
    document = {"did": "raw", "number": number, **ANSWER, **changes}
    say(one, "event", vehicle, **document)


def is_open(one, number):
    return number in [row.id for row in one.store.requests.open_commands()]


@pytest.fixture
def asking(bench, tmp_path: Path):
    """A monitor that knows car-1, and a request for its samples."""
    one = bench(tmp_path)
    one.describe()
    one.work()
    return one, one.store.requests.add_command("anna", "car-1", "raw", TIMES, now=BEGUN)


def test_a_vehicle_that_is_switched_off_is_asked_again_when_it_is_heard(asking) -> None:
    one, number = asking
    look(one)
    request: dict[object, object] = {0: 1, "do": "raw", "number": number, **TIMES}
    assert wishes(one) == [request]
    for _ in range(3):
        one.now += 3600 * SECOND
        look(one)
    assert wishes(one) == []
    assert is_open(one, number)
    say(one, "state", boots=[])
    look(one)
    assert [wish["number"] for wish in wishes(one)] == [number]
    look(one)
    assert wishes(one) == []  # nothing was heard since


def test_a_request_is_not_repeated_more_often_than_every_ten_seconds(asking) -> None:
    one, _ = asking
    look(one)
    for _ in range(9):
        one.now += SECOND
        one.link.on_message(topic("car-1", "state"), message({"boots": []}))
        one.work()
        look(one)
    assert len(wishes(one)) == 1


def test_a_request_is_not_lost_while_the_broker_is_away(asking, monkeypatch: pytest.MonkeyPatch) -> None:
    one, number = asking
    with monkeypatch.context() as away:
        away.setattr(one.link, "publish", lambda *_: False)
        look(one)
    look(one)
    assert [wish["number"] for wish in wishes(one)] == [number]


def test_a_request_is_done_when_all_that_the_box_says_it_sent_has_come(asking, drive, frames_of) -> None:
    one, number = asking
    frames = frames_of(drive(0))[:5]
    answer(one, number)
    one.send(frames[:4])
    look(one)
    assert is_open(one, number)
    one.send(frames[4:])
    look(one)
    assert not is_open(one, number)
    assert one.store.requests.command(number).detail == {"asked": TIMES, **ANSWER}
    wishes(one)
    answer(one, number)  # a box says it again where it was asked twice
    look(one)
    assert wishes(one) == []
    assert one.store.requests.command(number).detail == {"asked": TIMES, **ANSWER}


def test_an_answer_without_samples_ends_a_request(asking) -> None:
    one, number = asking
    answer(one, number, last=-1, frames=0, reason="the box holds no samples of that time")
    look(one)
    row = one.store.requests.command(number)
    assert row.done == one.now
    assert row.detail["reason"] == "the box holds no samples of that time"


@pytest.mark.parametrize("changes", [{"last": None}, {"boot": "1"}, {"frames": -2}, {"number": [1]}, {"to": 2**63}])
def test_an_answer_that_is_none_is_refused(asking, changes) -> None:
    one, number = asking
    say(one, "event", did="raw", **({"number": number} | ANSWER | changes))
    look(one)
    assert is_open(one, number)
    assert one.station.figures()["sprung_messages_refused_total"] == 1


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch):
    """What the monitor logs; not by way of the root, which hears nothing once a test has run the command line."""
    logger = logging.getLogger("sprung.monitor")
    monkeypatch.setattr(logger, "propagate", False)
    logger.addHandler(caplog.handler)
    caplog.set_level(logging.INFO, logger="sprung.monitor")
    yield lambda: [(one.levelname, one.getMessage()) for one in caplog.records if one.name == "sprung.monitor"]
    logger.removeHandler(caplog.handler)


AWAY = "the broker mqtt://broker:1883 cannot be reached (connection refused): check that it runs"


@pytest.mark.slow
def test_a_broker_that_is_away_is_logged_at_once_every_ten_minutes_and_when_it_is_back(bench, log) -> None:
    one = bench()

    def logged(minutes):
        before = len(log())
        for _ in range(6 * minutes):
            one.look(10.0)
        return log()[before:]

    one.link.is_connected, one.link.problem = False, ""
    assert logged(1) == []  # the first attempt has not failed yet
    one.link.problem = AWAY
    assert logged(1) == [("WARNING", AWAY)]
    assert logged(9) == []
    assert logged(11) == [("WARNING", AWAY)] * 2
    one.link.is_connected, one.link.problem = True, ""
    assert logged(30) == [("INFO", "connected to broker")]


def test_notifications_that_were_given_up_are_an_alert_until_that_sender_delivers(bench, tmp_path: Path) -> None:
    mail = {"host": "127.0.0.1", "port": 1, "sender": "a@example.org", "recipients": ["b@example.org"]}
    first = bench(tmp_path)
    AlertBook(first.store, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=BEGUN)
    lost = Delivery(20, given_up=BEGUN, last_error="mail server away")
    first.store.alerts.put_delivery(1, "mail 1", lost, senders=["mail 1"], now=BEGUN)
    first.look()
    assert own_alerts(first) == {}, "a sender that the site file no longer has misses nothing"
    first.close()
    again = bench(tmp_path, send={"mail": [mail]})
    again.look()
    sentence = own_alerts(again)["monitor:notifications"]
    assert sentence.startswith(
        "notifications were given up after 20 attempts by mail 1: mail server away; correct [send]"
    )
    late = Delivery(1, sent=BEGUN + SECOND)
    again.store.alerts.put_delivery(1, "mail 1", late, senders=["mail 1"], now=BEGUN + SECOND)
    again.close()
    last = bench(tmp_path, send={"mail": [mail]})
    last.look()
    assert own_alerts(last) == {}


def own_alerts(one):
    """The texts of the monitor's own alerts about notifications."""
    rows = one.store.alerts.find(vehicle="monitor", is_active=True)
    return {row.cause: row.text for row in rows if row.cause == "monitor:notifications"}
