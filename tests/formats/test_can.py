"""Raw CAN frames: every kind of signal decoded as cantools does, messages with multiplexers and of J1939."""

from functools import partial
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import FormatError
from sprung.formats.can import Frames, message_groups
from sprung.formats.columns import wanted_table
from sprung.formats.settings import ReadSettings
from sprung.formats.table import join

DBC = """VERSION ""

BU_: ECU

BO_ 256 ACC: 8 ECU
 SG_ acc_z : 0|16@1- (0.001,0) [0|0] "g" ECU
 SG_ gyro_y : 23|12@0- (0.25,-256) [0|0] "deg/s" ECU
 SG_ flags : 24|4@1+ (1,0) [0|0] "" ECU
 SG_ exact : 32|32@1- (1,0) [0|0] "m" ECU

BO_ 512 OBD: 8 ECU
 SG_ length : 0|8@1+ (1,0) [0|0] "" ECU
 SG_ pid M : 8|8@1+ (1,0) [0|0] "" ECU
 SG_ speed m13 : 16|8@1+ (1,0) [0|0] "km/h" ECU
 SG_ engine m12 : 23|16@0+ (0.25,0) [0|0] "rpm" ECU

BO_ 2566844926 CCVS: 8 ECU
 SG_ wheel_speed : 8|16@1+ (0.00390625,0) [0|0] "km/h" ECU

CM_ BO_ 256 "inertial unit";
CM_ SG_ 256 acc_z "vertical,
upwards";
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2566844926 3;
SIG_VALTYPE_ 256 exact : 1;
VAL_ 256 flags 0 "off" 1 "on" ;
"""
EXTENDED = 1 << 31


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "bus.dbc"
    path.write_text(DBC)
    return path


def frames(identifiers, payloads, *, stamps=None, buses=None):
    width = max(map(len, payloads))
    count = len(payloads)
    return Frames(
        np.arange(count) / 100 if stamps is None else np.array(stamps, dtype=float),
        np.ones(count, dtype=np.uint8) if buses is None else np.array(buses, dtype=np.uint8),
        np.array(identifiers, dtype=np.uint32),
        np.frombuffer(b"".join(payload.ljust(width, b"\xff") for payload in payloads), np.uint8).reshape(count, width),
        np.array([len(payload) for payload in payloads]),
    )


def source(pieces, first=0):
    row = 0
    for piece in pieces:
        count = piece.stamps.size
        if row + count > first:
            part = slice(max(0, first - row), None)
            yield Frames(
                piece.stamps[part], piece.buses[part], piece.ids[part], piece.payload[part], piece.lengths[part]
            )
        row += count


def groups_of(pieces, *databases):
    read = message_groups(Path("drive.mf4"), [partial(source, pieces)], databases, start=5, comment="test")
    return {group.name: group for group in read}


def values_of(group, *names, first=0, last=None):
    block = join(list(group.open(list(names) or None).blocks(first, last)))
    return block.stamps, block.values


def test_signals_are_decoded_with_unit_comment_and_calibration(dbc):
    database: Any = cantools.database.load_file(dbc)
    truth = [(0.5, -12.25, 1, 1.5), (-1.0, 30.0, 0, -2.25)]
    payloads = [
        database.encode_message("ACC", dict(zip(("acc_z", "gyro_y", "flags", "exact"), row, strict=True)), strict=False)
        for row in truth
    ]
    groups = groups_of([frames([256, 256], payloads, stamps=[0.5, 0.75])], dbc)
    table = groups["ACC"].open(None)
    (block,) = table.blocks()
    assert (groups["ACC"].n_rows, table.time_heading, table.start, table.comment) == (
        2,
        "time [s]",
        5,
        "test; inertial unit",
    )
    np.testing.assert_array_equal(block.stamps, [0.5, 0.75])
    np.testing.assert_allclose(block.values, np.transpose(truth), rtol=1e-12)
    acc, gyro, flags, exact = table.columns
    assert (acc.quantity, acc.comment, acc.calibration) == ("acceleration", "vertical, upwards", "0.001 * raw")
    assert (gyro.quantity, gyro.calibration, flags.calibration) == ("angular_velocity", "0.25 * raw - 256", "")
    assert exact.quantity == "displacement"


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(data=st.data(), little=st.booleans(), signed=st.booleans(), kind=st.sampled_from(["integer", "float"]))
def test_any_place_in_a_frame_is_decoded_as_by_cantools(tmp_path_factory, data, little, signed, kind):
    length = data.draw(st.integers(2, 64) if kind == "integer" else st.sampled_from([32, 64]))
    place = data.draw(st.integers(0, 64 - length))
    start = place if little else 8 * (place // 8) + 7 - place % 8
    text = f'VERSION ""\n\nBU_: ECU\n\nBO_ 1 M: 8 ECU\n SG_ s : {start}|{length}@{int(little)}'
    text += f'{"-" if signed or kind == "float" else "+"} (1,0) [0|0] "" ECU\n'
    text += f"\nSIG_VALTYPE_ 1 s : {length // 32};\n" if kind == "float" else ""
    path = tmp_path_factory.mktemp("dbc") / "one.dbc"
    path.write_text(text)
    payload = data.draw(st.binary(min_size=8, max_size=8))
    database: Any = cantools.database.load_file(path)
    expected = database.decode_message("M", payload)["s"]
    _, ((value,),) = values_of(groups_of([frames([1], [payload])], path)["M"])
    np.testing.assert_equal(value, float(expected))


def test_each_value_of_a_multiplexer_is_a_group_of_its_own(dbc):
    payloads = [bytes([3, pid, value, 0]) for pid, value in ((13, 50), (12, 8), (13, 51), (12, 9))]
    groups = groups_of([frames([512] * 4, payloads)], dbc)
    assert [(name, group.headings, group.n_rows) for name, group in groups.items()] == [
        ("OBD", ("length", "pid"), 4),
        ("OBD pid=13", ("speed",), 2),
        ("OBD pid=12", ("engine",), 2),
    ]
    stamps, values = values_of(groups["OBD pid=12"])
    np.testing.assert_array_equal(stamps, [0.01, 0.03])
    np.testing.assert_array_equal(values, [[512, 576]])


def test_j1939_is_found_by_parameter_group_and_sources_stay_apart(dbc):
    one, other = 0x18FEF100 | EXTENDED, 0x0CFEF127 | EXTENDED
    payloads = [bytes([0, 0, 16, 0, 0, 0, 0, 0]), bytes([0, 0, 0xFE, 0]), b"\xff" * 8, bytes([0, 0])]
    groups = groups_of([frames([one, other, one, one], payloads)], dbc)
    assert list(groups) == ["CCVS (CAN 1, 0xCFEF127)", "CCVS (CAN 1, 0x18FEF100)"]
    np.testing.assert_array_equal(values_of(groups["CCVS (CAN 1, 0x18FEF100)"])[1], [[16, np.nan, np.nan]])
    np.testing.assert_array_equal(values_of(groups["CCVS (CAN 1, 0xCFEF127)"])[1], [[np.nan]])


def test_one_message_on_two_buses_gives_two_groups(dbc):
    groups = groups_of([frames([256, 256], [bytes(8), bytes(8)], buses=[1, 2])], dbc)
    assert list(groups) == ["ACC (CAN 1, 0x100)", "ACC (CAN 2, 0x100)"]


def test_rows_are_read_from_the_piece_in_which_they_begin(dbc):
    opened = []
    generator = np.random.default_rng(1)
    sizes = (3, 10, 1, 8, 10, 5)
    pieces = [frames(generator.choice([256, 512, 7], n), [generator.bytes(8) for _ in range(n)]) for n in sizes]

    def counting(first=0):
        opened.append(first)
        yield from source([*pieces, frames([256] * 10, [bytes(8)] * 10)], first)

    groups = message_groups(Path("x.mf4"), [counting], [dbc], start=None, comment="")
    (group,) = [group for group in groups if group.name == "ACC"]
    _, values = values_of(group)
    n = group.n_rows or 0
    for first, last in ((0, 1), (2, 7), (n - 12, n - 3), (n - 1, None), (n - 4, n + 5)):
        np.testing.assert_array_equal(values_of(group, first=first, last=last)[1], values[:, first:last])
        (block, *_) = group.open(None).blocks(first, last)
        assert block.first_row == first + 1
    assert opened[-1] == sum(sizes)


def test_groups_of_two_clocks_need_a_choice(dbc):
    groups = tuple(groups_of([frames([256, 512], [bytes(8), bytes(8)])], dbc).values())
    assert len({group.clock for group in groups}) == len(groups)
    assert wanted_table(Path("x"), groups, ReadSettings(channels=["acc_z"])).columns[0].name == "acc_z"


def test_frames_without_a_database_or_with_that_of_another_bus_give_a_sentence(dbc):
    pieces = [frames([1, 0x18FEF200 | EXTENDED], [bytes(8), bytes(8)])]
    with pytest.raises(FormatError, match=r"^drive.mf4 holds raw CAN frames: give the database .* with --dbc FILE"):
        groups_of(pieces)
    with pytest.raises(FormatError, match=r"no database describes \(identifiers 0x1, 0x18FEF200\): give the database"):
        groups_of(pieces, dbc)


def test_a_file_that_is_no_database_gives_a_sentence(tmp_path):
    (tmp_path / "bus.dbc").write_text("time,acc\n0,1\n")
    with pytest.raises(FormatError, match=r"bus.dbc cannot be read as a CAN database"):
        groups_of([frames([1], [bytes(8)])], tmp_path / "bus.dbc")
