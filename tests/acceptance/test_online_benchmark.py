"""The benchmark of the monitor counts CPU time by places of the program that exist."""

import importlib
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "sprung"


def test_every_place_by_which_time_is_counted_exists(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SOURCE.parents[1] / "benchmarks" / "online"))
    sampling = importlib.import_module("sampling")

    modules = [f"{path}" for path in (*SOURCE.rglob("*.py"), *(f"{path}/" for path in SOURCE.rglob("*")))]
    parts = (*sampling.OF_ANALYSIS, *sampling.OF_STATION)
    places = [sampling.OF_WORKER, sampling.OF_MONITOR, *(place for _, belonging in parts for place in belonging)]
    for place in places:
        module, _, function = place.partition(":")
        files = [Path(name) for name in modules if module in name]
        assert files, place
        assert not function or any(f"def {function}" in file.read_text(encoding="utf-8") for file in files), place
    sys.modules.pop("sampling")
