"""Whether the online system keeps its promises while programs are killed and messages lost, doubled and damaged.

    box -> forwarder -> broker A -> relay -> broker B -> forwarder -> monitor -> store

Box, brokers and monitor are real processes, which are killed (SIGKILL) at random times and started again. The
forwarders cut connections. The relay loses, doubles, delays and damages messages in both directions. In the end the
store must hold what it holds when the same drives are sent undisturbed.
"""

import argparse
import hashlib
import heapq
import json
import os
import pwd
import queue
import random
import select
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from sprung.formats import write
from sprung.link import Address, Link, checked_map, topic
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle

VEHICLE = "car-1"
MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
SPRUNG = [sys.executable, "-c", "from sprung.cli import main; main()"]
#: Below the ports that the system gives to outgoing connections, so that a restart finds its port free.
PORTS = range(20000, 30000)
#: 2026-11-21, UTC ns; and the pause between two drives [s].
BEGUN, PAUSE = 1_795_219_200_000_000_000, 600
#: Shares of the messages, and longest time that one is held back [s].
LOST, DOUBLED, DELAYED, DAMAGED, LONGEST_DELAY = 0.05, 0.20, 0.20, 0.05, 1.0
#: Share of the time in which a box is not at its start, for its pace.
UPTIME = 0.6


@dataclass
class Result:
    """What a run came to."""

    seed: int
    kills: dict[str, int] = field(default_factory=dict)
    cuts: int = 0
    frames: int = 0
    sent_to_monitor: int = 0
    lost_on_the_way: int = 0
    doubled_on_the_way: int = 0
    delayed: int = 0
    damaged: int = 0
    boots: int = 0
    windows: int = 0
    findings: int = 0
    acknowledgements: int = 0
    acknowledged_not_stored: int = 0
    frames_lost: int = 0
    frames_left: int = 0
    windows_doubled: int = 0
    orphans: int = 0
    failures: list[str] = field(default_factory=list)
    is_equal: bool = False
    differs: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def is_kept(self) -> bool:
        """Whether every promise was kept."""
        return self.is_equal and self.is_sound

    @property
    def is_sound(self) -> bool:
        """Whether no promise has been broken so far."""
        faults = (
            self.acknowledged_not_stored,
            self.frames_lost,
            self.frames_left,
            self.windows_doubled,
            self.orphans,
            len(self.failures),
        )
        return not any(faults)


def until(condition: Callable[[], Any], *, timeout: float, what: str) -> Any:
    """Return the first true value of a condition."""
    end = time.monotonic() + timeout
    while not (value := condition()):
        if time.monotonic() > end:
            raise TimeoutError(f"not within {timeout:g} s: {what}")
        time.sleep(0.02)
    return value


def free_port(taken: set[int]) -> int:
    """Return a port at which nobody listens."""
    while True:
        port = random.randrange(PORTS.start, PORTS.stop)
        with socket.socket() as trial:
            if port not in taken and trial.connect_ex(("127.0.0.1", port)) != 0:
                taken.add(port)
                return port


class Program:
    """A process that is started again and again."""

    def __init__(self, name: str, command: Callable[[], list[str]], folder: Path) -> None:
        self.name = name
        self._command, self._folder = command, folder
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def log(self) -> Path:
        return self._folder / f"{self.name}.log"

    @property
    def exit_code(self) -> int | None:
        return None if self._process is None else self._process.poll()

    @property
    def children(self) -> list[int]:
        """Processes that it has started."""
        if self._process is None:
            return []
        found = Path(f"/proc/{self._process.pid}/task").glob("*/children")
        pids = []
        for path in found:
            with suppress(OSError):
                pids += [int(word) for word in path.read_text().split()]
        return pids

    def start(self) -> None:
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(self._command(), stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def end(self, number: int = signal.SIGKILL) -> None:
        """Send a signal and wait for the end; a mosquitto that has only just started may miss the first SIGTERM."""
        while self._process is not None and self._process.poll() is None:
            self._process.send_signal(number)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(10.0)


def broker(name: str, port: int, folder: Path) -> Program:
    """Return a mosquitto that keeps nothing on disk."""
    settings = folder / f"{name}.conf"
    # As root, mosquitto would become a user that may not read the folder.
    settings.write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\nlog_dest stdout\n"
        f"max_queued_messages 100000\nuser {pwd.getpwuid(os.geteuid()).pw_name}\n"
    )
    return Program(name, lambda: [str(MOSQUITTO), "-c", str(settings)], folder)


class Forwarder:
    """Hands bytes on between a port and a broker until the connection is cut."""

    def __init__(self, port: int, target: int) -> None:
        self._port, self._target = port, target
        self._pairs: list[tuple[socket.socket, socket.socket]] = []
        self._lock = threading.Lock()
        self._closed_until = 0.0
        self._is_over = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", port))
        threading.Thread(target=self._listen, daemon=True).start()

    @property
    def url(self) -> str:
        return f"mqtt://127.0.0.1:{self._port}"

    def cut(self, seconds: float) -> None:
        """Let what is under way vanish, and nobody through for a time."""
        self._closed_until = time.monotonic() + seconds
        self._hang_up()

    def close(self) -> None:
        self._is_over.set()
        self._listener.close()
        self._hang_up()

    def _hang_up(self) -> None:
        with self._lock:
            pairs, self._pairs = self._pairs, []
        for one in (each for pair in pairs for each in pair):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def _listen(self) -> None:
        while not self._is_over.is_set():
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            far = socket.socket()
            if time.monotonic() < self._closed_until or far.connect_ex(("127.0.0.1", self._target)) != 0:
                near.close()
                far.close()
                continue
            with self._lock:
                self._pairs.append((near, far))
            threading.Thread(target=self._forward, args=(near, far), daemon=True).start()

    def _forward(self, near: socket.socket, far: socket.socket) -> None:
        """Hand bytes on until one side hangs up."""
        other = {near: far, far: near}
        with near, far, suppress(OSError):
            while True:
                for one in select.select([near, far], [], [])[0]:
                    data = one.recv(1 << 16)
                    if not data:
                        return
                    other[one].sendall(data)


class Relay:
    """Carries messages from one broker to another, badly."""

    def __init__(self, upper: str, lower: str, *, generator: random.Random, store: Path, result: Result) -> None:
        self._random, self._store, self._result = generator, store, result
        self._arrived: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._held: list[tuple[float, int, str, bytes]] = []
        self._n_held = 0
        self._meta = b""
        self.ends: dict[int, int] = {}
        self.frames: dict[tuple[int, int], bytes] = {}
        self.position = BEGUN
        self.acknowledged: dict[int, int] = {}
        self.is_calm = False
        self._is_over = threading.Event()
        self._links = {
            "down": Link(
                Address.parse(upper),
                "chaos-box-side",
                topics=[topic(VEHICLE, what) for what in ("raw", "meta", "state")],
                on_message=self._from_box,
            ),
            "up": Link(
                Address.parse(lower),
                "chaos-monitor-side",
                topics=[topic(VEHICLE, "ack")],
                on_message=self._from_monitor,
                on_connected=self._described,
            ),
        }
        for link in self._links.values():
            link.open()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        for link in self._links.values():
            link.close()

    def _from_box(self, name: str, payload: bytes) -> None:
        """Take note of a message of the box."""
        if name.endswith("/meta"):
            self._meta = payload
        self._arrived.put((name, payload))

    def _from_monitor(self, name: str, payload: bytes) -> None:
        """See whether what is acknowledged is stored at this moment, before the box can hear of it."""
        document = checked_map(payload)
        boot, seq = document[2], document[3]
        self._result.acknowledgements += 1
        self.acknowledged[boot] = max(seq, self.acknowledged.get(boot, -1))
        if cursors(self._store).get(boot, (-1, -1, 0))[0] < seq:
            self._result.acknowledged_not_stored += 1
        self._arrived.put((name, payload))

    def _described(self) -> None:
        """Tell a new broker what the old one kept for the monitor."""
        if self._meta:
            self._arrived.put((topic(VEHICLE, "meta"), self._meta))

    def _carry(self) -> None:
        """Send what is due."""
        while not self._is_over.is_set():
            with suppress(queue.Empty):
                name, payload = self._arrived.get(timeout=0.02)
                if name.endswith("/raw"):
                    self._noted(payload)
                for delay, mangled in self._mangled(payload):
                    self._n_held += 1
                    heapq.heappush(self._held, (time.monotonic() + delay, self._n_held, name, mangled))
            while self._held and self._held[0][0] <= time.monotonic():
                _, _, name, payload = heapq.heappop(self._held)
                link = self._links["down" if name.endswith("/ack") else "up"]
                if link.publish(name, payload, is_retained=name.endswith("/meta")):
                    self._result.sent_to_monitor += name.endswith("/raw")
                else:
                    self._result.lost_on_the_way += 1

    def _noted(self, payload: bytes) -> None:
        """Take note of a frame; the same number must always be the same bytes."""
        document = checked_map(payload)
        boot, seq = document[2], document[3]
        self.position = max(self.position, document[4] + document[5] * document[7])
        digest = hashlib.sha256(payload).digest()
        if self.frames.setdefault((boot, seq), digest) != digest:
            self._result.failures.append(f"frame {boot}/{seq} came with different contents")

    def _mangled(self, payload: bytes) -> Iterator[tuple[float, bytes]]:
        """Yield what becomes of a message: delay and bytes."""
        chance, result = self._random.random, self._result
        if self.is_calm:
            yield 0.0, payload
            return
        if chance() < DAMAGED:
            result.damaged += 1
            yield 0.0, damaged(payload, self._random)
            if chance() < 0.5:
                return
        if chance() < LOST:
            result.lost_on_the_way += 1
            return
        is_delayed = chance() < DELAYED
        result.delayed += is_delayed
        yield chance() * LONGEST_DELAY if is_delayed else 0.0, payload
        if chance() < DOUBLED:
            result.doubled_on_the_way += 1
            yield chance() * LONGEST_DELAY, payload


def damaged(payload: bytes, generator: random.Random) -> bytes:
    """Return a message that is cut short, has a wrong byte, or is something else altogether."""
    kind, place = generator.randrange(3), generator.randrange(len(payload))
    if kind == 0:
        return payload[:place]
    if kind == 1:
        return payload[:place] + bytes([payload[place] ^ generator.randrange(1, 256)]) + payload[place + 1 :]
    return generator.randbytes(generator.randrange(200))


def rows(store: Path, query: str) -> list[tuple[Any, ...]]:
    """Return what a query finds in a store that another process writes; nothing where there is none yet."""
    if not store.exists():
        return []
    with closing(sqlite3.connect(f"file:{store}?mode=ro", uri=True, timeout=30.0)) as connection:
        try:
            return connection.execute(query).fetchall()
        except sqlite3.OperationalError as error:
            if "no such table" in str(error):
                return []
            raise


def cursors(store: Path) -> dict[int, tuple[int, int, int]]:
    """Return contiguous, done and lost of every boot."""
    return {row[0]: row[1:] for row in rows(store, "SELECT boot, contiguous, done, lost FROM cursors")}


def contents(store: Path) -> dict[str, list[tuple[Any, ...]]]:
    """Return what was found out about the vehicle, whatever boots it came in."""
    return {
        "observations": rows(store, "SELECT number, t0, document FROM observations ORDER BY number"),
        "modes": rows(store, "SELECT number, t0, document FROM modes ORDER BY number"),
        "findings": rows(store, "SELECT number, place, t0, document FROM findings ORDER BY number, place"),
        "baselines": rows(store, "SELECT version, reason, document FROM baselines ORDER BY version"),
        "alerts": rows(
            store, f"SELECT cause, severity, text, is_active FROM alerts WHERE vehicle = '{VEHICLE}' ORDER BY cause"
        ),
    }


@dataclass(frozen=True)
class Plan:
    """What a run is made of; times in minutes of driving, but `every` in seconds of the clock."""

    minutes: float
    drives: int
    window: float
    kills: int
    every: float
    patience: float
    seed: int

    @property
    def windows(self) -> int:
        return round(self.minutes / self.window)

    @property
    def duration(self) -> float:
        """Of a drive [s]."""
        return 60 * self.minutes / self.drives

    def ahead(self, position: int) -> float:
        """Return what is still to be driven at a time [s]."""
        passed, rest = divmod((position - BEGUN) / 1e9, self.duration + PAUSE)
        return 60 * self.minutes - passed * self.duration - min(rest, self.duration)

    def pace(self, position: int, n_kills: int) -> float:
        """Return how fast a box must go from there on to come to the end with the last kill."""
        left = max(self.kills - n_kills, 1) * self.every * UPTIME
        return max(self.ahead(position) / left, 0.1)


def drives(folder: Path, plan: Plan) -> list[Path]:
    """Write drives, the last of which has a soft spring, with pauses between them."""
    car, paths = read_vehicle("zafira"), []
    duration = plan.duration
    start = BEGUN
    for number in range(plan.drives):
        faults = (parse_fault("front_left.spring=-0.4"),) if number == plan.drives - 1 else ()
        settings = RoadDrive(duration=duration, snr=50.0, faults=faults)
        run = simulate_drive(car, settings, seed=number).recording
        paths.append(folder / f"drive-{number}.parquet")
        write(replace(run, start=start, history=()), paths[-1])
        start += round((duration + PAUSE) * 1e9)
    return paths


class Rig:
    """Box, brokers, monitor and all between them, in a folder."""

    def __init__(self, folder: Path, paths: list[Path], plan: Plan, result: Result, *, is_disturbed: bool) -> None:
        folder.mkdir()
        taken: set[int] = set()
        ports = [free_port(taken) for _ in range(5)]
        self.plan, self.result, self.store = plan, result, folder / "store.sqlite"
        self.pace = plan.pace(BEGUN, 0) if is_disturbed else None
        self._http = ports[4]
        site = folder / "site.toml"
        site.write_text(
            f'schema = "sprung.site/1"\nstore = "sqlite:///{self.store}"\nhttp = "127.0.0.1:{self._http}"\n'
            f"[watch]\nwindow_minutes = {plan.window}\nidentify_every_minutes = 1\nlearning_windows = 2\n"
            f"[keep]\nraw_days = 0\nfree_megabytes = 0\n"
        )
        self.brokers = [broker("broker-a", ports[0], folder), broker("broker-b", ports[1], folder)]
        self.forwarders = [Forwarder(ports[2], ports[0]), Forwarder(ports[3], ports[1])]
        self.monitor = Program(
            "monitor",
            lambda: [*SPRUNG, "monitor", "--site", str(site), "--broker", self.forwarders[1].url],
            folder,
        )
        self.box = Program("box", lambda: self._box_command(paths, folder / "spool"), folder)
        for one in (*self.brokers, self.monitor, self.box):
            one.start()
        urls = [f"mqtt://127.0.0.1:{port}" for port in ports[:2]]
        self.relay = Relay(*urls, generator=random.Random(plan.seed), store=self.store, result=result)
        self.relay.is_calm = not is_disturbed
        self.orphans: set[int] = set()

    def _box_command(self, paths: list[Path], spool: Path) -> list[str]:
        names = [str(path) for path in paths]
        pace = [] if self.pace is None else ["--pace", f"{self.pace:.3f}"]
        where = ["--broker", self.forwarders[0].url, "--spool", str(spool)]
        return [*SPRUNG, "box", *names, "--vehicle", "zafira", "--vehicle-id", VEHICLE, *where, *pace]

    def kill(self, kind: str, generator: random.Random) -> None:
        """End a program without a word, and start it again."""
        one = {"box": self.box, "monitor": self.monitor}.get(kind) or generator.choice(self.brokers)
        self.look()
        if one is self.monitor:
            self.orphans.update(one.children)
        one.end()
        one.start()
        self.result.kills[kind] = self.result.kills.get(kind, 0) + 1

    def look(self) -> None:
        """See that no program has ended by itself, other than a box that is done."""
        for one in (*self.brokers, self.monitor, self.box):
            code = one.exit_code
            if code is not None and not (one is self.box and code == 0):
                self.result.failures.append(f"{one.name} ended by itself with {code}: {tail(one.log)}")
                one.start()

    def figures(self) -> dict[str, float]:
        """Return the figures of the monitor; none where it does not answer."""
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self._http}/metrics", timeout=5.0) as answer:
                lines = answer.read().decode().splitlines()
        except OSError:
            return {}
        return {name: float(value) for name, value in (line.split() for line in lines if not line.startswith("#"))}

    def is_finished(self) -> bool:
        """Tell whether the box is done and the monitor idle."""
        self.look()
        if self.box.exit_code != 0:
            return False
        figures = self.figures()
        return figures.get("sprung_backlog_frames") == 0 and len(contents(self.store)["observations"]) >= (
            self.plan.windows
        )

    def close(self) -> None:
        self.relay.close()
        for one in (self.box, self.monitor, *self.brokers):
            one.end(signal.SIGTERM)
        for forwarder in self.forwarders:
            forwarder.close()


@contextmanager
def rig(folder: Path, paths: list[Path], plan: Plan, result: Result, *, is_disturbed: bool) -> Iterator[Rig]:
    """Return a rig that is taken down in the end."""
    made = Rig(folder, paths, plan, result, is_disturbed=is_disturbed)
    try:
        yield made
    finally:
        made.close()


def tail(path: Path) -> str:
    """Return the last lines of a log."""
    return " | ".join(path.read_text(errors="replace").splitlines()[-3:])


def is_alive(pid: int) -> bool:
    """Tell whether a process runs."""
    with suppress(OSError):
        return ") Z" not in Path(f"/proc/{pid}/stat").read_text()
    return False


def storm(one: Rig, generator: random.Random, say: Callable[[str], None]) -> None:
    """Kill and cut at random, as often as planned."""
    plan, result = one.plan, one.result
    until(lambda: one.relay.frames, timeout=60.0, what="the first frame")
    kinds = ["box", "broker", "monitor"]
    for number in range(plan.kills):
        time.sleep(generator.uniform(0.2, 2 * plan.every - 0.2))
        if generator.random() < 0.5:
            generator.choice(one.forwarders).cut(generator.uniform(0.0, 1.5))
            result.cuts += 1
            time.sleep(generator.uniform(0.0, 0.3))
        one.pace = plan.pace(one.relay.position, number)
        # The first of each kind come in turn, so that few kills, too, are of every kind.
        kind = kinds[number] if number < len(kinds) else generator.choice(kinds)
        one.kill(kind, generator)
        if number % 25 == 24:
            ahead = plan.ahead(one.relay.position)
            say(f"{number + 1} kills, {len(one.relay.frames)} frames, {ahead:.0f} s to drive, kept: {result.is_sound}")


def run(plan: Plan, folder: Path, say: Callable[[str], None]) -> Result:
    """Run the drives undisturbed and through the storm, and compare."""
    begun = time.monotonic()
    paths = drives(folder, plan)
    result = Result(plan.seed)
    generator = random.Random(plan.seed + 1)
    with (
        rig(folder / "calm", paths, plan, Result(plan.seed), is_disturbed=False) as calm,
        rig(folder / "storm", paths, plan, result, is_disturbed=True) as one,
    ):
        try:
            storm(one, generator, say)
            # What is left goes at once, and unharmed: every frame that is lost costs the box its patience.
            one.pace, one.relay.is_calm = None, True
            if one.box.exit_code is None:
                one.kill("box", generator)
            until(one.is_finished, timeout=plan.patience, what="the end of the run after the storm")
            until(calm.is_finished, timeout=plan.patience, what="the end of the undisturbed run")
        except TimeoutError as error:
            result.failures.append(f"{error}: {one.figures()}, cursors {cursors(one.store)}")
        one.monitor.end(signal.SIGTERM)
        if one.monitor.exit_code != 0:
            result.failures.append(f"the monitor stopped with {one.monitor.exit_code}: {tail(one.monitor.log)}")
        with suppress(TimeoutError):
            until(lambda: not any(map(is_alive, one.orphans)), timeout=5.0, what="the end of orphans")
        result.orphans = sum(map(is_alive, one.orphans))
        compared(one, contents(calm.store), result)
    result.seconds = round(time.monotonic() - begun, 1)
    return result


def compared(one: Rig, expected: dict[str, list[tuple[Any, ...]]], result: Result) -> None:
    """Compare the store with that of the undisturbed run, and with what boxes and acknowledgements said."""
    found = contents(one.store)
    result.differs = [name for name in found if found[name] != expected.get(name)]
    result.is_equal = not result.differs and len(found["observations"]) == one.plan.windows
    result.windows, result.findings = len(found["observations"]), len(found["findings"])
    times = Counter(row[1] for row in found["observations"])
    result.windows_doubled = sum(count - 1 for count in times.values())
    result.frames = len(one.relay.frames)
    result.boots = len({boot for boot, _ in one.relay.frames})
    reached = cursors(one.store)
    ends: dict[int, int] = {}
    for boot, seq in one.relay.frames:
        ends[boot] = max(seq, ends.get(boot, -1))
    short = (max(0, last - reached.get(boot, (-1, -1, 0))[0]) for boot, last in ends.items())
    result.frames_lost = sum(short) + sum(lost for _, _, lost in reached.values())
    result.frames_left = rows(one.store, "SELECT count(*) FROM frames")[0][0]


def table(result: Result) -> str:
    """Return the result as lines."""
    fields = asdict(result) | {"is_kept": result.is_kept}
    return "\n".join(f"{name.replace('_', ' '):26} {value}" for name, value in fields.items())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--every", type=float, default=2.0, help="mean time between kills [s]")
    parser.add_argument("--minutes", type=float, default=12.0, help="of driving: a multiple of the window")
    parser.add_argument("--drives", type=int, default=4)
    parser.add_argument("--window", type=float, default=2.0, help="[min]")
    parser.add_argument("--patience", type=float, default=300.0, help="for the end after the last kill [s]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for logs, spool and store; default: one that is removed")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    given = parser.parse_args()
    if MOSQUITTO is None:
        parser.error("there is no mosquitto: install Debian's package (scripts/system-packages)")
    if (60 * given.minutes / given.drives) % 1 or (given.minutes / given.window) % 1:
        parser.error("--minutes must be a multiple of --window, and --drives of whole seconds: the last window ends it")
    plan = Plan(given.minutes, given.drives, given.window, given.kills, given.every, given.patience, given.seed)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        result = run(plan, folder, lambda text: print(text, file=sys.stderr, flush=True))
    print(json.dumps(asdict(result) | {"is_kept": result.is_kept}) if given.json else table(result))
    return 0 if result.is_kept else 1


if __name__ == "__main__":
    sys.exit(main())
