"""Messages until they are through; /metrics and /health."""

import json
import urllib.error
import urllib.request

import pytest

from sprung.alerting import AlertSettings, SendError
from sprung.monitor import FIGURES, AlertBook, Postman, Serving
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
def store(tmp_path):
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        yield opened


def test_each_sender_gets_each_message_once_however_often_another_fails(store):
    AlertBook(store, AlertSettings()).trouble("car-1", "silent", "car-1 has sent nothing", now=NOW)
    good, bad = Sender("good"), Sender("bad", failures=3)
    postman = Postman(store, [good, bad])
    for second in range(60):
        postman.send(now=NOW + second * SECOND)
    assert good.sent == bad.sent == ["car-1: silent raised (low)"]
    assert store.alerts.due_notifications(10) == []


def test_a_message_that_never_gets_through_is_given_up(store):
    AlertBook(store, AlertSettings()).trouble("car-1", "silent", "car-1 has sent nothing", now=NOW)
    postman = Postman(store, [Sender("bad", failures=10**6)])
    for hour in range(100):
        postman.send(now=NOW + hour * 3600 * SECOND)
    assert store.alerts.due_notifications(10) == []


def test_trouble_that_stays_the_same_is_named_once(store):
    book = AlertBook(store, AlertSettings())
    for second in range(5):
        book.trouble("car-1", "silent", "car-1 has sent nothing", now=NOW + second)
    assert len(store.alerts.due_notifications(10)) == 1
    book.over("car-1", "silent", now=NOW + 10)
    book.over("car-1", "silent", now=NOW + 11)
    assert len(store.alerts.due_notifications(10)) == 2
    (row,) = store.alerts.find()
    assert [entry.what for entry in store.alerts.history(row.id)] == ["raised", "cleared"]


def test_metrics_and_health():
    troubles = []
    one = Serving(("127.0.0.1", 0), figures=lambda: dict.fromkeys(FIGURES, 2.5), troubles=lambda: troubles)
    one.open()

    def ask(path):
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{one.port}{path}") as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read().decode()

    status, text = ask("/metrics")
    assert status == 200
    assert "# TYPE sprung_frames_total counter\nsprung_frames_total 2.5\n" in text
    assert ask("/health") == (200, json.dumps({"healthy": True, "troubles": []}))
    troubles.append("the store cannot write")
    assert ask("/health")[0] == 503
    assert ask("/else")[0] == 404
    one.close()
