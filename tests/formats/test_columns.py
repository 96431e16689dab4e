"""Time columns under other names, and columns that are no motion."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.formats.conftest import said

from sprung.errors import FormatError, ParameterError
from sprung.formats import ReadSettings, read

N = 300
ACC = np.random.default_rng(1).standard_normal((2, N))


def lines(headings, *columns):
    rows = "\n".join(",".join(map(str, row)) for row in zip(*columns, strict=True))
    return f"{headings}\n{rows}\n"


@pytest.mark.parametrize(
    ("name", "step", "unit"),
    [
        ("Time_ms", 10, "ms"),
        ("time_ms", 10.0, "ms"),
        ("seconds_elapsed", 0.01, "s"),
        ("elapsed", 0.01, "s"),
        ("elapsed [ms]", 10, "ms"),
        ("timestamp_us", 10_000, "us"),
        ("Timestamp (ns)", 10_000_000, "ns"),
        ("SampleTimeFine", 10_000, "us"),
        ("Uhrzeit", 0.01, "s"),
        ("Time", 10, "ms"),
        ("timestamp", 10, "ms"),
        ("t_us", 10_000, "us"),
        ("logTime", 0.01, "s"),
    ],
)
def test_clock_under_another_name_is_the_time(text_file, name, step, unit) -> None:
    stamps = [round(17 + index * step, 6) if step < 1 else 17 + index * step for index in range(N)]
    recording = read(text_file(lines(f"{name},a,b", stamps, *ACC)))
    assert recording.names == ("a", "b")
    assert recording.sampling_rate == pytest.approx(100)
    assert np.array_equal(recording.samples, ACC)


def test_what_was_taken_as_time_is_said(text_file) -> None:
    recording = read(text_file(lines("SampleTimeFine,a,b", range(0, N * 8333, 8333), *ACC)))
    assert said(recording, "time: column 'SampleTimeFine', by its name, and as it rises steadily")
    assert said(recording, "in us, as seconds would mean 0.00012 Hz")
    assert recording.sampling_rate == pytest.approx(1e6 / 8333)


def test_counter_of_32_bits_goes_on_where_it_begins_anew(text_file) -> None:
    stamps = (2**32 - 1_000_000 + 8333 * np.arange(N)) % 2**32
    recording = read(text_file(lines("PacketCounter,SampleTimeFine,a,b", (65500 + np.arange(N)) % 65536, stamps, *ACC)))
    assert recording.names == ("a", "b")
    assert recording.gaps == ()
    assert recording.sampling_rate == pytest.approx(1e6 / 8333)
    assert said(recording, "left out, as they do not measure motion: 'PacketCounter' (a counter)")


def test_counters_flags_and_further_clocks_are_left_out(text_file) -> None:
    text = lines(
        "time,seconds_elapsed,Status,index,acc", 0.01 * np.arange(N), 0.01 * np.arange(N), [0] * N, range(N), ACC[0]
    )
    recording = read(text_file(text))
    assert recording.names == ("acc",)
    assert said(recording, "'seconds_elapsed' (a clock), 'Status' (a constant flag), 'index' (a counter)")
    named = read(text_file(text), channels=["Status", "index", "seconds_elapsed", "acc"])
    assert named.names == ("Status", "index", "seconds_elapsed", "acc")


def test_time_is_found_though_only_some_channels_are_wanted(text_file) -> None:
    path = text_file(lines("packet,time_ms,a,b", range(N), range(0, 10 * N, 10), *ACC))
    assert read(path, channels=["b"]).sampling_rate == pytest.approx(100)
    assert read(path, channels=["time_ms", "b"]).names == ("time_ms", "b")


def test_time_column_and_unit_as_stated(text_file) -> None:
    path = text_file(lines("time,stamp,a,b", 0.01 * np.arange(N), range(0, 20 * N, 20), *ACC))
    assert read(path, channels=["a"]).sampling_rate == pytest.approx(100)
    recording = read(path, channels=["a"], settings=ReadSettings(time="stamp", time_unit="ms"))
    assert recording.sampling_rate == pytest.approx(50)
    assert said(recording, "time: column 'stamp', as stated")
    assert said(recording, "time: column 'stamp' in ms, as stated")
    with pytest.raises(ParameterError, match=r"has no column 'clock' for the time"):
        read(path, settings=ReadSettings(time="clock"))
    slow = text_file(lines("time,a", range(0, 20 * N, 20), ACC[0]))
    assert read(slow, settings=ReadSettings(time_unit="s")).sampling_rate == pytest.approx(0.05)


def test_one_name_is_that_of_one_channel(text_file) -> None:
    path = text_file(lines("time,acc,b", 0.01 * np.arange(N), *ACC))
    assert read(path, channels="acc").names == ("acc",)
    assert read(path, settings=ReadSettings(channels="acc")).names == ("acc",)


def test_one_of_two_time_columns_is_named(text_file) -> None:
    path = text_file(lines("t,time,a,b", 0.01 * np.arange(N), 0.02 * np.arange(N), *ACC))
    with pytest.raises(FormatError, match="'t' and 'time', which advance at different rates: keep one"):
        read(path)
    assert read(path, settings=ReadSettings(time="t")).sampling_rate == pytest.approx(100)


def clock_digits(ticks: np.ndarray, per_second: int) -> np.ndarray:
    """Return times of day, counted in parts of a second, as the digits HHMMSS and those of the parts."""
    minutes, rest = np.divmod(ticks, 60 * per_second)
    return (minutes // 60 * 10**4 + minutes % 60 * 10**2) * per_second + rest


@pytest.mark.parametrize(
    ("face", "per_second", "start", "seconds"),
    [
        ("HHMMSScc", 100, (14, 39, 10), 90),
        ("HHMMSScc", 100, (1, 39, 10), 90),
        ("HHMMSSmmm", 1000, (14, 39, 10), 60),
        ("HHMMSSmmm", 1000, (0, 39, 50), 30),
        ("HHMMSScc", 100, (14, 39, 10), 30),
        ("HHMMSScc", 100, (1, 39, 10), 30),
        ("HHMMSSmmm", 1000, (12, 34, 10), 10),
    ],
)
def test_digits_of_a_clock_are_the_time_of_day(text_file, face, per_second, start, seconds) -> None:
    hour, minute, second = start
    n = seconds * per_second
    ticks = ((hour * 60 + minute) * 60 + second) * per_second + np.arange(n)
    digits = clock_digits(ticks, per_second)
    for stamps in (digits, digits.astype(float)):
        recording = read(text_file(lines("time,a", stamps, np.arange(n) % 7)))
        assert (recording.sampling_rate, recording.gaps) == (pytest.approx(per_second), ())
        assert any(f"time: column 'time' as {face}, as" in line for line in recording.history)


def test_digits_with_a_decimal_point_are_the_time_of_day(text_file) -> None:
    digits = clock_digits(5_275_000 + np.arange(6000), 100) / 100
    for heading in ("time", "time [s]"):
        recording = read(text_file(lines(f"{heading},a", digits, np.arange(6000) % 7)))
        assert (recording.sampling_rate, recording.gaps) == (pytest.approx(100), ())


def test_digits_that_may_count_milliseconds_are_asked_for(text_file) -> None:
    digits = clock_digits(5_275_000 + 10 * np.arange(N), 100)
    path = text_file(lines("time,a", digits, ACC[0]))
    with pytest.raises(FormatError, match=r"100 Hz in ms; 10 Hz as HHMMSScc: state its unit with --time-unit"):
        read(path)
    assert read(path, sampling_rate=10).sampling_rate == pytest.approx(10)
    assert read(path, settings=ReadSettings(time_unit="ms")).sampling_rate == pytest.approx(100)
    assert read(path, settings=ReadSettings(time_unit="HHMMSScc")).sampling_rate == pytest.approx(10)
    assert read(text_file(lines("utc,a", digits, ACC[0]))).sampling_rate == pytest.approx(10)


@pytest.mark.parametrize(("start", "step", "rate"), [(14_475_900, 1, 1), (5_000, 1, 1), (12_345_678, 10, 100)])
def test_counters_are_no_digits_of_a_clock(text_file, start, step, rate) -> None:
    counted = read(text_file(lines("time,a", start + step * np.arange(N), ACC[0])))
    assert counted.sampling_rate == pytest.approx(rate)


def test_unit_that_does_not_show_is_asked_for(text_file) -> None:
    path = text_file(lines("time,a,b", 20.05 * np.arange(N), *ACC))
    with pytest.raises(
        FormatError, match=r"'time' advances by 20.05 .* 0.0499 Hz in seconds; 49.88 Hz in ms: state its unit"
    ):
        read(path)
    assert read(path, sampling_rate=50).sampling_rate == pytest.approx(49.88, abs=0.01)
    path = text_file(lines("time,a,b", range(0, 100 * N, 100), *ACC))
    with pytest.raises(FormatError, match="10 Hz in ms; 1e\\+04 Hz in us: state its unit"):
        read(path)


def test_even_column_without_a_name_of_time_is_asked_for(text_file) -> None:
    path = text_file(lines("stamp,a,b", 0.01 * np.arange(N), *ACC))
    with pytest.raises(ParameterError, match=r"has no time column by name, but 'stamp' rises evenly: .* --time stamp"):
        read(path)
    assert read(path, sampling_rate=100).names == ("stamp", "a", "b")
    assert read(text_file(lines("time,stamp,a,b", *[0.01 * np.arange(N)] * 2, *ACC))).names == ("stamp", "a", "b")


@pytest.mark.parametrize("ending", [".parquet", ".npz", ".mat"])
def test_clocks_in_other_formats(tmp_path: Path, ending) -> None:
    columns = {"PacketCounter": np.arange(N), "time_ms": 10 * np.arange(N), "a": ACC[0], "b": ACC[1]}
    path = tmp_path / f"run{ending}"
    if ending == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table(columns), path)
    elif ending == ".npz":
        np.savez(path, **columns)
    else:
        from scipy.io import savemat

        savemat(path, columns)
    recording = read(path)
    assert recording.names == ("a", "b")
    assert recording.sampling_rate == pytest.approx(100)


def test_epoch_in_a_stated_unit_gives_the_start(text_file) -> None:
    start = 1_717_156_800_000_000
    recording = read(text_file(lines("timestamp_us,a", start + 10_000 * np.arange(N), ACC[0])))
    assert recording.start == start * 1000


def test_export_of_a_telephone(text_file) -> None:
    """Nanoseconds since 1970, and seconds since the start."""
    start = 1_717_156_800_123_000_000
    path = text_file(lines("time,seconds_elapsed,z,y", start + 10_000_000 * np.arange(N), 0.01 * np.arange(N), *ACC))
    recording = read(path)
    assert recording.names == ("z", "y")
    assert recording.start == pytest.approx(start, abs=1000)
    assert recording.sampling_rate == pytest.approx(100)


RELAXED = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
signals = st.sampled_from(["walk", "integrated", "drift", "ramp", "steps"])


def signal(kind, seed):
    rng = np.random.default_rng(seed)
    rising = np.arange(2000) * 10.0 ** rng.integers(-6, 2)
    if kind == "walk":
        return np.cumsum(rng.standard_normal(2000))
    if kind == "integrated":
        return np.cumsum(np.cumsum(rng.standard_normal(2000)))
    if kind == "drift":
        return 20 + rising + rng.standard_normal(2000) * np.ptp(rising) / 100
    if kind == "steps":  # temperature with a coarse resolution
        return np.round(20 + 3 * np.arange(2000) / 2000, 1)
    return rising


@pytest.mark.slow
@RELAXED
@given(
    kind=signals,
    seed=st.integers(0, 10_000),
    name=st.sampled_from(["acc_z", "strain", "temp_s", "x", "disp_min", "t_front"]),
)
def test_motion_is_no_clock(tmp_path_factory, kind, seed, name) -> None:
    path = tmp_path_factory.mktemp("motion") / "run.csv"
    values = signal(kind, seed)
    path.write_text(lines(f"time,{name},b", np.arange(2000) / 100, values, np.sin(np.arange(2000))))
    assert read(path).names == (name, "b")
    path.write_text(lines(f"{name},b", values, np.sin(np.arange(2000))))
    assert read(path, sampling_rate=100).names == (name, "b")


@pytest.mark.slow
@RELAXED
@given(kind=signals.filter(lambda kind: kind != "ramp"), seed=st.integers(0, 10_000))
def test_motion_in_the_first_column_without_names_is_no_clock(tmp_path_factory, kind, seed) -> None:
    path = tmp_path_factory.mktemp("motion") / "run.csv"
    path.write_text(lines("", signal(kind, seed), np.sin(np.arange(2000))).lstrip())
    with pytest.raises(ParameterError, match="has no time column"):
        read(path)
    assert read(path, sampling_rate=100).names == ("column_1", "column_2")
