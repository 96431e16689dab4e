"""Notifications are sent until every sender has passed them on."""

import logging
from pathlib import Path

import pytest

from sprung.alerting import AlertSettings, SendError
from sprung.monitor import AlertBook, Postman
from sprung.storage import open_store

NOW = 1_795_219_200_000_000_000
SECOND = 10**9


class Sender:
    def __init__(self, name, failures=0):
        self.name, self.failures, self.sent = name, failures, []

    def send(self, message):
        if self.failures:
            self.failures -= 1
            raise SendError(f"{self.name} is not there")
        self.sent.append(message.subject)


@pytest.fixture
def store(tmp_path: Path):
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        yield opened


def test_each_sender_gets_each_message_once_however_often_another_fails(store) -> None:
    AlertBook(store, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=NOW)
    good, bad = Sender("good"), Sender("bad", failures=3)
    postman = Postman(store, [good, bad])
    for second in range(60):
        postman.send(now=NOW + second * SECOND)
    assert good.sent == bad.sent == ["car-1: silent raised (low)"]
    assert store.alerts.due_notifications(10) == []


def test_a_failure_is_logged_at_once_and_kept_in_the_history(store, caplog) -> None:
    caplog.set_level(logging.INFO, "sprung.monitor")
    AlertBook(store, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=NOW)
    bad = Sender("mail 1", failures=3)
    postman = Postman(store, [Sender("log"), bad])
    assert postman.troubles == []
    postman.send(now=NOW)
    assert postman.troubles == ["alerts are not delivered by mail 1: mail 1 is not there"]
    (said,) = caplog.records
    assert said.levelno == logging.ERROR
    assert said.getMessage() == "notification of alert 1 undelivered: mail 1 is not there; it will be sent again"
    for second in range(1, 60):
        postman.send(now=NOW + second * SECOND)
    assert postman.troubles == []
    history = store.alerts.history(1)
    assert [row.what for row in history] == ["raised", "undelivered", "delivered"]
    assert history[1].time == NOW
    assert history[1].comment == "mail 1 is not there; it will be sent again"
    assert history[2].comment == "at attempt 4"


def test_a_message_that_never_gets_through_is_given_up(store) -> None:
    AlertBook(store, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=NOW)
    postman = Postman(store, [Sender("bad", failures=10**6)])
    for hour in range(100):
        postman.send(now=NOW + hour * 3600 * SECOND)
    assert store.alerts.due_notifications(10) == []
    last = store.alerts.history(1)[-1]
    assert (last.what, last.comment) == ("abandoned", "after 20 attempts: bad is not there")
    assert postman.troubles == ["alerts are not delivered by bad: bad is not there"]
