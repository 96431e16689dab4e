"""Formats of other packages, found by their entry points."""

import sys
from pathlib import Path

import numpy as np
import pytest

from sprung.formats import read, registry, write
from sprung.recording import Channel, Recording

MODULE = """
from pathlib import Path
import numpy as np
from sprung.formats.table import Block, Group, Table, stated_column

NAME, EXTRA, ENDINGS = "a rig's file", None, (".rig",)

def recognises(head):
    return head.startswith(b"rig ")

def groups(path, settings):
    def opened(channels):
        def blocks(first=0, last=None):
            values = np.array([float(word) for word in path.read_text().split()[1:]])
            yield Block(first + 1, None, values[None, first:last])

        return Table(path, (stated_column("acc", "acc", "g"),), None, blocks, sampling_rate=10.0)

    return (Group("all", ("acc",), "clock", opened),)

def write(recording, path):
    path.write_text("rig " + " ".join(str(value / 9.80665) for value in recording.samples[0]))
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch):
    """A distribution with a format is on the path."""
    metadata = tmp_path / "site" / "rig_format-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: rig-format\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[sprung.formats]\nrig = rig_format_of_a_test\n")
    (tmp_path / "site" / "rig_format_of_a_test.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path / "site")
    yield
    sys.modules.pop("rig_format_of_a_test", None)


@pytest.mark.usefixtures("installed")
def test_a_format_of_another_package_is_read_and_written(tmp_path: Path) -> None:
    (tmp_path / "run.rig").write_text("rig 0 1 2 3")
    recording = read(tmp_path / "run.rig")
    np.testing.assert_allclose(recording.samples, [[0, 9.80665, 2 * 9.80665, 3 * 9.80665]])
    assert (recording.names, recording.sampling_rate) == (("acc",), 10)
    write(recording, tmp_path / "again.rig")
    np.testing.assert_allclose(read(tmp_path / "again.rig").samples, recording.samples)


def test_known_files_are_read_without_a_look_at_other_packages(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(registry, "own_formats", None)
    for ending in registry.WRITERS:
        path = tmp_path / f"run{ending}"
        registry.WRITERS[ending].write(Recording(np.ones((1, 50)), 10.0, (Channel("a"),)), path)
        assert read(path).n_samples == 50
