"""The broker inside the monitor passes messages on, and says where it cannot listen."""

import queue
import socket

import pytest

from sprung.link import Address, Link, LinkError
from sprung.monitor.broker import EmbeddedBroker

pytest.importorskip("amqtt")


@pytest.fixture
def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def test_a_message_passes_through(free_port) -> None:
    heard: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
    broker = EmbeddedBroker(port=free_port)
    broker.open()
    link = Link(
        Address("127.0.0.1", free_port),
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


def test_a_port_in_use_is_refused() -> None:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        port = one.getsockname()[1]
        with pytest.raises(LinkError, match=rf"cannot listen at 127.0.0.1:{port}: .*: stop the program that listens"):
            EmbeddedBroker(port=port).open()
