"""Many people look at one server, some programs misbehave, and the store changes: answer times, memory, processor time.

    python benchmarks/viewers.py [--viewers 200] [--minutes 3] [--vehicles 500] [--changing 3] [--hostile]

The server runs in a process of its own. Each viewer listens to the live events and loads a page now and then, from an
address of its own on this machine. With `--hostile` others take nothing of what they asked for, drip heads or bodies,
send bodies that are too large, and ask without pause.
"""

import argparse
import asyncio
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from fleet_pages import fill

from sprung.online.monitor import Site, operations
from sprung.online.site import Context, Server
from sprung.online.store import open_store

PATHS = ("/", "/alerts", "/vehicles/bus-000001", "/alerts/4", "/api/v1/vehicles", "/static/base.css")
#: Time between pages of a viewer, between changes of the store, and between looks at the server [s].
THINKING, CHANGING, LOOKING = 10.0, 0.5, 10.0
#: Number of programs of each kind that misbehave.
HOSTILE = 20
#: Longest time for a request to be refused or cut off [s].
PATIENCE = 90.0


@dataclass
class Seen:
    """What viewers and misbehaving programs saw."""

    times: dict[str, list[float]] = field(default_factory=dict)
    latest: list[float] = field(default_factory=list)
    events: int = 0
    broken: int = 0
    hostile: Counter[str] = field(default_factory=Counter)


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--viewers", type=int, default=200)
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--vehicles", type=int, default=500)
    parser.add_argument("--changing", type=float, default=float("inf"), help="minutes during which the store changes")
    parser.add_argument("--hostile", action="store_true")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.serve)
        return
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite:///{folder}/store.sqlite"
        with open_store(url) as store:
            fill(store, given.vehicles, given.vehicles)
        command = [sys.executable, __file__, "--serve", url]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None
            port = int(server.stdout.readline())
            try:
                asyncio.run(watch(url, port, server.pid, given))
            finally:
                server.communicate()


def serve(url: str) -> None:
    """Serve a store until the standard input ends."""
    with open_store(url) as store:
        server = Server(Context(store, Site(http="127.0.0.1:0"), figures=dict, problems=list))
        server.open()
        print(server.address[1], flush=True)
        sys.stdin.read()
        server.close()


async def watch(url: str, port: int, pid: int, given: argparse.Namespace) -> None:
    """Run all viewers, and print what came of it."""
    seen, end = Seen(), time.monotonic() + 60 * given.minutes
    looks: list[tuple[float, float, float]] = []
    tasks = [
        asyncio.create_task(act) for k in range(given.viewers) for act in (listen(port, k, seen), load(port, k, seen))
    ]
    tasks.append(asyncio.create_task(asyncio.to_thread(change, url, min(end, time.monotonic() + 60 * given.changing))))
    if given.hostile:
        tasks += [asyncio.create_task(each) for each in hostile(port, seen)]
    print("| time [s] | memory [MB] | processor [%] | events | pages | longest answer [ms] |")
    print("|---|---|---|---|---|---|")
    looks.append((time.monotonic(), memory_of(pid), processor_of(pid)))
    n_events = 0
    while time.monotonic() < end:
        await asyncio.sleep(LOOKING)
        looks.append((time.monotonic(), memory_of(pid), processor_of(pid)))
        (before, _, used), (now, memory, present) = looks[-2:]
        longest = 1000 * max(seen.latest, default=0.0)
        share = 100 * (present - used) / (now - before)
        counts = f"{seen.events - n_events} | {len(seen.latest)} | {longest:.0f}"
        print(f"| {now - looks[0][0]:.0f} | {memory:.0f} | {share:.0f} | {counts} |", flush=True)
        n_events = seen.events
        seen.latest.clear()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    report(seen)


def report(seen: Seen) -> None:
    """Print the times of each page, and what came of programs that misbehave."""
    print("\n| page | answers | median [ms] | 99 % [ms] |\n|---|---|---|---|")
    for path, times in seen.times.items():
        ordered = sorted(times)
        print(
            f"| {path} | {len(times)} | {1e3 * median(times):.0f} | {1e3 * ordered[int(0.99 * (len(times) - 1))]:.0f} |"
        )
    print(f"\n{seen.events} events came; {seen.broken} connections of viewers broke")
    for name, number in sorted(seen.hostile.items()):
        print(f"- {name}: {number}")


def memory_of(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1000


def processor_of(pid: int) -> float:
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def change(url: str, end: float) -> None:
    """Change an alert now and then."""
    with open_store(url) as store:
        while time.monotonic() < end:
            operations.add_comment(store, 4, who="eve", comment="seen", now=time.time_ns())
            time.sleep(CHANGING)


def address(viewer: int) -> tuple[str, int]:
    """Return the address of a viewer on this machine."""
    return f"127.1.{viewer // 250}.{viewer % 250 + 1}", 0


def head(path: str, *, method: str = "GET", more: str = "") -> bytes:
    """Return the head of a request."""
    return f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n{more}\r\n".encode()


async def listen(port: int, viewer: int, seen: Seen) -> None:
    """Listen to the events."""
    while True:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=address(viewer))
        try:
            writer.write(head("/api/v1/events"))
            while line := await reader.readline():
                seen.events += line.startswith(b"event:")
        finally:
            writer.close()
        seen.broken += 1


async def load(port: int, viewer: int, seen: Seen) -> None:
    """Load a page now and then."""
    chance = random.Random(viewer)
    await asyncio.sleep(chance.uniform(0.0, THINKING))
    while True:
        path = chance.choice(PATHS)
        begin = time.perf_counter()
        reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=address(viewer))
        writer.write(head(path))
        answer = await reader.read(-1)
        writer.close()
        if not answer.startswith(b"HTTP/1.1 200"):
            raise RuntimeError(f"{path}: {answer[:200]!r}")
        seen.times.setdefault(path, []).append(time.perf_counter() - begin)
        seen.latest.append(seen.times[path][-1])
        await asyncio.sleep(chance.uniform(0.5, 1.5) * THINKING)


def hostile(port: int, seen: Seen) -> list["asyncio.Future[None] | object"]:
    """Return the acts of programs that misbehave."""
    long = "Content-Type: application/json\r\nContent-Length: {}\r\n"
    body = head("/api/v1/session", method="POST", more=long.format(5000))
    large = head("/api/v1/session", method="POST", more=long.format(10**9))
    acts: list[object] = []
    for k in range(HOSTILE):
        acts += [
            take_nothing(port, 1000 + k, seen),
            drip(port, 1100 + k, seen, b"GET / HTTP/1.1\r\nX: ", "drips a head"),
            drip(port, 1200 + k, seen, body, "drips a body"),
            drip(port, 1300 + k, seen, large, "body too large"),
        ]
    return [*acts, flood(port, 1400, seen)]


async def take_nothing(port: int, viewer: int, seen: Seen) -> None:
    """Ask for something large, and read none of it until the server gives up."""
    _, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=address(viewer), limit=1)
    writer.write(head("/static/plotly.js"))
    begin = time.monotonic()
    while time.monotonic() - begin < PATIENCE:
        await asyncio.sleep(1.0)
        try:
            writer.write(b"x")
            await writer.drain()
        except OSError:
            seen.hostile["takes nothing: cut off"] += 1
            return
    seen.hostile["takes nothing: NOT cut off"] += 1


async def drip(port: int, viewer: int, seen: Seen, begin: bytes, name: str) -> None:
    """Send a request in single bytes, until there is an answer or the end."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=address(viewer))
    writer.write(begin)
    answer = asyncio.create_task(reader.read(12))
    for _ in range(int(PATIENCE)):
        done, _ = await asyncio.wait([answer], timeout=1.0)
        if done:
            status = answer.result().decode()[9:] if not answer.exception() else ""
            seen.hostile[f"{name}: {status or 'cut off'}"] += 1
            writer.close()
            return
        writer.write(b"x")
    seen.hostile[f"{name}: NOT cut off"] += 1


async def flood(port: int, viewer: int, seen: Seen) -> None:
    """Ask without pause."""
    while True:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=address(viewer))
        writer.write(head("/health"))
        answer = await reader.read(-1)
        seen.hostile[f"asks without pause: {answer[9:12].decode()}"] += 1
        writer.close()


if __name__ == "__main__":
    main()
