"""NPZ, NPY and MAT: which arrays are channels, and what they are called."""

import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from sprung.errors import DataError, FormatError, MixedRatesError
from sprung.formats import read

G = 9.80665
SIGNAL = np.arange(50.0)
TIMES = np.arange(50) / 200


def npz(folder, **arrays):
    path = folder / "run.npz"
    np.savez(path, **arrays)
    return path


def mat(folder, **arrays):
    path = folder / "run.mat"
    savemat(path, arrays)
    return path


def mat73(folder, **arrays):
    """As MATLAB writes it: every matrix transposed, texts as codes, cells as references."""
    path = folder / "run73.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            write73(file, file, name, array)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as raw:
        raw.write(head)
    return path


def write73(file, group, name, array):
    if isinstance(array, dict):
        for key, value in array.items():
            write73(file, group.require_group(name), key, value)
        return
    array = np.asarray(array)
    if array.dtype.kind == "U":
        cells = file.require_group("#refs#")
        references = np.empty((array.size, 1), dtype=h5py.ref_dtype)
        for index, text in enumerate(array):
            cell = cells.create_dataset(f"{name}{index}", data=np.array([[ord(letter)] for letter in text], np.uint16))
            cell.attrs["MATLAB_class"] = np.bytes_("char")
            references[index, 0] = cell.ref
        group.create_dataset(name, data=references)
    else:
        group.create_dataset(name, data=np.atleast_2d(array).T)


WRITERS = pytest.mark.parametrize("write", [npz, mat, mat73])


@WRITERS
@pytest.mark.parametrize("transposed", [False, True])
def test_matrix_with_names_and_units(tmp_path: Path, write, transposed) -> None:
    samples = np.stack([SIGNAL, -SIGNAL])
    channels, units = np.array(["front", "rear"]), np.array(["g", "m/s^2"])
    if write is mat:
        channels, units = channels.astype(object), units.astype(object)
    path = write(tmp_path, data=samples.T if transposed else samples, channels=channels, units=units, fs=200.0)
    recording = read(path)
    assert recording.names == ("front", "rear")
    assert recording.sampling_rate == 200
    assert recording.samples == pytest.approx(np.stack([SIGNAL * G, -SIGNAL]))
    assert read(path, channels=["rear"]).samples.tolist() == [(-SIGNAL).tolist()]


@WRITERS
def test_every_array_as_long_as_time_is_a_channel(tmp_path: Path, write) -> None:
    path = write(tmp_path, t=TIMES, left=SIGNAL, imu=np.stack([SIGNAL, 2 * SIGNAL]), positions=np.arange(4.0), gain=3.0)
    recording = read(path)
    assert set(recording.names) == {"left", "imu_1", "imu_2"}
    assert recording.samples[recording.index("imu_2")].tolist() == (2 * SIGNAL).tolist()
    assert recording.sampling_rate == 200


@WRITERS
def test_arrays_of_two_lengths_are_refused(tmp_path: Path, write) -> None:
    path = write(tmp_path, left=SIGNAL, right=SIGNAL[:40], fs=10.0)
    with pytest.raises(MixedRatesError, match="'right' has 40 samples, others have 50"):
        read(path)
    assert read(path, channels=["right"]).n_samples == 40


@pytest.mark.parametrize("write", [mat, mat73])
def test_structures_one_level_down(tmp_path: Path, write) -> None:
    path = write(tmp_path, run={"time": TIMES, "acc": SIGNAL}, rear={"acc": -SIGNAL})
    recording = read(path)
    first, second = recording.names
    assert first == "acc"  # the second of the name carries its structure's
    assert second in {"rear_acc", "run_acc"}
    assert recording.samples[:, 1].tolist() == ([1, -1] if second == "rear_acc" else [-1, 1])
    assert recording.sampling_rate == 200


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"data": np.zeros((3, 50)), "channels": np.array(["a", "b"]), "fs": 1.0}, "2 channel names for 3 channels"),
        ({"data": np.zeros((2, 50)), "channels": np.array(["a", "a"]), "fs": 1.0}, "more than once"),
        ({"data": np.zeros((2, 50)), "units": np.array(["g"]), "fs": 1.0}, "1 units for 2 channels"),
        ({"data": np.zeros((2, 50)), "units": np.array(["g", "stone"]), "fs": 1.0}, "unit 'stone' is unknown"),
        ({"data": np.zeros((2, 5, 3)), "fs": 1.0}, r"shape \(2, 5, 3\)"),
        ({"data": np.zeros((2, 50)), "t": TIMES[:40]}, "'t' has 40 time stamps for 50 samples"),
        ({"text": np.array(["a", "b"])}, "holds no arrays of numbers"),
        ({"time": TIMES}, "holds no arrays of numbers"),
        ({"data": np.zeros((0, 3)), "fs": 1.0}, "shape"),
        ({"data": np.zeros((2, 50), dtype=complex), "fs": 1.0}, "holds no arrays of numbers"),
        ({"odd": np.array([{"a": 1}], dtype=object)}, "'odd' cannot be read"),
    ],
)
def test_bad_arrays_are_refused_with_a_sentence(tmp_path: Path, arrays, message) -> None:
    with pytest.raises(FormatError, match=message):
        read(npz(tmp_path, **arrays))


def test_one_sample(tmp_path: Path) -> None:
    with pytest.raises((DataError, FormatError), match=r"run\.npz"):
        read(npz(tmp_path, data=np.ones((1, 1)), fs=10.0))


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_an_archive_that_inflates_beyond_reason_is_refused_by_its_headers(tmp_path: Path, ending) -> None:
    path = tmp_path / f"run.{ending}"
    samples = np.zeros((4, 10_000_000))
    if ending == "npz":
        np.savez_compressed(path, samples=samples, fs=100.0)
    else:
        savemat(path, {"data": samples, "fs": 100.0}, do_compression=True)
    tracemalloc.start()
    with pytest.raises(FormatError, match=r"holds 0\.3 GB of arrays, but at most 0\.3 GB of it are read at once"):
        read(path)
    assert tracemalloc.get_traced_memory()[1] < 1e7
    tracemalloc.stop()
