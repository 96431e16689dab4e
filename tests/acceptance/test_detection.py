"""The benchmark of detection, small: a fault of a tenth is found, named and dated; healthy hours stay silent."""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from sprung.vehicles import parse_fault

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "detection.py"

#: Time after which the benchmark is taken to hang [s]: it needs two minutes on two idle cores.
HANGS = 3600.0

pytest.importorskip("numba")


@pytest.mark.slow
def test_a_tenth_is_found_on_a_car_whose_file_has_a_geometry_that_is_wrong(tmp_path: Path) -> None:
    lives = tmp_path / "lives.jsonl"
    command = [sys.executable, str(BENCHMARK), "--seeds", "45", "--healthy", "3", "--faulty", "4", "--jobs", "1"]
    command += ["--lives", str(lives)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANGS, check=False)
    assert done.returncode == 0, done.stderr
    found = {life["seed"]: life for life in map(json.loads, lives.read_text().splitlines())}
    assert set(found) == {45}
    for life in found.values():
        assert (life["size"], life["alarm"], life["mute"], life["hours"]) == (0.1, False, 0, 0.5)
        assert life["found"]["30"] == life["found"]["120"] == life["name"]
        low, high = life["said"]["120"]["interval"]
        assert low <= -0.1 <= high < 0
        assert life["said"]["120"]["onset"][0] == 0
        assert life["delay"] <= 20
    assert "| 10 % | 1 of 1" in done.stdout


@pytest.mark.slow
def test_the_method_of_the_thesis_is_compared(capsys: pytest.CaptureFixture[str]) -> None:
    """Two healthy windows and one with half the spring stiffness at one corner."""
    benchmark = runpy.run_path(str(BENCHMARK))
    file, real = benchmark["described"](4)
    faults = (parse_fault("front_left.spring=-0.5"),)
    modes = [benchmark["window"](file, real, 4, number, some)[1] for number, some in ((0, ()), (1, ()), (1000, faults))]
    assert all({"bounce", "pitch", "roll"} <= set(one) for one in modes)
    distances = benchmark["by_modes"](*([one] for one in modes))
    assert (distances["modes"], distances["windows"]) == (6, 2)
    assert len(distances["healthy"]) == len(distances["faulty"]) == 3
    assert distances["faulty"][0][0] > 2 * distances["healthy"][0][0]
    benchmark["thesis_table"]([{"size": 0.5, "thesis": distances}])
    assert "1 vehicles: CoSS-SSI found 100% of the body modes" in capsys.readouterr().out
