"""Many boxes in one process: frames come live, and are sent until they are acknowledged."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from network import BEGUN

from sprung.link import VERSION, Address, Frame, Key, Link, checked_map, encode, message, parse_topic, quantised, topic
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle, vehicle_text

#: Length of a frame [s], sampling rate of vehicles that stand and drive [Hz], and length of a window [s].
FRAME, RATE, DRIVING_RATE, WINDOW = 5.0, 50.0, 200.0, 120.0
NAMES = ("acc_fl", "acc_fr", "acc_rl", "acc_rr", "speed")
QUANTITIES = {name: "speed" if name == "speed" else "acceleration" for name in NAMES}
#: Time without progress after which a box sends everything again [s], and the most frames that it sends ahead, and
#: so the most that one acknowledgement stands for, however slow the machine is.
PATIENCE, AHEAD = 10.0, 6
_PER_WINDOW = round(WINDOW / FRAME)


@cache
def driven(seconds: float) -> "np.ndarray[Any, np.dtype[np.float64]]":
    """Return the samples of a drive, in the second half of which a spring is soft, shape (channels, samples)."""
    car, halves = read_vehicle("zafira"), ((), (parse_fault("front_left.spring=-0.4"),))
    settings = [RoadDrive(duration=seconds / 2, snr=50.0, faults=faults) for faults in halves]
    runs = [simulate_drive(car, one, seed=seed).recording for seed, one in enumerate(settings)]
    return np.concatenate([run.select(NAMES).samples for run in runs], axis=1)


def driving_frame(vehicle: str, seq: int, n_frames: int) -> bytes:
    """Return a frame of a vehicle that drives, out of a number of them."""
    size = round(FRAME * DRIVING_RATE)
    return framed(vehicle, seq, driven(n_frames * FRAME)[:, seq * size : (seq + 1) * size], DRIVING_RATE)


def frame_of(vehicle: str, number: int, seq: int) -> bytes:
    """Return a frame of a standing vehicle; in every third window of every third vehicle, a sensor is dead."""
    samples = np.zeros((len(NAMES), round(FRAME * RATE)))
    samples[:4] = 0.3 * np.random.default_rng((number, seq)).standard_normal((4, samples.shape[1]))
    if number % 3 == 0 and seq // _PER_WINDOW % 3 == 1:
        samples[number % 4] = 0.0
    return framed(vehicle, seq, samples, RATE)


def framed(vehicle: str, seq: int, samples: "np.ndarray[Any, np.dtype[np.float64]]", rate: float) -> bytes:
    """Return the frame of a number with samples, all of them equally long."""
    counts, scale, flags = quantised(samples)
    start = BEGUN + seq * round(samples.shape[1] / rate * 1e9)
    return encode(Frame(vehicle, 1, seq, start, round(1e9 / rate), NAMES, scale, counts, 2, flags))


@dataclass
class _Box:
    """A vehicle, the frames that it has made and that wait for an acknowledgement, and what it sent."""

    vehicle: str
    number: int
    waiting: dict[int, bytes] = field(default_factory=dict)
    n_made: int = 0
    sent: int = -1
    progress: float = 0.0


class Fleet:
    """Boxes that make frames at a pace, all on one connection.

    The first `driving` of them drive, the others stand. `check` is called with vehicle and sequence number of every
    acknowledgement.
    """

    def __init__(
        self,
        url: str,
        vehicles: int,
        *,
        windows: int,
        pace: float | None,
        check: Callable[[str, int], None],
        driving: int = 0,
    ) -> None:
        self.boxes = {f"car-{number}": _Box(f"car-{number}", number) for number in range(vehicles)}
        self.n_frames, self._pace, self._check, self._driving = windows * _PER_WINDOW, pace, check, driving
        if driving:
            driven(self.n_frames * FRAME)
        self.acknowledgements = self.sent = 0
        self._lock = threading.Lock()
        self._is_over = threading.Event()
        self._begun = time.monotonic()
        self._link = Link(
            Address.parse(url),
            "chaos-fleet",
            topics=[topic("+", "ack")],
            on_message=self._acknowledged,
            on_connected=self._describe,
        )
        self._link.open(timeout=30.0)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def is_done(self) -> bool:
        """Whether every frame was made and acknowledged."""
        return all(box.n_made == self.n_frames and not box.waiting for box in self.boxes.values())

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        self._link.close()

    def _describe(self) -> None:
        """Publish descriptions: each vehicle is of its own type, so that no other has a part in its windows."""
        car = read_vehicle("zafira")
        for box in self.boxes.values():
            own = car.model_copy(update={"body": car.body.model_copy(update={"mass": 1480.0 + box.number})})
            document = {Key.VERSION: VERSION, Key.CONFIGURATION: "c", "description": vehicle_text(own)}
            payload = message({**document, "quantities": QUANTITIES})
            self._link.publish(topic(box.vehicle, "meta"), payload, is_retained=True)

    def _acknowledged(self, name: str, payload: bytes) -> None:
        """Forget what is acknowledged."""
        vehicle, seq = parse_topic(name)[0], checked_map(payload)[Key.SEQ]
        self._check(vehicle, seq)
        with self._lock:
            self.acknowledgements += 1
            box = self.boxes[vehicle]
            for known in [known for known in box.waiting if known <= seq]:
                del box.waiting[known]
                box.progress = time.monotonic()

    def _run(self) -> None:
        """Make and send what is due."""
        announced = 0.0
        while not self._is_over.wait(0.05):
            now = time.monotonic()
            for box in self.boxes.values():
                for name, payload in self._due(box, now):
                    self.sent += self._link.publish(name, payload)
            if now - announced > 5.0:
                announced = now
                self._announce()

    def _due(self, box: _Box, now: float) -> list[tuple[str, bytes]]:
        """Return what a box sends now."""
        passed = float("inf") if self._pace is None else (now - self._begun) * self._pace / FRAME
        due = int(min(passed + box.number / len(self.boxes), self.n_frames))
        with self._lock:
            while box.n_made < due and len(box.waiting) < AHEAD:
                box.waiting[box.n_made] = self._made(box)
                box.n_made += 1
            if box.waiting and box.sent >= min(box.waiting) and now - box.progress > PATIENCE:
                box.sent, box.progress = -1, now
            frames = [seq for seq in box.waiting if seq > box.sent]
            if frames:
                box.sent = frames[-1]
                box.progress = max(box.progress, now - PATIENCE / 2)
            return [(topic(box.vehicle, "raw"), box.waiting[seq]) for seq in frames]

    def _made(self, box: _Box) -> bytes:
        """Return the next frame of a box."""
        if box.number < self._driving:
            return driving_frame(box.vehicle, box.n_made, self.n_frames)
        return frame_of(box.vehicle, box.number, box.n_made)

    def _announce(self) -> None:
        """Publish the state of every box."""
        with self._lock:
            firsts = {box.vehicle: (min(box.waiting, default=box.n_made), box.n_made) for box in self.boxes.values()}
        for vehicle, (first, end) in firsts.items():
            document = {Key.VERSION: VERSION, Key.BOOT: 1, "boots": [[1, first, end]], "dropped": 0, "spooled": 0}
            self._link.publish(topic(vehicle, "state"), message({**document, "is_leaving": False}))
