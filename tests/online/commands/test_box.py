"""The command `sprung box` as a process of its own, against a monitor's side that acknowledges everything."""

import signal
import subprocess
import sys
import threading

import pytest

from sprung.cli import main
from sprung.link import Address, Link, decode, message, topic

pytest.importorskip("paho.mqtt.client")
RUN = [sys.executable, "-c", "import sys; from sprung.cli import main; sys.exit(main())", "box"]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A minute of a car."""
    path = tmp_path_factory.mktemp("drive") / "drive.parquet"
    assert main(["simulate", "road", "--minutes", "1", "--seed", "1", "--out", str(path)]) == 0
    return path


@pytest.fixture
def address(mosquitto):
    """Of a broker with somebody who acknowledges every frame that comes."""
    broker = mosquitto()

    def acknowledge(_, payload):
        frame = decode(payload)
        link.publish(topic("car-1", "ack"), message({0: 1, 2: frame.boot, 3: frame.seq}))

    link = Link(Address.parse(broker.address), "monitor", topics=[topic("car-1", "raw")], on_message=acknowledge)
    link.open(timeout=10.0)
    yield broker.address
    link.close()


@pytest.fixture
def words(address, tmp_path):
    return [
        "--vehicle-id",
        "car-1",
        "--vehicle",
        "zafira",
        "--broker",
        address,
        "--spool",
        str(tmp_path / "spool"),
        "--frame-seconds",
        "0",
    ]


@pytest.mark.slow
def test_the_end_of_the_source_is_logged(words, drive):
    ended = "source finished; all frames of car-1 acknowledged"
    for said in (f"{ended}: 60 frames, 0.02 hours in this run", f"{ended}: 0 frames, 0.00 hours in this run"):
        done = subprocess.run([*RUN, str(drive), *words], capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
        (line,) = done.stderr.splitlines()
        assert line.endswith(f"info    {said}")
        assert done.stdout == ""


@pytest.mark.slow
def test_an_unreadable_recording_is_a_warning_with_the_reason(words, drive, tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "a.csv").write_text("a,b\n", encoding="utf-8")
    (folder / "b.parquet").write_bytes(drive.read_bytes())
    with subprocess.Popen([*RUN, "--source", f"folder:{folder}", *words], stderr=subprocess.PIPE, text=True) as box:
        guard = threading.Timer(60.0, box.kill)
        guard.start()
        try:
            assert box.stderr is not None
            lines = [box.stderr.readline() for _ in range(2)]
        finally:
            box.send_signal(signal.SIGTERM)
            rest = box.communicate(timeout=120)[1]
            guard.cancel()
    assert box.returncode == 0, rest
    assert "warning a.csv was not read completely: " in lines[0]
    assert "a.csv" in lines[0].split("completely: ")[1]
    assert lines[1].endswith("info    read b.parquet\n")
    assert "acknowledged" not in rest
