"""Notifications are sent until every sender has passed them on."""

import logging
from pathlib import Path

import pytest

from sprung.alerting import AlertSettings, SendError
from sprung.errors import ParameterError
from sprung.monitor import AlertBook, Postman, Site
from sprung.monitor.postman import try_senders
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
        self.sent.append(message)


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
    assert good.sent == bad.sent
    assert [message.subject for message in good.sent] == ["car-1: silent raised (low), alert 1"]
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
    assert said.getMessage() == "notification of alert 1 was not delivered: mail 1 is not there; it will be sent again"
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


def test_a_notification_has_number_link_and_picture(store) -> None:
    AlertBook(store, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=NOW)
    sender = Sender("mail 1")
    pictures = {("car-1", "silent"): b"picture"}
    postman = Postman(
        store,
        [sender],
        link=lambda number: f"https://sprung.example.org/alerts/{number}",
        picture=lambda vehicle, cause: pictures[vehicle, cause],
    )
    postman.send(now=NOW)
    (message,) = sender.sent
    assert message.document["number"] == 1
    assert message.document["link"] == "https://sprung.example.org/alerts/1"
    assert message.text.endswith("Link: https://sprung.example.org/alerts/1")
    assert message.picture == b"picture"


def test_senders_are_tried_and_each_result_is_returned() -> None:
    mail = {"host": "127.0.0.1", "port": 1, "sender": "a@example.org", "recipients": ["b@example.org"]}
    site = Site.model_validate({"send": {"mail": [mail], "webhook": [{"url": "http://127.0.0.1:1/secret"}]}})
    found = try_senders(site.send, now=NOW)
    assert list(found) == ["webhook 1", "mail 1"]
    assert "webhook at 127.0.0.1:1 cannot be reached" in found["webhook 1"]
    assert "mail server 127.0.0.1:1 cannot be reached (Connection refused)" in found["mail 1"]
    with pytest.raises(ParameterError, match=r"the site file has no sender, .*: add \[\[send.mail\]\]"):
        try_senders(Site().send, now=NOW)
