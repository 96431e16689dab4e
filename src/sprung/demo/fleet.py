"""A small simulated fleet that sends data as real vehicles would."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sprung.box import blocks_of
from sprung.box.running import box_of
from sprung.link import Address, Spool
from sprung.recording import Recording
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import Vehicle, parse_fault

#: Length of a piece of a drive, and of a block [s].
PIECE, _BLOCK = 600.0, 5.0


@dataclass(frozen=True, slots=True)
class Member:
    """A vehicle of the fleet.

    Parameters
    ----------
    name
        Name of the vehicle.
    seed
        Seed of its drives.
    fault
        Fault, such as "front_left.spring=-0.25"; empty: none.
    dead_channel
        Sensor that dies; empty: none.
    after
        Number of pieces of ten minutes before the fault.
    """

    name: str
    seed: int
    fault: str = ""
    dead_channel: str = ""
    after: int = 5


def drives(car: Vehicle, member: Member, start: int) -> Iterator[Recording]:
    """Yield the blocks of the endless drive of a member from a time (UTC ns) on; `car` is the healthy vehicle."""
    number = 0
    while True:
        is_bad = number >= member.after
        faults = (parse_fault(member.fault),) if is_bad and member.fault else ()
        settings = RoadDrive(
            duration=PIECE,
            snr=50.0,
            road=RoadConditions("BCD"[(member.seed + number) % 3]),
            faults=faults,
            n_stops=number % 2,
        )
        run = simulate_drive(car, settings, seed=[member.seed, number]).recording
        if is_bad and member.dead_channel:
            samples = np.array(run.samples)
            samples[run.index(member.dead_channel)] = 0.0
            run = replace(run, samples=samples)
        yield from blocks_of(replace(run, start=start), length=_BLOCK)
        start += round(run.duration * 1e9)
        number += 1


def drive_fleet(address: Address, car: Vehicle, members: Sequence[Member], *, folder: Path, pace: float) -> None:
    """Drive a fleet of identical cars at a pace, starting two hours ago, until the process is stopped."""
    begun = time.time_ns() - 7200 * 10**9
    boxes, sources = [], []
    for member in members:
        boxes.append(box_of(member.name, car, Spool(folder / member.name, is_synced=False), address))
        boxes[-1].open()
        sources.append(drives(car, member, begun))
    clock, driven = time.monotonic(), 0.0
    while True:
        for box, source in zip(boxes, sources, strict=True):
            box.take(next(source))
            box.step()
        driven += _BLOCK
        while (ahead := clock + driven / pace - time.monotonic()) > 0:
            for box in boxes:
                box.step()
            time.sleep(min(ahead, 0.02))
