"""Windows that wait on a disk reach the lake once each, whatever happens in between."""

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.fleet.lake import Lake, Outbox, window_of_recording
from sprung.recording import Channel, Recording

START = 1_767_225_600 * 10**9  # 2026-01-01


def window(k, vehicle="car"):
    samples = np.random.default_rng(k).normal(size=(1, 500))
    return window_of_recording(vehicle, Recording(samples, 100.0, (Channel("a"),), START + k * 10**9))


@pytest.fixture
def outbox(tmp_path):
    return Outbox(tmp_path / "outbox", max_bytes=1e6)


@pytest.fixture
def lake(tmp_path):
    return Lake(tmp_path / "lake")


def test_windows_are_moved_in_one_commit(outbox, lake) -> None:
    assert outbox.move(lake) == 0
    for k in range(3):
        outbox.put(window(k))
    outbox.put(window(1))
    assert len(outbox.files) == 3
    assert outbox.move(lake) == 3
    assert (lake.table.version, lake.facts.n_windows, outbox.files) == (1, 3, [])  # 0: the empty table
    digests = {each.row["digest"] for each in lake.windows()}
    assert digests == {window(k).row["digest"] for k in range(3)}


def test_a_crash_after_the_commit_adds_nothing_twice(outbox, lake) -> None:
    outbox.put(window(1))
    lake.write([window(1)])
    assert outbox.move(lake) == 1
    assert (lake.facts.n_windows, outbox.files) == (1, [])


def test_windows_wait_on_where_the_lake_cannot_be_written(outbox, tmp_path) -> None:
    outbox.put(window(1))
    (tmp_path / "lake").write_text("a file")
    with pytest.raises((DataError, OSError, ValueError)):
        outbox.move(Lake(tmp_path / "lake"))
    assert len(outbox.files) == 1


def test_a_damaged_file_is_left_aside(outbox, lake) -> None:
    for k in range(2):
        outbox.put(window(k))
    first, second = (each.path for each in outbox.files)
    with open(first, "r+b") as file:
        file.truncate(900)
    assert outbox.move(lake) == 1
    assert [path.name.endswith("damaged") for path in sorted(outbox.folder.glob("[0-9]*"))] == [True]
    assert second not in [each.path for each in outbox.files]


def test_no_more_wait_than_may(tmp_path) -> None:
    small = Outbox(tmp_path, max_bytes=4000)
    small.put(window(0))
    with pytest.raises(DataError, match=r"wait in .* for the lake: check why they are not written"):
        small.put(window(1))
    assert len(small.files) == 1


def test_one_process_at_a_time_empties_a_folder(outbox, lake) -> None:
    outbox.put(window(0))
    with outbox._locked() as is_own:
        assert is_own
        assert Outbox(outbox.folder, max_bytes=1e6).move(lake) == 0
    assert outbox.move(lake) == 1
