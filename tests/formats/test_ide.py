"""Recordings of enDAQ: a real one and its copy, and small ones written here."""

import logging
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from tests.formats.conftest import joined, table_of

from sprung.formats import ReadSettings, groups, ide, read

importer: Any = ide._importer()
ebmlite: Any = pytest.importorskip("ebmlite")


def block(channel, start, end, samples):
    payload = np.ascontiguousarray(samples).tobytes()
    stamps = {"StartTimeCodeAbs": start, "EndTimeCodeAbs": end}
    return {"ChannelIDRef": channel, **stamps, "ChannelDataPayload": payload}


def axis(number, name, unit, calibration):
    return {
        "SubChannelID": number,
        "SubChannelName": name,
        "SubChannelUnits": unit,
        "SubChannelLabel": "Quantity",
        "SubChannelSensorRef": 3,
        "SubChannelCalibrationIDRef": calibration,
    }


def header():
    """Two channels: two axes of acceleration, whose calibration needs the mean temperature, and the temperature."""
    acc = [axis(0, "X (40g)", "g", 2), axis(1, "Y (40g)", "g", 1)]
    channels = [
        {"ChannelID": 8, "ChannelName": "Acceleration", "ChannelFormat": "<hh", "SubChannel": acc},
        {
            "ChannelID": 36,
            "ChannelName": "Inside",
            "ChannelFormat": "<h",
            "SubChannel": [axis(0, "Inside:00", "°C", 4)],
        },
    ]
    for channel in channels:
        channel["TimeCodeScale"] = "1.0/1000000"
    polynomials = {
        "UnivariatePolynomial": [
            {"CalID": 1, "CalReferenceValue": 10.0, "PolynomialCoef": [0.001, 0.5]},
            {"CalID": 4, "CalReferenceValue": 0.0, "PolynomialCoef": [0.1, 0.0]},
        ],
        "BivariatePolynomial": [
            {
                "CalID": 2,
                "CalReferenceValue": 0.0,
                "BivariateCalReferenceValue": 20.0,
                "BivariateChannelIDRef": 36,
                "BivariateSubChannelIDRef": 0,
                "PolynomialCoef": [0.0001, 0.001, 0.0, 0.0],
            }
        ],
        "CalibrationDate": 1_600_000_000,
    }
    sensors = [{"SensorID": 3, "SensorName": "ADXL357", "TraceabilityData": {"SensorSerialNumber": "77"}}]
    properties = {
        "RecorderInfo": {"ProductName": "S3-D40", "RecorderSerial": 4711},
        "SensorList": {"Sensor": sensors},
        "ChannelList": {"Channel": channels},
    }
    return {"RecordingProperties": properties, "CalibrationList": polynomials, "TimeBaseUTC": 1_700_000_000}


def written(path: Path, *, n_blocks=20, n_samples=50) -> tuple[Path, Any]:
    """Write a recording of 1000 Hz, 2 s after the start of its clock; return its path and the raw samples."""
    schema = ebmlite.loadSchema("mide_ide.xml")
    raw = np.random.default_rng(5).integers(-3000, 3000, (n_blocks * n_samples, 2)).astype("<i2")
    with path.open("wb") as file:
        schema.encode(file, header(), headers=True)
        for number in range(n_blocks):
            first = number * n_samples
            start = 2_000_000 + 1000 * first
            blocks = [block(8, start, start + 1000 * (n_samples - 1), raw[first : first + n_samples])]
            blocks.append(block(36, start, start, np.array([240 + number], dtype="<i2")))
            file.write(b"".join(schema["ChannelDataBlock"].encode(item) for item in blocks))
    return path, raw


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return written(tmp_path / "run.IDE")[0]


def test_each_channel_is_a_group(path):
    acc, temperature = groups(path)
    assert (acc.name, acc.headings, acc.n_rows) == ("Acceleration", ("X (40g)", "Y (40g)"), 1000)
    assert (temperature.name, temperature.headings, temperature.n_rows) == ("Inside", ("Quantity",), 20)
    assert acc.clock != temperature.clock


def test_values_are_calibrated_with_the_mean_of_the_other_channel(tmp_path):
    path, raw = written(tmp_path / "run.ide")
    table = table_of(path, "Acceleration")
    values = joined(table).values
    temperature = np.mean(24 + 0.1 * np.arange(20))
    np.testing.assert_allclose(values[0], raw[:, 0] * (0.0001 * (temperature - 20) + 0.001), rtol=1e-9)
    np.testing.assert_allclose(values[1], 0.001 * (raw[:, 1] - 10.0) + 0.5, rtol=1e-9)


def test_units_sensor_calibration_and_start_are_carried(path):
    recording = read(path, settings=ReadSettings(groups=["Acceleration"]))
    x, y = recording.channels
    assert (x.quantity, x.comment) == ("acceleration", "ADXL357, serial number 77")
    assert y.calibration == "(0.001*(x-10.0))+0.5; calibrated 2020-09-13"
    assert recording.sampling_rate == pytest.approx(1000)
    assert abs((recording.start or 0) - 1_700_000_002_000_000_000) < 1000
    assert recording.comment == "S3-D40, serial number 4711"


def test_the_logging_of_the_program_stays_as_it_is(monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "idelib"]:
        monkeypatch.delitem(sys.modules, name)
    root = logging.getLogger()
    monkeypatch.setattr(root, "handlers", [])
    ide._importer()
    assert root.handlers == []


def test_the_drive_equals_its_copy(real_file):
    path = real_file("endaq_car_ide/GPS-Chick-Fil-A_003.IDE")
    rates = {}
    with h5py.File(real_file("endaq_car_ide/GPS-Chick-Fil-A_003.h5")) as copy:
        for name, twin in zip(sorted(copy), groups(path), strict=True):
            table, expected = twin.open(None), copy[name]
            rows = joined(table)
            np.testing.assert_allclose(rows.stamps, expected["t_s"], rtol=1e-12)
            for column, values in zip(table.columns, rows.values, strict=True):
                key = column.name.replace(" ", "_")
                if key in expected:
                    np.testing.assert_allclose(values, expected[key], rtol=1e-6, atol=1e-6)
            rates[twin.name] = expected.attrs["fs_Hz"]
    assert {"100g PE Acceleration", "40g DC Acceleration"} <= set(rates)
    for name, unit in (("100g PE Acceleration", "m/s^2"), ("40g DC Acceleration", "m/s^2")):
        recording = read(path, settings=ReadSettings(groups=[name]))
        assert [channel.unit for channel in recording.channels][:3] == [unit] * 3
        assert recording.sampling_rate == pytest.approx(rates[name], rel=1e-4)
    assert [column.name for column in table_of(path, "40g DC Acceleration").columns] == [
        "X (40g)",
        "Y (40g)",
        "Z (40g)",
    ]
