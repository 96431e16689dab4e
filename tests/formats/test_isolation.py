"""Readers in a process of their own: what a file does to them ends with a sentence, and the next file is read."""

import os
import textwrap
from pathlib import Path

import numpy as np
import pytest

from sprung.errors import FormatError, ParameterError
from sprung.formats import ReadSettings, isolation, read, write
from sprung.formats.isolation import isolated_groups
from sprung.recording import Channel, Recording

READER = """
import os, time
import numpy as np
from sprung.errors import ParameterError
from sprung.formats.table import Block, Column, Group, Table

NAME = "odd"

def groups(path, settings):
    text = path.read_text()
    if text == "crash at once":
        os.abort()
    return (Group("all", ("a",), "clock", lambda channels: table(path, text)),)

def table(path, text):
    if text == "refuse":
        raise ParameterError(f"{path} is refused")
    if text == "allocate":
        np.ones(1 << 40)
    if text == "wait":
        time.sleep(1000)

    def blocks(first=0, last=None):
        for number in range(3):
            if text == "crash later" and number == 2:
                os.abort()
            if text == "print":
                print("a library prints", flush=True)
            yield Block(1 + 10 * number, np.arange(10.0) + 10 * number, np.full((1, 10), float(number)))

    return Table(path, (Column("a", "a", comment="left"),), "time", blocks, start=5, comment="on a rig")
"""


@pytest.fixture
def groups_of(tmp_path, monkeypatch):
    """Function from the text of a file to its groups, read by a reader that does what the text says."""
    (tmp_path / "odd_reader.py").write_text(textwrap.dedent(READER))
    paths = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    reader = isolation._Reader()
    monkeypatch.setattr(isolation, "_READER", reader)

    def groups(text):
        path = tmp_path / "run.odd"
        path.write_text(text)
        return isolated_groups("odd_reader", path, ReadSettings())

    yield groups
    reader.close()


def values(groups):
    return [block.values[0, 0] for block in groups[0].open(None).blocks()]


@pytest.mark.parametrize("text", ["", "print"])
def test_blocks_and_facts_arrive(groups_of, text) -> None:
    groups = groups_of(text)
    assert (groups[0].name, groups[0].headings) == ("all", ("a",))
    table = groups[0].open(None)
    assert (table.comment, table.start, table.columns[0].comment) == ("on a rig", 5, "left")
    assert [block.values[0, 0] for block in table.blocks()] == [0, 1, 2]
    assert [block.first_row for block in table.blocks()] == [1, 11, 21]
    assert next(iter(table.blocks())).stamps.tolist() == list(range(10))


def test_two_streams_do_not_disturb_each_other(groups_of) -> None:
    table = groups_of("")[0].open(None)
    first, second = iter(table.blocks()), iter(table.blocks())
    assert [next(first).values[0, 0], next(second).values[0, 0], next(first).values[0, 0]] == [0, 0, 1]
    assert [block.values[0, 0] for block in second] == [1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("text", ["crash at once", "crash later", "allocate"])
def test_a_failing_reader_gives_a_sentence_and_the_next_file_is_read(groups_of, text) -> None:
    with pytest.raises(FormatError, match=r"run\.odd cannot be read"):
        values(groups_of(text))
    assert values(groups_of("")) == [0, 1, 2]


def test_a_reader_that_waits_for_ever_is_ended(groups_of, monkeypatch) -> None:
    groups_of("")  # the process is running
    monkeypatch.setattr(isolation, "LIMITS", isolation.Limits(time=0.3))
    with pytest.raises(FormatError, match=r"run\.odd cannot be read: its reader took too long"):
        values(groups_of("wait"))


def test_errors_keep_their_type_and_name_the_file_as_given(groups_of, tmp_path, monkeypatch) -> None:
    with pytest.raises(ParameterError, match=r"run\.odd is refused"):
        values(groups_of("refuse"))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ParameterError, match=r"^run\.odd is refused"):
        isolated_groups("odd_reader", Path("run.odd"), ReadSettings())[0].open(None)


def test_a_script_without_a_main_guard_reads_once(tmp_path: Path, capfd) -> None:
    write(Recording(np.ones((1, 50)), 10.0, (Channel("a"),)), tmp_path / "run.mat")
    recording = read(tmp_path / "run.mat")
    assert recording.n_samples == 50
    assert capfd.readouterr().out == ""


def test_modules_in_the_present_folder_are_not_imported(tmp_path: Path, monkeypatch) -> None:
    write(Recording(np.ones((1, 50)), 10.0, (Channel("a"),)), tmp_path / "run.h5")
    (tmp_path / "h5py.py").write_text("raise SystemExit(7)")
    monkeypatch.chdir(tmp_path)
    reader = isolation._Reader()
    monkeypatch.setattr(isolation, "_READER", reader)
    assert read("run.h5").n_samples == 50
    reader.close()
