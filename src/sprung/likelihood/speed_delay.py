"""Delay of the speed channel, from segments in which the vehicle changes its speed."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung.likelihood.missing_speed import STEP, log_likelihoods
from sprung.likelihood.spectra import OVERCOUNT, SLOWEST, UNSTEADIEST, SegmentSpectra
from sprung.likelihood.whittle import Model

#: Delays that are compared [s], and standard deviation of a delay before any data [s].
DELAYS, _PRIOR = np.linspace(-0.5, 3.0, 15), 1.0
#: Step of the posterior over the delays [s].
_FINE = 0.02
#: Gain of the log likelihood over no delay from which a delay is corrected, and shortest one [s].
_SIGNIFICANT, _SHORTEST = 8.0, 0.15
#: Least change of a segment's speed over the delays, relative to it, for which it is used; most and fewest segments.
_CHANGING, _MOST, _FEWEST = 0.03, 80, 6


@dataclass(frozen=True, slots=True)
class SpeedDelay:
    """Delay of the speed channel.

    Parameters
    ----------
    value
        Time by which the channel is late [s]; 0 where the data do not show a delay.
    std
        Standard deviation of it [s].
    """

    value: float = 0.0
    std: float = _PRIOR


def speed_delay(segments: SegmentSpectra, speeds: Real, spreads: Real, model_at: Callable[[Real], Model]) -> SpeedDelay:
    """Return the delay of the speed channel that makes the segments most likely.

    Parameters
    ----------
    segments
        All segments, without speeds.
    speeds, spreads
        Speed [m/s] and coefficient of variation of each segment for each of `DELAYS`, shape (delays, segments).
    model_at
        Function from speeds [m/s] to the nominal model with one class for each.

    Notes
    -----
    The likelihood of each segment at every speed of a grid, its level profiled out, is interpolated at the speed that
    it has with a delay; the sum over the segments is the likelihood of the delay, with a prior about 0. Only segments
    in which the speed changes are informative. Delay and deviation are those of the posterior. A delay below 0.15 s, or
    with a log likelihood that exceeds that of none by less than 8, is taken as none. If the posterior is largest at
    either end of the delays, none of them fits, as with a model that is far off, and the delay stays unknown.

    References
    ----------
    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953),
    125-139.
    """
    change = np.ptp(speeds, axis=0) / np.maximum(speeds.mean(axis=0), SLOWEST)
    is_usable = (speeds.min(axis=0) > SLOWEST) & (spreads.max(axis=0) < UNSTEADIEST) & (change > _CHANGING)
    chosen = np.flatnonzero(is_usable)
    chosen = chosen[np.argsort(change[chosen])[::-1][:_MOST]]
    if chosen.size < _FEWEST:
        return SpeedDelay()
    speeds = np.log(speeds[:, chosen])
    grid = np.arange(speeds.min() - np.log(STEP), speeds.max() + np.log(STEP), np.log(STEP))
    model = model_at(np.exp(grid))
    by_speed = log_likelihoods(segments.values[chosen], model.matrix(model.start)) / OVERCOUNT
    delays = np.arange(DELAYS[0], DELAYS[-1], _FINE)
    total = -0.5 * (delays / _PRIOR) ** 2
    for own, at_speeds in zip(speeds.T, by_speed, strict=True):
        total += np.interp(np.interp(delays, DELAYS, own), grid, at_speeds)
    return _peak(delays, total)


def _peak(delays: Real, total: Real) -> SpeedDelay:
    """Return mean and standard deviation of the posterior over the delays; a mean of 0 where 0 is as likely."""
    if np.argmax(total) in {0, total.size - 1}:
        return SpeedDelay()
    posterior = np.exp(total - total.max())
    posterior /= posterior.sum()
    mean = float(posterior @ delays)
    std = float(np.sqrt(posterior @ (delays - mean) ** 2 + _FINE**2))
    gain = float(total.max() - np.interp(0.0, delays, total))
    return SpeedDelay(mean if gain > _SIGNIFICANT and abs(mean) > _SHORTEST else 0.0, std)
