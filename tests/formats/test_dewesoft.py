"""A test drive of DEWESoft, whose library reads some channels and refuses others."""

import locale
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.formats.conftest import joined, table_of

from sprung.errors import FormatError, ParameterError
from sprung.formats import ReadSettings, dewesoft, groups, read

dwdatareader: Any = pytest.importorskip("dwdatareader")
REFUSED = "STWH_ANGLE, STWH_SIGN, V_SPEED2, ENG_RPM, V_SPEED, GAS_PEDAL, TEMP_OUTSIDE, WSPEED_FL, WSPEED_FR"


@pytest.fixture(autouse=True)
def _locale_is_kept():
    """Set the locale back that the library, here in this process, changes for all that comes after."""
    kept = locale.setlocale(locale.LC_ALL)
    yield
    locale.setlocale(locale.LC_ALL, kept)


@pytest.fixture
def path(real_file) -> Path:
    return real_file("formats/dewesoft/Example_Drive01.d7d")


def test_synchronous_channels_are_one_group_and_asynchronous_ones_stand_alone(path):
    synchronous, *others = groups(path)
    assert (synchronous.name, synchronous.headings) == ("100 Hz", ("GPSvel", "Math 0", "CNT 0"))
    assert (synchronous.n_rows, synchronous.sampling_rate) == (9580, 100)
    assert [(group.name, group.n_rows) for group in others] == [
        ("X absolute", 191),
        ("Y absolute", 191),
        ("Velocity", 1838),
        ("Direction", 1838),
        ("Used sattelites", 191),
    ]
    assert len({group.clock for group in groups(path)}) == 6


def test_values_are_those_of_the_library_in_si_units(path):
    recording = read(path, settings=ReadSettings(groups=["100 Hz"]))
    with dwdatareader.DWFile(str(path)) as file:
        stamps, speed = file["GPSvel"].scaled()
        moment = file.info.start_store_time
    np.testing.assert_allclose(recording.samples[0], speed / 3.6, rtol=1e-12)
    np.testing.assert_allclose(joined(table_of(path, "100 Hz")).stamps, stamps)
    assert recording.channels[0].quantity == "speed"
    assert (recording.channels[0].comment, recording.channels[0].calibration) == ("v", "0.00610351562 * raw")
    assert recording.channels[2].quantity == "displacement"
    assert recording.sampling_rate == pytest.approx(100)
    assert recording.start == round(moment.timestamp() * 1e6) * 1000


def test_channels_that_the_library_refuses_are_named(path):
    recording = read(path, settings=ReadSettings(groups=["100 Hz"]))
    assert recording.comment.startswith(f"channels that cannot be read: {REFUSED}")
    with pytest.raises(FormatError, match=r"d7d: channel 'ENG_RPM' cannot be read by the library of DEWESoft: export"):
        read(path, channels=["GPSvel", "ENG_RPM"])
    with pytest.raises(ParameterError, match=r"has no channel 'rpm'"):
        read(path, channels=["rpm"])


def test_channels_of_their_own_times_count_from_the_same_start(path):
    position, synchronous = table_of(path, "X absolute"), table_of(path, "100 Hz")
    (first, *_) = position.blocks(0, 2)
    np.testing.assert_allclose(first.stamps, [0.64, 1.14], atol=1e-6)
    assert position.start == synchronous.start


def test_an_archive_is_told_from_other_archives_by_its_first_file():
    head = b"PK\x03\x04" + bytes(22) + (9).to_bytes(2, "little") + bytes(2)
    assert dewesoft.recognises(head + b"drive.d7d")
    assert not dewesoft.recognises(head + b"array.npy")
    assert dewesoft.recognises(b"MULTI_STREAM_FILE_VER0201")
