"""A stand-in for the analysis of workers that is exact: a window says which samples it had, in order."""

from collections.abc import Callable, Sequence
from typing import Any

import cbor2
import numpy as np
from chance import Chance

from sprung.diagnosis import Observation, SensorFault
from sprung.link import Header, checked_map, decode
from sprung.online.monitor.events import Event, Identified, Observed
from sprung.online.monitor.jobs import Failure, Opening, Outcome, VehicleStatus, failed
from sprung.recording import Channel, Recording

#: Samples of a window, and between identifications; a sensor seems to fail in alternating groups of samples.
WINDOW, IDENTIFY, GROUP = 8, 5, 60


class Analysis:
    """Gathers the samples of one vehicle into windows.

    Parameters
    ----------
    state
        State to continue from, in CBOR; None: from scratch.
    """

    def __init__(self, state: bytes | None) -> None:
        known: dict[str, Any] = {} if state is None else cbor2.loads(state)
        self._samples: list[int] = known.get("samples", [])
        self._start: int = known.get("start", 0)
        self._n_windows: int = known.get("windows", 0)
        self._n_identified: int = known.get("identified", 0)

    def update(self, payload: bytes) -> list[Event]:
        """Add a frame, and return what it completes."""
        frame, events = decode(payload), list[Event]()
        for number in np.rint(frame.samples[0]).astype(int).tolist():
            self._start = self._start if self._samples else frame.start
            self._samples.append(number)
            if number % IDENTIFY == 0:
                events.append(Identified(self._n_identified, frame.start, ({"natural_frequency": float(number)},)))
                self._n_identified += 1
            if len(self._samples) == WINDOW:
                events.append(self._complete())
        return events

    def state(self) -> bytes:
        """Return the state in CBOR."""
        return cbor2.dumps(
            {
                "samples": self._samples,
                "start": self._start,
                "windows": self._n_windows,
                "identified": self._n_identified,
            }
        )

    def _complete(self) -> Observed:
        samples, self._samples = self._samples, []
        is_failing = samples[0] // GROUP % 2 == 1
        observation = Observation(
            time=float(samples[0]),
            components=(),
            log_ratios=np.zeros(0),
            covariance=np.zeros((0, 0)),
            conditions={f"{place}": float(number) for place, number in enumerate(samples)},
            modes={},
            sensor_faults=(SensorFault("acc_fl", "dead", "it is constant"),) if is_failing else (),
        )
        recording = Recording(
            np.array([samples], dtype=np.float64), 1.0, (Channel("acc_fl", "acceleration"),), self._start
        )
        self._n_windows += 1
        return Observed(self._n_windows - 1, recording, observation, None, None)


class InlineWorkers:
    """Workers in this process, as those of `monitor.workers`, which die and take their time as chance has it.

    Parameters
    ----------
    chance
        Decides when a worker dies or is slow, and which frames cannot be analysed.
    on_failed
        Function that receives vehicle, boot and sequence number of each frame that a job failed on.
    """

    is_busy = False

    def __init__(self, chance: Chance, *, on_failed: Callable[[str, int, int], None] = lambda *_: None) -> None:
        self._chance, self._on_failed = chance, on_failed
        self._opened: dict[str, Analysis] = {}
        self._outcomes: list[Outcome] = []
        #: Vehicles whose worker died since their last state: a frame on which it dies twice is quarantined.
        self._died: set[str] = set()

    @property
    def figures(self) -> dict[str, float]:
        return {}

    def is_open(self, vehicle: str) -> bool:
        return vehicle in self._opened

    def is_free(self, vehicle: str) -> bool:
        return True

    def is_misplaced(self, vehicle: str) -> bool:
        return self._chance.happens("vehicle moves to another worker", vehicle)

    def open(self, opening: Opening) -> None:
        self._opened[opening.vehicle] = Analysis(opening.state)

    def close_vehicle(self, vehicle: str) -> None:
        self._opened.pop(vehicle, None)

    def submit(self, vehicle: str, frames: Sequence[bytes], *, learn: str = "") -> None:
        self._outcomes.append(self._done(vehicle, frames, is_changed=bool(learn) or not frames))

    def outcomes(self, *, timeout: float = 0.0) -> list[Outcome]:
        if self._outcomes and self._chance.happens("worker is slow"):
            return []
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def close(self) -> None:
        """Nothing to stop."""

    def _done(self, vehicle: str, frames: Sequence[bytes], *, is_changed: bool) -> Outcome:
        """Return the outcome of a job."""
        analysis, events, n_consumed = self._opened[vehicle], list[Event](), 0
        if self._chance.happens("worker of others dies", vehicle):
            return failed(vehicle, "the process of its analysis was lost", Failure.VEHICLE)
        if frames and vehicle not in self._died and self._chance.happens("worker dies", vehicle):
            self._died.add(vehicle)
            return self._failed(vehicle, frames, 0, "the process of its analysis died")
        for payload in frames:
            if self._chance.is_poisoned(payload, vehicle):
                return self._failed(vehicle, frames, n_consumed, "its numbers cannot be analysed")
            events += analysis.update(payload)
            n_consumed += 1
            if any(isinstance(event, Observed) for event in events):
                is_changed = True
                break
        if is_changed:
            self._died.discard(vehicle)
        return Outcome(vehicle, n_consumed, tuple(events), analysis.state() if is_changed else None, VehicleStatus())

    def _failed(self, vehicle: str, frames: Sequence[bytes], place: int, reason: str) -> Outcome:
        """Return the outcome of a job that failed on a frame."""
        header = Header.of(checked_map(frames[place]))
        self._on_failed(vehicle, header.boot, header.seq)
        return failed(vehicle, f"{reason} ({header.boot}, {header.seq})", Failure.FRAME, n_consumed=place)
