"""What the windows of a vehicle are compared with, and the change of each part against it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from sprung._arrays import Real
from sprung.diagnosis import MAX_UNDETECTED, Baseline, Observation
from sprung.diagnosis.baseline import MeanDeviation, mean_deviation, typical_std
from sprung.modal import INTERVAL_95
from sprung.state.alerts import AlertState
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

    def limits(self, n_windows: int) -> dict[str, float]:
        """Return the smallest losses detectable in a number of windows; empty if unknown."""
        known = [count for count in self.detectable if count <= n_windows]
        return self.detectable[max(known)] if known else {}

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
            verdict = Verdict.NO_CHANGE_DETECTED if limit is not None and limit <= MAX_UNDETECTED else None
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
