"""The broker inside the monitor passes messages on, knows its user, and says where it cannot listen."""

import gc
import queue
import socket
import sys
from pathlib import Path

import pytest

from sprung.link import Address, Link, LinkError, SecretError, find_secret, keep_secret
from sprung.online.monitor.broker import EmbeddedBroker, open_broker

pytest.importorskip("amqtt")


@pytest.fixture
def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def test_a_message_passes_through(free_port) -> None:
    heard: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
    broker = EmbeddedBroker("secret", port=free_port)
    broker.open()
    link = Link(
        Address("127.0.0.1", free_port, "local", "secret", version="3"),
        "both",
        topics=["sprung/v1/+/raw"],
        on_message=lambda name, payload: heard.put((name, payload)),
    )
    link.open(timeout=10.0)
    try:
        for _ in range(100):  # the subscription may be a little late
            link.publish("sprung/v1/car-1/raw", b"payload")
            try:
                found = heard.get(timeout=0.1)
                break
            except queue.Empty:
                continue
        assert found == ("sprung/v1/car-1/raw", b"payload")
    finally:
        link.close()
        broker.close()


@pytest.mark.slow
def test_open_connections_are_closed_with_the_broker(free_port, monkeypatch) -> None:
    left_open = []
    monkeypatch.setattr(sys, "unraisablehook", lambda each: left_open.append(each.exc_value))
    broker = EmbeddedBroker("secret", port=free_port)
    broker.open()
    silent = socket.create_connection(("127.0.0.1", free_port))
    link = Link(
        Address("127.0.0.1", free_port, "local", "secret", version="3"), "c", topics=[], on_message=lambda *_: None
    )
    link.open(timeout=10.0)
    broker.close()
    silent.settimeout(10.0)
    assert silent.recv(1) == b""
    silent.close()
    link.close()
    del broker
    gc.collect()
    assert left_open == []


def test_a_port_in_use_is_refused() -> None:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        port = one.getsockname()[1]
        with pytest.raises(
            LinkError, match=rf"cannot listen at 127.0.0.1:{port} \(.*\): stop the program that listens"
        ):
            EmbeddedBroker("secret", port=port).open()


def is_accepted(address):
    """Whether a broker accepts a client."""
    link = Link(address, "client", topics=[], on_message=lambda name, payload: None)
    try:
        link.open(timeout=10.0)
    except LinkError:
        return False
    link.close()
    return True


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The folder of this user's state."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.mark.slow
def test_programs_of_this_user_find_the_password_and_no_others_get_in(state, free_port, monkeypatch) -> None:
    broker = f"embedded:{free_port}"
    plain = Address.parse(f"mqtt://127.0.0.1:{free_port}")
    with open_broker(broker) as address:
        (path,) = (state / "sprung").iterdir()
        assert path.stat().st_mode & 0o777 == 0o600
        assert path.parent.stat().st_mode & 0o777 == 0o700
        assert is_accepted(address)
        assert is_accepted(plain)
        assert is_accepted(Address.parse(f"mqtt://localhost:{free_port}"))
        monkeypatch.setenv("XDG_STATE_HOME", str(state / "of-another-user"))
        assert not is_accepted(plain)
        assert not is_accepted(Address("127.0.0.1", free_port, "local", "guess", version="3"))
        assert not is_accepted(Address("127.0.0.1", free_port, "monitor", address.password, version="3"))
        assert is_accepted(Address.parse(f"mqtt://local:{address.password}@127.0.0.1:{free_port}"))
    assert list(path.parent.iterdir()) == []


def test_a_password_that_a_killed_monitor_left_is_not_used(state, free_port) -> None:
    with keep_secret(free_port) as secret:
        assert find_secret("127.0.0.1", free_port) == secret
        assert find_secret("192.0.2.1", free_port) == find_secret("127.0.0.1", free_port + 1) == ""
    path = state / "sprung" / f"broker-{free_port}"
    path.write_text(secret, encoding="ascii")
    assert find_secret("127.0.0.1", free_port) == ""
    with keep_secret(free_port) as other:
        assert other != secret
        assert path.stat().st_mode & 0o777 == 0o600


def test_a_password_that_cannot_be_kept_is_said(state, free_port) -> None:
    state.write_text("no folder", encoding="ascii")
    with pytest.raises(SecretError, match=r"cannot be kept .*: set XDG_STATE_HOME"), keep_secret(free_port):
        pass
