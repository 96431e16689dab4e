"""Files of NumPy."""

from pathlib import Path

import numpy as np
import pytest

from sprung.errors import DataError, FormatError, ParameterError
from sprung.formats import ReadSettings, read

SIGNAL = np.arange(50.0)


def npz(folder, **arrays):
    path = folder / "run.npz"
    np.savez(path, **arrays)
    return path


def test_date_times_in_npz(tmp_path: Path) -> None:
    stamps = np.datetime64("2024-05-31T12:00:00", "ns") + np.arange(50) * np.timedelta64(5, "ms")
    recording = read(npz(tmp_path, timestamp=stamps, left=SIGNAL))
    assert recording.start == 1_717_156_800_000_000_000
    assert recording.sampling_rate == 200


def test_npy_of_times_alone_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "acc_t.npy", np.arange(1000) / 104.0)
    with pytest.raises(DataError, match=r"acc_t.npy holds times alone: give the file with the samples"):
        read(tmp_path / "acc_t.npy")


def test_npy_of_one_and_two_dimensions(tmp_path: Path) -> None:
    np.save(tmp_path / "run.npy", np.stack([SIGNAL, 2 * SIGNAL, SIGNAL], axis=1).astype(np.float32))
    with pytest.raises(ParameterError, match="has no time column"):
        read(tmp_path / "run.npy")
    recording = read(tmp_path / "run.npy", sampling_rate=12)
    assert recording.names == ("channel_1", "channel_2", "channel_3")
    assert recording.samples[1].tolist() == (2 * SIGNAL).tolist()
    np.save(tmp_path / "one.npy", SIGNAL)
    assert read(tmp_path / "one.npy", sampling_rate=12, channels=["channel_1"]).n_samples == 50


def test_the_stated_time_decides_between_two(tmp_path: Path) -> None:
    path = npz(tmp_path, t=np.arange(50) / 20, time=np.arange(50) / 10, left=SIGNAL)
    with pytest.raises(FormatError, match="keep one of them, or name it with --time"):
        read(path)
    assert read(path, settings=ReadSettings(time="t")).sampling_rate == 20
