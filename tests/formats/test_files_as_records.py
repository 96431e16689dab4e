"""Files as records: held together where they are small, one at a time where they are large together."""

import numpy as np
import pytest

from sprung.formats import read, read_records, write
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
