"""HDF5 files: what they may hold, and what is refused."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from sprung.errors import FormatError
from sprung.formats import read, write
from sprung.recording import Channel, Recording


@pytest.mark.parametrize("ending", [".h5", ".mat", ".npz", ".parquet", ".csv"])
@pytest.mark.parametrize("start", [None, 1_700_000_000_123_456_789])
def test_comments_and_calibration_are_carried(tmp_path: Path, ending, start) -> None:
    channels = (
        Channel("body/acc", "acceleration", comment="left, on the sill", calibration="101.9 mV/g, 2024-03-01"),
        Channel("b", "speed", comment="CAN"),
    )
    recording = Recording(np.random.default_rng(1).normal(size=(2, 300)), 256.0, channels, start, comment="wet road")
    write(recording, tmp_path / f"run{ending}")
    again = read(tmp_path / f"run{ending}")
    np.testing.assert_allclose(again.samples, recording.samples, rtol=1e-14, equal_nan=False)
    assert (again.start, again.sampling_rate, again.comment) == (start, 256.0, "wet road")
    assert [(c.name, c.quantity, c.comment, c.calibration) for c in again.channels] == [
        (c.name, c.quantity, c.comment, c.calibration) for c in channels
    ]


def test_values_in_another_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(bytes(800))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("acc", (100,), "f8", external=[(str(tmp_path / "secret"), 0, 800)])
    with pytest.raises(FormatError, match=r"a\.h5: dataset '/acc' lies in another file"):
        read(tmp_path / "a.h5", sampling_rate=10)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["acc"] = h5py.ExternalLink(str(tmp_path / "a.h5"), "/acc")
    with pytest.raises(FormatError, match=r"b\.h5: 'acc' is a link to another file"):
        read(tmp_path / "b.h5", sampling_rate=10)


@pytest.mark.parametrize("name", ["run.h5", "run.mat"])
def test_sizes_that_the_file_cannot_hold_are_refused(tmp_path: Path, name) -> None:
    with h5py.File(tmp_path / name, "w") as file:
        file.create_dataset("acc", (10**12,), "f8", chunks=(1000,), compression="gzip")
    with pytest.raises(FormatError, match="declares 8000000000000 bytes of values, but stores 0"):
        read(tmp_path / name, sampling_rate=10)


def test_links_in_a_circle_end(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["a"] = np.arange(100.0)
        file.create_group("folder")["again"] = h5py.SoftLink("/")
    with pytest.raises(FormatError, match="holds more than"):
        read(tmp_path / "run.h5", sampling_rate=10)


@pytest.mark.slow
def test_large_files_are_read_in_pieces(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        for name in "abcdef":
            file.create_dataset(name, data=np.random.default_rng(1).normal(size=8_000_000), chunks=(10_000,))
    script = (
        "from pathlib import Path; from sprung.formats.hdf5 import groups; from sprung.formats import ReadSettings\n"
        f"table = groups(Path({str(path)!r}), ReadSettings())[0].open(None)\n"
        "n = sum(block.n_rows for block in table.blocks())\n"
        "status = Path('/proc/self/status').read_text()\n"
        "print(n, status.split('VmHWM:')[1].split()[0])"
    )
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert int(output[0]) == 8_000_000
    assert int(output[1]) < 200_000
