"""TDMS files: written here by npTDMS and byte by byte, read as npTDMS reads them."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sprung.errors import FormatError
from sprung.formats import ReadSettings, groups, read, read_blocks, tdms
from sprung.formats.table import join

nptdms: Any = pytest.importorskip("nptdms")
ChannelObject, GroupObject, RootObject = nptdms.ChannelObject, nptdms.GroupObject, nptdms.RootObject
TdmsFile, TdmsWriter = nptdms.TdmsFile, nptdms.TdmsWriter

START = np.datetime64("2026-03-04T05:06:07.891011", "us")
NANOSECONDS = 1_772_600_767_891_011_000


def waveform(rate, **properties):
    return {"wf_increment": 1 / rate, "wf_start_time": START, "wf_start_offset": 0.25} | properties


def channels(count=1000):
    stamps = np.arange(count) / 200
    scale = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled", "NI_Scale[0]_Scale_Type": "Linear"}
    scale |= {"NI_Scale[0]_Linear_Slope": 0.5, "NI_Scale[0]_Linear_Y_Intercept": -20.0}
    acc = waveform(200, unit_string="g", description="front axle", Sensitivity="98.2 mV/g")
    return [
        ChannelObject("body", "acc_fl", np.sin(3 * stamps), acc),
        ChannelObject("body", "force", np.arange(count, dtype=np.int16), waveform(200, unit_string="N") | scale),
        ChannelObject("body", "speed", np.full(count // 8, 50.0), waveform(25, NI_UnitDescription="km/h")),
        ChannelObject("body", "note", ["start", "stop"]),
    ]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with a group of two rates, units, descriptions, a scale and a start, in two segments."""
    about = RootObject({"title": "ride", "author": "M. Ring", "description": "Belgian\npaving"})
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment([about, GroupObject("body", {"description": "car 7"}), *channels(1000)])
        writer.write_segment(channels(600)[:3])
    return tmp_path / "run.tdms"


def joined(table) -> Any:
    return join(list(table.blocks()))


def table_of(path, name, names=None):
    (group,) = [group for group in groups(path) if group.name == name]
    return group.open(names)


def test_groups_are_split_by_rate(path):
    body, bus = groups(path)
    assert (body.name, body.headings) == ("body (200 Hz)", ("acc_fl", "force"))
    assert (body.n_rows, body.sampling_rate) == (1600, 200)
    assert (bus.name, bus.headings, bus.n_rows, bus.sampling_rate) == ("body (25 Hz)", ("speed",), 200, 25)
    assert body.clock != bus.clock


def test_units_descriptions_scales_and_start_are_carried(path):
    recording = read(path, settings=ReadSettings(groups=["body (200 Hz)"]))
    acc, force = recording.channels
    stamps = np.concatenate([np.arange(1000), np.arange(600)]) / 200
    np.testing.assert_allclose(recording.samples[0], 9.80665 * np.sin(3 * stamps), rtol=1e-12)
    np.testing.assert_allclose(recording.samples[1], 0.5 * 200 * stamps - 20, atol=1e-10)
    assert (acc.quantity, acc.comment, acc.calibration) == ("acceleration", "front axle", "Sensitivity: 98.2 mV/g")
    assert (force.quantity, force.calibration) == ("force", "0.5 * raw - 20")
    assert recording.sampling_rate == 200
    assert recording.start == NANOSECONDS + 250_000_000
    assert recording.comment == "Belgian paving; title: ride; author: M. Ring; car 7"


def test_groups_of_one_waveform_share_a_clock(tmp_path):
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment(
            [ChannelObject(name, "a" + name, np.arange(100.0), waveform(200)) for name in ("left", "right")]
        )
    assert read(tmp_path / "run.tdms").names == ("aleft", "aright")


def test_any_rows_are_those_of_all_rows(path, monkeypatch):
    monkeypatch.setattr(tdms, "_PIECE_ROWS", 64)
    table = table_of(path, "body (200 Hz)", ["force", "acc_fl"])
    whole = joined(table)
    with TdmsFile.open(path) as file:
        np.testing.assert_array_equal(whole.values[1], file["body"]["acc_fl"][:])
        np.testing.assert_array_equal(whole.values[0], file["body"]["force"][:])
    for first, last in ((0, 1), (17, 400), (990, 1010), (1599, None), (1500, 5000)):
        part = join(list(table.blocks(first, last)))
        np.testing.assert_array_equal(part.values, whole.values[:, first:last])
        assert part.first_row == first + 1
    assert list(table.blocks(1600)) == []
    parts = list(read_blocks(path, settings=ReadSettings(groups=["body (200 Hz)"]), block_samples=1000))
    assert sum(part.n_samples for part in parts) == 1600


def test_channels_of_time_stamps_are_the_clock(tmp_path):
    stamps = START + np.arange(300) * np.timedelta64(10_000, "us")
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment(
            [ChannelObject("log", "when", stamps), ChannelObject("log", "acc", np.arange(300.0), {"unit_string": "g"})]
        )
    recording = read(tmp_path / "run.tdms")
    assert recording.names == ("acc",)
    assert recording.sampling_rate == pytest.approx(100)
    assert abs((recording.start or 0) - NANOSECONDS) < 1000


def test_channels_called_time_are_the_clock_in_their_unit(tmp_path):
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject("log", "Time", np.arange(300.0) * 4, {"unit_string": "ms"}),
                ChannelObject("log", "acc", np.arange(300.0)),
            ]
        )
    (group,) = groups(tmp_path / "run.tdms")
    assert group.open(None).time_heading == "Time [ms]"
    assert read(tmp_path / "run.tdms").sampling_rate == pytest.approx(250)


def text(value: str) -> bytes:
    return struct.pack("<L", len(value)) + value.encode()


def segment(objects, data: bytes, flags=0, *, size=None):
    meta = struct.pack("<L", len(objects))
    for name, index, properties in objects:
        meta += text(f"/'g'/'{name}'") + index + struct.pack("<L", len(properties))
        meta += b"".join(text(key) + struct.pack("<Ld", 10, value) for key, value in properties.items())
    size = len(meta) + len(data) if size is None else size
    lead = b"TDSm" + struct.pack("<lLQQ", 0b1110 | flags, 4713, size, len(meta))
    return lead + meta + data


def index(kind, count):
    return struct.pack("<LLLQ", 20, kind, 1, count)


def test_interleaved_values_in_several_chunks(tmp_path):
    rows = np.zeros(30, dtype=[("a", "<i2"), ("b", "<f8")])
    rows["a"], rows["b"] = np.arange(30), np.arange(30) / 4
    objects = [("a", index(2, 10), {"wf_increment": 0.01}), ("b", index(10, 10), {"wf_increment": 0.01})]
    (tmp_path / "run.tdms").write_bytes(segment(objects, rows.tobytes(), 1 << 5))
    block = joined(table_of(tmp_path / "run.tdms", "g"))
    np.testing.assert_array_equal(block.values, [rows["a"], rows["b"]])


def test_channels_one_after_another_in_several_chunks(tmp_path):
    a, b = np.arange(30, dtype="<i2"), np.arange(30) / 4
    data = b"".join(a[k : k + 10].tobytes() + b[k : k + 10].tobytes() for k in (0, 10, 20))
    objects = [("a", index(2, 10), {"wf_increment": 0.01}), ("b", index(10, 10), {"wf_increment": 0.01})]
    (tmp_path / "run.tdms").write_bytes(segment(objects, data))
    table = table_of(tmp_path / "run.tdms", "g")
    np.testing.assert_array_equal(joined(table).values, [a, b])
    np.testing.assert_array_equal(join(list(table.blocks(7, 23))).values, [a[7:23], b[7:23]])


def test_raw_values_of_a_card_are_scaled(tmp_path):
    """DAQmx writes the words of its card and says how they become volts."""
    rows = np.zeros(40, dtype=[("a", "<i2"), ("b", "<i4")])
    rows["a"], rows["b"] = np.arange(40), -np.arange(40) * 1000

    def scaler(kind, offset):
        head = struct.pack("<LLLQL", 0x1269, 0xFFFFFFFF, 1, 20, 1)
        return head + struct.pack("<LLLLL", kind, 0, offset, 0, 0) + struct.pack("<LL", 1, 6)

    linear = {"NI_Scale[1]_Linear_Slope": 0.001, "NI_Scale[1]_Linear_Y_Intercept": 0.5, "wf_increment": 0.01}
    content = segment([("a", scaler(3, 0), linear), ("b", scaler(5, 2), linear)], rows.tobytes())
    kind = text("NI_Scale[1]_Scale_Type") + struct.pack("<L", 0x20) + text("Linear")
    source = text("NI_Scale[1]_Linear_Input_Source") + struct.pack("<LL", 7, 0)
    count = text("NI_Number_Of_Scales") + struct.pack("<LL", 7, 2)
    for name in ("a", "b"):
        content = with_properties(content, name, kind + source + count, 3)
    (tmp_path / "run.tdms").write_bytes(content)
    table = table_of(tmp_path / "run.tdms", "g")
    with TdmsFile.open(tmp_path / "run.tdms") as file:
        twin = np.array([file["g"][name][:] for name in ("a", "b")])
    np.testing.assert_array_equal(joined(table).values, twin)
    np.testing.assert_allclose(twin, [rows["a"] * 0.001 + 0.5, rows["b"] * 0.001 + 0.5], rtol=1e-12)
    assert table.columns[0].calibration == "0.001 * raw + 0.5"


def with_properties(content: bytes, name: str, more: bytes, count: int) -> bytes:
    """Return a segment with more properties of an object, put in before its first one."""
    place = content.index(text("NI_Scale[1]_Linear_Slope"), content.index(text(f"/'g'/'{name}'")))
    (before,) = struct.unpack("<L", content[place - 4 : place])
    size, data = struct.unpack("<QQ", content[12:28])
    head = content[:12] + struct.pack("<QQ", size + len(more), data + len(more))
    return head + content[28 : place - 4] + struct.pack("<L", before + count) + more + content[place:]


def test_a_segment_that_was_never_finished_is_read_to_its_end_and_said(tmp_path):
    data = np.arange(30.0).tobytes() + b"\0\0\0"
    content = segment([("a", index(10, 1000), {"wf_increment": 0.01})], data, size=2**64 - 1)
    (tmp_path / "run.tdms").write_bytes(content)
    recording = read(tmp_path / "run.tdms")
    np.testing.assert_array_equal(recording.samples[0], np.arange(30))
    assert recording.comment == "the logger did not finish the last segment"


@pytest.mark.parametrize("cut", [1, 500, 3000])
def test_a_file_cut_short_gives_a_sentence(path, cut):
    path.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(FormatError, match=r"run.tdms ends within the segment .*: check that the file is complete"):
        groups(path)


def test_a_scale_that_is_not_known_is_said(tmp_path):
    properties = waveform(100, NI_Number_Of_Scales=1) | {"NI_Scale[0]_Scale_Type": "Chirp"}
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment([ChannelObject("g", "a", np.arange(100.0), properties)])
    assert read(tmp_path / "run.tdms").channels[0].calibration == "Chirp scale, not applied"


def test_an_index_file_of_another_file_does_no_harm(path):
    path.with_name("run.tdms_index").write_bytes(b"TDSh" + bytes(100))
    assert len(groups(path)) == 2


def test_too_many_scales_give_a_sentence(tmp_path):
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment([ChannelObject("g", "a", np.arange(9.0), {"NI_Number_Of_Scales": 2**31 - 1})])
    with pytest.raises(FormatError, match=r"run\.tdms cannot be read"):
        groups(tmp_path / "run.tdms")
