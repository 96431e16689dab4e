"""Full and read-only disks, clocks that step, senders that fail: it goes on, says so, and loses nothing."""

import zlib

import numpy as np
import pytest

from sprung.link import checked_map, decode, frame_block, joined, message, topic
from sprung.vehicles import vehicle_text

BEGUN = 1_795_219_200_000_000_000
WATCH = {"watch": {"learning_windows": 2, "window_minutes": 2, "identify_every_minutes": 0}, "keep": {"raw_days": 0}}


def stepped(payloads, shifts):
    """Frames whose clock is off from some frame on: {number: ns}."""
    found, shift = [], 0
    for number, payload in enumerate(payloads):
        shift = shifts.get(number, shift)
        document = checked_map(payload)
        found.append(message(document | {4: document[4] + shift}))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("shift", [3600 * 10**9, -3600 * 10**9, -BEGUN, 2_145_916_800_000_000_000 - BEGUN])
def test_a_clock_that_steps_is_one_gap(bench, drive, frames_of, car, shift) -> None:
    """An hour, 1970, 2038: windows hold the same samples, and only the stretch ends there."""
    frames = frames_of(drive(0))
    one = bench(**WATCH)
    one.describe()
    one.send(stepped(frames, {150: shift}))
    found = one.store.results.observations("car-1")
    assert len(found) == 5
    assert all(not entry.document["reason"] for entry in found)
    blocks = [frame_block(decode(payload), {}) for payload in stepped(frames[120:240], {30: shift})]
    assert [gap.index for gap in joined(blocks).gaps] == [6000]


def test_a_drifting_clock_makes_no_gap(drive, frames_of) -> None:
    """100 ppm: a sample in 50 s."""
    frames = [checked_map(payload) for payload in frames_of(drive(0))]
    drifting = [message(one | {4: one[4] + (one[4] - BEGUN) // 10_000}) for one in frames]
    assert joined([frame_block(decode(payload), {}) for payload in drifting]).gaps == ()


def test_little_room_is_an_alert_and_stops_taking_in(bench, drive, frames_of, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bench(**WATCH)
    one.describe()
    one.work()
    monkeypatch.setattr(one.store, "free", lambda: 5_000_000)
    one.look(60.0)
    (row,) = one.store.alerts.find(vehicle="monitor")
    assert (row.cause, row.is_active) == ("monitor:disk", True)
    one.link.on_message(topic("car-1", "raw"), frames_of(drive(0))[0])
    one.station.step()
    assert one.station.figures()["sprung_frames_total"] == 0
    monkeypatch.setattr(one.store, "free", lambda: 5_000_000_000)
    one.look(60.0)
    assert not one.store.alerts.find(vehicle="monitor")[0].is_active
    one.work()
    assert one.station.figures()["sprung_frames_total"] == 1


def test_samples_make_room_though_the_store_can_no_longer_delete(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    from sprung.link.archive import write_archive
    from sprung.online.store import StoreError

    one = bench(watch=WATCH["watch"], keep={"raw_days": 1})

    def refuse(*_, **__):
        raise StoreError("the store cannot write: the disk is full: free space")

    monkeypatch.setattr(one.store, "delete_older", refuse)
    for folder in ("raw", "correlations"):
        one.now = BEGUN
        where = one.store.folder / folder
        old, new = (
            write_archive(where, "car-1", 1, k, BEGUN + k, samples=[[1.0]], channels=["a"], sampling_rate=1.0)
            for k in range(2)
        )
        one.now = BEGUN + 86400 * 10**9 + 1
        one.look(60.0)
        assert one.station.problems() == ["the store cannot write: the disk is full: free space"]
        assert (old.exists(), new.exists()) == (False, True)


def claiming(generator, original):
    """A frame that claims much, with data of that size packed to almost nothing."""
    n_channels, n_samples = (int(2 ** generator.uniform(0, most)) for most in (8.1, 24))
    size = min(n_channels * n_samples * int(generator.integers(2, 5)), 1 << 24)
    each = {8: [f"c{k}" for k in range(n_channels)], 9: [1.0] * n_channels, 10: [0] * n_channels}
    return message(original | each | {7: n_samples, 11: zlib.compress(bytes(size))})


@pytest.mark.slow
def test_claims_of_frames_bound_memory_and_work(bench, drive, frames_of, memory_below) -> None:
    """Whatever they claim: no more samples than the largest frame holds unpacked, and 20 times its bytes to read it."""
    one = bench(**WATCH)
    original = checked_map(frames_of(drive(0))[0])
    generator = np.random.default_rng(2)
    for seq in range(1, 201):
        one.link.on_message(topic("car-1", "raw"), claiming(generator, original | {3: seq}))
    with memory_below(20 << 20, kept=8 << 20):
        one.work()
    figures = one.station.figures()
    assert figures["sprung_messages_refused_total"] > 50
    assert figures["sprung_frames_total"] > 50


@pytest.mark.parametrize("modes", [b"y", [{"damping_ratio": float("nan")}], {b"x": 1}])
def test_modes_that_the_store_cannot_hold_keep_nobody_waiting(bench, drive, frames_of, modes) -> None:
    one = bench(**WATCH)
    for vehicle in ("car-1", "car-2"):
        one.describe(vehicle)
    report = {0: 1, 1: "car-2", 2: 1, 3: 0, 4: BEGUN, 16: "modes", "number": 0, "modes": modes}
    one.link.on_message(topic("car-2", "modes"), message(report))
    one.send(frames_of(drive(0))[:3])
    assert one.station.problems() == []
    assert one.store.inbox.cursor("car-2", 1).done == 0
    assert one.store.results.modes("car-2") == []
    assert one.store.inbox.cursor("car-1", 1).contiguous == 2


@pytest.mark.parametrize(
    "change",
    [
        {"description": ".".join(["a"] * 50_000) + " = 1"},
        {"description": "# nothing\n" * 20_000},
        {14: "x" * 300},
        {14: "a\0b"},
        {"quantities": {"acc\0": "acceleration"}},
        {"quantities": {f"c{k}": "acceleration" for k in range(300)}},
    ],
    ids=["dotted", "long", "long name", "null", "null in a channel", "channels"],
)
def test_descriptions_that_are_too_much_work_are_refused(bench, change) -> None:
    one = bench(**WATCH)
    document = {0: 1, 14: "c", "description": vehicle_text(one.car), "quantities": one.quantities}
    one.link.on_message(topic("car-1", "meta"), message(document | change))
    one.work()
    assert one.station.figures()["sprung_messages_refused_total"] == 1
    assert one.store.inbox.vehicle("car-1") is None
    one.describe()
    one.work()
    assert one.store.inbox.vehicle("car-1") is not None
