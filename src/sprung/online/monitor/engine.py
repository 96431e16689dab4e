"""Monitoring of one vehicle: blocks of samples in, modes every minute and a diagnosis every ten minutes out."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from sprung._checks import check_number
from sprung.diagnosis import (
    LEARNING_WINDOWS,
    Baseline,
    ChangeDetector,
    Diagnosis,
    Observation,
    ResidualStatistics,
    SensorFault,
    TypeBaseline,
    diagnose,
    diagnosis_of,
    learn,
    observe_window,
    with_missing_as_faults,
)
from sprung.errors import DataError, ParameterError, SprungError
from sprung.identification import METHODS, IdentificationSettings, RunningSummary, modes_of_summary, rate_for_body
from sprung.link import Block, joined
from sprung.link.repeats import Repeats
from sprung.modal import Modes
from sprung.online.monitor.completion import Completion
from sprung.online.monitor.states import (
    FIRST,
    SCHEMA,
    UNUSABLE,
    checked_state,
    invalid_state,
    restored_block,
    stored_block,
)
from sprung.recording import Recording
from sprung.results.documents import (
    baseline_document,
    baseline_from_document,
    mode_documents,
    observation_document,
    observation_from_document,
    restored_statistics,
    stored_statistics,
    type_baseline_document,
    type_baseline_from_document,
)
from sprung.signals.harmonics import Harmonic, harmonic_from_dict
from sprung.vehicles import Vehicle, vehicle_from_text, vehicle_text

#: Shortest stretch of a window that modes are identified from [s].
_SHORTEST = 120.0
#: Length of the segments of a window that is not complete [s]: short enough for many of them after two minutes.
_SEGMENT = 10.0
#: Identification of a complete window, also for its page, and what that of an incomplete one has in common with it.
IDENTIFICATION = IdentificationSettings(has_road_modes=False, refine=False, allow_missing=True, kind="random")
#: Share of standstill in a window above which it is the stated reason for an inconclusive window.
_MOST_STANDING = 0.5
#: Note while a vehicle that deviates from its type is not learnt from.
_DEVIATES = (
    "no baseline is learnt while the vehicle deviates from its type: inspect it, then request one with sprung "
    "vehicles learn"
)


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """Settings of the monitoring of one vehicle.

    Parameters
    ----------
    window
        Length of a window [s], 60 to 7200.
    identify_every
        Time between identifications of modes [s]; 0: none.
    method
        Identification method: "cov", "acs" or "coss".
    learning_windows
        Number of conclusive windows that a baseline is learnt from, at least 2.
    false_alarms, hours_per_day
        Rate of false alarms per vehicle and day of driving, and hours of driving in a day.
    most_windows
        Largest number of most recent windows in a diagnosis, at least `learning_windows`.
    calibrate
        Whether the vehicle file is calibrated on the first windows of learning; None: if it is imperfect.

    Raises
    ------
    ParameterError
        If a setting is out of range.
    """

    window: float = 600.0
    identify_every: float = 60.0
    method: str = "cov"
    learning_windows: int = LEARNING_WINDOWS
    false_alarms: float = 1e-3
    hours_per_day: float = 8.0
    most_windows: int = 96
    calibrate: bool | None = None

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
        Number of the identification since the first block, from 0.
    start
        Start of the window, UTC ns; None if unknown.
    modes
        One object for each mode, as in `sprung.identification/1`; empty if none was identified.
    reason
        Reason why none was identified; empty otherwise.
    """

    number: int
    start: int | None
    modes: tuple[dict[str, Any], ...]
    reason: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class Observed:
    """A complete window.

    Parameters
    ----------
    number
        Number of the window since the first block, from 0.
    recording
        Samples of the window.
    observation
        Estimates and conditions of the window.
    diagnosis
        Diagnosis of the windows since the baseline; while it is being learnt, of these windows against the vehicle's
        type, or None if that is unknown.
    baseline
        Baseline learnt with this window as its last one; None otherwise.
    """

    number: int
    recording: Recording
    observation: Observation
    diagnosis: Diagnosis | None
    baseline: Baseline | None


@dataclass(frozen=True, eq=False, slots=True)
class Restored:
    """A return to an earlier baseline.

    Parameters
    ----------
    baseline
        Baseline in use from the next samples on, as a new version.
    """

    baseline: Baseline


#: Events that samples lead to.
Event = Identified | Observed


class VehicleMonitor:
    """Monitors one vehicle.

    Parameters
    ----------
    vehicle
        Vehicle with its sensors.
    settings
        Settings of the monitoring; None: windows of ten minutes, a baseline from twelve of them.
    baseline
        Baseline learnt before; None: one is learnt from the first windows.
    type_baseline
        Baseline of the vehicle's type: until the vehicle has a baseline its windows are compared with it, and it is the
        prior of that baseline. None: unknown.

    Notes
    -----
    Modes of a complete window are those of the batch method. Until then a cheaper identification serves: the samples
    between one identification and the next are one record (`RunningSummary`), prepared and correlated once, at a rate
    for the modes of the body alone (`rate_for_body`). Lines of wheels and engine are sought once per window, when it is
    complete; until then those of the previous window are used.

    Windows hold a fixed number of samples in order of arrival, independent of the division into blocks, and are
    processed by the functions that process recordings: `observe_window`, `learn`, `ChangeDetector` and `diagnosis_of`.
    Score, decision and learning are separate: only `learn_again` starts learning again, and only `restore` returns
    to an earlier baseline. A vehicle that deviates from its type gets no first baseline until `learn_again`: its fault
    would be normal from then on.

    Memory: the samples of one window, and 96 observations of about 4 kB each with four outputs and twelve components.
    While a baseline is learnt, an observation also holds the correlations of its segments for the residual test (170 kB
    in ten minutes): 2 MB with twelve windows, released when it is learnt.

    A sensor of the vehicle file that the samples lack counts as failing, like a dead one, unless the baseline was
    learnt without it: monitoring continues, and the window is not used for learning.

    The first three windows of a learning phase decide whether the vehicle file is calibrated (`Completion`). If so,
    learning starts again with the windows that follow, in terms of the completed file, which the baseline keeps and
    which is used from then on.

    Samples that were analysed before, as when a recording is replayed again, are skipped (`Repeats`) until learning
    starts again or the vehicle file changes.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        settings: MonitorSettings | None = None,
        baseline: Baseline | None = None,
        type_baseline: TypeBaseline | None = None,
    ) -> None:
        self._vehicle = self._given = vehicle
        self._settings = settings or MonitorSettings()
        self._baseline = baseline
        self._type = type_baseline
        if baseline is not None and baseline.vehicle_file:
            self._vehicle = vehicle_from_text(baseline.vehicle_file, source="the vehicle file of the baseline")
        self._completion = Completion(is_wanted=self._settings.calibrate)
        self._reason = FIRST
        self._blocks: list[Block] = []
        self._n_samples = 0
        self._running: RunningSummary | None = None
        self._n_windows = 0
        self._n_identified = 0
        self._learning: list[Observation] = []
        self._detector = None if baseline is None else self._new_detector(baseline)
        self._modes: tuple[dict[str, Any], ...] = ()
        self._diagnosis: Diagnosis | None = None
        self._note = ""
        self._harmonics: tuple[Harmonic, ...] | None = None
        self._repeats = Repeats()

    @property
    def vehicle(self) -> Vehicle:
        """Vehicle as its file describes it, or as completed by calibration."""
        return self._vehicle

    @property
    def settings(self) -> MonitorSettings:
        """Settings of the monitoring."""
        return self._settings

    @property
    def baseline(self) -> Baseline | None:
        """Normal state of the vehicle; None before it is learnt."""
        return self._baseline

    @property
    def type_baseline(self) -> TypeBaseline | None:
        """Normal state of the vehicles of its type; None if unknown."""
        return self._type

    @property
    def is_learning(self) -> bool:
        """Whether the windows are collected for a baseline."""
        return self._detector is None

    @property
    def learning(self) -> tuple[int, int]:
        """Number of windows for the next baseline so far, and number needed; equal if nothing is being learnt."""
        needed = self._settings.learning_windows
        if self._detector is not None:
            return needed, needed
        sound = sum(observation.is_conclusive and not observation.sensor_faults for observation in self._learning)
        return min(sound, needed), needed

    @property
    def diagnosis(self) -> Diagnosis | None:
        """Diagnosis of the windows since the baseline; while it is being learnt, against the type, if that is known."""
        return self._diagnosis

    @property
    def modes(self) -> tuple[dict[str, Any], ...]:
        """Modes identified last."""
        return self._modes

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Windows held for diagnosis, oldest first."""
        return tuple(self._learning) if self._detector is None else self._detector.observations

    @property
    def buffered(self) -> float:
        """Share of the present window that has been received, 0 to 1."""
        return self._n_samples / self._needed(self._blocks[0]) if self._blocks else 0.0

    @property
    def note(self) -> str:
        """Why the last window was inconclusive or not used for learning, or limits of the baseline; empty otherwise."""
        return self._note

    @property
    def until(self) -> int | None:
        """Time after the last sample, UTC ns; None before the first."""
        return self._repeats.end

    @property
    def repeated(self) -> float:
        """Duration of the samples that arrived last and were analysed before [s]; 0 after new ones."""
        return self._repeats.repeated

    def update(self, block: Block) -> tuple[Event, ...]:
        """Add samples and return the events that they complete.

        Parameters
        ----------
        block
            Samples of any length, a `Recording` or a `FrameBlock`. With other channels or another rate than before, a
            new window begins.

        Returns
        -------
        tuple of Identified or Observed
            Events in order of time; empty for samples that were analysed before.
        """
        events: list[Event] = []
        if self._repeats.update(block):
            return ()
        if self._blocks and not _are_alike(block, self._blocks[-1]):
            self._begin_window()
        rest: Block | None = block
        while rest is not None:
            room = self._needed(rest) - self._n_samples
            part, rest = (rest, None) if rest.n_samples <= room else _halves(rest, room)
            before = self._n_samples
            self._blocks.append(part)
            self._n_samples += part.n_samples
            whole = joined(self._blocks) if self._n_samples == self._needed(part) else None
            if self._is_due(before, self._n_samples):
                events.append(self._identify(whole))
            if whole is not None:
                events.append(self._complete(whole))
        return tuple(events)

    def learn_again(self, reason: str) -> None:
        """Forget the windows so far and learn a new baseline, such as after maintenance.

        Parameters
        ----------
        reason
            Reason, such as "new dampers"; it is kept in the baseline.

        Raises
        ------
        ParameterError
            If the reason is empty.
        """
        if not reason.strip():
            raise ParameterError("a new baseline needs a reason, such as 'new dampers'")
        self._reason = reason.strip()
        self._learning, self._detector, self._diagnosis = [], None, None
        self._completion = Completion(is_wanted=self._settings.calibrate)
        self._repeats.forget()

    def restore(self, baseline: Baseline) -> Restored:
        """Forget the windows so far and assess the next ones by an earlier baseline, such as after learning a fault.

        Parameters
        ----------
        baseline
            The earlier baseline, with its new version and the reason.

        Returns
        -------
        Restored
            Event that states the baseline in use.

        Notes
        -----
        Learning in progress ends without a baseline. Windows are observed in terms of the vehicle file with
        which the baseline was learnt.
        """
        self._baseline, self._reason = baseline, baseline.reason
        self._vehicle = self._given
        if baseline.vehicle_file:
            self._vehicle = vehicle_from_text(baseline.vehicle_file, source="the vehicle file of the baseline")
        self._learning, self._detector, self._diagnosis = [], self._new_detector(baseline), None
        self._completion = Completion(is_wanted=self._settings.calibrate)
        self._note = ""
        self._repeats.forget()
        return Restored(baseline)

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values and bytes."""
        return {
            "schema": SCHEMA,
            "vehicle": self._vehicle.name,
            "settings": asdict(self._settings),
            "reason": self._reason,
            "is_learning": self._detector is None,
            "baseline": None if self._baseline is None else baseline_document(self._baseline).as_json(),
            "type": None if self._type is None else type_baseline_document(self._type).as_json(),
            "n_windows": self._n_windows,
            "n_identified": self._n_identified,
            "observations": [observation_document(observation) for observation in self.observations],
            "residuals": [stored_statistics(observation.residuals) for observation in self.observations],
            "evidence": [] if self._detector is None else self._detector.evidence.tolist(),
            "modes": list(self._modes),
            "note": self._note,
            "completed": vehicle_text(self._vehicle) if self._vehicle is not self._given else "",
            "completion": self._completion.state(),
            "harmonics": None if self._harmonics is None else [asdict(line) for line in self._harmonics],
            "blocks": [stored_block(block) for block in self._blocks],
            "repeats": {"file": vehicle_text(self._given), **self._repeats.state()},
        }

    @classmethod
    def from_state(
        cls, vehicle: Vehicle, state: Mapping[str, Any], *, type_baseline: TypeBaseline | None = None
    ) -> "VehicleMonitor":
        """Return a monitor that continues from a state.

        Parameters
        ----------
        vehicle
            Vehicle with its sensors.
        state
            State from `state`.
        type_baseline
            Baseline of the vehicle's type from now on; None: that of the state.

        Raises
        ------
        StateError
            If the state is incomplete or invalid, or of another version.
        """
        present = checked_state(state)
        try:
            monitor = cls(vehicle, settings=MonitorSettings(**present["settings"]))
            monitor._restore(present, type_baseline)
        except (*UNUSABLE, SprungError) as error:
            raise invalid_state(error) from None
        return monitor

    def _restore(self, state: Mapping[str, Any], type_baseline: TypeBaseline | None) -> None:
        """Take over the parts of a state."""
        self._baseline = None if state["baseline"] is None else baseline_from_document(dict(state["baseline"]))
        self._type = type_baseline or _restored_type(state["type"])
        self._reason = state["reason"]
        if state["completed"]:
            self._vehicle = vehicle_from_text(state["completed"], source="the saved state")
        wanted = self._settings.calibrate
        self._completion = Completion.from_state(state["completion"], self._vehicle, is_wanted=wanted)
        self._n_windows, self._n_identified = state["n_windows"], state["n_identified"]
        observations = [
            self._restored_observation(observation_from_document(document), restored_statistics(stored))
            for document, stored in zip(state["observations"], state["residuals"], strict=True)
        ]
        if state["is_learning"] or self._baseline is None:
            self._learning = observations
            self._diagnosis = self._against_type()
        else:
            self._resume(self._baseline, observations, list(state["evidence"]))
        self._modes, self._note = tuple(state["modes"]), state["note"]
        lines = state["harmonics"]
        self._harmonics = None if lines is None else tuple(map(harmonic_from_dict, lines))
        self._blocks = [restored_block(block) for block in state["blocks"]]
        self._n_samples = sum(block.n_samples for block in self._blocks)
        self._repeats = Repeats.from_state(state["repeats"])
        if state["repeats"]["file"] != vehicle_text(self._given):
            self._repeats.forget()

    def _resume(self, baseline: Baseline, observations: list[Observation], evidence: list[float]) -> None:
        """Continue with the windows since the baseline."""
        self._detector = ChangeDetector.resumed(baseline, observations, evidence, **self._detection_settings())
        self._diagnosis = diagnosis_of(self._detector) if observations else None

    def _new_detector(self, baseline: Baseline) -> ChangeDetector:
        """Return a detector without windows."""
        return ChangeDetector(baseline, **self._detection_settings())

    def _detection_settings(self) -> dict[str, Any]:
        """Return rate of false alarms, windows per day, and largest number of windows held."""
        settings = self._settings
        return {
            "false_alarms": settings.false_alarms,
            "windows_per_day": settings.hours_per_day * 3600 / settings.window,
            "n_windows": settings.most_windows,
        }

    def _needed(self, block: Block) -> int:
        """Return the number of samples of a window."""
        return max(1, round(self._settings.window * block.sampling_rate))

    def _begin_window(self) -> None:
        """Forget the samples of the window so far."""
        self._blocks, self._n_samples, self._running = [], 0, None

    def _is_due(self, before: int, after: int) -> bool:
        """Return whether modes are identified where the window has grown from one number of samples to another."""
        step = self._settings.identify_every * self._blocks[0].sampling_rate
        return bool(step) and after // step > before // step

    def _identify(self, whole: Recording | None) -> Identified:
        """Identify the modes of the whole window, or of the part received so far."""
        self._n_identified += 1
        start = self._blocks[0].start
        modes: tuple[dict[str, Any], ...] = ()
        reason = ""
        if self._n_samples < _SHORTEST * self._blocks[0].sampling_rate:
            reason = f"the window is shorter than {_SHORTEST:.0f} s"
        else:
            try:
                modes = tuple(mode_documents(self._modes_so_far() if whole is None else self._modes_of_window(whole)))
            except SprungError as error:
                reason = str(error)
        self._modes = modes
        return Identified(self._n_identified - 1, start, modes, reason)

    def _modes_of_window(self, recording: Recording) -> Modes:
        """Return the modes of the complete window, and keep the lines that it shows."""
        identify = METHODS[self._settings.method]
        identification = identify(recording, settings=IDENTIFICATION, vehicle=self._vehicle)
        self._harmonics = identification.harmonics
        return identification.modes

    def _modes_so_far(self) -> Modes:
        """Return the modes of the body from the samples between one identification and the next, as records."""
        if self._running is None:
            settings = replace(
                IDENTIFICATION,
                harmonics=self._harmonics,
                decimate_to=rate_for_body(self._vehicle, self._blocks[0].sampling_rate),
                segment=_SEGMENT,
            )
            self._running = RunningSummary(
                self._settings.method, settings=settings, vehicle=self._vehicle, duration=self._settings.window
            )
        for record in self._records()[self._running.n_records :]:
            self._running.update(joined(record))
        return modes_of_summary(self._running.summary, vehicle=self._vehicle)

    def _records(self) -> list[list[Block]]:
        """Return the blocks between one identification of the window and the next; a state holds no more of them."""
        records: list[list[Block]] = []
        record: list[Block] = []
        after = 0
        for block in self._blocks:
            record.append(block)
            before, after = after, after + block.n_samples
            if after >= _SHORTEST * block.sampling_rate and self._is_due(before, after):
                records.append(record)
                record = []
        return records

    def _complete(self, recording: Recording) -> Observed:
        """Process the complete window."""
        self._begin_window()
        number = self._n_windows
        self._n_windows += 1
        time = recording.start / 1e9 if recording.start is not None else number * self._settings.window
        known = () if self._baseline is None else self._baseline.missing
        observed = observe_window(recording, self._vehicle, time=time, allow_missing=True)
        observed = with_missing_as_faults(observed, known=known)
        # Same as after a restart: the memory order of its arrays would show in the last digit of findings.
        observation = self._restored_observation(
            observation_from_document(observation_document(observed)), observed.residuals
        )
        self._note = _reservations(observation)
        learnt: Baseline | None = None
        if self._detector is None:
            if not self._complete_file(recording, observation):
                self._learning = [*self._learning, observation][-self._settings.most_windows :]
            self._diagnosis = diagnosis = self._against_type()
            learnt = self._learn()
        else:
            self._detector.update(observation.without_segments())
            self._diagnosis = diagnosis = diagnosis_of(self._detector)
        if not self._note and self._baseline is not None:
            self._note = " ".join(self._baseline.notes)
        return Observed(number, recording, observation.without_segments(), diagnosis, learnt)

    def _restored_observation(self, observation: Observation, residuals: ResidualStatistics | None) -> Observation:
        """Return an observation with the parts that its document does not contain."""
        return replace(observation, vehicle=self._vehicle.name, residuals=residuals)

    def _known_type(self) -> TypeBaseline | None:
        """Return the baseline of the type, if it is of the given file and has the components of a window."""
        if (
            self._type is None
            or self._vehicle is not self._given
            or not any(one.components == self._type.components for one in self._learning)
        ):
            return None
        return self._type

    def _against_type(self) -> Diagnosis | None:
        """Return the diagnosis of the windows so far against the vehicle's type; None if that is unknown."""
        of_type = self._known_type()
        if of_type is None:
            return None
        settings = self._detection_settings()
        return diagnose(
            [observation.without_segments() for observation in self._learning],
            type_baseline=of_type,
            false_alarms=settings["false_alarms"],
            windows_per_day=settings["windows_per_day"],
        )

    def _complete_file(self, recording: Recording, observation: Observation) -> bool:
        """Return whether the file was calibrated with this window, so that learning starts again with the next one."""
        if not self._completion.is_open:
            return False
        have, needed = self.learning
        is_last = have + (observation.is_conclusive and not observation.sensor_faults) >= needed
        try:
            calibration = self._completion.update(recording, observation, self._vehicle, is_last=is_last)
        except DataError as error:
            self._note = str(error)
            return False
        if calibration is None:
            return False
        # Same as after a restart: numbers as they are written.
        self._vehicle = vehicle_from_text(vehicle_text(calibration.vehicle), source="the calibrated vehicle file")
        self._learning = []
        self._note = " ".join(["the vehicle file was calibrated; learning starts again", *calibration.notes])
        return True

    def _learn(self) -> Baseline | None:
        """Return the baseline if the last window was the last one needed for it."""
        have, needed = self.learning
        if have < needed:
            return None
        if self._reason == FIRST and self._diagnosis is not None and self._diagnosis.findings:
            self._note = _DEVIATES
            return None
        try:
            learnt = learn(
                self._learning,
                reason=self._reason,
                previous=self._baseline,
                type_baseline=self._known_type(),
                min_windows=max(2, needed // 2),
            )
        except DataError as error:
            self._note = str(error)
            return None
        if self._vehicle is not self._given:
            learnt = replace(learnt, vehicle_file=vehicle_text(self._vehicle))
        self._baseline = baseline_from_document(baseline_document(learnt).as_json())
        self._learning, self._detector, self._diagnosis = [], self._new_detector(self._baseline), None
        return learnt


def _restored_type(document: Mapping[str, Any] | None) -> TypeBaseline | None:
    """Return the baseline of a type from its document, if there is one."""
    return None if document is None else type_baseline_from_document(dict(document))


def _are_alike(block: Block, last: Block) -> bool:
    """Return whether a block can continue a window."""
    return block.channels == last.channels and abs(block.sampling_rate / last.sampling_rate - 1) < 1e-6


def fault_in_words(fault: SensorFault) -> str:
    """Return the fault of a sensor, such as "sensor acc_fl is dead: it is constant"."""
    return f"sensor {fault.statement}: {fault.detail}"


def _reservations(observation: Observation) -> str:
    """Return why a window is inconclusive or not used for learning; empty if it is sound."""
    standing = observation.conditions.get("standing", 0.0)
    if observation.reason and standing > _MOST_STANDING:
        return f"the vehicle stood still for {100 * standing:.0f} % of the time"
    return observation.reason or "; ".join(map(fault_in_words, observation.sensor_faults))


def _as_recording(block: Block) -> Recording:
    """Return a block as a recording."""
    if isinstance(block, Recording):
        return block
    return Recording(block.samples, block.sampling_rate, block.channels, block.start)


def _halves(block: Block, place: int) -> tuple[Block, Block]:
    """Return a block up to a sample, and the rest."""
    whole = _as_recording(block)
    return whole.part(0, place), whole.part(place, whole.n_samples)
