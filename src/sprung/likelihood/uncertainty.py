"""How far a fit can be trusted: misfit of the spectra, credibility and weights of segments, covariance."""

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.spectra import OVERCOUNT, SegmentSpectra, speed_classes
from sprung.likelihood.whittle import Model

#: A segment counts at most this many times the median power.
_MOST_POWER = 3.0
#: Variance of the mean of n half-overlapping segments' relative power, times n.
_CHANCE = 1.06
#: Correlation of the misfit below which two frequencies tell different things.
_UNLIKE = 0.1


def segment_weights(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the weight of each segment: 1, or less where a pothole makes it far more powerful than the others."""
    squares = np.mean(np.abs(_whitened_segments(model, parameters, segments)) ** 2, axis=2)
    is_used = model.spectra.weights[speed_classes(segments.speeds)] > 0
    power = np.sum(squares * is_used, axis=1) / np.maximum(is_used.sum(axis=1), 1)
    return np.minimum(1.0, _MOST_POWER * np.median(power) / power)


def _whitened_segments(model: Model, parameters: Real, segments: SegmentSpectra) -> Complex:
    """Return L^-1 y of each segment, S = L L^H the model's spectral matrix of its class."""
    factor = np.linalg.inv(np.linalg.cholesky(model.matrix(parameters)))
    numbers = speed_classes(segments.speeds)
    return np.einsum("sfij,sfj->sfi", factor[numbers], segments.values)


def _scores(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the gradient of each segment's minus log likelihood, shape (segments, parameters)."""
    spectra = model.spectra
    whitened = (
        model.whitened_derivatives(parameters) * (np.sqrt(spectra.weights) / spectra.counts[:, None])[..., None, None]
    )
    values = _whitened_segments(model, parameters, segments)
    numbers = speed_classes(segments.speeds)
    scores = np.empty((values.shape[0], len(parameters)))
    for number in range(model.spectra.counts.size):
        members = np.flatnonzero(numbers == number)
        derivative = whitened[:, number]
        trace = np.einsum("pfii->p", derivative).real
        quadratic = np.einsum("sfi,pfij,sfj->sp", values[members].conj(), derivative, values[members], optimize=True)
        scores[members] = trace - quadratic.real
    return scores


def parameter_covariance(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the covariance of the parameters: from the information, and from the scores where these scatter more."""
    information = model.information(parameters)
    bread = np.linalg.inv(information + np.diag(1 / model.prior_std**2))
    expected = bread @ (OVERCOUNT * information + np.diag(1 / model.prior_std**2)) @ bread
    scores = _scores(model, parameters, segments)
    scores = scores - scores.mean(axis=0)
    meat = scores.T @ scores
    neighbours = scores[1:].T @ scores[:-1] / 2
    observed = bread @ (meat + neighbours + neighbours.T) @ bread
    n, p = scores.shape
    share = n / (n + 2.0 * p)
    scale = np.sqrt(np.maximum(1.0, share * np.diag(observed) / np.diag(expected) + (1 - share)))
    return expected * np.outer(scale, scale)


def power_misfit(model: Model, parameters: Real) -> tuple[Real, float]:
    """Return measured over fitted power less 1, (coordinates, frequencies), and its mean square beyond chance."""
    fitted = np.einsum("cfii->cif", model.matrix(parameters)).real
    measured = np.einsum("cfii->cif", model.spectra.matrices).real
    counts = (model.spectra.counts[:, None] * (model.spectra.weights > 0))[:, None, :]
    total = counts.sum(axis=0)
    misfit = np.sum(counts * (measured / fitted - 1), axis=0) / np.maximum(total, 1.0)
    return misfit, float(np.mean(misfit[:, total[0] > 0] ** 2) - np.mean(_CHANCE / total[total > 0]))


def tempering(model: Model, parameters: Real) -> float:
    """Return by how much the segments count less where the model fits worse than chance allows: 0 to 1.

    Notes
    -----
    With a relative error of the model's spectra of variance d^2, the mean of n segments is no more certain than
    1 / n + d^2; an error that reaches over L neighbouring frequencies counts L times. So 1 / (1 + n d^2 L): with
    segments that count less the prior holds what an imperfect model would carry away.
    """
    misfit, excess = power_misfit(model, parameters)
    if excess <= 0:
        return 1.0
    is_used = model.spectra.weights.sum(axis=0) > 0
    rows = misfit[:, is_used]
    reach = 1.0
    for lag in range(1, rows.shape[1] // 2):
        likeness = float(np.sum(rows[:, lag:] * rows[:, :-lag]) / np.sum(rows**2))
        if likeness < _UNLIKE:
            break
        reach += 2 * likeness
    return 1 / (1 + model.spectra.n_segments / OVERCOUNT * excess * reach)
