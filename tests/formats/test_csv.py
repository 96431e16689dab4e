import gzip
import zipfile
from pathlib import Path

import numpy as np
import pytest

from sprung.errors import DataError, FormatError, ParameterError
from sprung.formats import read, read_blocks
from sprung.formats.settings import ReadSettings

G = 9.80665


def test_units_in_brackets_are_converted(text_file) -> None:
    path = text_file("time,acc_fl [g],pitch rate (deg/s),speed [km/h],note (raw)\n0,1,180,36,5\n0.01,-2,90,72,6\n")
    recording = read(path)
    assert recording.names == ("acc_fl", "pitch rate", "speed", "note (raw)")
    assert [channel.quantity for channel in recording.channels] == [
        "acceleration",
        "angular_velocity",
        "speed",
        "unknown",
    ]
    expected = [[G, -2 * G], [np.pi, np.pi / 2], [10, 20], [5, 6]]
    assert recording.samples == pytest.approx(np.array(expected))
    assert recording.sampling_rate == 100
    assert recording.start is None


@pytest.mark.parametrize(
    "text",
    [
        "time,a,b\n0,1.5,2\n0.5,-3,4e1\n",
        "time;a;b\n0;1.5;2\n0.5;-3;4e1\n",
        "time;a;b\n0;1,5;2\n0,5;-3;4e1\n",
        "time\ta\tb\n0\t1.5\t2\n0.5\t-3\t4e1\n",
        "time\ta\tb\r\n0\t1,5\t2\r\n0,5\t-3\t4e1\r\n",
        '"time","a","b"\n0,"1.5", 2\n0.5,-3 ,4E+1',
        "\ufefftime,a,b\n0,1.5,2\n0.5,-3,4e1\n",
        "sep=,\nDevice:,car 7\n\nStart: 2025,x\ntime,a,b\n\n0,1.5,2\n0.5,-3,4e1\n",
        "time,,a,b,\n0,,1.5,2,\n0.5,,-3,4e1,\n",
        "time,a,b\ns,,\n0,1.5,2\n0.5,-3,4e1\n",
        "time,a [],b [-]\n0,1.5,2\n0.5,-3,4e1\n",
        "Car 7\ntime;a;b\ns;-;\n0;1.5;2\n0.5;-3;4e1\n",
        "time a b\n0 1.5 2\n0.5 -3 4e1\n",
        "  time     a      b\n   0.0   1.5    2.0\n   0.5  -3.0   40.0\n",
        "time [s]  a  b\n0 1.5 2\n0.5 -3 4e1\n",
        "0 1.5 2\n0.5 -3 4e1\n".join(["# time a b\n", ""]),
        "# time, a, b\n0,1.5,2\n0.5,-3,4e1\n",
        "% made by hand\n% time a b\n0 1.5 2\n0.5 -3 4e1\n",
        "// note\ntime,a,b\n// note\n0,1.5,2\n// note\n0.5,-3,4e1\n// end",
        "sep=|\ntime|a|b\n0|1.5|2\n0.5|-3|4e1\n",
        "time;a;b\n0;1,5;2\n0,5;-3;40\n",
        "time a b\n0 1,5 2\n0,5 -3,0 40\n",
        "time,a,b,\n0,1.5,2,\n0.5,-3,4e1,\n",
        "time,a,b\n0,1.5,2,\n0.5,-3,4e1,\n",
        "time,a,b,\n0,1.5,2\n0.5,-3,4e1\n",
        '"time";"a";"b"\n"0";"1,5";"2"\n"0,5";"-3";"40"\n',
        "time,a,b,note\n0,1.5,2,left\n0.5,-3,4e1,right\n",
    ],
)
def test_dialects(text_file, text) -> None:
    recording = read(text_file(text))
    assert recording.names == ("a", "b")
    assert recording.samples.tolist() == [[1.5, -3], [2, 40]]
    assert recording.sampling_rate == 2


def test_line_of_units_under_the_names(text_file) -> None:
    recording = read(text_file("time;acc;speed\ns;g;km/h\n0;1;36\n1;2;72\n"))
    assert recording.names == ("acc", "speed")
    assert recording.samples == pytest.approx(np.array([[G, 2 * G], [10, 20]]))


def test_latin_1_and_utf_8(text_file) -> None:
    for encoding in ("latin-1", "utf-8"):
        recording = read(text_file("time,größe,rate [°/s]\n0,1,180\n1,2,0\n".encode(encoding)))
        assert recording.names == ("größe", "rate")
        assert recording.samples[1, 0] == pytest.approx(np.pi)


def test_packed_files(text_file, tmp_path: Path) -> None:
    text = b"time,a\n0,1\n1,2\n"
    (tmp_path / "run.csv.gz").write_bytes(gzip.compress(text))
    with zipfile.ZipFile(tmp_path / "run.csv.zip", "w") as archive:
        archive.writestr("inside.csv", text)
    for name in ("run.csv.gz", "run.csv.zip"):
        assert read(tmp_path / name).samples.tolist() == [[1, 2]]
    with zipfile.ZipFile(tmp_path / "two.csv.zip", "w") as archive:
        archive.writestr("a.csv", text)
        archive.writestr("b.csv", text)
    assert read(tmp_path / "two.csv.zip").names == ("a_a", "b_a")
    (tmp_path / "short.csv.gz").write_bytes(gzip.compress(text * 1000)[:-20])
    with pytest.raises(FormatError, match=r"short.csv.gz"):
        read(tmp_path / "short.csv.gz")


@pytest.mark.parametrize(
    ("name", "stamps", "start", "rate"),
    [
        ("timestamp", ["2024-05-31 12:00:00.000", "2024-05-31 12:00:00.250"], 1_717_156_800_000_000_000, 4),
        ("Time (-)", ["2024-05-31T12:00:00Z", "2024-05-31T12:00:00.125Z"], 1_717_156_800_000_000_000, 8),
        ("time", ["2024-05-31 14:00:00+02:00", "2024-05-31 14:00:00.5+02:00"], 1_717_156_800_000_000_000, 2),
        ("timestamp", ["1717156800000", "1717156800100"], 1_717_156_800_000_000_000, 10),
        ("TimeStamp", ["1717156800", "1717156802"], 1_717_156_800_000_000_000, 0.5),
        ("t_s", ["1717156800", "1717156802"], None, 0.5),
        ("Time [ms]", ["17", "27"], None, 100),
        ("T", ["1e1", "1.2e1"], None, 0.5),
    ],
)
def test_time_columns(text_file, name, stamps, start, rate) -> None:
    recording = read(text_file(f"{name},a\n{stamps[0]},1\n{stamps[1]},2\n"))
    assert recording.start == start
    assert recording.sampling_rate == pytest.approx(rate)


def test_sampling_rate_must_agree_with_time(text_file) -> None:
    path = text_file("time,a\n0,1\n0.01,2\n0.02,3\n")
    assert read(path, sampling_rate=100.5).sampling_rate == 100
    with pytest.raises(ParameterError, match=r"sampling_rate=104.36 contradicts the time column 'time'.* 100 Hz"):
        read(path, sampling_rate=104.36)
    with pytest.raises(ParameterError, match="sampling_rate=-1 must be above 0"):
        read(path, sampling_rate=-1)


def test_channels_are_chosen_by_name_in_any_order(text_file) -> None:
    path = text_file("time,label,a [g],b,c [furlong]\n0,left,1,2,3\n1,right,4,5,6\n")
    recording = read(path, channels=["b", "a"])
    assert recording.names == ("b", "a")
    assert recording.samples == pytest.approx(np.array([[2, 5], [G, 4 * G]]))
    with pytest.raises(ParameterError, match="has no channel 'd': choose from label, a, b, c"):
        read(path, channels=["d"])


@pytest.mark.slow
def test_text_far_down_names_its_line(text_file) -> None:
    rows = [f"{index},{index / 7:.9f}" for index in range(300_000)]
    rows[250_001] += "?"
    path = text_file("time,a\n" + "\n".join(rows))
    with pytest.raises(FormatError, match=r"line 250003, column 'a': '35714.428571429\?'"):
        next(read_blocks(path))


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (b"", FormatError, "is empty"),
        (b"time,a\n", FormatError, "holds no samples"),
        (b"\n\n\n", FormatError, "holds no samples"),
        (b"time,a\n0,1\n", DataError, "holds one sample"),
        (b"time,a,b\n0,,\n1,,\n", DataError, "holds no samples: every channel is empty"),
        (b"time,a\n0,nan\n1,nan\n2,nan\n", DataError, "holds no samples"),
        (b"0,1\n1,2\n", ParameterError, "has no time column"),
        (b"time,a,a\n0,1,2\n1,2,3\n", FormatError, "column name 'a' occurs more than once"),
        (b"time,a [g],a [m/s^2]\n0,1,2\n1,2,3\n", FormatError, "column name 'a' occurs more than once"),
        (b"time,[g]\n0,1\n1,2\n", FormatError, "has no name"),
        (b"time\n0\n1\n2\n", FormatError, "holds no channel"),
        (b"time,a\n0,1\n,2\n2,3\n", FormatError, "line 3: column 'time' holds no time"),
        (b"time,a\n0,1\n2,2\n1,3\n", FormatError, "line 4: time runs backwards"),
        (b"time,a,b\nnoon,1,2\nevening,2,3\n", FormatError, "time column 'time' holds 'noon'"),
        (b"\x00\x01\x02time,a\n", FormatError, "binary data"),
        ("time,a\n0,1\n1,2\n".encode("utf-16-le"), FormatError, "binary data"),
        (b"\x89PNG\r\n\x1a\n" + bytes(range(1, 256)) * 20, FormatError, "run.csv"),
        (b"x" * 400_000, FormatError, "line 1 is longer"),
        (b"time,a [furlong]\n0,1\n1,2\n", FormatError, r"run.csv: column 'a \[furlong\]': unit 'furlong' is unknown"),
        (b"a,b\n1,2\n3,4\n", ParameterError, r"run.csv has no time column .* --sampling-rate"),
        (b"time,a,b\n0,1,2\n1,1,2\n2,x7,2\n", FormatError, r"run.csv, line 4, column 'a': 'x7' is not a number"),
        (b"time,a\n0,abc\n1,2\n2,3\n", FormatError, "line 2, column 'a': 'abc' is not a number"),
        (b"time,a,b\n0,1,2\n1,1,2\n2,1\n3,1,2\n", FormatError, "line 4 has 2 fields, but the header has 3"),
        (b"time,a,b\n0,1,2\n1,1,2\n2,1,2,3\n3,1,2\n", FormatError, "line 4 has 4 fields, but the header has 3"),
        (b"time,a\n0,1,2\n1,2,3\n", FormatError, "line 2 has 3 fields, but the header has 2"),
    ],
)
def test_bad_text_is_refused_with_a_sentence(text_file, text, error, message) -> None:
    with pytest.raises(error, match=message):
        read(text_file(text), sampling_rate=None)


@pytest.mark.parametrize("value", ["-inf", "1e101"])
def test_channel_without_a_measured_value_is_dead_and_the_others_are_read(text_file, value) -> None:
    rows = [f"{index / 100:.2f},{np.sin(index):.4f},{value}" for index in range(100)]
    recording = read(text_file("time,a,b\n" + "\n".join(rows)))
    assert np.isfinite(recording.samples[0]).all()
    assert np.isnan(recording.samples[1]).all()
    assert any(line.startswith("b: ") and "in line 2, the first of 100 values" in line for line in recording.history)


@pytest.mark.parametrize("heading", ["timestamp,t,a", "timestamp,elapsed_s,a", "t,timestamp,a"])
def test_of_two_clocks_the_one_that_advances_evenly_is_taken(text_file, heading) -> None:
    late = np.random.default_rng(0).uniform(0, 0.008, 500)
    rows = [f"{k / 100 + late[k]:.4f},{k / 100:.2f},{np.sin(k):.4f}" for k in range(500)]
    path = text_file(heading + "\n" + "\n".join(rows))
    first, second, _ = heading.split(",")
    for channels in (None, ["a"]):
        recording = read(path, channels=channels)
        assert (recording.names, recording.n_samples) == (("a",), 500)
        assert f"time: column '{second}', as '{first}' does not advance evenly" in recording.history
    stated = read(path, settings=ReadSettings(time=first))
    assert any("with a standard deviation of" in line for line in stated.history)


def test_slow_channel_is_refused_by_name(text_file) -> None:
    rows = [f"{index / 100:.2f},{index},{index if index % 10 == 0 else ''}" for index in range(500)]
    path = text_file("time,acc,speed\n" + "\n".join(rows))
    with pytest.raises(DataError, match="channel 'speed' has a value in one of 10 rows only"):
        read(path)
    assert read(path, channels=["acc"]).n_samples == 500


def test_line_numbers_in_history_free_messages_stay_on_one_line(text_file) -> None:
    with pytest.raises(FormatError) as caught:
        read(text_file("time,a\n0,1\n1,'" + "y" * 300_000 + "\n"))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_one_channel_is_singular(text_file) -> None:
    recording = read(text_file("time,a\n0.00,1\n0.01,2\n0.02,3\n"))
    assert recording.history[0].endswith(": 1 channel, 3 rows")
