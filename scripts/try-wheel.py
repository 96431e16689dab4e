#!/usr/bin/env python3
"""Try an installed sprung, whose version is the argument: its help, a simulated chain, and the modes of the chain."""

import json
import subprocess
import sys
from importlib import resources
from pathlib import Path

SPRUNG = Path(sys.executable).with_name("sprung")
#: Natural frequencies of the simulated chain [Hz], and the largest relative error.
TRUTH, TOLERANCE = (7.01, 19.65, 28.39), 0.02


def run(*words: str) -> str:
    """Return what a command prints."""
    return subprocess.run([SPRUNG, *words], check=True, capture_output=True, text=True).stdout


def main(version: str) -> None:
    """Raise if something is missing."""
    assert run("--version") == f"sprung {version}\n"
    assert "diagnose" in run("--help")
    assert "embedded" in run("monitor", "--help")
    run("simulate", "chain", "--out", "run.csv")
    found = [mode["natural_frequency"] for mode in json.loads(run("identify", "run.csv", "--json", "-"))["modes"]]
    assert len(found) == len(TRUTH), found
    assert all(abs(one / true - 1) < TOLERANCE for one, true in zip(found, TRUTH, strict=True)), found
    for folder in ("documents/json_schemas", "service/static", "service/templates", "vehicles/data"):
        assert any(resources.files("sprung").joinpath(folder).iterdir()), folder
    print(f"sprung {version} works: modes at {', '.join(f'{one:.2f}' for one in found)} Hz")


if __name__ == "__main__":
    main(sys.argv[1])
