"""Speed of a vehicle from the delay between its axles, if it was not recorded."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from sprung._arrays import Complex, Real
from sprung.errors import DataError
from sprung.likelihood.spectra import OVERCOUNT, SLOWEST, SegmentSpectra
from sprung.likelihood.surface import SurfaceInputs
from sprung.likelihood.whittle import Model

#: Highest speed of the grid [m/s], and ratio of neighbouring speeds.
FASTEST, STEP = 45.0, 1.02
#: Gain of a segment's log likelihood by the delay between the axles, over axles that are independent of each other,
#: from which the rear ones repeat the front ones; and spread of the speeds that makes them independent.
_REPEATED, _ANY_SPEED = 10.0, 100.0
#: Usual change of ln speed from one half-overlapping segment to the next.
_CHANGE = 0.08
#: Largest standard deviation of ln speed in a segment that is used, and fewest such segments.
_SHARP, _FEWEST = 0.06, 12


def speed_grid() -> Real:
    """Return the speeds at which the likelihood is computed [m/s], shape (speeds,)."""
    count = int(np.log(FASTEST / SLOWEST) / np.log(STEP)) + 1
    return np.asarray(SLOWEST * STEP ** np.arange(count), dtype=np.float64)


def with_estimated_speeds(
    segments: SegmentSpectra, model_at: Callable[[Real], Model], parameters: Real | None = None
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
    fit one speed better than others, too.

    References
    ----------
    L. R. Rabiner, A tutorial on hidden Markov models and selected applications in speech recognition, Proceedings of
    the IEEE 77 (1989) 257-286.
    """
    speeds = speed_grid()
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
    is_good = (deviation < _SHARP) & inside & (gain > _REPEATED)
    if np.count_nonzero(is_good) < min(_FEWEST, is_good.size):
        raise DataError(
            f"the recording has no speed channel, and the delay between the axles gives the speed of only "
            f"{np.count_nonzero(is_good)} of {is_good.size} segments: add the speed [m/s]"
        )
    return replace(
        segments,
        values=segments.values[is_good],
        speeds=np.exp(mean[is_good]),
        spreads=np.maximum(deviation[is_good], STEP - 1),
        n_rejected=segments.n_rejected + int(np.count_nonzero(~is_good)),
    )


def _with_independent_axles(model: Model) -> Model:
    """Return the model with inputs of the axles that do not repeat each other: of speeds spread over all delays."""
    blocks = tuple(
        replace(block, spectra=replace(block.spectra, spreads=np.full(block.spectra.spreads.shape, _ANY_SPEED)))
        if isinstance(block, SurfaceInputs)
        else block
        for block in model.blocks
    )
    return replace(model, blocks=blocks)


def log_likelihoods(values: Complex, matrices: Complex) -> Real:
    """Return the log likelihood of each segment at each speed, the level profiled out.

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

    References
    ----------
    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953),
    125-139.
    """
    factors = np.linalg.cholesky(matrices)
    inverse = np.linalg.inv(factors)
    logdet = 2 * np.log(np.einsum("vfii->vfi", factors).real).sum(axis=(1, 2))
    size = matrices.shape[1] * matrices.shape[2]
    by_frequency = np.ascontiguousarray(values.transpose(1, 2, 0))
    level = np.array([np.mean(np.abs(L @ by_frequency) ** 2, axis=(0, 1)) for L in inverse])
    return -logdet - size * np.log(level.T)


def _smoothed(evidence: Real, places: Real) -> Real:
    """Return the posterior of each segment over the places, (segments, places)."""
    step = -0.5 * (np.subtract.outer(places, places) / _CHANGE) ** 2
    step -= logsumexp(step, axis=1, keepdims=True)
    forward, backward = evidence.copy(), np.zeros_like(evidence)
    for k in range(1, len(evidence)):
        forward[k] += logsumexp(forward[k - 1][:, None] + step, axis=0)
    for k in range(len(evidence) - 2, -1, -1):
        backward[k] = logsumexp(step + evidence[k + 1] + backward[k + 1], axis=1)
    total = forward + backward
    return np.exp(total - logsumexp(total, axis=1, keepdims=True))
