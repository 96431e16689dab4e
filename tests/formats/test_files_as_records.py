"""Files as records: held together where they are small, one at a time where they are large together."""

import gzip
import zipfile

import numpy as np
import pytest

from sprung.formats import read, read_records, write
from sprung.formats.table import Block, Doubles
from sprung.recording import Channel, Recording


@pytest.fixture
def path(tmp_path):
    samples = np.random.default_rng(1).standard_normal((2, 3000))
    channels = (Channel("a", "acceleration"), Channel("b", "acceleration"))
    write(Recording(samples, 100.0, channels), tmp_path / "run.csv")
    return tmp_path / "run.csv"


def test_small_files_are_read_at_once(path):
    steps = []
    recordings = read_records([path, path], on_progress=lambda step, share: steps.append((step, share)))
    assert steps == [("reading run.csv", 0.0)] * 2
    assert isinstance(recordings, list)
    for recording in recordings:
        np.testing.assert_array_equal(recording.samples, read(path).samples)


def test_files_small_by_themselves_but_large_together_are_not_held_together(path, monkeypatch):
    monkeypatch.setattr("sprung.formats.LARGE", 2 * path.stat().st_size)
    steps = []
    recordings = read_records([path] * 3, on_progress=lambda step, share: steps.append((step, share)))
    assert steps == []
    assert next(iter(recordings)).n_samples == 3000
    assert steps == [("reading run.csv", 0.0)]


def test_a_large_file_gives_several_records_with_all_its_samples(path, monkeypatch):
    monkeypatch.setattr("sprung.formats.LARGE", 1)
    monkeypatch.setattr("sprung.formats.BLOCK_SAMPLES", 1000)
    recordings = list(read_records([path]))
    assert len(recordings) > 1
    np.testing.assert_array_equal(np.hstack([part.samples for part in recordings]), read(path).samples)


def packed(path, kind):
    """Write a recording of rest that takes far fewer bytes than its rows."""
    table = path.with_name("rest.csv")
    table.write_text("time,a\n" + "".join(f"{k / 100:.2f},0\n" for k in range(20_000)))
    if kind == "parquet":
        write(read(table), path.with_name("rest.parquet"))
        return path.with_name("rest.parquet")
    file = path.with_name(f"rest.csv.{kind}")
    if kind == "gz":
        file.write_bytes(gzip.compress(table.read_bytes()))
    else:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(table, "rest.csv")
    return file


@pytest.mark.parametrize("kind", ["gz", "zip", "parquet"])
def test_packed_files_are_as_large_as_what_they_hold(path, kind, monkeypatch):
    file = packed(path, kind)
    monkeypatch.setattr("sprung.formats.LARGE", 150_000)
    monkeypatch.setattr("sprung.formats.BLOCK_SAMPLES", 5000)
    assert file.stat().st_size < 150_000
    recordings = list(read_records([file]))
    assert len(recordings) == 4
    assert sum(part.n_samples for part in recordings) == 20_000


def test_rows_that_all_repeat_the_stamp_before_are_compared_at_once(monkeypatch):
    def one_by_one(*_, **__):
        raise AssertionError("rows are compared one by one")

    monkeypatch.setattr(np, "array_equal", one_by_one)
    values = np.array([[1.0, 1.0, np.nan, np.nan, 2.0], [0.0, 0.0, 5.0, 5.0, 5.0]])
    doubles = Doubles()
    found = [doubles.update(Block(1, np.zeros(5), values)), doubles.update(Block(6, np.zeros(2), values[:, [4, 0]]))]
    assert np.concatenate(found).tolist() == [False, True, False, True, False, True, False]
