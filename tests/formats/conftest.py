from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sprung.errors import SprungError
from sprung.formats import read


@pytest.fixture
def text_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a text file and returns its path."""

    def make(text: str | bytes, name: str = "run.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return make


@pytest.fixture
def mutations_give_a_sentence(tmp_path: Path) -> Callable[..., None]:
    """Reads mutations of a file, changed in some bytes and cut: each is read, or refused in a line that names it."""

    def check(whole: bytes, name: str, *, seed: int, count: int = 200, head: int | None = None) -> None:
        generator = np.random.default_rng(seed)
        path = tmp_path / name
        for _ in range(count):
            content = bytearray(whole)
            reach = len(whole) if head is None or generator.random() < 0.3 else head
            for position in generator.integers(0, reach, generator.integers(1, 8)):
                content[position] = generator.integers(0, 256)
            path.write_bytes(content[: generator.integers(1, 2 * len(whole))])
            message = path.name
            try:
                read(path, sampling_rate=10)
            except SprungError as error:
                message = str(error)
            assert path.name in message
            assert "\n" not in message

    return check
