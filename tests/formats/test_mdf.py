"""MDF files: written here by asammdf, and those of real loggers next to what they hold."""

from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal
from tests.formats.conftest import joined, table_of

from sprung.errors import FormatError
from sprung.formats import ReadSettings, groups, read

VERSIONS = ("3.30", "4.10", "4.20")
START = datetime(2026, 3, 4, 5, 6, 7, 891011, tzinfo=UTC)
NANOSECONDS = 1_772_600_767_891_011_000


def signals(rate, count, *names, **options):
    stamps = 2.5 + np.arange(count) / rate
    return [Signal(np.sin(stamps * (index + 3)), stamps, name=name, **options) for index, name in enumerate(names)]


def written(path: Path, version: str) -> Path:
    """Write a file with groups of 200 Hz and 25 Hz, units, comments, conversions and a start."""
    file = MDF(version=version)
    acc = signals(200, 1000, "acc_fl", "acc_fr", unit="g", comment="front axle")
    raw = np.arange(1000, dtype=np.int16) % 500
    state = {"val_0": 0, "val_1": 1, "text_0": b"off", "text_1": b"on", "default": b"?"}
    acc.append(Signal(raw, acc[0].timestamps, name="force", unit="N", conversion={"a": 0.5, "b": -20.0}))
    acc.append(Signal(raw % 2, acc[0].timestamps, name="state", conversion=state))
    file.append(acc, comment="body", common_timebase=True)
    file.append(signals(25, 125, "speed", unit="km/h"), comment="bus", common_timebase=True)
    file.start_time = START
    file.header.author = "M. Ring"
    return Path(file.save(path, overwrite=True)).rename(path)


@pytest.fixture(params=VERSIONS)
def path(tmp_path: Path, request) -> Path:
    return written(tmp_path / "run.mf4", request.param)


def start_of(path) -> int:
    return read(path, settings=ReadSettings(groups=[groups(path)[0].name])).start or 0


def test_groups_are_listed_with_channels_and_rows(path):
    body, bus = groups(path)
    assert (body.name, body.headings, body.n_rows) == ("body", ("acc_fl", "acc_fr", "force", "state"), 1000)
    assert (bus.name, bus.headings, bus.n_rows) == ("bus", ("speed",), 125)
    assert body.clock != bus.clock


def test_units_comments_conversions_and_start_are_carried(path):
    recording = read(path, settings=ReadSettings(groups=["body"]))
    stamps = 2.5 + np.arange(1000) / 200
    np.testing.assert_allclose(recording.samples[0], 9.80665 * np.sin(3 * stamps), rtol=1e-12)
    np.testing.assert_array_equal(recording.samples[2], 0.5 * (np.arange(1000) % 500) - 20)
    np.testing.assert_array_equal(recording.samples[3], np.arange(1000) % 2)
    assert [channel.quantity for channel in recording.channels] == ["acceleration", "acceleration", "force", "unknown"]
    assert recording.channels[0].comment == "front axle"
    assert recording.channels[2].calibration == "0.5 * raw - 20"
    assert recording.sampling_rate == pytest.approx(200, rel=1e-9)
    assert abs(start_of(path) - (NANOSECONDS + 2_500_000_000)) < 1000
    assert "<" not in recording.comment


def test_stamps_of_all_groups_count_from_the_start_of_the_file(path):
    body, bus = (joined(table_of(path, name)).stamps for name in ("body", "bus"))
    assert [body[0], bus[0], bus[1]] == pytest.approx([2.5, 2.5, 2.54], rel=1e-12)
    assert table_of(path, "body").start == table_of(path, "bus").start


def test_the_comment_says_what_was_measured_by_whom(tmp_path):
    file = MDF(version="4.10")
    file.append(signals(100, 50, "a"))
    file.header.description = "Belgian paving,\n tyres < 2 bar"
    file.header.author, file.header.project = "M. Ring", "ride"
    recording = read(file.save(tmp_path / "run.mf4"))
    assert recording.comment == "Belgian paving, tyres < 2 bar; author: M. Ring; project: ride"


def test_local_time_and_time_zones(tmp_path):
    east = timezone(timedelta(hours=2))
    for name, start, shift, note in (
        ("local", START.replace(tzinfo=None), 0, "start in local time of an unknown zone"),
        ("east", START.replace(tzinfo=east), -2 * 3600 * 10**9, ""),
    ):
        file = MDF(version="4.10")
        file.append(signals(100, 50, "a"))
        file.start_time = start
        path = file.save(tmp_path / f"{name}.mf4")
        assert abs(start_of(path) - NANOSECONDS - 2_500_000_000 - shift) < 1000
        assert read(path).comment == note


def test_version_3_in_local_time_as_the_format_has_it(tmp_path):
    """Programs write UTC or local time into one field; the text of date and time next to it tells them apart."""
    file = MDF(version="3.30")
    file.append(signals(100, 50, "a"))
    file.start_time = START.astimezone(timezone(timedelta(hours=5)))
    path = Path(file.save(tmp_path / "utc.mdf"))
    assert abs(start_of(path) - NANOSECONDS - 2_500_000_000) < 1000
    content = bytearray(path.read_bytes())
    place = content.index(int(START.timestamp() * 10**9).to_bytes(8, "little"))
    content[place : place + 8] = (int(START.timestamp() * 10**9) + 5 * 3600 * 10**9).to_bytes(8, "little")
    path.write_bytes(content)
    assert abs(start_of(path) - NANOSECONDS - 2_500_000_000) < 1000


def test_names_of_one_kind_are_made_distinct(tmp_path):
    file = MDF(version="4.10")
    file.append(signals(100, 50, "a", "a", "a\n b"), comment="same")
    file.append(signals(100, 50, "a"), comment="same")
    first, second = groups(file.save(tmp_path / "run.mf4"))
    assert (first.name, first.headings) == ("same", ("a", "a (2)", "a b"))
    assert second.name == "same (2)"


def test_invalid_values_are_missing(tmp_path):
    (signal,) = signals(100, 50, "a")
    signal.invalidation_bits = np.arange(50) % 10 == 3
    file = MDF(version="4.10")
    file.append([signal, *signals(100, 50, "b")], common_timebase=True)
    recording = read(file.save(tmp_path / "run.mf4"))
    assert recording.n_samples == 45
    assert len(recording.gaps) == 5


def test_texts_are_no_channels(tmp_path):
    file = MDF(version="4.10")
    words = np.array([b"one", b"two"] * 25)
    file.append([*signals(100, 50, "a"), Signal(words, np.arange(50) / 100, name="word", encoding="utf-8")])
    file.append([Signal(words, np.arange(50) / 100, name="word", encoding="utf-8")])
    (group,) = groups(file.save(tmp_path / "run.mf4"))
    assert group.headings == ("a",)


@pytest.mark.parametrize("name", ["00000165_00000001-60FEB68B", "00000165_00000002-60FEB8E3"])
def test_raw_frames_decode_to_the_published_values(real_file, name):
    path = real_file(f"canedge_car_body_imu/{name}.MF4")
    database = real_file("canedge_car_body_imu/canmod-gps.dbc")
    expected = pq.read_table(real_file(f"canedge_car_body_imu/{name}_decoded.parquet")).to_pydict()
    imu = table_of(path, "gnss_imu", databases=[database])
    block = joined(imu)
    np.testing.assert_allclose(block.stamps, expected["t_s"], atol=1e-9)
    for column, values in zip(imu.columns[1:], block.values[1:], strict=True):
        np.testing.assert_allclose(values, expected[column.name], rtol=1e-6)
    assert [column.quantity for column in imu.columns[1:]] == ["acceleration"] * 3 + ["angular_velocity"] * 3
    speed = joined(table_of(path, "gnss_speed", ["Speed"], databases=[database]))
    np.testing.assert_allclose(np.interp(block.stamps, speed.stamps, speed.values[0]), expected["Speed"], atol=2e-6)
    assert imu.start == 1_627_305_218 * 10**9


@pytest.mark.parametrize(("name", "frames"), [("3BA199E2_00000005_canmod_gps", 4518), ("2F6913DB_00000001", 4724)])
def test_other_loggers(real_file, name, frames):
    path = real_file(f"formats/mf4/{name}.MF4")
    with pytest.raises(FormatError, match=r"holds raw CAN frames: give the database .* with --dbc FILE"):
        groups(path)
    with pytest.raises(FormatError, match=r"no database describes \(identifiers 0x1, 0x2, 0x3, 0x4, 0x5, \.\.\.\)"):
        groups(path, ReadSettings(databases=[real_file("formats/mf4/CSS-Electronics-SAE-J1939-DEMO.dbc")]))
    settings = ReadSettings(databases=[real_file("formats/mf4/canmod-gps.dbc")], groups=["gnss_imu"])
    recording = read(path, settings=settings)
    assert recording.n_samples == pytest.approx(frames, rel=0.01)
    assert recording.sampling_rate == pytest.approx(101.3, rel=0.1)
