"""Files of MATLAB."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from sprung.errors import FormatError
from sprung.formats import read, write
from sprung.recording import Channel, Recording

SIGNAL = np.arange(50.0)


def test_old_mat_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "old.mat"
    savemat(path, {"a": SIGNAL}, format="4")
    with pytest.raises(FormatError, match="not a MAT file of version 5 or later"):
        read(path)


def test_a_written_file_is_read_by_scipy(tmp_path: Path) -> None:
    recording = Recording(np.array([SIGNAL, -SIGNAL]), 100.0, (Channel("a", "acceleration"), Channel("b")))
    write(recording, tmp_path / "run.mat")
    content = loadmat(tmp_path / "run.mat", squeeze_me=True)
    rows = [values for name, values in content.items() if isinstance(values, np.ndarray) and values.ndim == 2]
    assert any(np.array_equal(matrix if len(matrix) == 2 else matrix.T, recording.samples) for matrix in rows)
