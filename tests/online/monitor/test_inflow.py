"""Messages wait in bounded memory, and no vehicle keeps others from being heard."""

import pytest

from sprung.link import topic
from sprung.online.monitor.inflow import OVERHEAD, Inflow


def size_of(name, payload):
    return len(name) + len(payload) + OVERHEAD


def filled(inflow, vehicle, payload):
    """Number of messages of a vehicle that fit."""
    n_messages = 0
    while inflow.put(topic(vehicle, "raw"), payload):
        n_messages += 1
    return n_messages


def test_vehicles_take_turns_and_keep_their_order() -> None:
    inflow = Inflow()
    messages = [("a", b"1"), ("a", b"2"), ("a", b"3"), ("b", b"4"), ("c", b"5"), ("b", b"6")]
    for vehicle, payload in messages:
        assert inflow.put(topic(vehicle, "raw"), payload)
    taken = []
    while (message := inflow.take()) is not None:
        taken.append(message)
    assert [payload for _, payload in taken] == [b"1", b"4", b"5", b"2", b"6", b"3"]
    assert taken[0][0] == topic("a", "raw")
    assert (inflow.n_bytes, inflow.is_empty) == (0, True)


@pytest.mark.parametrize("n_hostile", [1, 3, 12])
def test_vehicles_that_flood_leave_room(n_hostile) -> None:
    """Each message is under a quarter of what is free: n floods take n / (n + 4)."""
    payload, most = bytes(10_000), 100_000_000
    inflow = Inflow(most)
    for _ in range(60):  # each takes what the others left
        for number in range(n_hostile):
            for _ in range(100):
                inflow.put(topic(f"car-{number}", "raw"), payload)
    assert inflow.n_bytes / most == pytest.approx(n_hostile / (n_hostile + 4), abs=0.01)
    size = size_of(topic("honest", "raw"), payload)
    assert filled(inflow, "honest", payload) * size / most == pytest.approx(0.8 / (n_hostile + 4), rel=0.03)


def test_small_messages_count_with_what_they_take_besides() -> None:
    name = topic("car-1", "raw")
    n_messages = filled(inflow := Inflow(1_000_000), "car-1", b"")
    assert n_messages == 200_000 // size_of(name, b"")
    assert inflow.n_bytes == n_messages * size_of(name, b"")


def test_messages_of_no_vehicle_share_one_queue() -> None:
    inflow = Inflow(1_000_000)
    accepted = sum(inflow.put(f"else/where/{number}", bytes(1000)) for number in range(1000))
    assert accepted <= 200
    assert inflow.put(topic("car-1", "raw"), bytes(1000))
