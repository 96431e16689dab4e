"""Uncertainty of a fit: misfit of the spectra, tempering of the likelihood, weights of segments, covariance."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.hermitian import hermitian, real_coordinates
from sprung.likelihood.search import SpectralLikelihood
from sprung.likelihood.spectra import (
    CLASS_WIDTH,
    OVERCOUNT,
    ClassSpectra,
    SegmentSpectra,
    speed_classes,
    through_window,
)
from sprung.likelihood.transfer import Transfer, transfer
from sprung.likelihood.whittle import Model


@dataclass(frozen=True, slots=True)
class MisfitSettings:
    """Settings of weights and tempering."""

    #: A segment counts for at most this many times the median power, about three standard deviations of chance.
    max_power: float = 1.2
    #: Variance of the mean relative power of n half-overlapping segments, times n.
    chance: float = 1.06
    #: Correlation of the misfit below which two frequencies are taken as independent.
    uncorrelated: float = 0.1


SETTINGS = MisfitSettings()


def segment_weights(
    model: SpectralLikelihood, parameters: Real, segments: SegmentSpectra, *, width: float = CLASS_WIDTH
) -> Real:
    """Return the weight of each segment: 1, or less for one far more powerful than the others, as on a pothole.

    Parameters
    ----------
    model
        Model with the spectra of the segments.
    parameters
        Parameters of the model.
    segments
        Spectra of the segments.
    width
        Width of the speed classes of the model's data, as for `class_spectra`.

    Returns
    -------
    ndarray
        Shape (segments,), above 0 and at most 1.

    Notes
    -----
    With the power q = |L^-1 y|^2 relative to the model, S = L L^H, averaged over the frequencies that are used, the
    weight is min(1, 1.2 median(q) / q): a bounded influence of single segments. By chance q scatters by 7 % over 100
    frequencies of three coordinates. Where single potholes on a smooth road scale whole segments, their spectra are a
    mixture of scales, and the shape of the mixture's members is that of the median segment: friction, bump stops and
    valves respond differently to a pothole.

    References
    ----------
    P. J. Huber, Robust estimation of a location parameter, Annals of Mathematical Statistics 35 (1964), 73-101 (weights
    that are inversely proportional to the size of an outlier).
    """
    squares = np.mean(np.abs(whitened_segments(model, parameters, segments, width)) ** 2, axis=2)
    is_used = model.spectra.weights[speed_classes(segments.speeds, width=width)] > 0
    power = np.sum(squares * is_used, axis=1) / np.maximum(is_used.sum(axis=1), 1)
    return np.minimum(1.0, SETTINGS.max_power * np.median(power) / power)


def parameter_covariance(
    model: SpectralLikelihood, parameters: Real, segments: SegmentSpectra, *, width: float = CLASS_WIDTH
) -> Real:
    """Return the covariance of the fitted parameters, larger where the scores of the segments scatter more.

    Parameters
    ----------
    model
        Model with the spectra of the segments.
    parameters
        Parameters at the optimum.
    segments
        Spectra of the segments, in the order of time.
    width
        Width of the speed classes of the model's data, as for `class_spectra`.

    Returns
    -------
    ndarray
        Shape (parameters, parameters).

    Notes
    -----
    With the Fisher information I, the prior P = diag(1 / prior_std^2) and A = (I + P)^-1, the covariance by the model
    is A (c I + P) A, where c = 19/9 corrects for the overlap of the windows. The sandwich A B A has instead the
    covariance B of the segments' scores, with half of that of neighbours, which overlap. Where its diagonal is larger,
    the variances are those of the mean of both, weighted n to 2 p for n segments and p parameters: B is uncertain
    itself.

    References
    ----------
    P. J. Huber, The behavior of maximum likelihood estimates under nonstandard conditions, Proceedings of the Fifth
    Berkeley Symposium on Mathematical Statistics and Probability 1 (1967), 221-233.
    H. White, Maximum likelihood estimation of misspecified models, Econometrica 50 (1982), 1-25.
    W. K. Newey and K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
    covariance matrix, Econometrica 55 (1987), 703-708 (weight 1/2 of neighbours).
    """
    whitened = model.whitened_derivatives(parameters)
    rows = whitened.reshape(parameters.size, -1)
    information = rows @ rows.T
    expected = expected_covariance(information, model.prior_std)
    scores = _scores(model, parameters, segments, whitened, width)
    bread = np.linalg.inv(information + np.diag(1 / model.prior_std**2))
    centred = scores - scores.mean(axis=0)
    neighbours = centred[1:].T @ centred[:-1] / 2
    observed = bread @ (centred.T @ centred + neighbours + neighbours.T) @ bread
    n, p = scores.shape
    share = n / (n + 2.0 * p)
    scale = np.sqrt(np.maximum(1.0, share * np.diag(observed) / np.diag(expected) + (1 - share)))
    return expected * np.outer(scale, scale)


def expected_covariance(information: Real, prior_std: Real) -> Real:
    """Return the covariance of parameters by the model, A (c I + P) A with A = (I + P)^-1, c for overlapping segments.

    Parameters
    ----------
    information
        Fisher information I without the prior, shape (parameters, parameters).
    prior_std
        Standard deviations of the prior, P = diag(1 / prior_std^2), shape (parameters,).

    References
    ----------
    As for `parameter_covariance`.
    """
    prior = np.diag(1 / prior_std**2)
    bread = np.linalg.inv(information + prior)
    return np.asarray(bread @ (OVERCOUNT * information + prior) @ bread, dtype=np.float64)


class Optimum:
    """A model at the end of its fit: score and information of parameters that it lacks.

    Parameters
    ----------
    model
        Model with data.
    parameters
        Its fitted parameters.

    Notes
    -----
    A further parameter q whose whitened derivative of the spectral matrix is d has the score -excess . d, the
    derivative of ln of the likelihood, the information d . d, and d . derivatives together with a parameter of the
    model.

    References
    ----------
    C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters with applications to problems
    of estimation, Proceedings of the Cambridge Philosophical Society 44 (1948), 50-57 (score test).
    """

    def __init__(self, model: Model, parameters: Real) -> None:
        self.model = model
        #: Response of the vehicle.
        self.response: Transfer = transfer(model.terms(parameters))
        factor = np.asarray(
            np.linalg.inv(np.linalg.cholesky(through_window(self.response.spectral_matrix))), dtype=np.complex128
        )
        root_weights = np.sqrt(model.spectra.weights)[..., None]
        self._factor = np.asarray(factor * np.sqrt(root_weights)[..., None], dtype=np.complex128)
        data = factor @ model.spectra.matrices @ factor.conj().swapaxes(-1, -2)
        #: The model's spectral matrix less the data's, whitened, in real coordinates.
        self.excess: Real = (real_coordinates(np.eye(data.shape[-1]) - data) * root_weights).ravel()
        #: Whitened derivatives with respect to the model's own parameters, shape (parameters, size of `excess`).
        self.derivatives: Real = model.whitened_derivatives(parameters).reshape(parameters.size, -1)

    def whitened(self, change: Real) -> Real:
        """Return a derivative of the spectral matrix before the window, as methods of `Transfer` give it, whitened."""
        seen = hermitian(through_window(change[..., None])[..., 0])
        return real_coordinates(self._factor @ seen @ self._factor.conj().swapaxes(-1, -2)).ravel()


def power_misfit(model: SpectralLikelihood, parameters: Real) -> tuple[Real, float]:
    """Return measured over fitted power less 1, and its mean square beyond chance.

    Parameters
    ----------
    model
        Model with data.
    parameters
        Parameters of the model.

    Returns
    -------
    ndarray, float
        Misfit averaged over the classes, shape (coordinates, frequencies); mean square of it less that by chance, below
        0 where it is smaller than expected.

    Notes
    -----
    The relative power of one segment has variance 1, the mean of n half-overlapping ones 1.06 / n.

    References
    ----------
    P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Transactions on Audio and
    Electroacoustics AU-15 (1967), 70-73 (variance of the mean of overlapping segments).
    """
    return excess_power(model.matrix(parameters), model.spectra)


def excess_power(matrices: Complex, spectra: ClassSpectra) -> tuple[Real, float]:
    """Return measured over fitted power less 1, and its mean square beyond chance, as `power_misfit`.

    Parameters
    ----------
    matrices
        Fitted spectral matrices, shape of `spectra.matrices`.
    spectra
        Measured ones.

    References
    ----------
    As for `power_misfit`.
    """
    fitted = np.einsum("cfii->cif", matrices).real
    measured = np.einsum("cfii->cif", spectra.matrices).real
    counts = (spectra.counts[:, None] * (spectra.weights > 0))[:, None, :]
    total = counts.sum(axis=0)
    misfit = np.sum(counts * (measured / fitted - 1), axis=0) / np.maximum(total, 1.0)
    return misfit, float(np.mean(misfit[:, total[0] > 0] ** 2) - np.mean(SETTINGS.chance / total[total > 0]))


def tempering(model: SpectralLikelihood, parameters: Real) -> float:
    """Return the weight of the likelihood: 1, or less where the model fits worse than chance allows.

    Parameters
    ----------
    model
        Model with data.
    parameters
        Parameters of the model.

    Returns
    -------
    float
        Above 0 and at most 1; factor of `ClassSpectra.weights`.

    Notes
    -----
    With a relative error of the model's spectra of variance d^2, the mean of n segments is no more certain than
    1 / n + d^2; an error that is correlated over L neighbouring frequencies counts L times. So the log likelihood is
    multiplied by 1 / (1 + n d^2 L), a power likelihood: with less weight of the segments the prior restrains the
    parameters that would otherwise compensate for the error of the model.

    References
    ----------
    J. W. Miller and D. B. Dunson, Robust Bayesian inference via coarsening, Journal of the American Statistical
    Association 114 (2019), 1113-1125 (power 1 / (1 + n / alpha)).
    P. G. Bissiri, C. C. Holmes and S. G. Walker, A general framework for updating belief distributions, Journal of the
    Royal Statistical Society B 78 (2016), 1103-1130.
    """
    misfit, excess = power_misfit(model, parameters)
    if excess <= 0:
        return 1.0
    is_used = model.spectra.weights.sum(axis=0) > 0
    reach = _correlated_frequencies(misfit[:, is_used])
    return 1 / (1 + model.spectra.n_segments / OVERCOUNT * excess * reach)


def _correlated_frequencies(misfit: Real) -> float:
    """Number of neighbouring frequencies over which the misfit is correlated."""
    reach = 1.0
    for lag in range(1, misfit.shape[1] // 2):
        correlation = float(np.sum(misfit[:, lag:] * misfit[:, :-lag]) / np.sum(misfit**2))
        if correlation < SETTINGS.uncorrelated:
            break
        reach += 2 * correlation
    return reach


def whitened_segments(
    model: SpectralLikelihood, parameters: Real, segments: SegmentSpectra, width: float = CLASS_WIDTH
) -> Complex:
    """Return L^-1 y of each segment, S = L L^H the model's spectral matrix of its class."""
    factor = np.linalg.inv(np.linalg.cholesky(model.matrix(parameters)))
    numbers = speed_classes(segments.speeds, width=width)
    return np.einsum("sfij,sfj->sfi", factor[numbers], segments.values)


def _scores(
    model: SpectralLikelihood, parameters: Real, segments: SegmentSpectra, whitened: Real, width: float
) -> Real:
    """Gradient of each segment's minus log likelihood, tr(S^-1 dS) - y^H S^-1 dS S^-1 y, (segments, parameters).

    `whitened` are the whitened derivatives of the model at the parameters.
    """
    spectra = model.spectra
    of_one_segment = (np.sqrt(spectra.weights) / spectra.counts[:, None])[..., None]
    whitened = whitened * of_one_segment
    values = whitened_segments(model, parameters, segments, width)
    excess = np.eye(values.shape[-1]) - values[..., :, None] * values[..., None, :].conj()
    coordinates = real_coordinates(excess)
    numbers = speed_classes(segments.speeds, width=width)
    scores = np.empty((values.shape[0], len(parameters)))
    for number in range(spectra.counts.size):
        members = np.flatnonzero(numbers == number)
        derivatives = whitened[:, number].reshape(len(parameters), -1)
        scores[members] = coordinates[members].reshape(members.size, -1) @ derivatives.T
    return scores
