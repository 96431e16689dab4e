"""Notifications are sent until every sender has passed them on."""

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


def test_a_message_that_never_gets_through_is_given_up(store) -> None:
    AlertBook(store, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=NOW)
    postman = Postman(store, [Sender("bad", failures=10**6)])
    for hour in range(100):
        postman.send(now=NOW + hour * 3600 * SECOND)
    assert store.alerts.due_notifications(10) == []
