"""Speed of a vehicle by the delay between its axles: where it was not recorded, or its channel is late."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Complex, Real
from sprung.errors import DataError
from sprung.likelihood.spectra import OVERCOUNT, SLOWEST, UNSTEADIEST, SegmentSpectra
from sprung.likelihood.surface import SurfaceInputs
from sprung.likelihood.whittle import Model

#: Highest speed of the grid [m/s], and ratio of neighbouring speeds; and that of a grid for the lines of rail joints.
FASTEST = 45.0
STEP = 1.02
FINE = 1.002
#: Delays that are compared [s].
DELAYS = np.linspace(-0.5, 3.0, 15)


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """Limits of the speed by the delay between the axles, and of the delay of its channel."""

    #: Whitened power at a frequency over the median in its segment up to which it counts.
    power: float = 50.0
    #: Gain of a segment's log likelihood by the delay between the axles, over axles that are independent of each other,
    #: from which the rear ones repeat the front ones; and spread of the speeds that makes them independent.
    repeated: float = 10.0
    any_speed: float = 100.0
    #: Typical change of ln speed from one half-overlapping segment to the next.
    change: float = 0.08
    #: Ratio of the ends of a second grid of speeds and of the speeds found by the first.
    beyond: float = 1.1
    #: Standard deviation of a time within a Hann-squared segment over the time between two segments.
    within: float = 0.28
    #: Largest standard deviation of ln speed in a segment that is used, and fewest such segments.
    sharp: float = 0.06
    min_segments: int = 12
    #: Standard deviation of the channel's delay before any data [s], and step of its posterior [s].
    prior: float = 1.0
    fine: float = 0.02
    #: Gain of the log likelihood over no delay from which a delay is corrected, and shortest one [s].
    significant: float = 8.0
    shortest: float = 0.15
    #: Least relative change of a segment's speed over the delays for which it is used; most and fewest segments.
    changing: float = 0.03
    max_changing: int = 80
    min_changing: int = 6


LIMITS = SpeedLimits()


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
    std: float = LIMITS.prior


def speed_grid(found: tuple[float, float] = (SLOWEST, FASTEST), *, step: float = STEP) -> Real:
    """Return the speeds at which the likelihood is computed [m/s], some beyond those found, shape (speeds,)."""
    lowest, highest = max(found[0] / LIMITS.beyond, SLOWEST), min(found[1] * LIMITS.beyond, FASTEST)
    count = int(np.log(highest / lowest) / np.log(step)) + 1
    return np.asarray(lowest * step ** np.arange(count), dtype=np.float64)


def with_estimated_speeds(
    segments: SegmentSpectra,
    model_at: Callable[[Real], Model],
    parameters: Real | None = None,
    *,
    speeds: Real | None = None,
    is_tentative: bool = False,
) -> SegmentSpectra:
    """Return the segments whose speed can be estimated from the delay between the axles, with that speed.

    Parameters
    ----------
    segments
        Segments in order of time, without speeds.
    model_at
        Function from speeds [m/s] to the model with one class for each.
    parameters
        Parameters of an earlier fit, of which those of the free parts and the first ones of the surface are used; None:
        nominal ones.
    speeds
        Speeds that are compared [m/s], in equal ratios; None: those of `speed_grid`.
    is_tentative
        Whether another estimate follows, with parameters of a fit.

    Raises
    ------
    DataError
        If the speed of too few segments can be estimated.

    Notes
    -----
    The likelihood of each segment at every speed of a grid, its level profiled out; along the segments ln speed is a
    random walk: a hidden Markov model, whose posterior the forward and backward recursion gives. Its mean and standard
    deviation are the speed and its spread. A segment counts only if its likelihood is larger than that of axles with
    inputs that are independent of each other, at any speed: the shape of a spectrum alone, of noise or of a rig, would
    fit one speed better than others, too. A weak spring or a load may hide that from a nominal vehicle: where too few
    segments count in a tentative estimate, all of a sharp speed do, and the one after the fit decides.

    References
    ----------
    L. R. Rabiner, A tutorial on hidden Markov models and selected applications in speech recognition, Proceedings of
    the IEEE 77 (1989) 257-286.
    """
    speeds = speed_grid() if speeds is None else speeds
    model = model_at(speeds)
    start = model.start.copy()
    if parameters is not None:
        kept = min(parameters.size, int(model.rows("class_roughness")[0]))
        start[:kept] = parameters[:kept]
        start[model.names.index("delay")] = 0.0  # the speed itself is sought
    evidence = log_likelihoods(segments.values, model.matrix(start)) / OVERCOUNT
    posterior = _smoothed(evidence, np.log(speeds))
    independent = log_likelihoods(segments.values, _with_independent_axles(model).matrix(start)) / OVERCOUNT
    gain = np.sum(posterior * evidence, axis=1) - independent.max(axis=1)
    mean = posterior @ np.log(speeds)
    deviation = np.sqrt(np.maximum(posterior @ np.log(speeds) ** 2 - mean**2, 0.0))
    inside = (mean > np.log(speeds[2])) & (mean < np.log(speeds[-3]))
    is_sharp = (deviation < LIMITS.sharp) & inside
    is_good, enough = is_sharp & (gain > LIMITS.repeated), min(LIMITS.min_segments, is_sharp.size)
    if is_tentative and np.count_nonzero(is_good) < enough <= np.count_nonzero(is_sharp):
        is_good = is_sharp
    if np.count_nonzero(is_good) < enough:
        raise DataError(
            f"the recording has no speed channel, and the delay between the axles gives the speed of only "
            f"{np.count_nonzero(is_good)} of {is_good.size} segments: add the speed [m/s]"
        )
    # No speed is more certain than the step of the grid; a fine one shows how it changes within a segment.
    step = speeds[1] / speeds[0] - 1
    is_fine = not np.isclose(step, STEP - 1) and mean.size > 1
    changing = LIMITS.within * np.abs(np.gradient(mean)) if is_fine else np.zeros(mean.size)
    spreads = np.hypot(np.maximum(deviation, step), changing)
    return replace(
        segments,
        values=segments.values[is_good],
        speeds=np.exp(mean[is_good]),
        spreads=spreads[is_good],
        n_rejected=segments.n_rejected + int(np.count_nonzero(~is_good)),
    )


def _with_independent_axles(model: Model) -> Model:
    """Return the model with inputs of the axles that do not repeat each other: of speeds spread over all delays."""
    blocks = tuple(
        replace(block, spectra=replace(block.spectra, spreads=np.full(block.spectra.spreads.shape, LIMITS.any_speed)))
        if isinstance(block, SurfaceInputs)
        else block
        for block in model.blocks
    )
    return replace(model, blocks=blocks)


def log_likelihoods(values: Complex, matrices: Complex) -> Real:
    """Return the log likelihood of each segment at each speed, the level profiled out, without outlying frequencies.

    Parameters
    ----------
    values
        Spectra of the segments, shape (segments, frequencies, coordinates).
    matrices
        Spectral matrices at each speed, shape (speeds, frequencies, coordinates, coordinates).

    Returns
    -------
    ndarray
        Shape (segments, speeds).

    Notes
    -----
    The level is the mean whitened power over the frequencies, each of which counts at most fifty times the median
    (winsorised): it would otherwise be that of the lines of wheels that are not round. A wrong speed shows at few
    frequencies, too, those of the delay between the axles, at ten to twenty times the median.

    References
    ----------
    P. J. Huber, Robust estimation of a location parameter, Annals of Mathematical Statistics 35 (1964), 73-101.
    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953),
    125-139.
    """
    factors = np.linalg.cholesky(matrices)
    logdet = 2 * np.log(np.einsum("vfii->vfi", factors).real).sum(axis=(1, 2))
    by_frequency = np.ascontiguousarray(values.transpose(1, 2, 0))
    level = np.array([_levels(L @ by_frequency) for L in np.linalg.inv(factors)])
    return -logdet - np.prod(matrices.shape[1:3]) * np.log(level.T)


def _levels(whitened: Complex) -> Real:
    """Mean power of segments, (frequencies, coordinates, segments), where none counts beyond fifty times the median."""
    power = np.mean(whitened.real**2 + whitened.imag**2, axis=1)
    level = np.asarray(power.mean(axis=0), dtype=np.float64)
    # Medians only where not more than half of the powers are above a fiftieth of the largest.
    may_exceed = 2 * np.count_nonzero(LIMITS.power * power >= power.max(axis=0), axis=0) <= len(power)
    most = LIMITS.power * np.median(power[:, may_exceed], axis=0)
    level[may_exceed] = np.minimum(power[:, may_exceed], most).mean(axis=0)
    return level


def _smoothed(evidence: Real, places: Real) -> Real:
    """Return the posterior of each segment over the places, (segments, places)."""
    from scipy.special import logsumexp

    step = -0.5 * (np.subtract.outer(places, places) / LIMITS.change) ** 2
    moves = np.exp(step - logsumexp(step, axis=1, keepdims=True))
    forward, backward = evidence.copy(), np.zeros_like(evidence)
    for k in range(1, len(evidence)):
        forward[k] += _after(forward[k - 1], moves)
    for k in range(len(evidence) - 2, -1, -1):
        backward[k] = _after(evidence[k + 1] + backward[k + 1], moves.T)
    total = forward + backward
    return np.exp(total - logsumexp(total, axis=1, keepdims=True))


def _after(logs: Real, moves: Real) -> Real:
    """Return ln of the probabilities of the places after a move with those before it, shape (places,)."""
    most = logs.max()
    return np.asarray(most + np.log(np.exp(logs - most) @ moves), dtype=np.float64)


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
    is_usable = (speeds.min(axis=0) > SLOWEST) & (spreads.max(axis=0) < UNSTEADIEST) & (change > LIMITS.changing)
    chosen = np.flatnonzero(is_usable)
    chosen = chosen[np.argsort(change[chosen])[::-1][: LIMITS.max_changing]]
    if chosen.size < LIMITS.min_changing:
        return SpeedDelay()
    speeds = np.log(speeds[:, chosen])
    grid = np.arange(speeds.min() - np.log(STEP), speeds.max() + np.log(STEP), np.log(STEP))
    model = model_at(np.exp(grid))
    by_speed = log_likelihoods(segments.values[chosen], model.matrix(model.start)) / OVERCOUNT
    delays = np.arange(DELAYS[0], DELAYS[-1], LIMITS.fine)
    total = -0.5 * (delays / LIMITS.prior) ** 2
    for own, at_speeds in zip(speeds.T, by_speed, strict=True):
        total += np.interp(np.interp(delays, DELAYS, own), grid, at_speeds)
    if np.argmax(total) in {0, total.size - 1}:
        return SpeedDelay()
    posterior = np.exp(total - total.max())
    posterior /= posterior.sum()
    mean = float(posterior @ delays)
    std = float(np.sqrt(posterior @ (delays - mean) ** 2 + LIMITS.fine**2))
    gain = float(total.max() - np.interp(0.0, delays, total))
    return SpeedDelay(mean if gain > LIMITS.significant and abs(mean) > LIMITS.shortest else 0.0, std)
