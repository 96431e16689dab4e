"""A small simulated fleet that sends data as real vehicles would."""

import signal
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sprung.link import Address, Spool
from sprung.online.box import blocks_of
from sprung.online.box.running import box_of
from sprung.recording import Recording
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import Vehicle, parse_fault

#: Length of a piece of a drive, and of a block [s].
PIECE, _BLOCK = 600.0, 5.0
#: Time from the start of the drives to that of the program [ns].
_AGO = 3 * 3600 * 10**9


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
    """Drive a fleet of identical cars until the process is stopped.

    The drives began three hours ago. They continue at a pace until they have reached the present, then in real time.

    Parameters
    ----------
    address
        Address of the broker.
    car
        Vehicle without a fault.
    members
        Vehicles of the fleet.
    folder
        Folder of the spools.
    pace
        Speed of the drives, as a multiple of real time.

    Examples
    --------
    >>> from pathlib import Path
    >>> from sprung.link import Address
    >>> from sprung.vehicles import parse_fault, read_vehicle
    >>> members = [Member("car-1", 1), Member("car-2", 2, fault="front_left.spring=-0.25")]
    >>> parse_fault(members[1].fault).change
    -0.25
    >>> address = Address.parse("mqtt://127.0.0.1:1883")
    >>> drive_fleet(address, read_vehicle("zafira"), members, folder=Path("boxes"), pace=100.0)  # doctest: +SKIP
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to this process, too: its parent ends it
    begun = time.time_ns() - _AGO
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
        while (ahead := clock + waiting_time(driven, pace) - time.monotonic()) > 0:
            for box in boxes:
                box.step()
            time.sleep(min(ahead, 0.02))


def waiting_time(driven: float, pace: float) -> float:
    """Return the time [s] from the start of the program to the end of a drive.

    Parameters
    ----------
    driven
        Length of the drive [s], which began three hours before the program.
    pace
        Speed of the drive, as a multiple of real time, until it has reached the present; more than 1.
    """
    ago = _AGO / 1e9
    return max(driven / pace, driven - ago)
