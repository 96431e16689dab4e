"""Limits of rate, size and time, and headers, around any application; and a real server with slow clients."""

import asyncio
import http.client
import socket
import time
from contextlib import suppress
from dataclasses import replace

import pytest

from sprung.online.monitor import Site
from sprung.online.site import Context, Server, app, guard
from sprung.online.site.guard import Attempts, Guard, RateLimit, network_of, policy
from sprung.online.site.shared import LIMITS


def test_a_bucket_fills_again() -> None:
    now = [0.0]
    limit = RateLimit(2.0, 3.0, lambda: now[0])
    assert [limit.wait("a") for _ in range(4)] == [0, 0, 0, 0.5]
    assert limit.wait("b") == 0
    now[0] = 0.5
    assert [limit.wait("a") for _ in range(2)] == [0, 0.5]
    now[0] = 60.0
    assert [limit.wait("a") > 0 for _ in range(4)] == [False, False, False, True]


def test_addresses_are_forgotten_beyond_a_number(monkeypatch) -> None:
    monkeypatch.setattr(guard, "LIMITS", replace(LIMITS, max_addresses=2))
    limit = RateLimit(1.0, 1.0, lambda: 0.0)
    assert [limit.wait(address) for address in ("a", "b", "c", "a")] == [0, 0, 0, 0]


def test_attempts_to_log_in() -> None:
    now = [0.0]
    attempts = Attempts(lambda: now[0])
    assert [attempts.wait("192.0.2.1", "ada") for _ in range(7)] == [0] * 5 + [30, 30]
    assert attempts.wait("192.0.2.2", "ada") == 0
    names = [f"name {k}" for k in range(40)]
    assert [attempts.wait("192.0.2.1", name) == 0 for name in names] == [True] * 25 + [False] * 15
    # A hundred to one name at once, of many addresses; then slowly. Refused ones count nowhere else.
    others = [attempts.wait(f"198.51.100.{k}", "ada") for k in range(100)]
    assert [wait == 0 for wait in others] == [True] * 94 + [False] * 6
    now[0] = 3.0
    assert attempts.wait("203.0.113.1", "ada") == 0
    assert attempts.wait("203.0.113.2", "ada") > 0


def test_one_machine_has_many_addresses_of_version_6() -> None:
    assert network_of("2001:db8:1:2:3:4:5:6") == network_of("2001:db8:1:2::1") != network_of("2001:db8:1:3::1")
    assert network_of("::ffff:192.0.2.1") == network_of("192.0.2.1") == "192.0.2.1"
    assert network_of("::ffff:192.0.2.1") != network_of("::ffff:192.0.2.2")
    assert network_of("testclient") == "testclient"


async def _echo(scope, receive, send):
    """Answer with the body."""
    body = (await receive())["body"]
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": body})


def asked(messages, *, headers=(), rate=1e9, hosts=None):
    """Status, headers and body of a request that comes in parts; None is a part that never comes."""
    sent = []

    async def receive():
        if messages[0] is None:
            await asyncio.sleep(60.0)
        return {"type": "http.request", "body": messages.pop(0), "more_body": bool(messages)}

    async def send(message):
        sent.append(message)

    app = Guard(_echo, limit=RateLimit(rate, 1.0, lambda: 0.0), hosts=hosts, is_secure=False)
    scope = {"type": "http", "headers": list(headers), "client": ("127.0.0.1", 1)}
    asyncio.run(app(scope, receive, send))
    return sent[0]["status"], dict(sent[0]["headers"]), sent[1]["body"]


def test_a_request_in_parts_passes_with_headers() -> None:
    status, headers, body = asked([b"one ", b"two"])
    assert (status, body) == (200, b"one two")
    assert headers[b"content-security-policy"] == policy().encode()
    assert "script-src 'self';" in policy()
    assert "unsafe-eval" not in policy()


@pytest.mark.parametrize(
    ("messages", "headers", "status"),
    [
        ([b""], [(b"content-length", str(LIMITS.max_body + 1).encode())], 413),
        ([b""], [(b"content-length", b"-1")], 413),
        ([b"x" * LIMITS.max_body, b"x"], [], 413),
        ([b"x", None], [], 408),
    ],
)
def test_large_and_slow_bodies_are_refused(monkeypatch, messages, headers, status) -> None:
    monkeypatch.setattr(guard, "LIMITS", replace(LIMITS, body_timeout=0.05))
    found, own, _ = asked(messages, headers=headers)
    assert found == status
    assert b"content-security-policy" in own


@pytest.fixture
def opened(store):
    one = Server(Context(store, Site(http="127.0.0.1:0"), figures=dict, problems=list))
    one.open()
    yield one
    one.close()


@pytest.fixture
def running(opened):
    return opened.address


@pytest.mark.parametrize("n_before", [0, 1])
def test_a_request_that_does_not_end_is_cut_off(running, monkeypatch, n_before) -> None:
    monkeypatch.setattr(app, "LIMITS", replace(LIMITS, head_timeout=0.05))
    with socket.create_connection(running, timeout=20.0) as slow:
        received = b""
        if n_before:
            slow.sendall(b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            while not received.endswith(b'"problems":[]}'):
                received += slow.recv(4096)
        slow.sendall(b"GET / HT")
        assert slow.recv(100) == b""


def test_a_client_that_takes_nothing_is_cut_off(opened, running, monkeypatch) -> None:
    """The rest of what it asked for is discarded: it does not stay in memory until the client comes back."""
    complete = http.client.HTTPConnection(running[0], running[1], timeout=20.0)
    complete.request("GET", "/static/plotly.js")
    n_complete = len(complete.getresponse().read())
    complete.close()
    monkeypatch.setattr(app, "LIMITS", replace(LIMITS, write_timeout=0.05))
    opened._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 16)  # of the system, for each connection
    with socket.create_connection(running, timeout=20.0) as slow:
        slow.sendall(b"GET /static/plotly.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        time.sleep(1.0)
        n_taken = 0
        with suppress(ConnectionResetError):
            while part := slow.recv(1 << 16):
                n_taken += len(part)
    assert n_complete > 4 * 10**6
    assert n_taken < 10**6


def test_a_large_head_is_refused(running) -> None:
    with socket.create_connection(running, timeout=20.0) as large:
        large.sendall(b"GET /health HTTP/1.1\r\nX-Long: " + b"x" * 40_000)
        assert large.recv(100).startswith(b"HTTP/1.1 400")


@pytest.mark.slow
def test_requests_of_one_connection_follow_each_other(running) -> None:
    connection = http.client.HTTPConnection(running[0], running[1], timeout=20.0)
    for _ in range(3):
        connection.request("GET", "/health")
        answer = connection.getresponse()
        assert (answer.status, answer.read()) == (200, b'{"healthy":true,"problems":[]}')
    connection.close()


def test_head_is_the_beginning_of_get(running, opened) -> None:
    """For pages, files, refusals, and for live events, which do not end by themselves."""
    connection = http.client.HTTPConnection(running[0], running[1], timeout=20.0)
    lengths = []
    for path, status in (("/", 200), ("/api/v1/vehicles", 200), ("/static/base.css", 200), ("/nothing", 404)):
        found = []
        for method in ("GET", "HEAD"):
            connection.request(method, path)
            answer = connection.getresponse()
            found.append((answer.status, answer.getheader("content-length"), answer.getheader("content-type")))
            lengths.append(len(answer.read()))
        assert found[0] == found[1]
        assert found[0][0] == status
    assert all(lengths[::2])
    assert not any(lengths[1::2])
    for _ in range(2):  # the connection is free again
        connection.request("HEAD", "/api/v1/events")
        answer = connection.getresponse()
        assert (answer.status, answer.getheader("content-type"), answer.read()) == (
            200,
            "text/event-stream; charset=utf-8",
            b"",
        )
    connection.close()
    connection = http.client.HTTPConnection(running[0], running[1], timeout=20.0)
    connection.request("HEAD", "/log-out")
    assert connection.getresponse().status == 405
    connection.close()
