"""Windows of one vehicle against its baseline, or its type while that baseline is being learnt."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sprung.baseline_progress import learning_progress
from sprung.calibration import (
    CALIBRATION_WINDOWS,
    Calibration,
    WindowSpectra,
    calibrated,
    calibrated_if_imperfect,
    usable_spectra,
    window_layouts,
)
from sprung.diagnosis import (
    Baseline,
    ChangeDetector,
    Diagnosis,
    Observation,
    SensorFault,
    TypeBaseline,
    diagnose,
    diagnosis_of,
    learn,
    observe_window,
    with_missing_as_faults,
)
from sprung.errors import DataError
from sprung.likelihood import CornerSettings, SegmentSpectra
from sprung.online.monitor.events import MonitorSettings
from sprung.recording import Recording
from sprung.results.documents import (
    baseline_document,
    baseline_from_document,
    observation_document,
    observation_from_document,
    restored_statistics,
    stored_statistics,
    type_baseline_document,
    type_baseline_from_document,
)
from sprung.vehicles import Vehicle, vehicle_from_text, vehicle_text

#: Reason of the first baseline of a vehicle.
FIRST = "first learning"
#: Share of standstill in a window above which it is the stated reason for an inconclusive window.
_MAX_STANDING = 0.5
#: Note while a vehicle that deviates from its type is not learnt from.
_DEVIATES = (
    "no baseline is learnt while the vehicle deviates from its type: inspect it, then request one with sprung "
    "vehicles learn"
)


@dataclass(frozen=True, eq=False, slots=True)
class History:
    """Stored results of a vehicle without a usable state.

    Parameters
    ----------
    baseline
        Document of the present baseline; None if none was learnt.
    observations
        Documents of the windows since the baseline, oldest first.
    n_windows, n_identified
        Number of windows and of identifications so far: the next ones are numbered from there.
    relearning
        Reason for learning a new baseline, if that was in progress; empty otherwise.
    """

    baseline: Mapping[str, Any] | None = None
    observations: tuple[Mapping[str, Any], ...] = ()
    n_windows: int = 0
    n_identified: int = 0
    relearning: str = ""


class Assessment:
    """Compares the windows of a vehicle with its baseline, and learns that baseline first.

    Parameters
    ----------
    vehicle, settings, baseline, type_baseline
        As for `VehicleMonitor`.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        settings: MonitorSettings,
        *,
        baseline: Baseline | None = None,
        type_baseline: TypeBaseline | None = None,
    ) -> None:
        self._given = vehicle
        self._vehicle = vehicle
        self._settings = settings
        self._type = type_baseline
        self._baseline: Baseline | None = None
        self._reason = FIRST
        self._note = ""
        self._learning: list[Observation] = []
        self._detector: ChangeDetector | None = None
        self._diagnosis: Diagnosis | None = None
        self._completion = Completion(is_wanted=settings.calibrate)
        if baseline is not None:
            self.use(baseline)

    @property
    def vehicle(self) -> Vehicle:
        """Vehicle as its file describes it, or as completed by calibration."""
        return self._vehicle

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
        n_learnt = needed if self._detector is not None else sum(map(_is_valid, self._learning))
        return min(n_learnt, needed), needed

    @property
    def coverage(self) -> str:
        """What the windows have brought of the information that a baseline needs, in words; empty if none is learnt."""
        if not any(map(_is_valid, self._learning)):
            return ""
        return str(learning_progress(self._learning, self._vehicle, n_needed=self._settings.learning_windows))

    @property
    def diagnosis(self) -> Diagnosis | None:
        """Diagnosis of the windows since the baseline; while it is being learnt, against the type, if that is known."""
        return self._diagnosis

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Windows held for diagnosis, oldest first."""
        return tuple(self._learning) if self._detector is None else self._detector.observations

    @property
    def note(self) -> str:
        """Why the last window was inconclusive or not used for learning, or limits of the baseline; empty otherwise."""
        return self._note

    def update(self, recording: Recording, *, time: float) -> tuple[Observation, Diagnosis | None, Baseline | None]:
        """Add a window that begins at a time [s], and return its observation, the diagnosis, and a baseline learnt."""
        known = () if self._baseline is None else self._baseline.missing
        settings = None if self._detector is None else CornerSettings(expected=self._detector.baseline.expected)
        observed = with_missing_as_faults(
            observe_window(recording, self._vehicle, time=time, settings=settings, allow_missing=True), known=known
        )
        observation = replace(observed, vehicle=self._vehicle.name)
        self._note = _reservations(observation)
        learnt: Baseline | None = None
        if self._detector is None:
            if not self._complete_file(recording, observation):
                self._learning = [*self._learning, observation][-self._settings.max_windows :]
            self._diagnosis = diagnosis = self._against_type()
            learnt = self._learn()
        else:
            self._detector.update(observation.without_segments())
            self._diagnosis = diagnosis = diagnosis_of(self._detector)
        if not self._note and self._baseline is not None:
            self._note = " ".join(self._baseline.notes)
        return observation.without_segments(), diagnosis, learnt

    def learn_again(self, reason: str) -> None:
        """Forget the windows so far and learn a new baseline."""
        self._reason = reason
        self._begin(None)

    def restore(self, baseline: Baseline) -> None:
        """Forget the windows so far and compare the next ones with an earlier baseline."""
        self._reason = baseline.reason
        self._note = ""
        self.use(baseline)

    def use(self, baseline: Baseline) -> None:
        """Compare the next windows with a baseline, in terms of the vehicle file that it was learnt with."""
        self._baseline = baseline
        self._vehicle = self._given
        if baseline.vehicle_file:
            self._vehicle = vehicle_from_text(baseline.vehicle_file, source="the vehicle file of the baseline")
        self._begin(ChangeDetector(baseline, **self._detection))

    def recall(self, history: History) -> None:
        """Continue from stored results; the evidence is computed again from the windows since the baseline.

        Learning in progress begins with the next window: its windows may be in terms of a calibrated file that only the
        lost state had.
        """
        if history.baseline is None:
            return
        self.use(baseline_from_document(history.baseline))
        if history.relearning:
            self.learn_again(history.relearning)
        else:
            self._resume([observation_from_document(document) for document in history.observations], [])

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values and bytes."""
        return {
            "reason": self._reason,
            "is_learning": self.is_learning,
            "baseline": None if self._baseline is None else baseline_document(self._baseline).as_json(),
            "type": None if self._type is None else type_baseline_document(self._type).as_json(),
            "observations": [observation_document(observation) for observation in self.observations],
            "residuals": [stored_statistics(observation.residuals) for observation in self.observations],
            "evidence": [] if self._detector is None else self._detector.evidence.tolist(),
            "note": self._note,
            "completed": vehicle_text(self._vehicle) if self._vehicle is not self._given else "",
            "completion": self._completion.state(),
        }

    @classmethod
    def from_state(
        cls, vehicle: Vehicle, settings: MonitorSettings, state: Mapping[str, Any], type_baseline: TypeBaseline | None
    ) -> "Assessment":
        """Return the assessment that continues from a state; parameters as for `VehicleMonitor.from_state`."""
        if type_baseline is None and state["type"] is not None:
            type_baseline = type_baseline_from_document(state["type"])
        assessment = cls(vehicle, settings, type_baseline=type_baseline)
        if state["baseline"] is not None:
            assessment.use(baseline_from_document(state["baseline"]))
        if state["completed"]:
            assessment._vehicle = vehicle_from_text(state["completed"], source="the saved state")
        observations = [
            replace(observation_from_document(document), residuals=restored_statistics(stored))
            for document, stored in zip(state["observations"], state["residuals"], strict=True)
        ]
        if state["is_learning"]:
            assessment.learn_again(state["reason"])
            assessment._learning = [replace(one, vehicle=assessment._vehicle.name) for one in observations]
            assessment._diagnosis = assessment._against_type()
        else:
            assessment._resume(observations, state["evidence"])
        assessment._reason = state["reason"]
        assessment._note = state["note"]
        assessment._completion = Completion.from_state(
            state["completion"], assessment._vehicle, is_wanted=settings.calibrate
        )
        return assessment

    @property
    def _detection(self) -> dict[str, Any]:
        """Rate of false alarms, windows per day, and largest number of windows held."""
        settings = self._settings
        return {
            "false_alarms": settings.false_alarms,
            "windows_per_day": settings.hours_per_day * 3600 / settings.window,
            "n_windows": settings.max_windows,
        }

    def _begin(self, detector: ChangeDetector | None) -> None:
        """Forget the windows; the next ones are given to a detector, or collected for a baseline."""
        self._learning = []
        self._detector = detector
        self._diagnosis = None
        self._completion = Completion(is_wanted=self._settings.calibrate)

    def _resume(self, observations: Sequence[Observation], evidence: Sequence[float]) -> None:
        """Continue with the windows since the baseline."""
        if self._baseline is None:
            raise DataError("windows to compare, and no baseline")
        named = [replace(observation, vehicle=self._vehicle.name) for observation in observations]
        self._detector = ChangeDetector.resumed(self._baseline, named, list(evidence), **self._detection)
        self._diagnosis = diagnosis_of(self._detector) if named else None

    def _known_type(self) -> TypeBaseline | None:
        """Return the baseline of the type, if it is of the given file and has the components of a window."""
        known = self._type
        if known is None or self._vehicle is not self._given:
            return None
        return known if any(one.components == known.components for one in self._learning) else None

    def _against_type(self) -> Diagnosis | None:
        """Return the diagnosis of the windows so far against the vehicle's type; None if that is unknown."""
        of_type = self._known_type()
        if of_type is None:
            return None
        return diagnose(
            [observation.without_segments() for observation in self._learning],
            type_baseline=of_type,
            false_alarms=self._settings.false_alarms,
            windows_per_day=self._detection["windows_per_day"],
        )

    def _complete_file(self, recording: Recording, observation: Observation) -> bool:
        """Return whether the file was calibrated with this window, so that learning starts again with the next one."""
        if not self._completion.is_open:
            return False
        have, needed = self.learning
        is_last = have + _is_valid(observation) >= needed
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
        self.use(learnt)
        return learnt


def describe_fault(fault: SensorFault) -> str:
    """Return the fault of a sensor, such as "sensor acc_fl is dead: it is constant"."""
    return f"sensor {fault.statement}: {fault.detail}"


def _is_valid(observation: Observation) -> bool:
    """Return whether a baseline may be learnt from a window."""
    return observation.is_conclusive and not observation.sensor_faults


def _reservations(observation: Observation) -> str:
    """Return why a window is inconclusive or not used for learning; empty if it is valid."""
    standing = observation.conditions.get("standing", 0.0)
    if observation.reason and standing > _MAX_STANDING:
        return f"the vehicle stood still for {100 * standing:.0f} % of the time"
    return observation.reason or "; ".join(map(describe_fault, observation.sensor_faults))


#: Apparent sensor faults that a wrong place, gain or delay in the file can cause.
_SEEMING = frozenset({"noisy", "wrong_gain", "time_shifted"})


class Completion:
    """Collects windows of a learning phase, and calibrates the vehicle file on them if it is imperfect.

    Parameters
    ----------
    is_wanted
        Whether the file is calibrated; None: if it fits the windows badly or misplaces sensors.

    Notes
    -----
    Three windows are held as spectra in single precision until the decision: 0.5 MB each with four sensors in ten
    minutes, and released then. Windows without a speed or with a broken sensor are skipped.
    """

    def __init__(self, *, is_wanted: bool | None) -> None:
        self._is_wanted = is_wanted
        self._spectra: tuple[WindowSpectra, ...] = ()
        self._model_errors: list[float] = []
        self._is_open = is_wanted is not False

    @property
    def is_open(self) -> bool:
        """Whether the decision is still to be made."""
        return self._is_open

    def update(
        self, recording: Recording, observation: Observation, vehicle: Vehicle, *, is_last: bool
    ) -> Calibration | None:
        """Add a window, and return the calibration if this was the last one needed and it improves the file.

        Parameters
        ----------
        recording
            Window as read.
        observation
            Its observation.
        vehicle
            Vehicle as its file describes it.
        is_last
            Whether the baseline needs no further window, so that the decision is due.
        """
        self._model_errors.append(observation.conditions.get("model_error", float("inf")))
        if all(fault.kind in _SEEMING for fault in observation.sensor_faults):
            for window in usable_spectra([recording], vehicle):
                if not self._spectra or window.layout.names == self._spectra[0].layout.names:
                    self._spectra = (*self._spectra, _rounded(window))
        if not (self._spectra and (is_last or len(self._spectra) == CALIBRATION_WINDOWS)):
            return None
        windows, errors = self._spectra, self._model_errors
        self._is_open = False
        self._spectra = ()
        self._model_errors = []
        if self._is_wanted:
            return calibrated(windows, vehicle)
        return calibrated_if_imperfect(windows, vehicle, model_errors=errors)

    def state(self) -> dict[str, Any]:
        """Return everything that is needed to continue, as plain values and bytes."""
        return {
            "is_open": self._is_open,
            "model_errors": self._model_errors,
            "windows": [_stored(window) for window in self._spectra],
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any], vehicle: Vehicle, *, is_wanted: bool | None) -> "Completion":
        """Return the completion that continues from a state, of the same vehicle."""
        completion = cls(is_wanted=is_wanted)
        completion._is_open = bool(state["is_open"])
        completion._model_errors = [float(error) for error in state["model_errors"]]
        completion._spectra = tuple(_restored(stored, vehicle) for stored in state["windows"])
        return completion


def _rounded(window: WindowSpectra) -> WindowSpectra:
    """Return spectra in single precision, so that a restart changes nothing."""
    values = window.segments.values.astype(np.complex64).astype(np.complex128)
    return replace(window, segments=replace(window.segments, values=values))


def _stored(window: WindowSpectra) -> dict[str, Any]:
    """Return spectra as plain values and bytes."""
    segments = window.segments
    return {
        "channels": list(window.layout.names),
        "kind": window.kind,
        "frequencies": segments.frequencies.astype("<f8").tobytes(),
        "values": segments.values.astype("<c8").tobytes(),
        "speeds": segments.speeds.astype("<f8").tobytes(),
        "spreads": segments.spreads.astype("<f8").tobytes(),
        "segment_length": segments.segment_length,
        "n_rejected": segments.n_rejected,
    }


def _restored(stored: Mapping[str, Any], vehicle: Vehicle) -> WindowSpectra:
    """Return the spectra of plain values and bytes."""
    frequencies, speeds, spreads = (np.frombuffer(stored[name], dtype="<f8") for name in _REALS)
    layout, rigid = window_layouts(vehicle, tuple(stored["channels"]))
    values = np.frombuffer(stored["values"], dtype="<c8").reshape(speeds.size, frequencies.size, -1)
    segments = SegmentSpectra(
        frequencies=frequencies,
        values=values,
        speeds=speeds,
        spreads=spreads,
        segment_length=stored["segment_length"],
        n_rejected=stored["n_rejected"],
    )
    return WindowSpectra(segments, layout, rigid, stored["kind"])


_REALS = ("frequencies", "speeds", "spreads")
