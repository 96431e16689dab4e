"""Figures of alerts."""

import struct

import pytest

from sprung.online.monitor import MonitorSettings, VehicleMonitor
from sprung.online.monitor.jobs import analyse
from sprung.online.monitor.vehicle_report import alert_picture
from sprung.online.store import Progress, StoredFrame, open_store
from sprung.vehicles import vehicle_text
from sprung.vehicles.sensor_layout import quantities_of

pytestmark = pytest.mark.slow

NOW = 1_795_219_200_000_000_000


@pytest.fixture
def store(sqlite_url, car, drive, frames_of):
    """A store with a vehicle after two windows that taught and one with a soft spring."""
    runs = [drive(0), drive(1), drive(2, "front_left.spring=-0.3")]
    quantities = quantities_of(runs[0], car.sensor)
    monitor = VehicleMonitor(car, settings=MonitorSettings(learning_windows=2, identify_every=0))
    with open_store(sqlite_url) as opened:
        channels = [list(pair) for pair in quantities.items()]
        text = vehicle_text(car)
        opened.inbox.put_vehicle("car-1", configuration="c", description=text, channels=channels, now=NOW)
        opened.inbox.add_frames([StoredFrame("car-1", 1, 0, NOW, b"x")], now=NOW)
        for run in runs:
            outcome = analyse("car-1", (monitor, quantities), frames_of(run))
            opened.results.commit(Progress("car-1", 1, done_seq=0, snapshot=outcome.state))
        yield opened


def test_an_alert_of_the_suspension_has_a_picture_of_the_corners(store) -> None:
    picture = alert_picture(store, "car-1", "front_left.spring")
    assert picture.startswith(b"\x89PNG\r\n")
    width, height = struct.unpack(">II", picture[16:24])
    assert 600 < width < 1200
    assert 200 < height < 1000


@pytest.mark.parametrize(
    ("vehicle", "cause"), [("car-1", "sensor:acc_fl"), ("car-1", "silent"), ("car-2", "front_left.spring")]
)
def test_other_alerts_have_none(tmp_path, vehicle, cause) -> None:
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        assert alert_picture(opened, vehicle, cause) == b""


def test_a_picture_that_cannot_be_drawn_keeps_no_alert_back(tmp_path, caplog) -> None:
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        opened.inbox.put_vehicle("car-1", configuration="c", description="broken", channels=[], now=NOW)
        opened.inbox.add_frames([StoredFrame("car-1", 1, 0, NOW, b"x")], now=NOW)
        opened.results.commit(Progress("car-1", 1, done_seq=0, snapshot=b"broken"))
        assert alert_picture(opened, "car-1", "front_left.spring") == b""
    assert "an alert is sent without a picture" in caplog.text
