"""The journey that a newcomer sees first: a fleet, a soft spring, a dead sensor, two alerts and no other."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_demo_finds_the_spring_and_the_sensor() -> None:
    program = Path(sys.executable).with_name("sprung")
    words = [str(program), "demo", "--pace", "90", "--minutes", "8"]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "200"}
    outcome = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False, env=environment)
    assert outcome.returncode == 0, outcome.stderr
    assert "car-2: front-left spring 2" in outcome.stdout
    assert "car-3: sensor acc_rr is dead" in outcome.stdout
    assert "car-1: no alert (simulated: healthy)" in outcome.stdout
