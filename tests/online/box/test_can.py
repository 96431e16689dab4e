"""Signals on a CAN bus, with a database made here."""

from pathlib import Path

import can
import cantools
import numpy as np
import pytest

from sprung.errors import FormatError, ParameterError
from sprung.online.box import can_bus, can_database, from_can
from sprung.units import STANDARD_GRAVITY

TODAY = 1_700_000_000_000_000_000
DBC = """VERSION ""

BU_: BOX

BO_ 256 ACC: 8 BOX
 SG_ acc_fl : 0|16@1- (0.001,0) [0|0] "g" BOX
 SG_ acc_fr : 16|16@1- (0.001,0) [0|0] "g" BOX
 SG_ counter : 32|8@1+ (1,0) [0|0] "" BOX

BO_ 512 DRIVE: 4 BOX
 SG_ speed : 0|16@1+ (0.01,0) [0|0] "km/h" BOX
 SG_ counter : 16|8@1+ (1,0) [0|0] "" BOX

BO_ 2147483904 LONG: 2 BOX
 SG_ raw : 0|16@1- (1,0) [0|0] "lumen" BOX

VAL_ 512 speed 0 "stands" ;
"""


@pytest.fixture
def database():
    return cantools.database.load_string(DBC)


def message(database, name, seconds, *, start=TODAY / 1e9, **values):
    described = database.get_message_by_name(name)
    filled = {signal.name: 0 for signal in described.signals} | values
    return can.Message(
        arbitration_id=described.frame_id,
        is_extended_id=described.is_extended_frame,
        data=described.encode(filled, strict=False),
        timestamp=start + seconds,
    )


def drive(database, n_samples=300, **options):
    """100 Hz of accelerations, 10 Hz of speed."""
    for k in range(n_samples):
        yield message(database, "ACC", k / 100, acc_fl=k / 1000, acc_fr=-k / 1000, counter=k % 256, **options)
        if k % 10 == 0:
            yield message(database, "DRIVE", k / 100, speed=float(k // 10), **options)


def joined(blocks):
    return np.concatenate([block.samples for block in blocks], axis=1)


def test_signals_are_those_of_the_database_in_si_units(database) -> None:
    names = ["speed", "acc_fr", "acc_fl", "ACC.counter"]
    blocks = list(from_can(drive(database), database, names=names, sampling_rate=100.0))
    assert blocks[0].names == tuple(names)
    assert [channel.quantity for channel in blocks[0].channels] == ["speed", "acceleration", "acceleration", "unknown"]
    assert [block.n_samples for block in blocks] == [100, 100, 100]
    assert blocks[0].start == pytest.approx(TODAY, abs=1000, rel=0)
    found = joined(blocks)
    k = np.arange(300)
    assert np.allclose(found[1:3], STANDARD_GRAVITY * np.array([-k, k]) / 1000, atol=1e-5)
    assert np.allclose(found[0, :291], k[:291] / 10 / 3.6, atol=1e-4)
    assert np.isnan(found[0, 291:]).all()


def test_what_is_no_signal_is_passed_over(database) -> None:
    """An id that is not in the database, the id of another kind, error and remote frames, short messages, None."""
    said: list[str] = []

    def disturbed():
        for k, one in enumerate(drive(database)):
            yield one
            stamp = one.timestamp + 0.0001
            yield can.Message(arbitration_id=0x7FF, is_extended_id=False, data=bytes(8), timestamp=stamp)
            yield can.Message(arbitration_id=256, is_extended_id=True, data=b"\x99" * 8, timestamp=stamp)
            yield can.Message(arbitration_id=256, is_extended_id=False, is_error_frame=True, timestamp=stamp)
            yield can.Message(arbitration_id=256, is_extended_id=False, is_remote_frame=True, dlc=8, timestamp=stamp)
            yield None
            if k % 7 == 0:
                yield can.Message(arbitration_id=256, is_extended_id=False, data=b"\x99\x99", timestamp=stamp)

    names = ["acc_fl", "acc_fr"]
    expected = joined(from_can(drive(database), database, names=names, sampling_rate=100.0))
    found = joined(from_can(disturbed(), database, names=names, sampling_rate=100.0, on_problem=said.append))
    assert np.array_equal(found, expected, equal_nan=True)
    assert len(said) == 1
    assert said[0].startswith("CAN message ACC (id 0x100) cannot be decoded (")
    assert said[0].endswith("check that the database is that of this bus")


def test_stamps_that_do_not_count_from_1970(database) -> None:
    stream = drive(database, start=17.0)
    blocks = list(from_can(stream, database, names=["acc_fl"], sampling_rate=100.0, start=lambda: TODAY))
    assert [block.start for block in blocks] == [TODAY, TODAY + 10**9, TODAY + 2 * 10**9]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["acc_rl"], "the CAN database has no signal 'acc_rl': it has acc_fl, acc_fr, counter, raw, speed"),
        (["counter"], "signal 'counter' is in the CAN messages ACC and DRIVE: write ACC.counter"),
        (["speed", "speed"], "channel 'speed' is named more than once"),
        ([], "no channel is named"),
    ],
)
def test_signals_that_cannot_be(database, names, said) -> None:
    with pytest.raises(ParameterError, match=said):
        from_can([], database, names=names, sampling_rate=100.0)


def test_virtual_bus(database) -> None:
    """From one end of python-can's virtual bus to the other."""
    with can_bus("virtual", "sprung-test") as receiver, can.Bus("sprung-test", interface="virtual") as sender:
        for k in range(150):
            sender.send(message(database, "ACC", k / 100, acc_fl=k / 1000), timeout=1)
        received = list(iter(lambda: receiver.recv(timeout=0.1), None))
    assert len(received) == 150
    for k, one in enumerate(received):
        one.timestamp = TODAY / 1e9 + k / 100  # the bus stamps messages when they are sent, which was all at once
    found = joined(from_can(received, database, names=["acc_fl"], sampling_rate=100.0))
    assert np.allclose(found[0], STANDARD_GRAVITY * np.arange(150) / 1000, atol=1e-5)


def test_bus_that_breaks_down_or_cannot_be_opened(database) -> None:
    def broken():
        yield from drive(database, 150)
        raise can.CanOperationError("Network is down")

    blocks = from_can(broken(), database, names=["acc_fl"], sampling_rate=100.0)
    with pytest.raises(FormatError, match=r"can no longer be read \(Network is down\): check that it is up"):
        list(blocks)
    with pytest.raises(ParameterError, match="the CAN bus nonsense can0 cannot be opened"):
        can_bus("nonsense", "can0")


def test_databases_that_cannot_be_read(tmp_path: Path) -> None:
    path = tmp_path / "bus.dbc"
    path.write_text(DBC)
    assert [item.name for item in can_database(path).messages] == ["ACC", "DRIVE", "LONG"]
    path.write_text("BO_ nonsense")
    with pytest.raises(FormatError, match=r"bus.dbc cannot be read as a CAN database"):
        can_database(path)
    path.write_text('VERSION ""\n')
    with pytest.raises(FormatError, match=r"bus.dbc describes no CAN messages"):
        can_database(path)
    with pytest.raises(FormatError, match=r"absent.dbc: no such file"):
        can_database(tmp_path / "absent.dbc")
