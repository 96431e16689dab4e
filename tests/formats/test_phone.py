"""Recordings of phones, in the layouts of their apps: Sensor Logger, phyphox, Physics Toolbox."""

import json
import zipfile

import numpy as np
import pytest

from sprung.errors import FormatError, ParameterError
from sprung.formats import groups, read
from sprung.formats.settings import ReadSettings

START = 1_698_501_144_401_000_000
VALUES = np.random.default_rng(41).standard_normal((3, 50)).round(6)
METADATA = {
    "sensor": "Metadata",
    "version": "3",
    "device name": "SM-G970F",
    "recording time": "2023-10-28_13-52-24",
    "platform": "android",
    "sensors": "Accelerometer|Gyroscope",
}


def times(n=50, step=10_000_000):
    return [START + k * step for k in range(n)]


def records(sensor, n=50, step=10_000_000, values=VALUES):
    """Return records as Sensor Logger exports them: all numbers are texts."""
    return [
        {"sensor": sensor, "time": str(time), "seconds_elapsed": str(k * step * 1e-9)}
        | {axis: str(values[row, k]) for row, axis in enumerate("xyz")}
        for k, time in enumerate(times(n, step))
    ]


def archive(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, text in members.items():
            file.writestr(name.replace("__", "/").replace("_csv", ".csv").replace("_", " "), text)
    return path


def table(headings, columns, delimiter=",", decimal="."):
    rows = [delimiter.join(f'"{heading}"' for heading in headings)]
    rows += [delimiter.join(f"{value!r}".replace(".", decimal) for value in row) for row in columns]
    return "\n".join(rows) + "\n"


def test_json_of_sensor_logger(tmp_path) -> None:
    content = [*records("Accelerometer"), *records("Gyroscope"), *records("Barometer", 5, 10**9), METADATA]
    content.append({"sensor": "Annotation", "time": str(START), "seconds_elapsed": "0", "text": "bump"})
    (tmp_path / "run.json").write_text(json.dumps(content))
    found = {group.name: group.headings for group in groups(tmp_path / "run.json")}
    axes = ("x", "y", "z")
    assert found == {
        name: tuple(f"{name}_{axis}" for axis in axes) for name in ("Accelerometer", "Gyroscope", "Barometer")
    }
    run = read(tmp_path / "run.json", settings=ReadSettings(groups=["Accelerometer", "Gyroscope"]))
    assert np.array_equal(run.samples, np.tile(VALUES, (2, 1)))
    assert [channel.quantity for channel in run.channels] == ["acceleration"] * 3 + ["angular_velocity"] * 3
    assert (run.sampling_rate, run.start) == (100, START)
    assert run.comment == "SM-G970F; android; 2023-10-28_13-52-24"
    with pytest.raises(ParameterError, match="3 groups of channels with different clocks"):
        read(tmp_path / "run.json")
    assert read(tmp_path / "run.json", channels=["Gyroscope_y"]).names == ("Gyroscope_y",)


@pytest.mark.parametrize(("platform", "quantity"), [("android", "acceleration"), ("ios", "unknown")])
def test_units_that_depend_on_the_phone(tmp_path, platform, quantity) -> None:
    content = [METADATA | {"platform": platform}, *records("AccelerometerUncalibrated")]
    (tmp_path / "run.json").write_text(json.dumps(content, indent=1))
    run = read(tmp_path / "run.json")
    assert run.names == ("x", "y", "z")
    assert {channel.quantity for channel in run.channels} == {quantity}


def test_records_without_dates_count_seconds_and_may_lack_values(tmp_path) -> None:
    content = [{"sensor": "a", "seconds_elapsed": 0.02 * k, "x": k, "late": k} for k in range(40)]
    for record in content[:10]:
        del record["late"]
    (tmp_path / "run.json").write_text(json.dumps(content))
    run = read(tmp_path / "run.json", channels=["x"])
    assert (run.start, run.sampling_rate) == (None, 50)
    assert np.array_equal(run.samples, [np.arange(40)])
    assert np.array_equal(read(tmp_path / "run.json").samples, np.tile(np.arange(10, 40), (2, 1)))


def test_long_lists_are_read_in_pieces(tmp_path) -> None:
    values = np.random.default_rng(2).standard_normal((3, 12_000)).round(6)
    text = json.dumps(records("Accelerometer", 12_000, values=values))
    assert len(text) > 1.5e6
    (tmp_path / "run.json").write_text(text)
    assert np.array_equal(read(tmp_path / "run.json").samples, values)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            '[{"sensor": "a", "x": 1}, {"sensor"',
            "character 26: this is not a record .*damaged or incomplete",
        ),
        ('[{"sensor": "a", "x": 1} 5]', "records have up to 65536 characters"),
        ('[{"sensor": "a", "x": ' + "[" * 60_000, "brackets within brackets"),
        ('[{"sensor": "a", "x": 1}, ' + "[" * 2_000_000, "brackets within brackets"),
        ('[{"sensor": "a", "x": "' + "y" * 3_000_000 + '"}]', "this is not a record of a sensor"),
        ('[{"sensor": "a", "x": 1}]', "holds no samples: no sensor has times and numbers"),
        ('[{"sensor": "a", "x": 1' + "0" * 5000 + "}]", "cannot be read as a phone recording"),
        (json.dumps([{"sensor": str(k)} for k in range(501)]), "names more than 500 sensors"),
    ],
)
def test_damaged_deep_and_long_json(tmp_path, text, words) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(FormatError, match=f"run.json.*{words}"):
        read(tmp_path / "run.json")


def test_archive_of_sensor_logger(tmp_path) -> None:
    headings = ["time", "seconds_elapsed", "z", "y", "x"]
    rows = [(time, 0.01 * k, *VALUES[::-1, k].tolist()) for k, time in enumerate(times())]
    path = archive(
        tmp_path / "2023-10-28_13-52-24.zip",
        Accelerometer_csv=table(headings, rows),
        Gyroscope_csv=table(headings, rows),
        Annotation_csv="time,seconds_elapsed,text\n",
        Metadata_csv="version,device name,platform\n3,SM-G970F,android\n",
        Camera__frame="...",
    )
    run = read(path)
    assert run.names == tuple(f"{sensor}_{axis}" for sensor in ("Accelerometer", "Gyroscope") for axis in "zyx")
    assert np.array_equal(run.samples, np.tile(VALUES[::-1], (2, 1)))
    assert [channel.quantity for channel in run.channels] == ["acceleration"] * 3 + ["angular_velocity"] * 3
    assert (run.start, run.sampling_rate) == (START, 100)
    assert run.comment == "SM-G970F; android"


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (";", ","), ("\t", ".")])
def test_archive_of_phyphox(tmp_path, delimiter, decimal) -> None:
    seconds = np.arange(50) / 100
    headings = ["Time (s)", "Acceleration x (m/s^2)", "Acceleration y (m/s^2)", "Acceleration z (m/s^2)"]
    rows = np.column_stack([seconds, VALUES.T]).tolist()
    events = table(
        ["event", "experiment time", "system time", "system time text"],
        [
            ("START", 0.0, 1698501144.25, "x"),
            ("PAUSE", 0.245, 1698501144.495, "x"),
            ("START", 0.245, 1698501150.495, "x"),
        ],
        delimiter,
        decimal,
    ).replace("'", '"')
    path = archive(
        tmp_path / "run.zip",
        Raw_Data_csv=table(headings, rows, delimiter, decimal),
        meta__device_csv='"property","value"\n"deviceModel","SM-G970F"\n"deviceBrand","samsung"\n',
        meta__time_csv=events,
    )
    run = read(path)
    assert run.names == ("Acceleration x", "Acceleration y", "Acceleration z")
    assert {channel.quantity for channel in run.channels} == {"acceleration"}
    assert np.array_equal(run.samples, VALUES)
    assert run.start == 1_698_501_144_250_000_000
    assert [(gap.index, gap.duration) for gap in run.gaps] == [(25, pytest.approx(6.0))]
    assert run.comment == "samsung; SM-G970F"


def test_sensors_of_phyphox_with_times_of_their_own(tmp_path) -> None:
    headings = ["Time (s)", "X (m/s^2)", "Y (m/s^2)", "Z (m/s^2)"]
    turned = ["Time (s)", "X (rad/s)", "Y (rad/s)", "Z (rad/s)"]
    rows = [np.column_stack([np.arange(50) / 100 + late, VALUES.T]).tolist() for late in (0.0, 0.003)]
    path = archive(
        tmp_path / "run.zip",
        Accelerometer_csv=table(headings, rows[0]),
        Gyroscope_csv=table(turned, rows[1]),
        meta__device_csv='"property","value"\n',
    )
    assert [group.name for group in groups(path)] == ["Accelerometer", "Gyroscope"]
    run = read(path, settings=ReadSettings(groups=["Gyroscope"]))
    assert run.names == ("Gyroscope_X", "Gyroscope_Y", "Gyroscope_Z")
    assert {channel.quantity for channel in run.channels} == {"angular_velocity"}


def test_archives_that_are_too_large_or_hold_no_samples(tmp_path) -> None:
    path = archive(tmp_path / "run.zip", **{f"a{k}_csv": "x\n" for k in range(1001)})
    with pytest.raises(FormatError, match=r"run.zip holds 1001 files of 2002 bytes: unpack it"):
        read(path)
    path = archive(tmp_path / "run.zip", a_csv="b,c\n1,2\n", b_csv="", photo="x")
    with pytest.raises(FormatError, match=r"run.zip holds no samples: no sensor has times and numbers"):
        read(path)
    content = bytearray(archive(tmp_path / "run.zip", a_csv="time,x\n1,2\n", b_csv="time,x\n1,2\n").read_bytes())
    size = content.rindex(b"PK\x01\x02") + 24
    content[size : size + 4] = (2**31).to_bytes(4, "little")
    path.write_bytes(content)
    with pytest.raises(FormatError, match=r"run.zip holds 2 files of 21474836\d\d bytes"):
        read(path)
    path = archive(tmp_path / "run.zip", a_csv="time,x\n1,2\n3\n", photo="x")
    with pytest.raises(FormatError, match=r"run.zip, a.csv: .*: the table is damaged"):
        read(path)


def test_plain_tables_of_phyphox_and_physics_toolbox(text_file) -> None:
    rows = np.column_stack([np.arange(50) / 100, VALUES.T]).tolist()
    headings = ["Time (s)", "Acceleration x (m/s^2)", "Acceleration y (m/s^2)", "Acceleration z (m/s^2)"]
    run = read(text_file(table(headings, rows, ";", ",")))
    assert run.names == ("Acceleration x", "Acceleration y", "Acceleration z")
    assert (run.sampling_rate, run.channels[0].quantity) == (100, "acceleration")
    assert np.array_equal(run.samples, VALUES)
    run = read(text_file(table(["time", "gFx", "gFy", "gFz"], rows).replace('"', "")))
    assert (run.names, run.sampling_rate) == (("gFx", "gFy", "gFz"), 100)
