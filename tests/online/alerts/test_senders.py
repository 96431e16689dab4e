"""Messages and senders, against a real HTTP server and a small SMTP server in threads."""

import json
import logging
import socket
import socketserver
import threading
import urllib.request
from contextlib import contextmanager
from dataclasses import replace
from email import message_from_bytes
from email.policy import default
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import (
    AlertSettings,
    Backoff,
    LogSender,
    MailSender,
    PublishSender,
    Report,
    SendError,
    WebhookSender,
    addressed,
    deliver,
    message_of,
    reported,
)

TIME = 1_700_000_000_000_000_000  # 2023-11-14 22:13:20 UTC
DIRECT = urllib.request.ProxyHandler({})


def a_message(severity=700, **evidence):
    report = Report("car", "front_left.spring", severity, "front-left spring 20 % softer – inspect", evidence)
    transition = reported(None, report, AlertSettings(), TIME)
    return message_of(transition)


@contextmanager
def serving(server):
    """Serve in a thread, on any free port."""
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@contextmanager
def http_server(status=200, location=None):
    requests = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            requests.append((self.path, dict(self.headers), body))
            self.send_response(status)
            if location:
                self.send_header("Location", location)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def do_GET(self):
            requests.append((self.path, dict(self.headers), b""))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_):
            pass

    with serving(HTTPServer(("127.0.0.1", 0), Handler)) as port:
        yield port, requests


@contextmanager
def smtp_server(refused=(), greeting="220 ready"):
    """A mail server that knows what the tests need, refuses some recipients and any login."""
    mails, commands = [], []

    class Handler(socketserver.StreamRequestHandler):
        def answer(self, line):
            self.wfile.write(line.encode() + b"\r\n")

        def handle(self):
            self.answer(greeting)
            recipients = []
            while line := self.rfile.readline().decode().strip():
                commands.append(line)
                verb = line.split()[0].upper()
                if verb == "EHLO":
                    self.answer("250-here\r\n250 AUTH PLAIN")
                elif verb == "AUTH":
                    self.answer("535 no")
                elif verb == "RCPT":
                    address = line.split("<")[1].split(">")[0]
                    is_refused = address in refused
                    self.answer("550 unknown" if is_refused else "250 ok")
                    recipients += [] if is_refused else [address]
                elif verb == "DATA":
                    self.answer("354 go on")
                    body = b""
                    while (part := self.rfile.readline()) != b".\r\n":
                        body += part
                    mails.append((recipients, message_from_bytes(body, policy=default)))
                    self.answer("250 ok")
                elif verb == "QUIT":
                    self.answer("221 bye")
                    return
                else:
                    self.answer("250 ok")

    with serving(socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler)) as port:
        yield port, mails, commands


def webhook(url, **options):
    return WebhookSender(url, handlers=[DIRECT], **options)


def mail(port, **options):
    defaults = {"sender": "car@example.org", "recipients": ["ann@example.org", "bob@example.org"], "starttls": False}
    return MailSender("127.0.0.1", port, **{**defaults, **options})


def closed_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.mark.parametrize(
    ("severity", "level"),
    [(100, logging.INFO), (300, logging.INFO), (500, logging.WARNING), (700, logging.ERROR), (900, logging.CRITICAL)],
)
def test_log(caplog: pytest.LogCaptureFixture, severity, level) -> None:
    caplog.set_level(logging.DEBUG)
    sender = LogSender(logging.getLogger("alerts"))
    sender.send(a_message(severity))
    odd = {"text": "20 %s\r\nforged"}
    sender.send(replace(a_message(severity), what="cleared", subject="100 % gone\nforged", document=odd))
    assert [(one.levelno, one.getMessage()) for one in caplog.records] == [
        (level, f"{a_message(severity).subject}: front-left spring 20 % softer – inspect"),
        (logging.INFO, "100 % gone forged: 20 %s forged"),
    ]


def test_webhook_posts_the_document() -> None:
    with http_server() as (port, requests):
        webhook(f"http://127.0.0.1:{port}/hook?key=1", headers={"Authorization": "Bearer abc"}).send(a_message())
    ((path, headers, body),) = requests
    assert path == "/hook?key=1"
    assert (headers["Authorization"], headers["Content-Type"]) == ("Bearer abc", "application/json")
    assert json.loads(body) == a_message().document


@pytest.mark.parametrize("status", [400, 404, 500])
def test_webhook_that_refuses_and_keeps_its_secret(status) -> None:
    with http_server(status) as (port, _), pytest.raises(SendError, match=f"answered {status}") as caught:
        webhook(f"http://127.0.0.1:{port}/secret").send(a_message())
    assert "secret" not in str(caught.value)


def test_webhook_follows_no_redirection(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with http_server() as (other, unasked), http_server(302, f"http://127.0.0.1:{other}/") as (port, requests):
        with pytest.raises(SendError, match="answered 302"):
            WebhookSender(f"http://127.0.0.1:{port}/").send(a_message())
        assert len(requests) == 1
        assert not unasked


def test_webhook_without_an_answer() -> None:
    with pytest.raises(SendError, match=r"webhook at 127\.0\.0\.1:\d+ cannot be reached"):
        webhook(f"http://127.0.0.1:{closed_port()}/").send(a_message())
    with socket.create_server(("127.0.0.1", 0)) as mute, pytest.raises(SendError, match="gave no answer"):
        webhook(f"http://127.0.0.1:{mute.getsockname()[1]}/", timeout=0.05).send(a_message())
    with smtp_server() as (port, _, _), pytest.raises(SendError, match="gave no answer"):
        webhook(f"http://127.0.0.1:{port}/").send(a_message())


def test_webhook_with_a_header_that_http_does_not_allow() -> None:
    with http_server() as (port, requests), pytest.raises(SendError, match="text that HTTP forbids"):
        webhook(f"http://127.0.0.1:{port}/", headers={"X-A": "a\r\nB: c"}).send(a_message())
    assert not requests


def test_mail() -> None:
    with smtp_server() as (port, mails, commands):
        mail(port).send(a_message())
    ((recipients, one),) = mails
    assert recipients == ["ann@example.org", "bob@example.org"]
    assert one["Subject"] == a_message().subject
    assert one["To"] == "ann@example.org, bob@example.org"
    assert one["Date"].datetime.timestamp() == TIME / 1e9
    assert one["Auto-Submitted"] == "auto-generated"
    assert one.get_content().splitlines() == a_message().text.splitlines()
    assert commands[-1] == "QUIT"


def test_mail_carries_number_link_and_picture() -> None:
    link = "https://sprung.example.org/alerts/7"
    message = addressed(a_message(), number=7, key="18-7", link=link, picture=b"\x89PNG picture")
    with smtp_server() as (port, mails, _):
        mail(port).send(message)
    ((_, one),) = mails
    assert one["Subject"] == "car: front-left spring raised (high), alert 7"
    assert one["Message-ID"] == "<18-7.sprung@example.org>"
    plain, html = one.get_body(("plain",)).get_content(), one.get_body(("html",)).get_content()
    for text in (plain, html):
        assert "front-left spring 20 % softer" in text
        assert "Alert: 7 (acknowledge with: sprung alerts ack 7)" in text
    assert f"Link: {link}\r\n" in plain
    assert f'<a href="{link}">{link}</a>' in html
    (picture,) = [part for part in one.walk() if part.get_content_type() == "image/png"]
    assert picture.get_content() == b"\x89PNG picture"
    assert picture.get_content_disposition() == "inline"
    assert f"cid:{picture['Content-ID'].strip('<>')}" in html
    assert (message.document["number"], message.document["link"]) == (7, link)


def test_mail_is_not_sent_in_the_clear() -> None:
    with smtp_server() as (port, mails, commands), pytest.raises(SendError, match="STARTTLS"):
        mail(port, starttls=True, username="ann", password="secret").send(a_message())
    assert not mails
    assert not any(line.startswith(("AUTH", "MAIL")) for line in commands)


def test_mail_with_a_wrong_password() -> None:
    with smtp_server() as (port, mails, _), pytest.raises(SendError, match=r"refused username or password \(535\)"):
        mail(port, username="ann", password="secret").send(a_message())
    assert not mails


@pytest.mark.parametrize(
    ("refused", "sentence", "count"),
    [
        (["bob@example.org"], "refused bob@example.org and accepted the others", 1),
        (["ann@example.org", "bob@example.org"], "refused ann@example.org, bob@example.org: check", 0),
    ],
)
def test_mail_with_refused_recipients(refused, sentence, count) -> None:
    with smtp_server(refused) as (port, mails, _), pytest.raises(SendError, match=sentence):
        mail(port).send(a_message())
    assert len(mails) == count


def test_mail_without_a_server() -> None:
    with pytest.raises(SendError, match=r"mail server 127\.0\.0\.1:\d+ cannot be reached \(Connection ref"):
        mail(closed_port()).send(a_message())
    with smtp_server(greeting="554 go away") as (port, _, _), pytest.raises(SendError, match="554"):
        mail(port).send(a_message())


def test_publish() -> None:
    published = []
    PublishSender(lambda *one: published.append(one)).send(a_message())
    ((topic, payload),) = published
    assert topic == "sprung/v1/car/alert"
    assert json.loads(payload) == a_message().document


def test_publish_fails() -> None:
    def publish(topic, payload):
        raise ConnectionError("no broker")

    with pytest.raises(SendError, match=r"alert of car was not published \(no broker\)"):
        PublishSender(publish).send(a_message())
    with pytest.raises(SendError, match=r"alert of car was not published \(no connection\): check the broker"):
        PublishSender(lambda topic, payload: False).send(a_message())
    for vehicle in ("#", "a/b", "+", ""):
        with pytest.raises(SendError, match="cannot be part of a topic"):
            PublishSender(print).send(replace(a_message(), vehicle=vehicle))


@pytest.mark.parametrize(
    ("act", "sentence"),
    [
        (lambda: WebhookSender("file:///etc/passwd"), "must begin with http:// or https:// and a host"),
        (lambda: WebhookSender("https://"), "must begin with"),
        (lambda: WebhookSender("http://a:port/"), "cannot be read"),
        (lambda: WebhookSender("http://a/", timeout=0), "timeout=0 must be above 0"),
        (lambda: mail(25, recipients=[]), "at least one address"),
        (lambda: mail(25, recipients="ann@example.org"), "must be a list"),
        (lambda: mail(25, recipients=["ann@example.org\nBcc: x@y"]), "is not a mail address"),
        (lambda: mail(25, sender="car"), "'car' is not a mail address"),
        (lambda: mail(25, username="ann"), "give both or none"),
        (lambda: mail(70000), "port=70000 must be"),
        (lambda: Backoff(first=0), "first=0 must be above 0"),
        (lambda: Backoff(first=5, most=4), "most=4 must be at least 5"),
        (lambda: Backoff().next_attempt(0, 0), "attempts=0 must be at least 1"),
    ],
)
def test_refusals(act, sentence) -> None:
    with pytest.raises(ParameterError, match=sentence):
        act()


class Recorder:
    """A sender that keeps what it is given, or fails."""

    shows_pictures = False

    def __init__(self, name, error=None):
        self.name, self.error, self.sent = name, error, []

    def send(self, message):
        if self.error is not None:
            raise self.error
        self.sent.append(message)


def test_one_failing_sender_does_not_keep_the_others() -> None:
    last, message = Recorder("last"), a_message()
    senders = [Recorder("faulty", KeyError("bug")), Recorder("hook", SendError("webhook at 127.0.0.1: refused")), last]
    assert deliver(message, senders) == {
        "faulty": "faulty failed with KeyError: 'bug'",
        "hook": "webhook at 127.0.0.1: refused",
    }
    assert last.sent == [message]
    assert deliver(message, [last]) == {}


def test_backoff_doubles_up_to_the_longest() -> None:
    backoff = Backoff(first=3, most=20)
    waits = [backoff.next_attempt(attempts, 100) - 100 for attempts in (1, 2, 3, 4, 5, 10**9)]
    assert waits == [3, 6, 12, 20, 20, 20]
