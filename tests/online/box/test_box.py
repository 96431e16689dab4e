"""The box against a monitor's side played by hand."""

import time
from pathlib import Path

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.link import Address, Link, Spool, checked_map, decode, message, topic
from sprung.online.box import Box, BoxSettings, blocks_of
from sprung.online.box.onboard import Answers, OnBoard
from sprung.recording import Channel, Recording
from sprung.vehicles import read_vehicle, vehicle_text


@pytest.fixture(scope="module")
def broker(mosquitto):
    return Address.parse(mosquitto().address)


class Monitor:
    """Takes what a vehicle sends, and acknowledges on request."""

    def __init__(self, address):
        self.heard: list[tuple[str, bytes]] = []
        self.link = Link(
            address,
            "monitor",
            topics=["sprung/v1/+/+"],
            on_message=lambda name, payload: self.heard.append((name, payload)),
        )
        self.link.open(timeout=10.0)

    def of(self, what):
        return [payload for name, payload in list(self.heard) if name.endswith("/" + what)]

    def forget(self):
        """Wait until the box has left, and clear what it sent: its last state must not pass for one of the next."""
        end = time.monotonic() + 60.0
        while not any(checked_map(payload)["is_leaving"] for payload in self.of("state")):
            assert time.monotonic() < end, "the box does not leave"
            time.sleep(0.01)
        self.heard.clear()

    def acknowledge(self, boot, seq):
        self.link.publish(topic("car-1", "ack"), message({0: 1, 2: boot, 3: seq}))


def until(condition, box, *, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        box.step()
        time.sleep(0.01)


@pytest.fixture
def monitor(broker):
    one = Monitor(broker)
    yield one
    one.link.close()


def run(seconds=20.0, n_channels=2, rate=100.0, start=10**18):
    samples = np.random.default_rng(1).normal(size=(n_channels, round(seconds * rate)))
    return Recording(samples, rate, tuple(Channel(f"acc_{k}", "acceleration") for k in range(n_channels)), start)


def box_of(broker, folder, *, spool=None, **fields):
    car = read_vehicle("zafira")
    return Box(
        BoxSettings("car-1", vehicle_text(car), patience=1.0),
        spool or Spool(folder / "spool", is_synced=False),
        broker,
        quantities=lambda block: {channel.name: channel.quantity for channel in block.channels},
        **fields,
    )


def test_a_box_goes_on_where_it_stopped(broker, tmp_path: Path) -> None:
    box = box_of(broker, tmp_path)
    for block in list(blocks_of(run()))[:7]:
        box.take(block)
    box.close()
    again = box_of(broker, tmp_path)
    assert again.resume_time() == 10**18 + 7 * 10**9
    again.close()


def test_a_block_that_no_frame_can_hold_is_cut(broker, tmp_path: Path) -> None:
    spool = Spool(tmp_path / "spool", is_synced=False)
    box = box_of(broker, tmp_path, spool=spool)
    whole = run(seconds=10.0, n_channels=8, rate=20_000.0)
    box.take(whole)
    frames = [decode(payload) for _, _, payload in spool.frames()]
    assert len(frames) == 4
    assert sum(frame.n_samples for frame in frames) == whole.n_samples
    assert np.allclose(np.concatenate([frame.samples for frame in frames], axis=1), whole.samples, atol=1e-3)
    box.close()


def test_samples_stay_on_board_until_they_are_asked_for(broker, monitor, tmp_path: Path) -> None:
    ring = Spool(tmp_path / "ring", is_synced=False)
    box = box_of(broker, tmp_path, on_board=OnBoard(read_vehicle("zafira"), ring, window=60.0))
    box.open(timeout=10.0)
    for block in blocks_of(run(seconds=90.0)):
        box.take(block)
    until(lambda: monitor.of("modes"), box)
    assert monitor.of("raw") == []
    document = checked_map(monitor.of("modes")[-1])
    assert (document["number"], document[16], document[7]) == (0, "modes", 6000)
    wish = message({0: 1, "do": "raw", "from": 10**18 + 30 * 10**9, "to": 10**18 + 35 * 10**9})
    until(lambda: monitor.of("state"), box)
    monitor.link.publish(topic("car-1", "cmd"), wish)
    until(lambda: len(monitor.of("raw")) >= 5, box)
    frames = [decode(payload) for payload in monitor.of("raw")]
    assert sorted({(frame.start - 10**18) // 10**9 for frame in frames}) == [30, 31, 32, 33, 34]
    box.close()


def asked(monitor, box, *, seconds=(30, 35), number=7):
    """Ask for samples between two times, until the box answers, and return the answer."""
    n_before = len(monitor.of("event"))
    begin, end = (10**18 + second * 10**9 for second in seconds)
    wish = message({0: 1, "do": "raw", "number": number, "from": begin, "to": end})
    until(lambda: monitor.of("state"), box)  # only then has it subscribed
    monitor.link.publish(topic("car-1", "cmd"), wish)
    until(lambda: len(monitor.of("event")) > n_before, box)
    return checked_map(monitor.of("event")[-1])


def test_a_request_that_comes_again_is_answered_again_and_sends_nothing_twice(broker, monitor, tmp_path: Path) -> None:
    """Nor does it after a restart of the box; another wish for the same time does."""

    def begun():
        ring = Spool(tmp_path / "ring", is_synced=False)
        answers = Answers(tmp_path / "ring" / "answers.json")
        one = box_of(broker, tmp_path, on_board=OnBoard(read_vehicle("zafira"), ring, window=600.0, answers=answers))
        one.open(timeout=10.0)
        return one, ring

    box, ring = begun()
    for block in blocks_of(run(seconds=90.0)):
        box.take(block)
    first = asked(monitor, box)
    assert (first["did"], first["number"], first["boot"], first["last"]) == ("raw", 7, 0, 4)
    assert (first["frames"], first["reason"]) == (5, "")
    assert ((first["from"] - 10**18) / 1e9, (first["to"] - 10**18) / 1e9) == (30.0, 35.0)
    assert asked(monitor, box) == first
    assert box.n_waiting == 5
    box.close()
    ring.close()
    monitor.forget()
    box, ring = begun()
    assert asked(monitor, box) == first
    assert box.n_waiting == 5
    assert asked(monitor, box, number=8)["frames"] == 5
    assert box.n_waiting == 10
    nothing = asked(monitor, box, number=9, seconds=(1000, 2000))
    assert nothing["frames"] == 0
    assert "the box holds no samples of that time" in nothing["reason"]
    box.close()
    ring.close()


def test_a_monitor_of_another_version_is_a_problem_that_is_said(broker, monitor, tmp_path: Path) -> None:
    box = box_of(broker, tmp_path)
    box.open(timeout=10.0)
    wish = message({0: 2, "do": "speak", "versions": [2, 3]})

    def is_said():
        monitor.link.publish(topic("car-1", "cmd"), wish)  # the box may not yet have subscribed
        return "version [2, 3]" in box.problem

    until(is_said, box)
    assert "version [2, 3]" in box.problem
    box.close()


class Merging:
    """A box without a broker that joins blocks into frames of ten seconds; its clock is played."""

    def __init__(self, folder: Path) -> None:
        self.now = 0.0
        self.spool = Spool(folder / "spool", is_synced=False)
        self.box = Box(
            BoxSettings("car-1", "", frame_seconds=10.0),
            self.spool,
            Address("127.0.0.1", 1),
            quantities=lambda block: {channel.name: channel.quantity for channel in block.channels},
            clock=lambda: self.now,
        )

    def take(self, recording: Recording) -> None:
        for block in blocks_of(recording):
            self.box.take(block)

    def frames(self) -> list[tuple[float, float]]:
        """Return start and length of the frames in the spool [s], counted from that of `run`."""
        frames = [decode(payload) for _, _, payload in self.spool.frames()]
        return [((frame.start - 10**18) / 1e9, frame.n_samples * frame.interval / 1e9) for frame in frames]


def test_blocks_become_frames_up_to_full_tens_of_seconds(tmp_path: Path) -> None:
    """So that a box that continues after a stop sends the frames that it would have sent without one."""
    one = Merging(tmp_path)
    recording = run(25.0, start=10**18 + 3 * 10**9)
    one.take(recording)
    assert one.frames() == [(3.0, 7.0), (10.0, 10.0)]
    one.box.close()
    assert one.frames() == [(3.0, 7.0), (10.0, 10.0), (20.0, 8.0)]
    samples = np.concatenate([decode(payload).samples for _, _, payload in one.spool.frames()], axis=1)
    assert np.allclose(samples, recording.samples, atol=1e-3)


def test_a_gap_or_other_channels_end_a_frame(tmp_path: Path) -> None:
    one = Merging(tmp_path)
    one.take(run(3.0))
    one.take(run(2.0, start=10**18 + 4 * 10**9))
    one.take(run(1.0, n_channels=3, start=10**18 + 6 * 10**9))
    assert one.frames() == [(0.0, 3.0), (4.0, 2.0)]
    assert not one.box.drain(timeout=0.0)
    assert one.frames() == [(0.0, 3.0), (4.0, 2.0), (6.0, 1.0)]


def test_a_source_that_stalls_keeps_no_samples_in_memory(tmp_path: Path) -> None:
    one = Merging(tmp_path)
    one.take(run(3.0))
    one.now = 19.0
    one.box.step()
    assert one.frames() == []
    one.now = 20.0
    one.box.step()
    assert one.frames() == [(0.0, 3.0)]


@pytest.mark.parametrize("name", ["monitor", "monitor-2", "viewer", "viewer-17"])
def test_names_of_users_of_the_broker_are_no_vehicles(name) -> None:
    with pytest.raises(ParameterError, match=rf"vehicle '{name}' has the name of a user of the broker"):
        BoxSettings(name, "")
    assert BoxSettings(f"{name}-bus", "").vehicle == f"{name}-bus"
