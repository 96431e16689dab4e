"""One vehicle that is watched: blocks of samples in, modes every minute and a diagnosis every ten out."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sprung._checks import check_number
from sprung.diagnosis import (
    Baseline,
    Diagnosis,
    Observation,
    baseline_from_dict,
    diagnose,
    learn,
    observation_from_dict,
    observe,
)
from sprung.errors import DataError, ParameterError, SprungError
from sprung.identification import METHODS, IdentificationSettings
from sprung.link import Block, joined
from sprung.link.summaries import mode_documents
from sprung.recording import Channel, Gap, Recording
from sprung.signals.harmonics import Harmonic, harmonic_from_dict
from sprung.vehicles import Vehicle

STATE = "sprung.vehicle-monitor/1"
#: Shortest stretch of a window that modes are identified from [s].
_SHORTEST = 120.0


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """How a vehicle is monitored.

    Parameters
    ----------
    window
        Length of a window [s].
    identify_every
        Time between identifications of modes [s]; 0: none.
    method
        "cov", "acs" or "coss".
    learning_windows
        Usable windows from which a baseline is learnt.
    false_alarms, hours_per_day
        Rate per vehicle and day of driving, and hours of driving in one.
    most_windows
        That a diagnosis looks back on.
    """

    window: float = 600.0
    identify_every: float = 60.0
    method: str = "cov"
    learning_windows: int = 12
    false_alarms: float = 1e-3
    hours_per_day: float = 8.0
    most_windows: int = 96

    def __post_init__(self) -> None:
        check_number("window", self.window, at_least=60, at_most=7200)
        check_number("identify_every", self.identify_every, at_least=0)
        check_number("learning_windows", self.learning_windows, at_least=2)
        check_number("false_alarms", self.false_alarms, above=0)
        check_number("hours_per_day", self.hours_per_day, above=0, at_most=24)
        check_number("most_windows", self.most_windows, at_least=self.learning_windows)


@dataclass(frozen=True, eq=False, slots=True)
class Identified:
    """Modes of the window so far.

    Parameters
    ----------
    number
        Of the identification since the first block.
    start
        Of the window, UTC ns; None where unknown.
    modes
        One object for each mode; empty where there is none.
    reason
        Why there is none.
    """

    number: int
    start: int | None
    modes: tuple[dict[str, Any], ...]
    reason: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class Observed:
    """A window that is complete.

    Parameters
    ----------
    number
        Of the window since the first block.
    recording
        Its samples.
    observation
        What it says.
    diagnosis
        Of all windows since the baseline; None while it is being learnt.
    baseline
        Where this window was the last that it needed.
    """

    number: int
    recording: Recording
    observation: Observation
    diagnosis: Diagnosis | None
    baseline: Baseline | None


Event = Identified | Observed


class VehicleMonitor:
    """Watches one vehicle.

    Parameters
    ----------
    vehicle
        With its sensors.
    settings
        Default: windows of ten minutes, twelve of them teach.
    baseline
        Learnt before; None: the first windows teach one.

    Notes
    -----
    Lines of wheels and engine are sought once in a window, when it is complete; until then those of the window before
    are known.

    Windows hold a fixed number of samples in the order in which they come, whatever the blocks they come in, and are
    worked up by the functions that work up recordings: `observe`, `learn` and `diagnose`. Score, decision and learning
    stay apart: nothing but `learn_again` makes it learn a second time.
    """

    def __init__(
        self, vehicle: Vehicle, *, settings: MonitorSettings | None = None, baseline: Baseline | None = None
    ) -> None:
        self._vehicle = vehicle
        self._settings = settings or MonitorSettings()
        self._baseline = baseline
        self._reason = "first learning"
        self._is_learning = baseline is None
        self._blocks: list[Block] = []
        self._n_samples = 0
        self._n_windows = 0
        self._n_identified = 0
        self._observations: list[Observation] = []
        self._evidence: list[float] = []
        self._modes: tuple[dict[str, Any], ...] = ()
        self._diagnosis: Diagnosis | None = None
        self._note = ""
        self._harmonics: tuple[Harmonic, ...] | None = None

    @property
    def vehicle(self) -> Vehicle:
        """As its file says."""
        return self._vehicle

    @property
    def baseline(self) -> Baseline | None:
        """What is normal; None before it is learnt."""
        return self._baseline

    @property
    def learning(self) -> tuple[int, int]:
        """Windows that can teach so far, and how many are needed; equal when nothing is being learnt."""
        needed = self._settings.learning_windows
        if not self._is_learning:
            return needed, needed
        sound = sum(one.is_conclusive and not one.sensor_faults for one in self._observations)
        return min(sound, needed), needed

    @property
    def diagnosis(self) -> Diagnosis | None:
        """Of the windows since the baseline; None while it is being learnt."""
        return self._diagnosis

    @property
    def modes(self) -> tuple[dict[str, Any], ...]:
        """Identified last."""
        return self._modes

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Windows that are looked back on, oldest first."""
        return tuple(self._observations)

    @property
    def buffered(self) -> float:
        """Share of the present window that is there, 0 to 1."""
        return self._n_samples / self._needed(self._blocks[0]) if self._blocks else 0.0

    @property
    def note(self) -> str:
        """What stands in the way at present; empty where nothing does."""
        return self._note

    def update(self, block: Block) -> tuple[Event, ...]:
        """Take in samples and return what they complete.

        Parameters
        ----------
        block
            A `Recording` or a `FrameBlock`, of any length. With other channels or another rate than before, a new
            window begins.
        """
        events: list[Event] = []
        if self._blocks and not _are_alike(block, self._blocks[-1]):
            self._blocks, self._n_samples = [], 0
        step = self._settings.identify_every * block.sampling_rate
        rest: Block | None = block
        while rest is not None:
            room = self._needed(rest) - self._n_samples
            part, rest = (rest, None) if rest.n_samples <= room else _halves(rest, room)
            before = self._n_samples
            self._blocks.append(part)
            self._n_samples += part.n_samples
            if step and self._n_samples // step > before // step:
                events.append(self._identify())
            if self._n_samples == self._needed(part):
                events.append(self._complete())
        return tuple(events)

    def learn_again(self, reason: str) -> None:
        """Forget the windows so far and learn a new baseline, such as after maintenance; the reason is kept in it."""
        if not reason.strip():
            raise ParameterError("a new baseline needs a reason, such as 'new dampers'")
        self._reason, self._is_learning = reason.strip(), True
        self._observations, self._evidence, self._diagnosis = [], [], None

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to go on, as plain values and bytes."""
        return {
            "schema": STATE,
            "vehicle": self._vehicle.name,
            "settings": asdict(self._settings),
            "reason": self._reason,
            "is_learning": self._is_learning,
            "baseline": None if self._baseline is None else self._baseline.to_dict(),
            "n_windows": self._n_windows,
            "n_identified": self._n_identified,
            "observations": [one.to_dict() for one in self._observations],
            "evidence": list(self._evidence),
            "modes": list(self._modes),
            "note": self._note,
            "harmonics": None if self._harmonics is None else [asdict(line) for line in self._harmonics],
            "blocks": [_stored(block) for block in self._blocks],
        }

    @classmethod
    def from_state(cls, vehicle: Vehicle, state: Mapping[str, Any]) -> "VehicleMonitor":
        """Return a monitor that goes on from a state.

        Raises
        ------
        ParameterError
            Where it is none.
        """
        if state.get("schema") != STATE:
            raise ParameterError(f"the state has the schema {state.get('schema')!r}, not {STATE!r}: begin anew")
        try:
            found = cls(vehicle, settings=MonitorSettings(**state["settings"]))
            found._baseline = None if state["baseline"] is None else baseline_from_dict(dict(state["baseline"]))
            found._reason, found._is_learning = state["reason"], state["is_learning"]
            found._n_windows, found._n_identified = state["n_windows"], state["n_identified"]
            found._observations = [observation_from_dict(one) for one in state["observations"]]
            found._evidence, found._modes = list(state["evidence"]), tuple(state["modes"])
            found._note = state["note"]
            lines = state["harmonics"]
            found._harmonics = None if lines is None else tuple(map(harmonic_from_dict, lines))
            found._blocks = [_restored(block) for block in state["blocks"]]
        except (KeyError, TypeError, ValueError) as error:
            raise ParameterError(f"the state lacks or garbles {error}: begin anew") from None
        found._n_samples = sum(block.n_samples for block in found._blocks)
        if not found._is_learning and found._baseline is not None and found._observations:
            found._diagnose()
        return found

    def _needed(self, block: Block) -> int:
        """Samples of a window."""
        return max(1, round(self._settings.window * block.sampling_rate))

    def _identify(self) -> Identified:
        """Identify the modes of the window so far."""
        self._n_identified += 1
        start = self._blocks[0].start
        modes: tuple[dict[str, Any], ...] = ()
        reason = ""
        if self._n_samples < _SHORTEST * self._blocks[0].sampling_rate:
            reason = f"the window is shorter than {_SHORTEST:.0f} s"
        else:
            try:
                is_complete = self._n_samples == self._needed(self._blocks[0])
                known = IdentificationSettings(harmonics=None if is_complete else self._harmonics)
                found = METHODS[self._settings.method](joined(self._blocks), settings=known, vehicle=self._vehicle)
                modes = tuple(mode_documents(found.modes))
                self._harmonics = found.harmonics if is_complete else self._harmonics
            except SprungError as error:
                reason = str(error)
        self._modes = modes
        return Identified(self._n_identified - 1, start, modes, reason)

    def _complete(self) -> Observed:
        """Work up the window that is complete."""
        recording = joined(self._blocks)
        self._blocks, self._n_samples = [], 0
        number = self._n_windows
        self._n_windows += 1
        time = recording.start / 1e9 if recording.start is not None else number * self._settings.window
        # As it comes back after a restart: the order in memory of its arrays would show in the last digit of findings.
        observation = observation_from_dict(observe(recording, self._vehicle, time=time).to_dict())
        self._observations.append(observation)
        gone = self._observations[: -self._settings.most_windows]
        del self._observations[: len(gone)]
        del self._evidence[: self._n_telling(gone)]
        self._note = observation.reason
        learnt = self._learn() if self._is_learning else None
        if not self._note and self._baseline is not None:
            self._note = " ".join(self._baseline.notes)
        if not self._is_learning and learnt is None:
            self._diagnose()
        return Observed(number, recording, observation, self._diagnosis, learnt)

    def _learn(self) -> Baseline | None:
        """Return the baseline if this was the last window it needed."""
        have, needed = self.learning
        if have < needed:
            return None
        try:
            learnt = learn(
                self._observations,
                vehicle=self._vehicle.name,
                reason=self._reason,
                previous=self._baseline,
                n_windows=max(2, needed // 2),
            )
        except DataError as error:
            self._note = str(error)
            return None
        self._baseline, self._is_learning = baseline_from_dict(learnt.to_dict()), False
        self._observations, self._evidence = [], []
        return learnt

    def _diagnose(self) -> None:
        """Diagnose the windows since the baseline."""
        per_day = self._settings.hours_per_day * 3600 / self._settings.window
        before = max(0, self._n_telling(self._observations) - 1)
        self._diagnosis = diagnose(
            self._observations,
            self._baseline,
            vehicle=self._vehicle.name,
            false_alarms=self._settings.false_alarms,
            windows_per_day=per_day,
            known=self._evidence[:before],
        )
        if self._diagnosis.detection is not None:
            self._evidence = self._diagnosis.detection.evidence.tolist()

    def _n_telling(self, observations: Sequence[Observation]) -> int:
        """Return how many windows there is evidence of."""
        components = () if self._baseline is None else self._baseline.components
        return sum(one.is_conclusive and not one.sensor_faults and one.components == components for one in observations)


def _are_alike(one: Block, other: Block) -> bool:
    """Tell whether two blocks can follow each other in a window."""
    return one.channels == other.channels and abs(one.sampling_rate / other.sampling_rate - 1) < 1e-6


def _as_recording(block: Block) -> Recording:
    """Return a block as a recording."""
    if isinstance(block, Recording):
        return block
    return Recording(block.samples, block.sampling_rate, block.channels, block.start)


def _halves(block: Block, place: int) -> tuple[Block, Block]:
    """Return a block up to a sample, and the rest."""
    whole = _as_recording(block)
    return whole.part(0, place), whole.part(place, whole.n_samples)


def _stored(block: Block) -> dict[str, Any]:
    """Return a block as plain values and bytes."""
    return {
        "samples": np.ascontiguousarray(block.samples, dtype="<f8").tobytes(),
        "channels": [[c.name, c.quantity, c.position, c.direction] for c in block.channels],
        "sampling_rate": block.sampling_rate,
        "start": block.start,
        "gaps": [[gap.index, gap.duration] for gap in block.gaps],
    }


def _restored(stored: Mapping[str, Any]) -> Recording:
    """Return the block of plain values and bytes."""
    channels = tuple(
        Channel(name, quantity, tuple(position) if position else None, tuple(direction) if direction else None)
        for name, quantity, position, direction in stored["channels"]
    )
    samples = np.frombuffer(stored["samples"], dtype="<f8").reshape(len(channels), -1)
    gaps = tuple(Gap(index, duration) for index, duration in stored["gaps"])
    return Recording(samples, stored["sampling_rate"], channels, stored["start"], gaps)
