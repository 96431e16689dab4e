"""Dates and times of day as people and programs write them."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from tests.formats.conftest import said

from sprung.errors import FormatError
from sprung.formats import read

START = datetime(2024, 12, 31, 13, 5, 1, 250_000, tzinfo=UTC)
NOON = 1_735_650_301_250_000_000


def file_of(write, stamp, *, start=START, header="Zeit;a", delimiter=";", n=100):
    moments = (start + timedelta(milliseconds=10 * index) for index in range(n))
    return write(header + "\n" + "".join(f"{stamp(moment)}{delimiter}{k % 7}\n" for k, moment in enumerate(moments)))


@pytest.mark.parametrize(
    ("form", "digits"),
    [
        ("%Y-%m-%d %H:%M:%S,{ms}", 3),
        ("%Y-%m-%dT%H:%M:%S.{ms}Z", 3),
        ("%Y/%m/%d %H:%M:%S.{ms}", 3),
        ("%d.%m.%Y %H:%M:%S,{ms}", 2),
        ("%d.%m.%y %H:%M:%S.{ms}", 3),
        ("%d/%m/%Y %H:%M:%S.{ms}", 3),
        ("%m/%d/%Y %I:%M:%S.{ms} %p", 3),
        ("%m/%d/%Y %H:%M:%S.{ms}", 2),
        ("%Y-%m-%d %H:%M:%S.{ms} UTC", 3),
        ("%d-%b-%Y %H:%M:%S.{ms}", 3),
        ("'%d-%b-%Y %H:%M:%S.{ms}'", 3),
        ('"%d-%b-%Y %H:%M:%S.{ms}"', 3),
        ("'%Y-%m-%d %H:%M:%S.{ms}'", 3),
        ("%d.Dez.%y %H:%M:%S,{ms}", 3),
    ],
)
def test_dates_and_times(text_file, form, digits) -> None:
    path = file_of(text_file, lambda t: t.strftime(form).replace("{ms}", f"{t.microsecond // 1000:03d}"[:digits]))
    recording = read(path)
    assert recording.names == ("a",)
    assert recording.start == NOON
    assert recording.sampling_rate == pytest.approx(100)
    assert recording.n_samples == 100


def test_zone_is_taken_off(text_file) -> None:
    recording = read(
        file_of(text_file, lambda t: t.strftime("%d.%m.%Y %H:%M:%S,") + f"{t.microsecond // 1000:03d} +01:00")
    )
    assert recording.start == NOON - 3_600_000_000_000


def test_date_and_time_in_two_columns(text_file) -> None:
    path = file_of(text_file, lambda t: f"{t:%d.%m.%Y};{t:%H:%M:%S},{t.microsecond // 1000:03d}", header="Date;Time;a")
    recording = read(path)
    assert (recording.start, recording.sampling_rate) == (NOON, pytest.approx(100))
    assert said(recording, "time: 'Date' and 'Time', by their dates and times")
    assert said(recording, "dates in 'Date' read as day.month.year")


def test_midnight_between_two_columns_and_in_times_of_day(text_file) -> None:
    late = datetime(2024, 12, 31, 23, 59, 59, 500_000, tzinfo=UTC)
    both = read(
        file_of(text_file, lambda t: f"{t:%d/%m/%Y},{t:%H:%M:%S.%f}", header="Date,Time,a", delimiter=",", start=late)
    )
    assert (both.sampling_rate, both.gaps) == (pytest.approx(100), ())
    only = read(file_of(text_file, lambda t: f"{t:%H:%M:%S.%f}", header="Time,a", delimiter=",", start=late))
    assert (only.sampling_rate, only.gaps, only.start) == (pytest.approx(100), (), None)


def test_times_of_day_after_blanks(text_file) -> None:
    recording = read(file_of(text_file, lambda t: f"{t:%Y-%m-%d %H:%M:%S.%f}", header="Date Time a", delimiter="   "))
    assert recording.start == NOON
    recording = read(file_of(text_file, lambda t: f"{t:%Y-%m-%d %H:%M:%S.%f}", header="Stamp a", delimiter=" "))
    assert recording.start == NOON


def test_minutes_and_seconds(text_file) -> None:
    recording = read(file_of(text_file, lambda t: f"{t:%M:%S}.{t.microsecond // 1000:03d}", header="Time;a"))
    assert recording.sampling_rate == pytest.approx(100)


def test_day_and_month_that_cannot_be_told_apart(text_file) -> None:
    fifth = START.replace(month=6, day=5)
    path = file_of(text_file, lambda t: f"{t:%d/%m/%Y %H:%M:%S.%f}", start=fifth)
    with pytest.raises(
        FormatError, match=r"'Zeit' holds dates such as '05/06/2024 .* cannot be distinguished: write them as"
    ):
        read(path)
    assert said(read(path, sampling_rate=100), "day and month cannot be distinguished")
    same = file_of(text_file, lambda t: f"{t:%d/%m/%Y %H:%M:%S.%f}", start=START.replace(month=5, day=5))
    assert np.datetime64(read(same).start, "ns") == np.datetime64("2024-05-05T13:05:01.250")


def test_day_shows_where_it_changes(text_file) -> None:
    late = datetime(2024, 6, 5, 23, 59, 59, 500_000, tzinfo=UTC)
    recording = read(file_of(text_file, lambda t: f"{t:%m/%d/%Y %H:%M:%S.%f}", start=late))
    assert np.datetime64(recording.start, "ns") == np.datetime64("2024-06-05T23:59:59.5")
    assert recording.gaps == ()


def test_text_among_dates_names_its_line(text_file) -> None:
    path = text_file("Time;a\n" + "".join(f"31.12.2024 13:05:{k:02d};1\n" for k in range(9)) + "soon;1\n")
    with pytest.raises(FormatError, match="line 11: column 'Time' holds no time"):
        read(path)


def test_text_of_dates_is_the_time_beside_channels_that_end_like_units(text_file) -> None:
    recording = read(file_of(text_file, lambda t: f"{t:%d.%m.%Y %H:%M:%S.%f};1", header="Stempel;acc_min;a"))
    assert recording.names == ("acc_min", "a")
    assert recording.start == NOON
