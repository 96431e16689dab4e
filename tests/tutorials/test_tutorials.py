"""Tutorials of the documentation: what they print is true, and they show their figures."""

import ast
import os
import re
import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import pytest
from matplotlib import pyplot as plt

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"
ALL = sorted(TUTORIALS.glob("plot_*.py"))


@pytest.fixture(autouse=True)
def _without_a_screen(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    mpl.use("Agg")
    monkeypatch.setattr(plt, "show", lambda: None)
    plt.close("all")
    yield
    plt.close("all")


def run(name: str) -> int:
    """Run a tutorial and return the number of its figures."""
    runpy.run_path(str(TUTORIALS / f"plot_{name}.py"), run_name="__main__")
    return len(plt.get_fignums())


def test_there_are_tutorials() -> None:
    assert len(ALL) >= 10


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_it_has_a_heading_and_cells(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    heading, rule, *_ = (ast.get_docstring(ast.parse(text)) or "").splitlines()
    assert set(rule) == {"="}
    assert len(rule) == len(heading)
    assert text.count("# %%") >= 4
    assert text.rstrip().endswith("plt.show()")


@pytest.mark.slow
def test_a_format_of_ones_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("own_format") == 2
    printed = capsys.readouterr().out
    assert "Recording: 30000 samples at 100 Hz" in printed
    assert {"bounce", "pitch", "roll"} <= set(re.findall(r"\w+", printed))


@pytest.mark.slow
def test_an_excitation_of_ones_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("own_excitation") == 2
    printed = capsys.readouterr().out
    (drawn, expected), *_ = re.findall(r"variance ([\d.]+), expected ([\d.]+)", printed)
    assert float(drawn) == pytest.approx(float(expected), rel=0.03)
    gusts, steady, exact = (
        [float(value) for value in re.findall(r"([\d.]+) Hz", line)] for line in printed.splitlines() if " Hz" in line
    )
    assert gusts == pytest.approx(exact, rel=0.01)
    assert steady == pytest.approx(exact, rel=0.01)


@pytest.mark.slow
def test_harmonics(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("harmonics") == 2
    printed = capsys.readouterr().out
    assert re.findall(r"line at ([\d.]+) Hz", printed) == ["9.600", "19.200", "28.800"]
    rows = {
        line.split(":")[0].strip(): re.findall(r"([\d.]+) Hz", line) for line in printed.splitlines() if ": " in line
    }
    assert [float(f) for f in rows["lines subtracted"]] == pytest.approx([float(f) for f in rows["exact"]], rel=0.01)


@pytest.mark.slow
def test_a_fleet_on_a_laptop() -> None:
    """In a process of its own, as it stops the session of Spark that other tests share."""
    pytest.importorskip("deltalake")
    pytest.importorskip("pyspark")
    if shutil.which("java") is None:
        pytest.skip("java is missing: run scripts/system-packages")
    program = (
        "import runpy, sys; from matplotlib import pyplot; runpy.run_path(sys.argv[1]);"
        " print(len(pyplot.get_fignums()), 'figures')"
    )
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    printed = subprocess.run(
        [sys.executable, "-c", program, str(TUTORIALS / "plot_a_fleet_on_a_laptop.py")],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    assert printed.endswith("2 figures\n")
    assert "32 windows analysed, 4 vehicles assessed\n0 windows analysed, 0 vehicles assessed" in printed
    (found,) = [line for line in printed.splitlines() if "rear_right damper" in line and line.startswith("car-4")]
    change, low, high = (float(value) for value in re.findall(r"([+-]?\d+)(?= %| to)", found))
    assert low <= -50 <= high
    assert change < -30
    discovered = [line.split()[0] for line in printed.splitlines() if line.endswith("True")]
    assert discovered == ["car-4"]
