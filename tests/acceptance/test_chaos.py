"""Programs are killed, connections cut, messages lost, duplicated and damaged: nothing is missing in the end."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HARNESS = Path(__file__).parents[2] / "benchmarks" / "chaos"
POSTGRESQL = list(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")

pytest.importorskip("paho.mqtt.client")


@pytest.mark.slow
@pytest.mark.skipif(MOSQUITTO is None, reason="no mosquitto: install Debian's package (scripts/system-packages)")
@pytest.mark.skipif(not POSTGRESQL, reason="no PostgreSQL: install Debian's package (scripts/system-packages)")
def test_a_monitor_that_takes_over_stores_what_one_does(tmp_path: Path) -> None:
    pytest.importorskip("psycopg")
    command = [sys.executable, str(HARNESS / "takeover.py"), "--vehicles", "4", "--driving", "1"]
    command += ["--windows", "8", "--seconds", "24", "--every", "3", "--json", "--keep", str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=560, check=False)
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)
    assert found["failures"] == found["differs"] == []
    assert (found["acknowledged_not_stored"], found["messages_missing"]) == (0, 0)
    assert found["is_kept"]
    assert found["acknowledgements"] >= 100
    assert found["events"]["kill"] >= 1
    assert max(found["takeovers"]) <= 30.0
    assert found["rows"]["observations"] == 32
    assert found["empty"] == []
    assert found["rows"]["notifications"] == found["messages"]


@pytest.mark.slow
@pytest.mark.skipif(MOSQUITTO is None, reason="no mosquitto: install Debian's package (scripts/system-packages)")
def test_a_dozen_kills_change_nothing(tmp_path: Path) -> None:
    command = [sys.executable, str(HARNESS), "--kills", "12", "--every", "1.6", "--seed", "1", "--json"]
    command += ["--keep", str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=560, check=False)
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)
    assert found["failures"] == []
    assert (found["acknowledged_not_stored"], found["frames_lost"], found["frames_left"]) == (0, 0, 0)
    assert (found["windows_doubled"], found["orphans"], found["differs"]) == (0, 0, [])
    assert found["is_kept"]
    assert sum(found["kills"].values()) >= 12
    assert found["acknowledgements_in_storm"] >= 100
    assert min(found[name] for name in ("lost_on_the_way", "doubled_on_the_way", "damaged")) > 0
    assert found["frames"] == 720
    assert found["windows"] == 6
    assert found["findings"] > 0
