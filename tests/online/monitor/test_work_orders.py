"""Work orders: what a workshop is to do about an alert."""

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import AlertSettings, Report, SendError, reported
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.operations import send_work_order, work_order

NOW = 1_795_219_200_000_000_000


def raise_alert(store, cause, severity=700, **evidence):
    report = Report("car-1", cause, severity, "a sentence", evidence)
    AlertBook(store, AlertSettings()).put(reported(None, report, AlertSettings(), NOW), now=NOW)


def test_the_order_of_a_finding(store, check_document) -> None:
    evidence = {
        "change": -0.2,
        "interval": [-0.22, -0.18],
        "since": 1_795_215_600.0,
        "since_interval": [1_795_215_000.0, 1_795_215_600.0],
        "advice": "inspect before the next 500 km",
        "runner_up": "front-right spring",
    }
    raise_alert(store, "front_left.spring", **evidence)
    order = work_order(store, 1, who="anna", now=NOW + 5, link="https://s/alerts/1").as_json()
    check_document(order)
    assert order == {
        "schema": "sprung.work-order/1",
        "key": f"work-order-1-{NOW}",
        "alert": 1,
        "created": NOW + 5,
        "created_by": "anna",
        "vehicle": "car-1",
        "corner": "front_left",
        "part": "spring",
        "change": -0.2,
        "interval": [-0.22, -0.18],
        "since": 1_795_215_600_000_000_000,
        "since_interval": [1_795_215_000_000_000_000, 1_795_215_600_000_000_000],
        "severity": 700,
        "step": "high",
        "urgency": "inspect before the next 500 km",
        "sentence": "a sentence",
        "runner_up": "front-right spring",
        "state": "unacknowledged",
        "raised": NOW,
        "assignee": None,
        "evidence": evidence,
        "link": "https://s/alerts/1",
    }


@pytest.mark.parametrize(
    ("cause", "severity", "part", "urgency"),
    [
        ("sensor:acc_fl", 400, "sensor acc_fl", "continue monitoring"),
        ("silent", 300, "measuring box", "continue monitoring"),
        ("lost", 500, "measuring box", "inspect at the next service"),
        ("vehicle.unmodelled", 900, "unmodelled", "inspect before the next drive"),
        ("rear", 150, "rear", "continue monitoring"),
    ],
)
def test_orders_without_a_size_have_the_urgency_of_their_severity(
    store, check_document, *, cause, severity, part, urgency
) -> None:
    raise_alert(store, cause, severity, since=60.0)
    order = work_order(store, 1, who="anna", now=NOW).as_json()
    check_document(order)
    assert (order["part"], order["urgency"], order["change"], order["link"]) == (part, urgency, None, None)
    assert (order["since"], order["since_interval"]) == (NOW, None)


def test_what_has_no_work_order(store) -> None:
    AlertBook(store, AlertSettings()).report("monitor", "monitor:disk", "full", now=NOW)
    with pytest.raises(ParameterError, match=r"alert 1 is about the monitor \(monitor:disk\)"):
        work_order(store, 1, who="anna", now=NOW)
    with pytest.raises(ParameterError, match="unknown alert 2"):
        work_order(store, 2, who="anna", now=NOW)


class Recorder:
    """A sender that keeps what it sends, or fails."""

    shows_pictures = False

    def __init__(self, name, *, error=""):
        self.name, self.error, self.messages = name, error, []

    def send(self, message):
        if self.error:
            raise SendError(self.error)
        self.messages.append(message)


def test_an_order_goes_to_every_webhook(store) -> None:
    raise_alert(store, "front_left.spring")
    first, second = Recorder("webhook 1", error="no answer"), Recorder("webhook 2")
    results = send_work_order(store, 1, [first, second], who="anna", now=NOW)
    assert results == {"webhook 1": "no answer", "webhook 2": None}
    (message,) = second.messages
    assert (message.key, message.document["key"]) == (f"work-order-1-{NOW}",) * 2
    last = store.alerts.history(1)[-1]
    assert (last.who, last.comment) == ("anna", "work order by webhook 1: no answer; by webhook 2: sent")
    with pytest.raises(ParameterError, match="has no webhook"):
        send_work_order(store, 1, [], who="anna", now=NOW)
