"""Fixtures of all tests."""

import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: matrices are small, more threads only wait

import pytest
from hypothesis import settings

settings.register_profile("same every time", derandomize=True)
settings.load_profile("same every time")

DATA = Path(os.environ.get("SPRUNG_DATA", Path(__file__).parents[2] / "shared" / "data"))


@pytest.fixture
def real_file():
    """Return a function from a path below the real recordings to the file; it skips the test where that is absent."""

    def find(name):
        path = DATA / name
        if not path.exists():
            pytest.skip(f"no {name} among the real recordings: set SPRUNG_DATA to their folder")
        return path

    return find
