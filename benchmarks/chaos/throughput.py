"""Frames stored per second by a monitor on PostgreSQL, and the processor time of a frame.

The first frame of every vehicle is withheld, so that all others are stored and none is analysed or acknowledged.

Run as `python benchmarks/chaos/throughput.py`, or under `taskset -c 0` for one core.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

from processes import until
from servers import postgresql
from takeover import Plan, Rig, rig

from fleet import DRIVING_RATE, driven, framed
from sprung.link import Address, Link, topic

#: Clock ticks of a second.
_TICKS = os.sysconf("SC_CLK_TCK")
#: Most frames that wait in the broker: it drops what a monitor leaves to it beyond that.
_AHEAD = 2000
#: Length of a frame [s]: four accelerations and speed at 200 Hz.
_LENGTH = 10.0


def n_frames(one: Rig) -> int:
    """Return the number of frames in the store."""
    return int(one.database.rows("SELECT count(*) FROM frames")[0][0])


def cpu_times(one: Rig, server: Path) -> dict[str, float]:
    """Return the processor time of this process, of monitors without their workers, PostgreSQL and broker [s]."""
    database = (server / "data" / "postmaster.pid").read_text().split()[0]
    times = {int(path.parent.name): _times(path) for path in Path("/proc").glob("[0-9]*/stat")}
    return {
        "sender": time.process_time(),
        "monitors": sum(times[program.pid][1] for program in one.monitors if program.pid is not None),
        "PostgreSQL": sum(seconds for parent, seconds in times.values() if parent == int(database)),
        "broker": sum(times[pid][1] for pid in (one.broker.pid,) if pid is not None),
    }


def _times(path: Path) -> tuple[int, float]:
    """Return the parent and the processor time of a process [s]; 0 if it has just ended."""
    try:
        words = path.read_text(encoding="utf-8", errors="replace").rpartition(") ")[2].split()
    except OSError:
        return 0, 0.0
    return int(words[1]), (int(words[11]) + int(words[12])) / _TICKS


def core_times() -> tuple[float, float]:
    """Return the times that all cores together have run, and stood idle, since the machine started [s]."""
    user, nice, system, idle, waiting, *rest = map(
        int, Path("/proc/stat").read_text(encoding="utf-8").splitlines()[0].split()[1:]
    )
    return (user + nice + system + sum(rest[:3])) / _TICKS, (idle + waiting) / _TICKS


def flood(one: Rig, server: Path, frames: list[tuple[str, bytes]]) -> tuple[float, dict[str, float]]:
    """Send frames as fast as they are stored, and return the time and the processor times that it took [s]."""
    link = Link(Address.parse(one.url), "chaos-flood", topics=[], on_message=lambda name, payload: None)
    link.open(timeout=30.0)
    begun, before = time.monotonic(), cpu_times(one, server)
    for start in range(0, len(frames), _AHEAD // 4):
        for vehicle, payload in frames[start : start + _AHEAD // 4]:
            link.publish(topic(vehicle, "raw"), payload)
        least = start - _AHEAD // 2
        until(lambda least=least: n_frames(one) >= least, timeout=120.0, what="frames stored")
    until(lambda: n_frames(one) == len(frames), timeout=120.0, what="all frames stored")
    seconds, after = time.monotonic() - begun, cpu_times(one, server)
    link.close()
    return seconds, {name: after[name] - used for name, used in before.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=300)
    parser.add_argument("--frames", type=int, default=20, help="of each vehicle")
    given = parser.parse_args()
    drive, size = driven(_LENGTH * (given.frames + 1)), round(_LENGTH * DRIVING_RATE)
    frames = [
        (name, framed(name, seq, drive[:, seq * size : (seq + 1) * size], DRIVING_RATE))
        for seq in range(1, given.frames + 1)
        for name in (f"car-{number}" for number in range(given.vehicles))
    ]
    print(f"{len(frames)} frames of {sum(len(payload) for _, payload in frames) / len(frames):.0f} bytes", flush=True)
    plan = Plan(1, given.vehicles, 0, 1, 0.0, 0.0, 0.0, 0)
    with (
        tempfile.TemporaryDirectory() as folder,
        postgresql() as server,
        rig(Path(folder) / "flood", plan, server, monitors=1) as one,
    ):
        time.sleep(1.0)  # subscribed
        before = core_times()
        seconds, used = flood(one, server, frames)
        busy, idle = (after - earlier for earlier, after in zip(before, core_times(), strict=True))
    costs = ", ".join(f"{name} {1e6 * cost / len(frames):.0f}" for name, cost in used.items())
    own, whole = sum(used.values()), busy + idle
    print(
        f"{len(frames) / seconds:.0f} frames/s; us of processor a frame: {costs}; of the"
        f" cores {own / whole:.0%} for these, {(busy - own) / whole:.0%} for others, {idle / whole:.0%} idle",
        flush=True,
    )


if __name__ == "__main__":
    main()
