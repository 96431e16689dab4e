from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sprung.errors import FormatError
from sprung.formats import read

G = 9.80665


def parquet(folder, fields, arrays):
    path = folder / "run.parquet"
    pq.write_table(pa.Table.from_arrays([pa.array(array) for array in arrays], schema=pa.schema(fields)), path)
    return path


def test_unit_from_metadata_and_from_the_name(tmp_path: Path) -> None:
    fields = [
        pa.field("timestamp", pa.timestamp("us", "UTC")),
        pa.field("a", pa.float32(), metadata={"unit": "g"}),
        pa.field("b [deg/s]", pa.int16()),
        pa.field("c", pa.float64(), metadata={"unit": ""}),
    ]
    stamps = [1_700_000_000_000_000, 1_700_000_000_020_000, 1_700_000_000_040_000]
    recording = read(parquet(tmp_path, fields, [stamps, [1, 2, 3], [180, 90, 0], [1.5, 2.5, 3.5]]))
    assert recording.names == ("a", "b", "c")
    assert recording.start == 1_700_000_000_000_000_000
    assert recording.sampling_rate == 50
    assert recording.samples == pytest.approx(np.array([[G, 2 * G, 3 * G], [np.pi, np.pi / 2, 0], [1.5, 2.5, 3.5]]))


def test_index_of_date_times_without_a_name_is_time(tmp_path: Path) -> None:
    fields = [pa.field("a", pa.float64()), pa.field("__index_level_0__", pa.timestamp("ns"))]
    recording = read(parquet(tmp_path, fields, [[1.0, 2.0], [10**18, 10**18 + 10**8]]))
    assert (recording.names, recording.start, recording.sampling_rate) == (("a",), 10**18, 10)


def test_nulls_are_missing_values(tmp_path: Path) -> None:
    values = [None if index == 7 else index for index in range(30)]
    fields = [pa.field("t", pa.float64()), pa.field("a", pa.int32())]
    recording = read(parquet(tmp_path, fields, [np.arange(30) / 10, values]))
    assert recording.n_samples == 29
    assert [gap.index for gap in recording.gaps] == [7]


def test_text_column_is_refused_by_name_and_can_be_left_out(tmp_path: Path) -> None:
    fields = [pa.field("t", pa.float64()), pa.field("a", pa.float64()), pa.field("label", pa.string())]
    path = parquet(tmp_path, fields, [[0.0, 1.0], [1.0, 2.0], ["x", "y"]])
    with pytest.raises(FormatError, match="column 'label' holds string, not numbers"):
        read(path)
    assert read(path, channels=["a"]).names == ("a",)


def test_infinite_values_are_missing_and_named(tmp_path: Path) -> None:
    fields = [pa.field("t", pa.float64()), pa.field("a", pa.float64())]
    values = np.cos(np.arange(50.0))
    values[[1, 30]] = -np.inf
    recording = read(parquet(tmp_path, fields, [np.arange(50) / 100, values]))
    assert recording.n_samples == 48
    assert "a: -inf in row 2, the first of 2 values, cannot be measured: taken as missing" in recording.history
