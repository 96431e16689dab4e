"""Sensors that publish on topics, by way of a private broker."""

import json
import socket
import threading
import time

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.link import Address, Link, LinkError
from sprung.online.box import from_mqtt
from sprung.recording import Recording

TODAY = 1_700_000_000


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.fixture(scope="module")
def broker(mosquitto):
    return Address.parse(mosquitto().address)


def until(condition, *, timeout=20.0):
    """Wait for a condition."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def received(broker, messages, *, names, rate=100.0, **options):
    """Return blocks and problems from messages that are published once the source listens."""
    is_over, said, blocks = threading.Event(), list[str](), list[Recording]()
    sender = Link(broker, "sender", topics=[], on_message=lambda *_: None)
    sender.open(timeout=5)
    source = from_mqtt(
        broker,
        ["sensors/#"],
        names=names,
        sampling_rate=rate,
        is_done=is_over.is_set,
        on_problem=said.append,
        **options,
    )
    reader = threading.Thread(target=lambda: blocks.extend(source))
    reader.start()
    # The subscription is in place when a message that nobody can use has been reported.
    until(lambda: said or not sender.publish("sensors/hello", b"hello"))
    for topic, payload in messages:
        sender.publish(topic, payload if isinstance(payload, bytes) else json.dumps(payload).encode())
    sender.publish("sensors/end", b"end")
    until(lambda: "sensors/end" in said[-1])
    is_over.set()
    reader.join(timeout=5)
    sender.close()
    assert not reader.is_alive()
    assert "has a message that is not JSON: 'hello'" in said[0]
    return blocks, said[1:-1]


def joined(blocks):
    return np.concatenate([block.samples for block in blocks], axis=1)


def test_objects_with_time_and_numbers(broker) -> None:
    """A fast sensor and a slow one, with times of their own: the values they sent."""
    k = np.arange(300)
    messages = [
        ("sensors/body", {"time": TODAY + n / 100, "acc_fl": 0.1 * n, "acc_fr": -n, "other": 5}) for n in range(300)
    ]
    for n in reversed(range(0, 300, 10)):
        messages.insert(n, ("sensors/can", {"time": TODAY + n / 100, "speed": n / 10}))
    blocks, said = received(broker, messages, names=["acc_fl", "speed", "acc_fr"])
    assert said == []
    assert blocks[0].names == ("acc_fl", "speed", "acc_fr")
    assert blocks[0].start == TODAY * 10**9
    found = joined(blocks)
    assert found.shape == (3, 300)
    assert np.allclose(found[[0, 2]], [0.1 * k, -k], atol=1e-3)
    assert np.allclose(found[1, :291], k[:291] / 10, atol=1e-3)
    assert np.isnan(found[1, 291:]).all()


def test_one_number_per_topic_has_the_time_at_which_it_came(broker) -> None:
    ticks = iter(range(10**6))
    messages = [(f"sensors/bus/{name}", value * n) for n in range(150) for name, value in (("a", 1), ("b", -1.0))]
    blocks, said = received(broker, messages, names=["a", "b"], clock=lambda: TODAY * 10**9 + next(ticks) * 5_000_000)
    assert said == []
    found = joined(blocks)
    assert np.abs(found[0] + found[1])[5:-2].max() < 0.51  # half a step apart
    assert np.allclose(np.diff(found[0, 5:-2]), 1, atol=1e-6)


def test_messages_that_cannot_be_used_are_reported_once_and_ignored(broker) -> None:
    good = [("sensors/body", {"time": TODAY + n / 100, "a": n}) for n in range(200)]
    bad = [
        ("sensors/1", b"\xff\xfe"),
        ("sensors/2", b"[" * 60_000),
        ("sensors/3", b"{" + b" " * 70_000 + b"}"),
        ("sensors/4", [1, 2]),
        ("sensors/5", True),
        ("sensors/6", {"time": "noon", "a": 1}),
        ("sensors/7", {"time": 1.7e12, "a": 1}),
        ("sensors/8", {"time": TODAY + 0.5, "a": "1"}),
        ("sensors/9", {"time": TODAY + 0.5, "b": 1}),
        ("sensors/c", 5),
    ]
    blocks, said = received(broker, [*good[:50], *bad, *bad, *good[50:]], names=["a"])
    assert np.allclose(joined(blocks)[0], np.arange(200), atol=1e-3)
    expected = [
        "topic 'sensors/1' has a message that is not JSON",
        "topic 'sensors/2' has a message that is not JSON",
        "topic 'sensors/3' has a message of 70002 bytes: send at most 65536",
        "topic 'sensors/4' has the message [1, 2]: send an object of numbers, or one number",
        "topic 'sensors/5' has the message True",
        "topic 'sensors/6': time is 'noon': send seconds since 1970, or leave it out",
        "topic 'sensors/7': time is 1700000000000.0: send seconds since 1970",
        "topic 'sensors/8': 'a' is '1': send a number, or null",
        "topic 'sensors/9' has none of the channels, but 'time', 'b': check the names",
        "topic 'sensors/c' has none of the channels, but 'c'",
    ]
    assert len(said) == len(expected)
    assert all(one.startswith(other) for one, other in zip(said, expected, strict=True))


def test_null_is_missing_and_a_clock_that_was_not_set_is_not_used(broker) -> None:
    messages = [("sensors/x", {"time": 12.5, "a": None if n == 120 else n}) for n in range(200)]
    ticks = iter(range(10**6))
    blocks, _ = received(broker, messages, names=["a"], clock=lambda: TODAY * 10**9 + next(ticks) * 10_000_000)
    found = joined(blocks)[0]
    begin = int(found[0])
    assert np.flatnonzero(np.isnan(found)).tolist() == [120 - begin]
    assert blocks[0].start >= TODAY * 10**9


@pytest.mark.parametrize(
    ("address", "topics", "names", "said"),
    [
        ("http://host", ["a"], ["a"], "is not the address of a broker"),
        ("mqtt://host", [], ["a"], "topics=.. must be a list of one or more topics"),
        ("mqtt://host", "a/b", ["a"], "topics='a/b' must be a list"),
        ("mqtt://host", ["a/#/b"], ["a"], "'a/#/b' is not a topic filter"),
        ("mqtt://host", ["a/b+"], ["a"], "'a/b.' is not a topic filter"),
        ("mqtt://host", [""], ["a"], "'' is not a topic filter"),
        ("mqtt://host", ["a"], [], "no channel is named"),
    ],
)
def test_settings_that_cannot_be(address, topics, names, said) -> None:
    with pytest.raises(ParameterError, match=said):
        from_mqtt(address, topics, names=names, sampling_rate=100.0)


def test_no_broker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sprung.online.box.mqtt_source._CONNECT", 0.5)
    source = from_mqtt(f"mqtt://127.0.0.1:{free_port()}", ["a"], names=["a"], sampling_rate=10.0)
    with pytest.raises(LinkError, match="cannot be reached"):
        next(source)
