"""Deviations of windows from a baseline: their mean with its uncertainty, and what is usual of single windows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import freeze
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.observation import Observation
from sprung.errors import ParameterError
from sprung.vehicles import Component


@dataclass(frozen=True, eq=False, slots=True)
class MeanDeviation:
    """Mean deviation of windows from a baseline.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the baseline.
    log_ratios
        Mean deviation from the baseline under the conditions of each window, ln values, shape (components,).
    std
        Standard deviation of `log_ratios` with the effects that corners share, shape (components,).
    std_by_chance
        Part of `std` that is independent from window to window, shape (components,).
    n_windows
        Number of windows.
    """

    components: tuple[Component, ...]
    log_ratios: Real
    std: Real
    std_by_chance: Real
    n_windows: int

    def __post_init__(self) -> None:
        freeze(self, log_ratios=1, std=1, std_by_chance=1)


def mean_deviation(baseline: Baseline, observations: Sequence[Observation]) -> MeanDeviation:
    """Return the mean deviation of windows from a baseline.

    Parameters
    ----------
    baseline
        Baseline of the vehicle or its type, or of the vehicle file.
    observations
        Conclusive windows with the components of the baseline, at least one.

    Raises
    ------
    ParameterError
        If there is no window, or one has other components.

    Notes
    -----
    By chance the mean of n windows has the variance C (1 / n + 1 / m) with the covariance C of the m windows of the
    baseline, or the mean of what the windows report without one. Common effects such as that of a payload may persist:
    averaging over windows does not remove them.
    """
    if not observations:
        raise ParameterError("observations is empty, but a mean needs at least one conclusive window")
    count = len(observations)
    mean = np.mean([baseline.residual(window) for window in observations], axis=0)
    by_chance = np.mean([window.covariance for window in observations], axis=0) / count
    if baseline.version:
        by_chance = baseline.covariance * (1 / count + 1 / baseline.n_windows)
    whole = by_chance + baseline.nuisance + _between(baseline)
    return MeanDeviation(baseline.components, mean, np.sqrt(np.diag(whole)), np.sqrt(np.diag(by_chance)), count)


def usual_std(baseline: Baseline) -> Real:
    """Return the standard deviation of single windows about a baseline, ln values, shape (components,)."""
    return np.sqrt(np.diag(baseline.covariance + baseline.nuisance + _between(baseline)))


def _between(baseline: Baseline) -> Real:
    """Return the covariance between vehicles, of a baseline that is not the vehicle's own."""
    return baseline.doubt if baseline.version == 0 else np.zeros_like(baseline.covariance)
