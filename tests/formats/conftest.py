from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from sprung.formats import ReadSettings, groups
from sprung.formats.table import Table, join
from sprung.recording import Recording


def table_of(path: Path, name: str, channels: Sequence[str] | None = None, **settings: Any) -> Any:
    """Return the table of the group of a name."""
    (group,) = [group for group in groups(path, ReadSettings(**settings)) if group.name == name]
    return group.open(channels)


def joined(table: Table) -> Any:
    """Return all rows of a table as one block."""
    return join(list(table.blocks()))


def said(recording: Recording, words: str) -> bool:
    """Return whether a line of the history holds some words."""
    return any(words in line for line in recording.history)


@pytest.fixture
def text_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a text file and returns its path."""

    def make(text: str | bytes, name: str = "run.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return make
