"""TDMS files: written here by npTDMS and byte by byte, read as npTDMS reads them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.formats.conftest import joined, table_of

from sprung.errors import FormatError
from sprung.formats import ReadSettings, groups, read

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


def written(path: Path) -> Path:
    """Write a group of two rates, units, descriptions, a scale and a start, in two segments."""
    about = RootObject({"title": "ride", "author": "M. Ring", "description": "Belgian\npaving"})
    with TdmsWriter(path) as writer:
        writer.write_segment([about, GroupObject("body", {"description": "car 7"}), *channels(1000)])
        writer.write_segment(channels(600)[:3])
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return written(tmp_path / "run.tdms")


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


def test_values_are_those_of_the_library(path):
    whole = joined(table_of(path, "body (200 Hz)", ["force", "acc_fl"]))
    with TdmsFile.open(path) as file:
        np.testing.assert_array_equal(whole.values, [file["body"][name][:] for name in ("force", "acc_fl")])


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


def test_a_segment_that_was_never_finished_is_read_to_its_end_and_said(tmp_path):
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment([ChannelObject("g", "a", np.arange(30.0), {"wf_increment": 0.01})])
    content = (tmp_path / "run.tdms").read_bytes()
    (tmp_path / "run.tdms").write_bytes(content[:12] + b"\xff" * 8 + content[20:] + bytes(3))
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
