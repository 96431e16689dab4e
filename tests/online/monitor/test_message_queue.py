"""Messages wait in bounded memory, and no vehicle keeps others from being heard."""

import pytest

from sprung.link import topic
from sprung.online.monitor.message_queue import INVALID, OTHERS, OVERHEAD, OVERLOAD, MessageQueue, Refusals


def size_of(name, payload):
    return len(name) + len(payload) + OVERHEAD


def filled(messages, vehicle, payload):
    """Number of messages of a vehicle that fit."""
    n_messages = 0
    while messages.put(topic(vehicle, "raw"), payload):
        n_messages += 1
    return n_messages


def test_vehicles_take_turns_and_keep_their_order() -> None:
    queue = MessageQueue()
    messages = [("a", b"1"), ("a", b"2"), ("a", b"3"), ("b", b"4"), ("c", b"5"), ("b", b"6")]
    for vehicle, payload in messages:
        assert queue.put(topic(vehicle, "raw"), payload)
    taken = []
    while (message := queue.take()) is not None:
        taken.append(message)
    assert [payload for _, payload in taken] == [b"1", b"4", b"5", b"2", b"6", b"3"]
    assert taken[0][0] == topic("a", "raw")
    assert (queue.n_bytes, queue.is_empty) == (0, True)


@pytest.mark.parametrize("n_hostile", [1, 3, 12])
def test_vehicles_that_flood_leave_room(n_hostile) -> None:
    """Each message is under a quarter of what is free: n floods take n / (n + 4)."""
    payload, most = bytes(10_000), 100_000_000
    messages = MessageQueue(most)
    for _ in range(60):  # each takes what the others left
        for number in range(n_hostile):
            for _ in range(100):
                messages.put(topic(f"car-{number}", "raw"), payload)
    assert messages.n_bytes / most == pytest.approx(n_hostile / (n_hostile + 4), abs=0.01)
    size = size_of(topic("honest", "raw"), payload)
    assert filled(messages, "honest", payload) * size / most == pytest.approx(0.8 / (n_hostile + 4), rel=0.03)


def test_small_messages_count_with_what_they_take_besides() -> None:
    name = topic("car-1", "raw")
    n_messages = filled(messages := MessageQueue(1_000_000), "car-1", b"")
    assert n_messages == 200_000 // size_of(name, b"")
    assert messages.n_bytes == n_messages * size_of(name, b"")


def test_messages_of_no_vehicle_share_one_queue() -> None:
    messages = MessageQueue(1_000_000)
    accepted = sum(messages.put(f"else/where/{number}", bytes(1000)) for number in range(1000))
    assert accepted <= 200
    assert messages.put(topic("car-1", "raw"), bytes(1000))


def test_refusals_are_counted_by_vehicle_and_reason_and_many_names_together() -> None:
    refusals = Refusals()
    for vehicle, reason in (("car-1", INVALID), ("car-1", OVERLOAD), ("car-1", INVALID), ("", INVALID)):
        refusals.add(vehicle, reason)
    assert refusals.counts == {("car-1", INVALID): 2, ("car-1", OVERLOAD): 1, (OTHERS, INVALID): 1}
    for number in range(1, 1500):
        refusals.add(f"car-{number}", INVALID)
    assert len({vehicle for vehicle, _ in refusals.counts}) == 1001
    assert refusals.counts[OTHERS, INVALID] == 500
    assert refusals.total == 4 + 1499
