"""When a box announces its vehicle: at each connection, and until the monitor has it; the link is played."""

import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sprung.link import Address, Spool, checked_map, message, topic
from sprung.link.spool import Disk
from sprung.online.box import Box, BoxSettings
from sprung.recording import Channel, Recording
from sprung.vehicles import read_vehicle, vehicle_text

TEXT = vehicle_text(read_vehicle("zafira"))
PATIENCE = 10.0


class PlayedLink:
    """A link whose connection and messages the test decides."""

    is_connected, is_rejected, problem = False, False, ""

    def __init__(self, _address, _name, *, on_message, on_connected, **_given):
        self.on_message, self.on_connected = on_message, on_connected
        self.published = []

    def open(self, *, timeout=0.0):
        self.connect()

    def connect(self):
        self.is_connected = True
        self.on_connected()

    def close(self):
        self.is_connected = False

    def publish(self, name, payload, *, is_retained=False):
        self.published.append((name, payload, is_retained))
        return True

    @property
    def announced(self):
        return [payload for name, payload, is_retained in self.published if name.endswith("/meta") and is_retained]

    def confirm(self, payload):
        answer = {0: 1, "do": "described", "checksum": zlib.crc32(payload[:-4])}
        self.on_message(topic("car-1", "cmd"), message(answer))


class Car:
    """A box on a vehicle that is switched off and on; the time is set."""

    def __init__(self, folder: Path, disk: Disk | None = None) -> None:
        self.folder, self.disk, self.now = folder, disk, 0.0
        self.start()

    def start(self):
        self.spool = Spool(self.folder, is_synced=False, disk=self.disk)
        self.box = Box(
            BoxSettings("car-1", TEXT, patience=PATIENCE),
            self.spool,
            Address("broker", 1883),
            quantities=lambda block: {channel.name: channel.quantity for channel in block.channels},
            clock=lambda: self.now,
            connect=self.linked,
        )
        self.box.open()
        self.box.step()

    def linked(self, *given: Any, **named: Any) -> Any:
        self.link = PlayedLink(*given, **named)
        return self.link

    def restart(self):
        self.box.close()
        self.start()

    def step(self, seconds=0.0):
        self.now += seconds
        self.box.step()
        return self.link.announced

    def drive(self, *names):
        channels = tuple(Channel(name, "acceleration") for name in names)
        self.box.take(Recording(np.zeros((len(names), 100)), 100.0, channels, 10**18))


@pytest.fixture
def car(tmp_path: Path):
    one = Car(tmp_path)
    yield one
    one.box.close()


def test_a_box_that_starts_without_samples_announces_what_it_did_before(car) -> None:
    assert car.link.announced == []
    car.drive("acc_fl", "acc_fr")
    (first,) = car.step()
    assert checked_map(first)["quantities"] == {"acc_fl": "acceleration", "acc_fr": "acceleration"}
    car.restart()
    assert car.step() == [first]
    car.drive("acc_fl", "acc_fr")
    assert car.step() == [first], "nothing new"
    car.drive("acc_fl")
    assert car.step() == [first], "the channels of the first samples count"


def test_an_announcement_is_repeated_until_the_monitor_has_it(car) -> None:
    car.drive("acc_fl")
    (first,) = car.step()
    assert car.step(PATIENCE - 0.1) == [first]
    assert car.step(0.1) == [first, first]
    car.link.confirm(message({0: 1}))  # of something else
    assert len(car.step(PATIENCE)) == 3
    car.link.confirm(first)
    assert len(car.step(100 * PATIENCE)) == 3
    car.link.connect()  # the broker may have lost what it retained
    assert len(car.step()) == 4
    assert len(car.step(PATIENCE)) == 5
    car.link.confirm(first)
    assert len(car.step(PATIENCE)) == 5


@pytest.mark.parametrize("damaged", [b"", b"\xff", b"[1]", b'{"acc_fl": 1}', b"{"])
def test_a_damaged_memory_counts_as_none(tmp_path: Path, damaged) -> None:
    tmp_path.joinpath("remembered").write_bytes(damaged)
    car = Car(tmp_path)
    assert car.link.announced == []
    car.drive("acc_fl")
    assert len(car.step()) == 1
    car.box.close()
