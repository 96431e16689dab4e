"""Real processes to measure: a broker, a monitor, and vehicles with prepared frames."""

import getpass
import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from measuring import ONE_THREAD

_BROKER = """
listener {port} 127.0.0.1
allow_anonymous true
persistence false
max_queued_messages 30000
max_queued_bytes 268435456
user {user}
"""
#: Seconds of an hour, and frames of a window, one a second.
HOUR, WINDOW = 3600, 600
_TICKS = os.sysconf("SC_CLK_TCK")


def cpu(pid: int) -> float:
    """Return the CPU seconds of a process so far, of all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def memory(pid: int | str = "self") -> float:
    """Return the resident memory of a process [MiB]."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return int(next(line for line in status if line.startswith("VmRSS")).split()[1]) / 1024


def n_files(pid: int) -> int:
    """Return the number of files that a process has open."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def until(condition: Callable[[], Any], *, patience: float, every: float = 0.02) -> Any:
    """Return the first true value of a condition."""
    end = time.monotonic() + patience
    while not (value := condition()):
        if time.monotonic() > end:
            raise SystemExit(f"the condition did not hold within {patience:g} s")
        time.sleep(every)
    return value


def free_port() -> int:
    """Return a free port."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


@contextmanager
def mosquitto(folder: Path) -> Iterator[str]:
    """Run a broker and return its address; queues as in deploy/mosquitto."""
    program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin:/usr/local/sbin")
    if program is None:
        raise SystemExit("no mosquitto: install Debian's package (scripts/system-packages)")
    port, settings = free_port(), folder / "mosquitto.conf"
    settings.write_text(_BROKER.format(port=port, user=getpass.getuser()))
    with (folder / "mosquitto.log").open("w") as log:
        process = subprocess.Popen([program, "-c", settings], stdout=log, stderr=log)
    try:
        until(lambda: _listens(port), patience=10.0)
        yield f"mqtt://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()


def _listens(port: int) -> bool:
    with socket.socket() as trial:
        return trial.connect_ex(("127.0.0.1", port)) == 0


class Program:
    """A command of sprung that runs, one thread for linear algebra."""

    def __init__(self, arguments: Sequence[str], folder: Path) -> None:
        self._log = folder / f"{arguments[0]}.log"
        with self._log.open("a") as log:
            self._process = subprocess.Popen(
                [Path(sys.executable).with_name("sprung"), *arguments, "--log", "json"],
                env={**os.environ, **ONE_THREAD},
                stderr=log,
            )
        self.pid = self._process.pid

    @property
    def errors(self) -> list[str]:
        """Lines of its log that are warnings or worse, or no lines of a log."""
        lines = self._log.read_text().splitlines()
        return [line for line in lines if not line.startswith("{") or json.loads(line)["level"] != "info"]

    def close(self) -> None:
        """Stop it in good order."""
        self._process.terminate()
        self._process.wait()


class Monitor(Program):
    """A running `sprung monitor` on a store in a folder."""

    def __init__(self, broker: str, folder: Path, **watch: float) -> None:
        self.store = f"sqlite:///{folder}/store.sqlite"
        port = free_port()
        self.address = f"http://127.0.0.1:{port}"
        lines = [f'schema = "sprung.site/1"\nstore = "{self.store}"\nhttp = "127.0.0.1:{port}"\n[watch]']
        site = folder / "site.toml"
        site.write_text("\n".join([*lines, *(f"{name} = {value}" for name, value in watch.items())]))
        super().__init__(["monitor", "--site", str(site), "--broker", broker], folder)
        until(lambda: self.figures().get("sprung_link_connected"), patience=180.0)

    @property
    def workers(self) -> list[int]:
        """Process numbers of its workers."""
        children = map(int, Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text(encoding="utf-8").split())
        return [pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]

    def figures(self) -> dict[str, float]:
        """Return the figures of /metrics; none before it answers."""
        try:
            with urllib.request.urlopen(f"{self.address}/metrics", timeout=10) as answer:
                lines = answer.read().decode().splitlines()
        except OSError:
            return {}
        figures = (line.rpartition(" ") for line in lines if not line.startswith("#"))
        return {name: float(value) for name, _, value in figures}


@dataclass(frozen=True)
class Course:
    """A drive over and over, as the maps of its frames.

    Parameters
    ----------
    documents
        Of the frames.
    first
        The first block of samples.
    begin
        UTC ns.
    length
        Length of a frame [s].
    """

    documents: Sequence[dict[Any, Any]]
    first: Any
    begin: int
    length: float = 1.0

    def payload(self, vehicle: str, boot: int, seq: int) -> bytes:
        """Return the frame of a number as that of a vehicle."""
        from sprung.link import Key, message

        start = self.begin + round(seq * self.length * 1e9)
        own = {Key.VEHICLE: vehicle, Key.BOOT: boot, Key.SEQ: seq, Key.START: start}
        return message({**self.documents[seq % len(self.documents)], **own})


def course(n_drives: int = 1, *, length: float = 1.0, car: Any = None) -> Course:
    """Simulate ten minutes on a road of class C, or several times that: accelerations and speed at 200 Hz.

    Without a car it is one with four accelerations.
    """
    from sprung.link import Frame, checked_map, encode, quantised
    from sprung.online.box import blocks_of
    from sprung.simulation import RoadDrive, simulate_drive
    from sprung.vehicles import read_vehicle

    car, begin = car or read_vehicle("zafira"), time.time_ns() - 7200 * 10**9
    blocks = []
    for seed in range(n_drives):
        run = simulate_drive(car, RoadDrive(snr=50.0), seed=seed).recording
        blocks += blocks_of(replace(run, start=begin + seed * 600 * 10**9), length=length)
    documents = []
    for block in blocks:
        counts, scale, flags = quantised(block.samples)
        frame = Frame("car", 1, 0, begin, 5_000_000, block.names, scale, counts, 2, flags)
        documents.append(checked_map(encode(frame)))
    return Course(documents, blocks[0], begin, length)


class Vehicle:
    """A box whose frames are prepared."""

    def __init__(self, name: str, broker: str, folder: Path, course: Course, car: Any = None) -> None:
        from sprung.link import Address, Spool
        from sprung.online.box import Box, BoxSettings
        from sprung.vehicles import read_vehicle, vehicle_text
        from sprung.vehicles.sensor_layout import quantities_of

        car = car or read_vehicle("zafira")
        self.name, self._course = name, course
        self._spool = Spool(folder / name, is_synced=False)
        self.box = Box(
            BoxSettings(name, vehicle_text(car)),
            self._spool,
            Address.parse(broker),
            quantities=lambda block: quantities_of(block, car.sensor),
        )
        self.box.take(course.first)

    @property
    def seconds(self) -> int:
        """Seconds that it drove."""
        return self._spool.next_seq

    @property
    def has_sent(self) -> bool:
        """Whether all of it was acknowledged."""
        return next(self._spool.frames(), None) is None

    def drive(self, seconds: int) -> None:
        """Keep more frames in the spool."""
        for _ in range(seconds):
            self._spool.append(lambda boot, seq: self._course.payload(self.name, boot, seq))


def publisher(broker: str, **given: object) -> object:
    """Return a link that is connected."""
    from sprung.link import Address, Link

    link = Link(Address.parse(broker), "publisher", **{"topics": [], "on_message": lambda *_: None, **given})
    link.open(timeout=10.0)
    return link


def is_analysed(car: Vehicle, monitor: Monitor, most: int = 0) -> bool:
    """Let the box of a vehicle step; return whether everything it sent is analysed, except `most` frames."""
    car.box.step()
    return car.has_sent and monitor.figures()["sprung_backlog_frames"] <= most
