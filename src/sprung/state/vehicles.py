"""The state of a vehicle and of its parts, from its last windows, its baseline and its active alerts."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung._display import counted
from sprung.diagnosis import Baseline, Observation, max_undetected
from sprung.diagnosis.baseline import MeanDeviation, mean_deviation, typical_std
from sprung.modal import INTERVAL_95
from sprung.results.tables import describe_no_change
from sprung.state.alerts import AlertState, health_index
from sprung.vehicles import Component


class Verdict(StrEnum):
    """What matters most about a vehicle; of a part one of the first three."""

    CHANGE = "change"
    NO_CHANGE_DETECTED = "no_change_detected"
    INCONCLUSIVE = "inconclusive"
    FAULT = "fault"  # an active alert that is not of the suspension: a sensor, lost frames
    LEARNING = "learning"
    WAITING = "waiting"  # nothing analysed yet
    STALE = "stale"  # data too old for a statement about the present


@dataclass(frozen=True, slots=True)
class PartState:
    """What is known of a spring, damper or tyre; changes are relative, -0.2 for a loss of a fifth.

    Parameters
    ----------
    part, corner, kind
        "front_left.spring", "front_left" and "spring".
    change, interval
        Change and its 95 % interval: that of the finding of the alert that names the part; without one the mean of the
        windows with their scatter, by which a change of one part is decided.
    interval_with_common
        95 % interval with what moves all corners alike, such as payload and temperature.
    detectable
        Smallest relative loss that would have been found; None: unknown.
    verdict
        "change", "no_change_detected" or "inconclusive".
    alert, step
        Number of the alert that names the part, and step of its severity; None without one.
    """

    part: str
    corner: str
    kind: str
    change: float
    interval: tuple[float, float]
    interval_with_common: tuple[float, float]
    detectable: float | None
    verdict: Verdict
    alert: int | None
    step: str | None


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """Reference with which the windows of a vehicle are compared.

    Parameters
    ----------
    baseline
        Baseline; None: the values of the vehicle file.
    detectable
        Smallest detectable losses by number of windows with the change.
    notes
        Limits of the comparison, one sentence each.
    absence
        Why there is no baseline, where there is none.
    """

    baseline: Baseline | None
    detectable: dict[int, dict[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    absence: str = "there is no baseline to compare with"

    @property
    def in_words(self) -> str:
        """Name of the reference."""
        return "the vehicle file" if self.baseline is None else f"baseline {self.baseline.version}"

    @property
    def learnt_until(self) -> float:
        """Start of the last window that the baseline was learnt from [s]."""
        return -np.inf if self.baseline is None else max(self.baseline.learning_times, default=-np.inf)

    def accepts(self, observation: Observation) -> bool:
        """Return whether a window can be compared."""
        if self.baseline is None:
            return observation.is_conclusive
        is_of_its_file = not self.baseline.vehicle_file or observation.time > max(
            self.baseline.learning_times, default=0.0
        )
        return is_of_its_file and self.baseline.accepts(observation)

    def deviation(self, windows: Sequence[Observation]) -> MeanDeviation:
        """Return the mean deviation of windows that it accepts, all with the components of the last one."""
        if self.baseline is not None:
            return mean_deviation(self.baseline, windows)
        std = np.sqrt(np.diag(np.mean([window.covariance for window in windows], axis=0) / len(windows)))
        mean = np.mean([window.log_ratios for window in windows], axis=0)
        return MeanDeviation(windows[-1].components, mean, std, std, len(windows))

    def band(self) -> Real | None:
        """Return the ends of the range of 95 % of usual windows, relative, shape (2, components); None: unknown."""
        return None if self.baseline is None else interval_95(np.zeros(()), typical_std(self.baseline))

    def parts(
        self, windows: Sequence[Observation], alerts: Sequence[AlertState] = (), *, limits: dict[str, float]
    ) -> tuple[PartState, ...]:
        """Return the states of all parts in windows.

        Parameters
        ----------
        windows
            Windows that it accepts; without any there is no part.
        alerts
            Active alerts of the suspension.
        limits
            Smallest detectable loss of each part.
        """
        alike = [window for window in windows if window.components == windows[-1].components]
        if not alike:
            return ()
        mean = self.deviation(alike)
        near, wide = (interval_95(mean.log_ratios, std).T.tolist() for std in (mean.std_by_chance, mean.std))
        named: dict[Component, AlertState] = {}
        for each in sorted(alerts, key=lambda alert: alert.severity):
            named |= dict.fromkeys(each.names(mean.components), each)
        parts = []
        for row, component in enumerate(mean.components):
            alert, limit = named.get(component), limits.get(str(component))
            change, interval, with_common = float(np.expm1(mean.log_ratios[row])), tuple(near[row]), tuple(wide[row])
            if alert is not None and alert.change is not None and alert.interval is not None:
                change = alert.change
                interval = with_common = alert.interval
            verdict = Verdict.NO_CHANGE_DETECTED if limit is not None and limit <= max_undetected(component) else None
            parts.append(
                PartState(
                    part=str(component),
                    corner=component.corner,
                    kind=component.kind,
                    change=change,
                    interval=interval,
                    interval_with_common=with_common,
                    detectable=limit,
                    verdict=Verdict.CHANGE if alert is not None else verdict or Verdict.INCONCLUSIVE,
                    alert=None if alert is None else alert.number,
                    step=None if alert is None else alert.step,
                )
            )
        return tuple(parts)


def interval_95(log_ratio: Real, std: Real) -> Real:
    """Return the ends of the 95 % interval of a value / reference - 1 from its ln and standard deviation.

    Examples
    --------
    >>> import numpy as np
    >>> interval_95(np.log([0.8]), np.array([0.01])).round(3).ravel().tolist()
    [-0.216, -0.184]
    """
    return np.expm1(log_ratio + INTERVAL_95 * np.multiply.outer([-1.0, 1.0], std))


#: Windows that are averaged since the onset of a finding, and without one.
WINDOWS_SINCE_ONSET = 48
LAST_WINDOWS = 12
#: More than the rounding of seconds since 1970 in double precision, and less than any time between windows [ns].
TIME_ROUNDING = 1000


class Conclusion(NamedTuple):
    """What the diagnosis of the windows since the baseline says after a window.

    Parameters
    ----------
    verdict, sentence
        Verdict, and the sentence that states it without an alert.
    detectable
        Smallest relative loss of each part that would have been found.
    """

    verdict: str
    sentence: str
    detectable: dict[str, float]


class AssessedWindow(NamedTuple):
    """Start [UTC ns] and observation of a window, and the conclusion after it; None without a baseline."""

    t0: int
    observation: Observation
    conclusion: Conclusion | None = None


class VehicleStatus(NamedTuple):
    """Progress of the monitoring of a vehicle.

    Parameters
    ----------
    share
        Part of the present window that has arrived, 0 to 1.
    n_learnt, n_needed
        Number of windows usable for the baseline so far, and needed; equal where nothing is being learnt.
    note
        Reason why the vehicle cannot be assessed at present; empty if it can.
    is_learning
        Whether windows are collected for a baseline.
    window
        Length of a window [s]; 0: unknown.
    until
        Time after the last sample, UTC ns; None before the first.
    repeated
        Duration of the samples that arrived last and were analysed before [s]; 0 after new ones.
    coverage
        What the windows have brought of the information that a baseline needs, in words; empty before the first.
    """

    share: float = 0.0
    n_learnt: int = 0
    n_needed: int = 0
    note: str = ""
    is_learning: bool = False
    window: float = 0.0
    until: int | None = None
    repeated: float = 0.0
    coverage: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class VehicleState:
    """How a vehicle is. Times are UTC ns.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    verdict, sentence
        What matters most, in a word and in a sentence.
    reference, baseline
        What windows are compared with, in words, and version of the baseline; None: the vehicle file.
    n_windows, since, until
        Windows that the parts are the mean of, and starts of the first and last; None without any.
    parts
        Springs, dampers and tyres.
    alerts
        Active alerts, the most severe first.
    last_seen, is_old
        Time of the last message, and whether it is too old for a statement about the present.
    windows_learnt, windows_needed
        Progress of learning; None before the first analysis.
    health_index
        0 to 100, for planning; None while the state is not known.
    notes
        Limits of the comparison, one sentence each.
    """

    vehicle: str
    verdict: Verdict
    sentence: str
    reference: str
    baseline: int | None
    n_windows: int
    since: int | None
    until: int | None
    parts: tuple[PartState, ...]
    alerts: tuple[AlertState, ...]
    last_seen: int
    is_old: bool
    windows_learnt: int | None
    windows_needed: int | None
    health_index: float | None
    notes: tuple[str, ...]

    @property
    def worst(self) -> AlertState | None:
        """The most severe active alert; None without one."""
        return self.alerts[0] if self.alerts else None

    @property
    def severity(self) -> int:
        """Greatest severity of the active alerts, 1 to 1000; 0 without one."""
        return 0 if self.worst is None else self.worst.severity

    @property
    def step(self) -> str | None:
        """Step of that severity; None without an alert."""
        return None if self.worst is None else self.worst.step

    @property
    def detectable(self) -> dict[str, float]:
        """Smallest relative loss of each part that would have been found; empty if unknown."""
        return {part.part: part.detectable for part in self.parts if part.detectable is not None}


def state_of(
    vehicle: str,
    windows: Sequence[AssessedWindow],
    reference: Reference,
    alerts: Sequence[AlertState],
    *,
    status: VehicleStatus | None = None,
    is_past: bool = False,
    n_on_board: int = 0,
    last_seen: int = 0,
    is_old: bool = False,
    is_parked: bool = False,
) -> VehicleState:
    """Return the state of a vehicle.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    windows
        Last windows, in order of time.
    reference
        What they are compared with.
    alerts
        Active alerts.
    status
        Progress of the analysis; None before the first.
    is_past
        Whether the state is that of the end of an earlier period, which the present progress does not concern.
    n_on_board
        Windows that the vehicle's box identified on board; such a vehicle is not assessed.
    last_seen, is_old, is_parked
        Time of the last message, whether it is too old for a statement about the present, and whether the vehicle was
        shut down properly.

    Notes
    -----
    Alerts decide first, then the age of the data, then learning, then what the last windows allow to say. A part has
    changed if an active alert names it; its size and interval are those of the finding. The smallest detectable losses
    are those of the change test behind the most severe finding; without one, those of the diagnosis with the last
    window that can be compared, whose verdict and sentence are then those of the vehicle.
    """
    active = tuple(sorted(alerts, key=lambda alert: (-alert.severity, alert.raised)))
    findings = [alert for alert in active if alert.is_of_suspension]
    usable = [
        each
        for each in windows
        if each.observation.time > reference.learnt_until and reference.accepts(each.observation)
    ]
    usable = [each for each in usable if each.observation.components == usable[-1].observation.components]
    conclusion = usable[-1].conclusion if usable and reference.baseline is not None else None
    stated = next((alert.detectable for alert in findings if alert.detectable), {})
    limits = stated or ({} if conclusion is None else conclusion.detectable)
    begin = next((alert.onset for alert in findings if alert.onset is not None), None)
    since_onset = [] if begin is None else [each for each in usable if each.t0 >= begin - TIME_ROUNDING]
    shown = since_onset[-WINDOWS_SINCE_ONSET:] or usable[-LAST_WINDOWS:]
    parts = reference.parts([each.observation for each in shown], findings, limits=limits)
    is_doubted = conclusion is not None and conclusion.verdict == Verdict.INCONCLUSIVE
    if is_doubted and all(part.verdict is not Verdict.INCONCLUSIVE for part in parts):  # for another reason
        parts = tuple(replace(part, verdict=Verdict.INCONCLUSIVE) if part.alert is None else part for part in parts)
    if active:
        verdict, sentence = _by_alerts(active)
    elif is_old and not is_parked:
        verdict, sentence = Verdict.STALE, f"{vehicle} sends no data"
    else:
        concluded = conclusion or Conclusion(Verdict.INCONCLUSIVE, _why_not_compared(reference, parts), {})
        verdict, sentence = _by_windows(status, parts, concluded, is_past=is_past, n_on_board=n_on_board)
        if is_old:
            verdict, sentence = Verdict.STALE, f"parked; until then {sentence}"
    is_judged = verdict in {Verdict.CHANGE, Verdict.NO_CHANGE_DETECTED}
    is_judged |= verdict is Verdict.FAULT and reference.baseline is not None
    is_hindered = status is not None and bool(status.note or status.is_learning)
    is_known = is_judged and not (is_old or is_hindered)
    return VehicleState(
        vehicle=vehicle,
        verdict=verdict,
        sentence=_as_sentence(sentence, vehicle),
        reference=reference.in_words,
        baseline=None if reference.baseline is None else reference.baseline.version,
        n_windows=len(shown),
        since=shown[0][0] if shown else None,
        until=shown[-1][0] if shown else None,
        parts=parts,
        alerts=active,
        last_seen=last_seen,
        is_old=is_old,
        windows_learnt=None if status is None else status.n_learnt,
        windows_needed=None if status is None else status.n_needed,
        health_index=health_index(active) if is_known else None,
        notes=reference.notes,
    )


def progress_in_words(status: VehicleStatus) -> str:
    """Return progress of learning and of the current window, and repeated samples; empty if there is none of these."""
    parts = [f"learning: {status.n_learnt} of {status.n_needed} windows"] if status.is_learning else []
    if status.note:
        parts.append(f"last window: {status.note}")
    if status.is_learning and status.share:
        length = status.window / 60
        parts.append(f"{status.share * length:.1f} of the {length:g} min of the next window have arrived")
    if status.repeated:
        parts.append(f"the last {status.repeated / 60:.1f} min were analysed before and do not count again")
    return "; ".join(parts)


def _by_alerts(active: Sequence[AlertState]) -> tuple[Verdict, str]:
    """Return verdict and sentence by the most severe of the active alerts."""
    first, *others = active
    more = f". {counted(len(others), 'further alert')} {'is' if len(others) == 1 else 'are'} active" if others else ""
    verdict = Verdict.CHANGE if first.is_of_suspension else Verdict.FAULT
    return Verdict.STALE if first.cause == "silent" else verdict, f"{first.sentence.rstrip('.')}{more}"


def _by_windows(
    status: VehicleStatus | None, parts: Sequence[PartState], concluded: Conclusion, *, is_past: bool, n_on_board: int
) -> tuple[Verdict, str]:
    """Return verdict and sentence without an alert."""
    if n_on_board:
        return Verdict.INCONCLUSIVE, f"identifies on board: {counted(n_on_board, 'window')} of modes"
    if status is None and not parts and not is_past:
        return Verdict.WAITING, "no samples analysed yet"
    said = "" if status is None or is_past else progress_in_words(status)
    if said and status is not None and status.is_learning:
        return Verdict.LEARNING, said
    if said and status is not None and status.note:
        return Verdict.INCONCLUSIVE, f"inconclusive: {said}"
    verdict, sentence = Verdict(concluded.verdict), concluded.sentence
    if verdict is Verdict.CHANGE:  # its alert waits for further windows, or has been cleared
        verdict, sentence = Verdict.INCONCLUSIVE, f"inconclusive: a change without an active alert: {sentence}"
    return verdict, "; ".join(text for text in (sentence, said) if text)


def _why_not_compared(reference: Reference, parts: Sequence[PartState]) -> str:
    """Return why there is no conclusion."""
    if reference.baseline is None:
        return describe_no_change({}, reference.absence)
    missing = "no window since its learning can be compared with the baseline"
    return describe_no_change({}, "the last window was not diagnosed" if parts else missing)


def _as_sentence(text: str, vehicle: str) -> str:
    """Return a text that begins with a capital, or the name of a vehicle as it is, and ends with a full stop."""
    first = text[:1] if text.startswith(vehicle) else text[:1].upper()
    return f"{first}{text[1:].rstrip('.')}."
