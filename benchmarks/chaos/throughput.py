"""Frames stored per second by one monitor and several on one PostgreSQL, and the processor time of each.

The first frame of every vehicle is withheld, so that all others are stored and none is analysed or acknowledged.

Run as `python benchmarks/chaos/throughput.py`, or under `taskset -c 0` for one core.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

from fleet import frame_of
from processes import until
from servers import postgresql
from several import Plan, Rig, rig

from sprung.link import Address, Link, topic

#: Clock ticks of a second.
_TICKS = os.sysconf("SC_CLK_TCK")
#: Most frames that wait in the broker: it drops what a monitor leaves to it beyond that.
_AHEAD = 4000


def n_frames(one: Rig) -> int:
    """Return the number of frames in the store."""
    return int(one.database.rows("SELECT count(*) FROM frames")[0][0])


def n_holders(one: Rig) -> int:
    """Return the number of monitors that hold shards."""
    return int(one.database.rows("SELECT count(DISTINCT holder) FROM leases")[0][0])


def cpu_time(one: Rig) -> float:
    """Return the processor time of the monitors, without those of their workers [s]."""
    words = [Path(f"/proc/{program.pid}/stat").read_text().rpartition(") ")[2].split() for program in one.monitors]
    return sum(int(word[11]) + int(word[12]) for word in words) / _TICKS


def flood(one: Rig, frames: list[tuple[str, bytes]]) -> tuple[float, float]:
    """Send frames as fast as they are stored, and return the time and the processor time that it took [s]."""
    link = Link(Address.parse(one.url), "chaos-flood", topics=[], on_message=lambda name, payload: None)
    link.open(timeout=30.0)
    begun, used = time.monotonic(), cpu_time(one)
    for start in range(0, len(frames), _AHEAD // 4):
        for vehicle, payload in frames[start : start + _AHEAD // 4]:
            link.publish(topic(vehicle, "raw"), payload)
        least = start - _AHEAD // 2
        until(lambda least=least: n_frames(one) >= least, timeout=120.0, what="frames stored")
    until(lambda: n_frames(one) == len(frames), timeout=120.0, what="all frames stored")
    seconds, used = time.monotonic() - begun, cpu_time(one) - used
    link.close()
    return seconds, used


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--monitors", type=int, default=3)
    parser.add_argument("--vehicles", type=int, default=300)
    parser.add_argument("--frames", type=int, default=40, help="of each vehicle")
    given = parser.parse_args()
    numbers = [(f"car-{number}", number) for number in range(given.vehicles)]
    frames = [(name, frame_of(name, number, seq)) for seq in range(1, given.frames + 1) for name, number in numbers]
    plan = Plan(given.monitors, given.vehicles, 0, 1, 0.0, 0.0, 30.0, 0.0, 0)
    for n_monitors in range(1, given.monitors + 1):
        with (
            tempfile.TemporaryDirectory() as folder,
            postgresql() as server,
            rig(Path(folder) / f"flood{n_monitors}", plan, server, monitors=n_monitors) as one,
        ):
            until(lambda one=one, n=n_monitors: n_holders(one) == n, timeout=120.0, what="the start of all")
            time.sleep(1.0)  # subscribed
            seconds, used = flood(one, frames)
        rate, cost = len(frames) / seconds, 1e6 * used / len(frames)
        print(f"{n_monitors} monitors: {rate:6.0f} frames/s, {cost:5.0f} us of processor a frame", flush=True)


if __name__ == "__main__":
    main()
