"""The benchmark of the monitor counts CPU time by places of the program that exist."""

import runpy
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_place_by_which_time_is_counted_exists() -> None:
    sampling = runpy.run_path(str(ROOT / "benchmarks" / "online" / "sampling.py"))
    files = list((ROOT / "src" / "sprung").rglob("*.py"))
    parts = (*sampling["OF_ANALYSIS"], *sampling["OF_STATION"])
    places = [sampling["OF_WORKER"], sampling["OF_MONITOR"], *(place for _, belonging in parts for place in belonging)]
    for place in places:
        module, _, function = place.partition(":")
        belonging = [file for file in files if module in file.as_posix()]
        assert belonging, place
        assert any(f"def {function}" in file.read_text(encoding="utf-8") for file in belonging), place
