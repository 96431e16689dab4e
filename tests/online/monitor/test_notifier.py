"""Notifications are sent until every sender has passed them on, or given them up."""

import json
import logging
import socket
import socketserver
import threading
import urllib.request
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import AlertSettings, MailSender, SelectiveSender, SendError, WebhookSender, trial_message
from sprung.online.monitor import Site, notifier
from sprung.online.monitor.alert_book import AlertBook, Context
from sprung.online.monitor.notifier import NotificationService, try_senders

NOW = 1_795_219_200_000_000_000
SECOND = 10**9
DIRECT = urllib.request.ProxyHandler({})


class Sender:
    shows_pictures = True

    def __init__(self, name, failures=0):
        self.name, self.failures, self.sent = name, failures, []

    def send(self, message):
        if self.failures:
            self.failures -= 1
            raise SendError(f"{self.name} is not there")
        self.sent.append(message)


class Clock:
    """A clock that is set by hand."""

    def __init__(self):
        self.now = NOW

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def office(store, clock):
    """Make an office that sends by hand, as after a restart."""

    def made(*senders, **site):
        opened = NotificationService(Context(Site.model_validate(site), store, clock), senders)
        opened.resume()
        return opened

    return made


def report(store, number=1, text="car-1 has sent nothing"):
    AlertBook(store, AlertSettings()).report(f"car-{number}", "silent", text, now=NOW)


def send_for(office, clock, seconds, *, step=1):
    for _ in range(0, seconds, step):
        office.send()
        clock.now += step * SECOND


def test_a_failure_is_logged_at_once_and_kept_in_the_history(store, office, clock, caplog) -> None:
    caplog.set_level(logging.INFO, "sprung.monitor")
    report(store)
    opened = office(Sender("log"), Sender("mail 1", failures=3))
    assert opened.problems == []
    opened.send()
    assert opened.problems == ["alerts are not delivered by mail 1: mail 1 is not there"]
    (said,) = caplog.records
    assert said.levelno == logging.ERROR
    sentence = "by mail 1: mail 1 is not there; it will be sent again"
    assert said.getMessage() == f"notification of alert 1 was not delivered {sentence}"
    send_for(opened, clock, 60)
    assert opened.problems == []
    history = store.alerts.history(1)
    assert [row.what for row in history] == ["raised", "undelivered", "delivered"]
    assert history[1].time == NOW
    assert history[1].comment == sentence
    assert history[2].comment == "by mail 1 at attempt 4"


def test_a_message_that_never_gets_through_is_given_up_and_not_called_sent(store, office, clock) -> None:
    report(store)
    good, bad = Sender("good"), Sender("bad", failures=10**6)
    opened = office(good, bad)
    send_for(opened, clock, 100 * 3600, step=3600)
    assert bad.failures == 10**6 - 20
    assert len(good.sent) == 1
    assert store.alerts.n_open() == 0
    last = store.alerts.history(1)[-1]
    assert (last.what, last.comment) == ("abandoned", "by bad after 20 attempts: bad is not there")
    assert opened.problems == ["alerts are not delivered by bad: bad is not there"]
    assert opened.lasting_problem.startswith("notifications were given up after 20 attempts by bad: bad is not there")
    assert opened.figures == {"sprung_notifications_sent_total": 1, "sprung_notifications_given_up_total": 1}
    assert store.alerts.given_up() == {"bad": "bad is not there"}
    again = office(good, bad)
    assert again.lasting_problem == opened.lasting_problem, "a restart forgets nothing"
    bad.failures = 0
    report(store, 2)
    again.send()
    assert again.lasting_problem == ""
    assert office(good, bad).lasting_problem == ""


def test_a_notification_that_cannot_be_composed_holds_no_other_up(store, office, clock, monkeypatch) -> None:
    report(store)
    report(store, 2)
    sender, pictures = Sender("mail 1"), {"car-2": b""}
    monkeypatch.setattr(notifier, "alert_picture", lambda _store, vehicle, _cause: pictures[vehicle])
    send_for(office(sender), clock, 3)
    assert [message.vehicle for message in sender.sent] == ["car-2"]
    assert "cannot be composed (KeyError: 'car-1')" in store.alerts.history(1)[-1].comment


def test_a_notification_has_number_key_link_and_picture(store, office, monkeypatch) -> None:
    report(store)
    sender, plain = Sender("mail 1"), Sender("webhook 1")
    plain.shows_pictures = False
    pictures = {("car-1", "silent"): b"picture"}
    monkeypatch.setattr(notifier, "alert_picture", lambda _store, *alert: pictures.pop(alert))
    office(sender, plain, url="https://sprung.example.org").send()
    (message,) = sender.sent
    assert message.document["number"] == 1
    assert message.document["key"] == message.key == f"{NOW}-1"
    assert message.document["link"] == "https://sprung.example.org/alerts/1"
    assert message.text.endswith("Link: https://sprung.example.org/alerts/1")
    assert message.picture == b"picture"
    assert [other.picture for other in plain.sent] == [b""]


def test_senders_are_tried_and_each_result_is_returned() -> None:
    mail = {"host": "127.0.0.1", "port": 1, "sender": "a@example.org", "recipients": ["b@example.org"]}
    site = Site.model_validate({"send": {"mail": [mail], "webhook": [{"url": "http://127.0.0.1:1/secret"}]}})
    found = try_senders(site.send, now=NOW)
    assert list(found) == ["webhook 1", "mail 1"]
    assert "webhook at 127.0.0.1:1 cannot be reached" in found["webhook 1"]
    assert "mail server 127.0.0.1:1 cannot be reached (Connection refused)" in found["mail 1"]
    assert list(try_senders(site.send, name="mail 1", now=NOW)) == ["mail 1"]
    with pytest.raises(ParameterError, match="unknown sender 'mail 2'"):
        try_senders(site.send, name="mail 2", now=NOW)
    with pytest.raises(ParameterError, match=r"the site file has no sender, .*: add \[\[send.mail\]\]"):
        try_senders(Site().send, now=NOW)


@contextmanager
def _serving(server):
    """Serve in a thread, on any free port."""
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@contextmanager
def _server(answer):
    """A server that answers every connection in its own way."""

    class Handler(socketserver.BaseRequestHandler):
        def handle(self):
            answer(self.request)

    with _serving(socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler)) as port:
        yield port


def _dripping(opening):
    """A server that sends an opening, and then a byte each 10 ms, until the other side ends the connection."""

    def drip(connection):
        try:
            connection.sendall(opening)
            while True:
                connection.sendall(b"x")
                threading.Event().wait(0.01)
        except OSError:
            return

    return drip


def _silent(connection):
    """Accept everything, and say nothing."""
    while connection.recv(4096):
        pass


def _closing(connection):
    """Close at once."""
    connection.shutdown(socket.SHUT_RDWR)


@contextmanager
def _healthy():
    """A webhook that keeps what it is sent."""
    posted = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            posted.append((self.headers["Idempotency-Key"], json.loads(body)))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            pass

    with _serving(ThreadingHTTPServer(("127.0.0.1", 0), Handler)) as port:
        yield port, posted


def _hook(port, name, *, limit=30.0, timeout=10.0):
    return WebhookSender(f"http://127.0.0.1:{port}/", limit=limit, timeout=timeout, handlers=[DIRECT], name=name)


def _mail(port, name, *, limit=30.0, timeout=10.0):
    return MailSender(
        "127.0.0.1",
        port,
        sender="a@example.org",
        recipients=["b@example.org"],
        starttls=False,
        limit=limit,
        timeout=timeout,
        name=name,
    )


SICK = {
    "a webhook that drips its status": (_hook, _dripping(b"HTTP/1.1 2")),
    "a webhook that drips its headers": (_hook, _dripping(b"HTTP/1.1 200 OK\r\nX: ")),
    "a webhook that is silent": (_hook, _silent),
    "a webhook that closes": (_hook, _closing),
    "a mail server that drips its greeting": (_mail, _dripping(b"220 ")),
    "a mail server that drips its answer": (_mail, _dripping(b"220 ready\r\n250-")),
    "a mail server that is silent": (_mail, _silent),
    "a mail server that closes": (_mail, _closing),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", SICK)
def test_a_sick_server_is_left_after_the_limit(store, office, case) -> None:
    sender_of, answer = SICK[case]
    report(store)
    with _server(answer) as port:
        opened = office(sender_of(port, "sick", limit=0.3))
        opened.send()
    (problem,) = opened.problems
    if "closes" not in case:
        assert "took longer than 0.3 s" in problem
    assert store.alerts.n_open() == 1


@pytest.mark.slow
def test_a_healthy_server_gets_every_message_once_while_all_others_hold_their_threads(store, clock) -> None:
    """All sick servers hold their senders for the whole test: their limits are longer than it lasts."""
    n_messages = 25
    with _healthy() as (good_port, posted):
        released = threading.Event()

        def hold(connection):
            connection.sendall(b"2")
            released.wait()

        with _server(hold) as sick_port:
            sick = [_hook(sick_port, "webhook 1"), _mail(sick_port, "mail 1")]
            senders = [*sick, _hook(good_port, "webhook 2")]
            office = NotificationService(Context(Site(), store, clock), senders)
            office.open()
            try:
                for number in range(n_messages):
                    report(store, number)
                done = threading.Event()
                while len(posted) < n_messages and not done.wait(0.01):
                    pass
                assert [document["vehicle"] for _, document in posted] == [f"car-{n}" for n in range(n_messages)]
                assert len({key for key, _ in posted}) == n_messages
                assert office.figures["sprung_notifications_sent_total"] in (n_messages - 1, n_messages)
                assert store.alerts.n_open() == n_messages, "the sick ones have passed on none"
            finally:
                released.set()
                office.close()


def test_a_sender_is_given_the_alerts_of_its_vehicles_and_severity(office, clock, store):
    every, some, severe = Sender("every"), Sender("some"), Sender("severe")
    running = office(every, SelectiveSender(some, vehicles=("car-1*",)), SelectiveSender(severe, step=4))
    for number in (1, 2, 12):
        report(store, number)
    send_for(running, clock, 2)
    assert [each.vehicle for each in every.sent] == ["car-1", "car-2", "car-12"]
    assert [each.vehicle for each in some.sent] == ["car-1", "car-12"]
    assert severe.sent == []
    assert running.problems == []
    assert not store.alerts.next_notification("severe", now=clock())
    SelectiveSender(severe, step=4).send(trial_message(NOW))
    assert len(severe.sent) == 1


def test_the_site_file_selects_what_a_sender_is_given():
    site = Site.model_validate(
        {"send": {"webhook": [{"url": "https://x.org", "severity": "high", "vehicles": ["a*"]}]}}
    )
    (sender,) = (
        each for each in notifier.senders_of(site.send, lambda topic, payload: None) if each.name == "webhook 1"
    )
    assert isinstance(sender, SelectiveSender)
    assert (sender.step, sender.vehicles) == (3, ("a*",))
