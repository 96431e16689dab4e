"""The benchmark of detection, small: a fault of a tenth is found, named and dated; healthy hours stay silent."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "detection.py"

#: Time after which the benchmark is taken to hang [s]: it needs two minutes on two idle cores.
HANGS = 3600.0

pytest.importorskip("numba")


@pytest.mark.slow
def test_a_tenth_is_found_whatever_the_file_knows(tmp_path: Path) -> None:
    # A car whose file is complete, with the method of the thesis next to ours, and one whose geometry is 3 % wrong.
    lives = tmp_path / "lives.jsonl"
    command = [sys.executable, str(BENCHMARK), "--seeds", "4", "5", "--healthy", "3", "--jobs", "2"]
    command += ["--lives", str(lives)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANGS, check=False)
    assert done.returncode == 0, done.stderr
    found = {life["seed"]: life for life in map(json.loads, lives.read_text().splitlines())}
    assert set(found) == {4, 5}
    for life in found.values():
        assert (life["size"], life["alarm"], life["mute"], life["hours"]) == (0.1, False, 0, 0.5)
        assert life["found"]["30"] == life["found"]["120"] == life["name"]
        low, high = life["said"]["120"]["interval"]
        assert low <= -0.1 <= high < 0
        assert life["said"]["120"]["onset"][0] == 0
        assert life["delay"] <= 20
    assert len(found[4]["thesis"]["faulty"]) == 3
    assert "thesis" in done.stdout
    assert "| 10 % | 1 of 1" in done.stdout
