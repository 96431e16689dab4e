"""A store that is full, and a box with a small spool: both say what was lost, and from when to when."""

from pathlib import Path

import pytest

from sprung.errors import DataError
from sprung.link import Address, Loss, Spool, message, topic
from sprung.online.box import Box, BoxSettings, blocks_of
from sprung.online.box.running import replay
from sprung.vehicles import vehicle_text
from sprung.vehicles.sensor_layout import quantities_of

WATCH = {"watch": {"identify_every_minutes": 0.0}}


class Wire:
    """The broker between a box and a station of a bench, without a network."""

    is_connected, is_rejected, problem = True, False, ""

    def __init__(self, bench, on_message):
        self._bench, self._on_message = bench, on_message

    def open(self, *, timeout=0.0):
        """Nothing to connect."""

    def close(self):
        """Nothing to disconnect."""

    def publish(self, name, payload, *, is_retained=False):
        self._bench.link.on_message(name, payload)
        return True

    def deliver(self):
        """Let the station work, and give the box what it published."""
        self._bench.work()
        published, self._bench.link.published = self._bench.link.published, []
        for name, payload in published:
            if name.endswith(("/ack", "/cmd")):
                self._on_message(name, payload)


class Clock:
    """A clock of the box, which goes on when it waits; meanwhile the station works."""

    def __init__(self, on_wait):
        self.now, self.on_wait = 0.0, on_wait

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.now += 1.0
        self.on_wait()


@pytest.fixture
def lossy(bench, car, drive, tmp_path: Path):
    """A station and a function that makes a box with a spool of a few kB at it."""
    station = bench(tmp_path / "monitor", **WATCH)
    run = drive(0).part(0, 60 * round(drive(0).sampling_rate))

    def made(on_wait=lambda: None):
        wires = []

        def connect(*_, on_message, **__):
            wires.append(Wire(station, on_message))
            return wires[-1]

        def wait():
            on_wait()
            wires[-1].deliver()

        clock = Clock(wait)
        return Box(
            BoxSettings("car-1", vehicle_text(car), patience=5.0),
            Spool(tmp_path / "spool", most_bytes=1 << 16, is_synced=False),
            Address.parse("mqtt://127.0.0.1:1"),
            quantities=lambda block: quantities_of(block, car.sensor),
            clock=clock,
            sleep=clock.sleep,
            connect=connect,
        )

    return station, made, run


def lost_alert(station, *, is_active=True):
    rows = station.store.alerts.find(vehicle="car-1", is_active=is_active)
    return next((row for row in rows if row.cause == "lost"), None)


@pytest.mark.slow
def test_a_full_store_and_a_small_spool_are_a_loss_that_both_sides_name(lossy) -> None:
    station, made, run = lossy
    station.station._breaker.set_shortage("the disk is full")
    box = made(on_wait=lambda: station.station._breaker.set_shortage(""))
    with pytest.raises(
        DataError, match=r"frames, 2026-11-21 00:00 to 00:00 UTC, were dropped .*; all others are ack"
    ) as said:
        replay(box, blocks_of(run, length=0.1), pace=None, patience=600.0)
    (loss,) = box.losses
    assert str(said.value).startswith(f"{loss.n_frames} frames, ")
    assert loss.begin == run.start
    assert box.n_waiting == 0
    cursor = station.store.inbox.cursor("car-1", 0)
    assert cursor.contiguous == 599
    assert 0 < cursor.lost <= loss.n_frames, "frames on the way when they were dropped have arrived"
    row = lost_alert(station)
    assert row.text.startswith(f"{cursor.lost} frames of car-1, 2026-11-21 00:00 to 00:00 UTC, are lost, as its box")
    assert row.evidence == {
        "frames": cursor.lost,
        "from": loss.begin,
        "to": loss.end,
        "boots": {"0": cursor.lost},
    }
    figures = station.station.figures()
    assert figures["sprung_frames_lost_total"] == cursor.lost
    assert figures['sprung_vehicle_frames_lost_total{vehicle="car-1"}'] == cursor.lost
    assert [entry.what for entry in station.store.alerts.history(row.number)] == ["raised"]
    box.close()
    station.now += 3600 * 10**9
    station.look()
    assert lost_alert(station) is None


def test_a_loss_is_named_after_a_restart_of_the_box(lossy, tmp_path: Path) -> None:
    station, made, run = lossy
    box = made()
    for block in blocks_of(run, length=0.1):
        box.take(block)
    (loss,) = box.losses
    box._spool.close()  # as when its process is killed
    again = made()
    assert again.losses == (loss,)
    again.open()
    assert again.drain(timeout=600.0)
    assert station.store.inbox.cursor("car-1", 0).lost == loss.n_frames
    assert lost_alert(station).evidence["frames"] == loss.n_frames
    again.step()
    again.close()
    assert made().losses == (), "the monitor knows"


def test_an_alert_that_a_crash_left_out_is_made_up_for(lossy, tmp_path: Path) -> None:
    """The loss is in the store, and neither alert nor acknowledgement: the box states it again."""
    station, _, _ = lossy
    station.store.inbox.declare_lost({("car-1", 3): 10}, now=0)
    state = message({"boots": [[3, 10, -1]], "lost": [list(Loss(3, 0, 9, 10, 10**18, 2 * 10**18))]})
    for _ in range(3):
        station.link.on_message(topic("car-1", "state"), state)
        station.work()
    row = lost_alert(station)
    assert row.evidence["frames"] == 10
    assert len(station.store.alerts.history(row.number)) == 1
    acks = [name for name, _ in station.link.published if name == topic("car-1", "ack")]
    assert len(acks) == 3


def test_losses_add_up_while_the_alert_is_active_and_begin_anew_afterwards(lossy) -> None:
    station, _, _ = lossy

    def lose(boot, last):
        state = message({"boots": [], "lost": [list(Loss(boot, 0, last, last + 1, 10**18, 10**18 + 1))]})
        station.link.on_message(topic("car-1", "state"), state)
        station.work()
        return lost_alert(station).evidence["frames"]

    assert [lose(1, 9), lose(1, 19), lose(2, 4)] == [10, 20, 25]
    station.now += 3600 * 10**9
    station.look()
    assert lost_alert(station) is None
    assert lose(2, 5) == 1
    assert "1 frame of car-1" in lost_alert(station).text
    assert "is lost, as its box had to drop it before it was stored here" in lost_alert(station).text
