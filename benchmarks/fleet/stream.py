"""A day of frames at speed through a stream of Spark whose driver is killed: tables, memory and speed.

    python benchmarks/fleet/stream.py [--vehicles 10] [--windows 12] [--minutes 3] [--kills 4] [--seed 1]

Frames of simulated drives, a sixth of them twice, appear shuffled in files of a folder, one every few seconds.
`sprung fleet stream` is killed (SIGKILL, the driver alone or with all of its processes), in turn soon after a commit
and at random moments, and started again until every window has its results; the tables must then equal those of a
stream that nothing disturbs.
"""

import argparse
import json
import math
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from sprung.fleet.jobs import Results
from sprung.link import Frame, encode, quantised
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle, vehicle_text

RATE, FRAME = 100, 1000
START, BETWEEN = 1_767_225_600 * 10**9, 7200 * 10**9
TABLES = ("windows", "baselines", "types", "diagnoses", "findings")
TOLERANCE = 1e-9
PROGRAM = [sys.executable, "-c", "from sprung.cli import main; raise SystemExit(main())", "fleet", "stream"]


def main() -> None:
    """Run, and print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--windows", type=int, default=12)
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--kills", type=int, default=4)
    parser.add_argument("--files", type=int, default=24)
    parser.add_argument("--seconds", type=float, default=5.0, help="time between files")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="fleet-stream-"))
    chance = random.Random(given.seed)
    files = arriving(frames_of_fleet(folder / "vehicles", given), given.files, chance)
    expected = given.vehicles * given.windows
    print(f"{expected} windows of {given.minutes:g} min, {sum(map(len, files))} messages in {len(files)} files")

    put(folder / "calm", files)
    calm = Run(folder, "calm", given.minutes, chance)
    calm.once()
    print(f"undisturbed: {calm.summary()}")

    disturbed = Run(folder, "disturbed", given.minutes, chance)
    feeder = threading.Thread(target=put, args=(folder / "disturbed", files, given.seconds), daemon=True)
    feeder.start()
    disturbed.until(expected, kills=given.kills)
    print(f"disturbed: {disturbed.summary()}")
    print(f"kills: {'; '.join(disturbed.kills)}")
    print("memory [MB] over time [s]: Java, driver, workers (number)")
    for line in disturbed.memory[:: max(1, len(disturbed.memory) // 20)]:
        print("   ", line)

    different = compared(Results(folder / "calm-results"), Results(folder / "disturbed-results"))
    print("tables:", ", ".join(f"{name} {count} rows" for name, (count, _) in different.items()))
    problems = [problem for _, own in different.values() for problem in own]
    print("differences:", *(problems[:10] or ["none"]), sep="\n    ")
    shutil.rmtree(folder)
    sys.exit(bool(problems))


def frames_of_fleet(vehicles: Path, given: argparse.Namespace) -> dict[str, list[bytes]]:
    """Return the frames of each vehicle, and write the vehicle files; the first one's damper fails half-way."""
    vehicles.mkdir()
    car = read_vehicle("zafira")
    frames: dict[str, list[bytes]] = {}
    for number in range(given.vehicles):
        name = f"car{number:03d}"
        (vehicles / f"{name}.toml").write_text(vehicle_text(car))
        frames[name] = []
        for window in range(given.windows):
            is_faulty = number == 0 and window >= given.windows // 2
            faults = (parse_fault("rear_left.damper=-0.5"),) if is_faulty else ()
            drive = RoadDrive(duration=60 * given.minutes, sampling_rate=float(RATE), snr=50.0, faults=faults)
            recording = simulate_drive(car, drive, seed=[given.seed, number, window]).recording
            scale = np.max(np.abs(recording.samples), axis=1) / 32_000
            counts, _, flags = quantised(recording.samples, scale=scale)
            for first in range(0, recording.n_samples, FRAME):
                frame = Frame(
                    vehicle=name,
                    boot=0,
                    seq=len(frames[name]),
                    start=START + window * BETWEEN + first * 10**9 // RATE,
                    interval=10**9 // RATE,
                    channels=tuple(channel.name for channel in recording.channels),
                    scale=scale,
                    counts=counts[:, first : first + FRAME],
                    flags=flags,
                )
                frames[name].append(encode(frame))
    return frames


def arriving(frames: dict[str, list[bytes]], n_files: int, chance: random.Random) -> list[list[tuple[str, bytes]]]:
    """Return messages as they arrive in files: out of order across neighbouring files, some of them twice."""
    files: list[list[tuple[str, bytes]]] = [[] for _ in range(n_files)]
    for vehicle, own in frames.items():
        for place, payload in enumerate(own):
            due = place * n_files // len(own)
            for _ in range(2 if chance.random() < 1 / 6 else 1):
                late = min(n_files - 1, due + chance.choice([0, 0, 0, 0, 1, 2]))
                files[late].append((vehicle, payload))
    for messages in files:
        chance.shuffle(messages)
    return files


def put(folder: Path, files: list[list[tuple[str, bytes]]], seconds: float = 0.0) -> None:
    """Let files appear in a folder."""
    folder.mkdir()
    for number, messages in enumerate(files):
        keys, values = zip(*messages, strict=True)
        pq.write_table(pa.table({"key": keys, "value": pa.array(values, pa.binary())}), folder / f".{number}")
        (folder / f".{number}").rename(folder / f"{number:04d}.parquet")
        time.sleep(seconds)


@dataclass
class Run:
    """A stream in processes of its own, started as often as it is killed."""

    folder: Path
    name: str
    minutes: float
    chance: random.Random
    begun: float = field(default_factory=time.monotonic)
    kills: list[str] = field(default_factory=list)
    ready: list[float] = field(default_factory=list)
    first: list[float] = field(default_factory=list)
    memory: list[str] = field(default_factory=list)
    n_windows: int = 0
    elapsed: float = 0.0
    process: subprocess.Popen[str] | None = None

    def once(self) -> None:
        """Analyse what there is."""
        self.start("--once")
        assert self.process is not None
        if self.process.wait():
            raise RuntimeError((self.folder / f"{self.name}.log").read_text())
        self.elapsed, self.n_windows = time.monotonic() - self.begun, self.rows()

    def until(self, expected: int, *, kills: int) -> None:
        """Run until all windows have results, with kills at random moments, and end in good order."""
        self.start("--every", "3")
        assert self.process is not None
        at, known = self.moment(), 0
        while True:
            time.sleep(0.5)
            self.look()
            before, known = known, self.rows()
            is_commit = known > before  # the assessment has just begun
            is_due = is_commit if len(self.kills) % 2 == 0 else time.monotonic() > at
            if len(self.kills) < kills and is_due:
                time.sleep(self.chance.uniform(0, 4) if is_commit else 0)
                self.kill()
                self.start("--every", "3")
                at = self.moment()
            elif self.process.poll() is not None:
                raise RuntimeError((self.folder / f"{self.name}.log").read_text()[-3000:])
            elif self.is_complete(expected):
                break
        self.elapsed, self.n_windows = time.monotonic() - self.begun, self.rows()
        self.process.send_signal(signal.SIGTERM)
        print(f"exit status after SIGTERM: {self.process.wait(timeout=300)}")

    def is_complete(self, expected: int) -> bool:
        """Return whether every window has a result that is part of a diagnosis."""
        diagnoses = Results(self.folder / f"{self.name}-results")["diagnoses"].rows(["n_windows"])
        return self.rows() >= expected and sum(diagnoses["n_windows"].to_pylist()) >= expected

    def rows(self) -> int:
        """Return the number of windows with results."""
        return sum(file.n_rows for file in Results(self.folder / f"{self.name}-results")["windows"].files())

    def moment(self) -> float:
        """Return a moment to kill at: before Spark is ready, while a batch is analysed, or later."""
        return time.monotonic() + self.chance.uniform(40, 200)

    def start(self, *more: str) -> None:
        """Start the program."""
        began, number = time.monotonic(), len(self.ready)
        arguments = [
            "--vehicles",
            "vehicles",
            "--out",
            f"{self.name}-results",
            "--checkpoint",
            f"{self.name}-checkpoint",
        ]
        arguments += [
            "--frames",
            self.name,
            "--steps",
            "baseline,diagnose",
            "--learn",
            "4",
            "--window",
            str(self.minutes),
        ]
        arguments += ["--master", "local[2]", *more]
        self.ready.append(math.nan)
        self.first.append(math.nan)
        log = (self.folder / f"{self.name}.log").open("a")
        self.process = subprocess.Popen(
            PROGRAM + arguments,
            cwd=self.folder,
            env=os.environ | {"PYSPARK_SUBMIT_ARGS": "--driver-memory 1g pyspark-shell"},
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

        def read(stream: Any) -> None:
            for line in stream:
                log.write(line)
                log.flush()
                if "Spark is ready" in line:
                    self.ready[number] = time.monotonic() - began
                if re.search(r"batch \d+", line) and math.isnan(self.first[number]):
                    self.first[number] = time.monotonic() - began

        threading.Thread(target=read, args=(self.process.stderr,), daemon=True).start()

    def kill(self) -> None:
        """Kill the driver, or all processes of the program."""
        assert self.process is not None
        own = list(self.processes())
        is_alone = self.chance.random() < 0.5
        self.process.kill()
        for pid, _ in own if not is_alone else []:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        self.process.wait()
        who = "driver" if is_alone else f"all {len(own)} processes"
        self.kills.append(f"{who} at {time.monotonic() - self.begun:.0f} s with {self.rows()} windows")

    def processes(self) -> Iterator[tuple[int, str]]:
        """Yield the processes of the program: number and kind."""
        assert self.process is not None
        for entry in Path("/proc").iterdir():
            try:
                name, _, rest = (entry / "stat").read_text().partition(") ") if entry.name.isdigit() else ("", "", "")
                if rest and int(rest.split()[3]) == self.process.pid:
                    pid = int(entry.name)
                    kind = "Java" if "java" in name else "driver" if pid == self.process.pid else "worker"
                    yield pid, kind
            except (OSError, IndexError):
                continue

    def look(self) -> None:
        """Note the memory of the processes."""
        sums: dict[str, list[float]] = {"Java": [], "driver": [], "worker": []}
        for pid, kind in self.processes():
            try:
                pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="utf-8").split()[1])
            except OSError:
                continue
            sums[kind].append(pages * os.sysconf("SC_PAGE_SIZE") / 1e6)
        at = time.monotonic() - self.begun
        line = f"{at:6.0f}: {sum(sums['Java']):6.0f} {sum(sums['driver']):6.0f} {sum(sums['worker']):6.0f}"
        self.memory.append(f"{line} ({len(sums['worker'])}), {self.rows()} windows")

    def summary(self) -> str:
        """Return speed and start-up times."""
        speed = f"{self.n_windows} windows in {self.elapsed:.0f} s ({self.n_windows / self.elapsed:.2f}/s)"
        times = [f"{ready:.0f}/{first:.0f}" for ready, first in zip(self.ready, self.first, strict=True)]
        return f"{speed}; Spark ready and first batch done after {', '.join(times)} s"


def compared(left: Results, right: Results) -> dict[str, tuple[int, list[str]]]:
    """Return number of rows and differences by table."""
    differences = {}
    for name in TABLES:
        pair = [sorted(results[name].rows().to_pylist(), key=key_of) for results in (left, right)]
        problems = [] if len(pair[0]) == len(pair[1]) else [f"{name}: {len(pair[0])} and {len(pair[1])} rows"]
        for row, other in zip(*pair, strict=False):
            problems += [
                f"{name}.{column} of {key_of(row)}" for column in row if not are_equal(row[column], other[column])
            ]
        differences[name] = len(pair[0]), problems
    return differences


def key_of(row: dict[str, Any]) -> tuple[str, ...]:
    """Return what identifies a row."""
    return tuple(str(row.get(name)) for name in ("vehicle", "type", "start", "digest", "corner", "component"))


def are_equal(value: Any, other: Any) -> bool:
    """Return whether values are equal, numbers to a billionth."""
    if isinstance(value, dict):
        return (
            isinstance(other, dict)
            and value.keys() == other.keys()
            and all(are_equal(value[k], other[k]) for k in value)
        )
    if isinstance(value, list | tuple):
        return len(value) == len(other) and all(map(are_equal, value, other))
    if isinstance(value, float) and isinstance(other, float):
        return math.isclose(value, other, rel_tol=TOLERANCE, abs_tol=TOLERANCE) or (
            math.isnan(value) and math.isnan(other)
        )
    if isinstance(value, str) and value.startswith("{") and isinstance(other, str):
        return are_equal(json.loads(value), json.loads(other))
    if isinstance(value, bytes) and isinstance(other, bytes) and len(value) == len(other) and len(value) % 8 == 0:
        return np.allclose(np.frombuffer(value), np.frombuffer(other), rtol=TOLERANCE, atol=TOLERANCE)
    return bool(value == other)


if __name__ == "__main__":
    main()
