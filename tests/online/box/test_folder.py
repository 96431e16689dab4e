"""A watched folder: each file is read once, complete, in order."""

import gzip
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from sprung.formats import ReadSettings, write
from sprung.online.box import from_folder
from sprung.recording import Channel, Recording

START = 1_700_000_000_000_000_000


def recording(n_samples=1000, *, rate=200.0, start=START, gaps=(), seed=1):
    samples = np.random.default_rng(seed).normal(size=(2, n_samples))
    channels = (Channel("acc_fl", "acceleration"), Channel("speed", "speed"))
    return Recording(samples, rate, channels, start, gaps)


def text(n_samples, *, first=0.0, rate=100.0, pause=0.0):
    """Return a table whose seconds begin at `first`, with a pause after its first half."""
    seconds = first + np.arange(n_samples) / rate + pause * (np.arange(n_samples) >= n_samples // 2)
    return "t_s,a\n" + "".join(f"{second:.3f},{k}\n" for k, second in enumerate(seconds))


class Folder:
    """A watched folder, in which something happens at each look."""

    def __init__(
        self,
        path: Path,
        *events: Callable[[], object],
        known: Sequence[str] = (),
        sampling_rate: float | None = None,
    ) -> None:
        self.path, self.events, self.problems = path, list(events), dict[str, str]()
        self.blocks = from_folder(
            path,
            start=lambda: START,
            is_done=lambda: not self.events,
            sleep=self._sleep,
            done=self.problems.__setitem__,
            known=known,
            settings=ReadSettings(sampling_rate=sampling_rate),
        )

    def _sleep(self, _seconds: float) -> None:
        self.events.pop(0)()

    def put(self, name: str, content: str | bytes, *, age: float = 0.0) -> None:
        path = self.path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        os.utime(path, (time.time() - age,) * 2)


def test_folder_gives_old_files_by_name_and_leaves_out_those_done(tmp_path: Path) -> None:
    folder = Folder(tmp_path, known=["a.csv"])
    write(recording(400, seed=2), tmp_path / "c.parquet")
    os.utime(tmp_path / "c.parquet", (1e9, 1e9))
    folder.put("a.csv", text(100), age=60)
    folder.put("b.csv.gz", gzip.compress(text(100, first=1_700_000_000).encode()), age=60)
    folder.put("notes.md", "none", age=60)
    folder.put(".d.csv", text(100), age=60)
    (tmp_path / "e.csv").mkdir()
    blocks = list(folder.blocks)
    assert folder.problems == {"b.csv.gz": "", "c.parquet": ""}
    assert [block.names for block in blocks] == [("a",), ("acc_fl", "speed"), ("acc_fl", "speed")]


def test_files_that_still_grow_are_waited_for(tmp_path: Path) -> None:
    """A file is read when two looks see the same; one from the future (a clock that is wrong) too."""
    whole = text(300, first=1_700_000_000).encode()
    folder = Folder(tmp_path)
    folder.events += [
        lambda: folder.put("a.csv", whole[:2000]),
        lambda: folder.put("a.csv", whole[:3000], age=-7200),
        lambda: folder.put("a.csv", whole, age=-7200),
        lambda: None,
        lambda: None,
    ]
    blocks = list(folder.blocks)
    assert np.array_equal(np.concatenate([block.samples[0] for block in blocks]), np.arange(300.0))
    assert folder.problems == {"a.csv": ""}


def test_broken_files_are_named_and_skipped(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.put("a.csv", "", age=60)
    folder.put("b.parquet", b"PAR1 and nothing more", age=60)
    folder.put("c.csv", "t_s,a\n0,1\n0.01,x\n0.02,3\n", age=60)
    folder.put("d.csv", "a\n" + "1\n" * 100, age=60)
    folder.put("e.csv", text(100), age=60)
    assert len(list(folder.blocks)) == 1
    assert list(folder.problems) == ["a.csv", "b.parquet", "c.csv", "d.csv", "e.csv"]
    assert "a.csv is empty" in folder.problems["a.csv"]
    assert "b.parquet cannot be read" in folder.problems["b.parquet"]
    assert "c.csv, line 3, column 'a': 'x' is not a number" in folder.problems["c.csv"]
    assert "d.csv has no time column" in folder.problems["d.csv"]
    assert folder.problems["e.csv"] == ""


def test_file_or_folder_that_is_taken_away(tmp_path: Path) -> None:
    watched = tmp_path / "in"
    watched.mkdir()
    folder = Folder(watched)
    folder.events += [lambda: folder.put("a.csv", text(100)), (watched / "a.csv").unlink, watched.rmdir]
    assert list(folder.blocks) == []
