"""Dry friction of suspensions from what a force that is not linear leaves in a drive beside its spectra."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.spectra import ClassSpectra, SegmentSpectra, speed_classes, through_window
from sprung.likelihood.transfer import Transfer, dynamic_stiffness, times_classes, transfer
from sprung.likelihood.whittle import Model


@dataclass(frozen=True, slots=True)
class ForceSettings:
    """Settings of the forces."""

    #: Highest frequency of the suspensions' velocities over that of the band of the fit.
    reach: float = 2.0
    #: Relative error of the model's spectra, at least.
    model_error: float = 0.02
    #: Standard deviation of velocities given the motion of the body, over their own, at least.
    unseen: float = 0.03
    #: Values of the window below which a segment says nothing of its ends.
    faint: float = 0.1
    #: Samples of a segment over its highest frequency, at least.
    oversampling: int = 4
    #: Error of a friction over the mean size of the force by unlike valves, whose effects on each other are left out.
    second: float = 0.04
    #: Number of bands of frequencies that are left out one after another.
    n_bands: int = 8
    #: Rounds in which velocities follow the forces.
    n_rounds: int = 3
    #: Number of laws of each suspension; smallest number of segments over that of the forces, and largest number.
    n_laws: int = 3
    fewest: int = 4
    most: int = 600


SETTINGS = ForceSettings()


@dataclass(frozen=True, eq=False, slots=True)
class DrivenSegments:
    """Segments of a drive, and the model of their spectra up to frequencies at which wheels hardly move.

    Parameters
    ----------
    model
        Model without data, whose frequencies begin with those of the segments.
    segments
        Segments that were fitted.
    """

    model: Model
    segments: SegmentSpectra


def beyond(spectra: ClassSpectra) -> ClassSpectra:
    """Return the classes of spectra with no data and frequencies from the same lowest to twice the highest one."""
    step = 1 / spectra.segment_length
    n_more = round((SETTINGS.reach - 1) * spectra.frequencies[-1] / step)
    frequencies = np.append(spectra.frequencies, spectra.frequencies[-1] + step * np.arange(1, n_more + 1))
    shape = (spectra.counts.size, frequencies.size)
    size = spectra.matrices.shape[-1]
    return replace(
        spectra,
        frequencies=frequencies,
        matrices=np.broadcast_to(np.eye(size, dtype=np.complex128), (*shape, size, size)),
        weights=np.ones(shape),
    )


def elongation_spectrum(response: Transfer, element: int) -> Real:
    """Return the spectrum of the elongation of an element [m^2/Hz], shape (classes, grid)."""
    terms = response.terms
    elongation = terms.elongations[element] @ response.displacements - terms.feet[element]
    wheels = terms.inputs.shape[-1]
    spectrum = np.zeros(terms.inputs.shape[:2])
    for inputs, part in ((terms.inputs, elongation[:, :wheels]), (terms.measured_inputs, elongation[:, wheels:])):
        spectrum += np.einsum("fi,cfij,fj->cf", part, inputs, part.conj()).real
    return spectrum


class SuspensionForces(NamedTuple):
    """Forces of suspensions that are not linear in their velocity.

    Friction [N] is of either sign, shape (elements,), `covariance` (elements, elements). Valves that differ in bump and
    rebound have a force `uneven` |v| [N s/m]. By bands of frequencies, the friction's variance is `excess` times as
    large, at least 1.
    """

    friction: Real
    covariance: Real
    uneven: Real
    excess: float


def friction_forces(
    driven: DrivenSegments, fitted: Model, parameters: Real, elements: list[int], *, model_error: float
) -> SuspensionForces | None:
    """Return the Coulomb friction of suspensions and its covariance, from what a linear vehicle does not do.

    Parameters
    ----------
    driven
        Segments, and the model beyond their band.
    fitted
        Model that was fitted to them.
    parameters
        Its parameters.
    elements
        Numbers of the suspensions among the elements of the structure.
    model_error
        Relative error of the fitted spectra.

    Returns
    -------
    SuspensionForces
        None from too few segments.

    Notes
    -----
    Of a linear vehicle on a Gaussian road, the velocity v of a suspension given the motion y of the body is Gaussian
    (Wiener). A force f(v) that is not linear is a v + r(v), a that of statistical linearisation; r is not correlated
    with any motion (Bussgang). The spectra of the linear vehicle have a v, and what remains is a motion G r, G the
    response of the body to a force at the suspension. The size of r, at its mean given y, is found by regression with
    the weights of the likelihood, [G r]^H S^-1 y. Where the rear wheels follow the front ones, or more is measured than
    the road moves, S is small: ten minutes on a road of class C give 2 to 4 N a corner, the spectra 20 N.

    Besides sign(v), forces |v| (valves that differ in bump and rebound) and v^3 (valves that open) are fitted. Such
    forces move the suspension themselves: its velocity is estimated anew with those of the round before. The gain a is
    found at each time in the window of a segment, from all segments, as the variance of an estimate differs at their
    ends. The covariance is that of the scores of the segments with half of that of neighbours (sandwich), and 4 % of
    the force |v|, whose effects on itself are followed to first order. Where the response G is not the vehicle's, bands
    of frequencies disagree more than by chance: the variance by leaving out one band after another (jackknife) is then
    above that of the segments, in a multibody car with bushings and digressive valves 5 times.

    References
    ----------
    J. J. Bussgang, Crosscorrelation functions of amplitude-distorted Gaussian signals, MIT Research Laboratory of
    Electronics, Technical Report 216 (1952).
    J. B. Roberts, P. D. Spanos, Random Vibration and Statistical Linearization, Dover, 2003, chapter 5.
    N. Wiener, Extrapolation, Interpolation, and Smoothing of Stationary Time Series, MIT Press, 1949.
    """
    segments = driven.segments
    kept = slice(None, None, -(-len(segments.values) // SETTINGS.most))
    numbers, y = speed_classes(segments.speeds)[kept], segments.values[kept]
    n = len(elements)
    if len(y) < SETTINGS.fewest * n * SETTINGS.n_laws:
        return None
    seen = _seen(driven.model, fitted, parameters, elements, max(model_error, SETTINGS.model_error))
    window, band = _Window(driven.model.spectra), np.arange(y.shape[1])
    elongations = np.zeros((n, len(y), window.s.size), dtype=np.complex128)
    elongations[..., band] = np.einsum("sfek,sfk->esf", seen.weights[numbers], y)
    pull = np.einsum("sfek,sfk->esf", seen.pull[numbers], y)
    information, given = seen.information[numbers], seen.given[numbers]
    std, unseen = (each[numbers].T[..., None] for each in (seen.std, seen.unseen))
    moved = np.zeros_like(elongations)
    for _ in range(SETTINGS.n_rounds):
        velocities = window.samples(window.s * (elongations + moved)) / std
        forces = np.array([window.spectra(_not_linear(law, velocities)) for law in _laws(velocities, unseen / std)])
        forces *= np.array([np.ones_like(std), std, std**3])
        in_band = forces[..., band]
        pushed = information.transpose(1, 2, 0, 3)[..., None, :] * in_band.transpose(3, 2, 0, 1)[:, None]
        by_force = in_band.conj().transpose(3, 1, 0, 2) @ pushed.reshape(*pushed.shape[:3], -1)
        shares = by_force.swapaxes(1, 2).reshape(band.size, len(forces) * n, -1)
        bread = np.linalg.pinv(2 * shares.real.sum(axis=0), rcond=1e-14, hermitian=True)
        sizes = bread @ (2 * np.einsum("kdsf,dsf->kd", in_band.conj(), pull).real.ravel())
        whole = np.einsum("le,lesf->esf", sizes.reshape(-1, n), forces)
        moved = np.einsum("sfde,esf->dsf", given, whole)
    left = pull - np.einsum("sfde,esf->dsf", information, whole[..., band])
    scores = 2 * np.einsum("ldsf,dsf->sld", in_band.conj(), left).real.reshape(len(y), -1)
    neighbours = scores[1:].T @ scores[:-1] / 2
    spread = scores.T @ scores + neighbours + neighbours.T
    covariance = bread @ spread @ bread * len(y) / (len(y) - sizes.size)
    jackknife = _by_bands(shares, np.einsum("kdsf,dsf->fkd", in_band.conj(), pull), n)
    excess = max(1.0, float(np.sum(jackknife) / np.trace(covariance[:n, :n])))
    left_out = SETTINGS.second * np.sqrt(2 / np.pi) * sizes[n : 2 * n] * np.mean(std[..., 0], axis=1)
    return SuspensionForces(sizes[:n], covariance[:n, :n] + np.diag(left_out**2), sizes[n : 2 * n], excess)


def _by_bands(information: Complex, pull: Complex, n: int) -> Real:
    """Return the variances of the first n forces by leaving out one band after another of equal information on them."""
    A, b = information.real.reshape(len(pull), pull[0].size, -1), pull.real.reshape(len(pull), -1)
    share = np.einsum("fii->f", A[:, :n, :n])
    bands = (SETTINGS.n_bands * (np.cumsum(share) - share / 2) / np.sum(share)).astype(np.intp)
    others = [bands != band for band in np.unique(bands)]
    found = np.array([np.linalg.pinv(A[o].sum(0), rcond=1e-14, hermitian=True)[:n] @ b[o].sum(0) for o in others])
    return (len(others) - 1) * np.var(found, axis=0)


def _laws(velocities: Real, unseen: Real) -> list[Real]:
    """Return the means of sign(v), |v| and v^3 (but for a part that is linear) of velocities with an error."""
    from scipy.special import erf

    signs = erf(velocities / (np.sqrt(2) * unseen))
    sizes = velocities * signs + np.sqrt(2 / np.pi) * unseen * np.exp(-(velocities**2) / (2 * unseen**2))
    return [signs, sizes, velocities * velocities * velocities]  # a power of 3 takes ten times as long


def _not_linear(law: Real, velocities: Real) -> Real:
    """Return a force less what is linear in the velocity at each time in a segment, shape (.., segments, times)."""
    gains = np.sum(law * velocities, axis=-2) / np.sum(velocities**2, axis=-2)
    return np.asarray(law - gains[..., None, :] * velocities, dtype=np.float64)


class _Window:
    """Between spectra of segments and samples in their Hann window, where it is not faint."""

    def __init__(self, spectra: ClassSpectra) -> None:
        length = spectra.segment_length
        first, last = np.rint(spectra.frequencies[[0, -1]] * length).astype(int).tolist()
        self._lines = slice(first, last + 1)
        self._n = int(2 ** np.ceil(np.log2(SETTINGS.oversampling * last)))
        window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(self._n) / self._n)
        self._scale = np.sqrt(2 * length / (self._n * np.sum(window**2)))
        clear = np.flatnonzero(window > SETTINGS.faint)
        self._clear = slice(int(clear[0]), int(clear[-1]) + 1)
        self._window = window[self._clear]
        self.s: Complex = np.asarray(2j * np.pi * spectra.frequencies, dtype=np.complex128)

    def samples(self, spectra: Complex) -> Real:
        """Return samples without the window, shape (.., times)."""
        whole = np.zeros((*spectra.shape[:-1], self._n // 2 + 1), dtype=np.complex128)
        whole[..., self._lines] = spectra / self._scale
        return np.asarray(np.fft.irfft(whole, self._n)[..., self._clear] / self._window, dtype=np.float64)

    def spectra(self, samples: Real) -> Complex:
        """Return spectra of samples in the window, less their mean, shape (.., frequencies)."""
        mean = samples @ self._window / self._window.sum()
        whole = np.zeros((*samples.shape[:-1], self._n))
        whole[..., self._clear] = (samples - mean[..., None]) * self._window
        return np.asarray(np.fft.rfft(whole)[..., self._lines] * self._scale, dtype=np.complex128)


class _Seen(NamedTuple):
    """What the motion of the body says of suspensions, by class: (classes, frequencies in the band, ..).

    Elongations given the motion y are weights y, and forces f of the suspensions add `given` f to that, also beyond the
    band. With the response G to these forces, `pull` is G^H S^-1, and `information` G^H S^-1 G. Standard deviations of
    velocities `std`, and `unseen` given y: (classes, elements).
    """

    weights: Complex
    given: Complex
    pull: Complex
    information: Complex
    std: Real
    unseen: Real


def _seen(driven: Model, fitted: Model, parameters: Real, elements: list[int], model_error: float) -> _Seen:
    """Return what the motion says of the suspensions with some numbers."""
    response = transfer(driven.terms(parameters))
    terms = response.terms
    rows = terms.elongations[elements]
    S = through_window(response.spectral_matrix)
    S = S + model_error**2 * np.einsum("cfii->cfi", S)[..., None] * np.eye(S.shape[-1])
    crossed = times_classes(rows @ response.displacements - terms.feet[elements], response.driven)[:, 1:-1]
    weights = crossed @ np.linalg.inv(S)
    own = np.stack([elongation_spectrum(response, element)[:, 1:-1] for element in elements], axis=-1)
    missing = np.maximum(own - np.einsum("cfek,cfek->cfe", weights, crossed.conj()).real, 0.0)
    n_band, step = fitted.spectra.frequencies.size, 1 / fitted.spectra.segment_length
    missing[:, n_band:] = own[:, n_band:]
    std, unseen = (np.sqrt(np.einsum("cfe,f->ce", each, terms.squared[1:-1]) * step) for each in (own, missing))
    solved = np.linalg.solve(dynamic_stiffness(terms), np.broadcast_to(rows.T, (len(terms.s), *rows.T.shape)))
    given, G = -(rows @ solved)[1:-1], -(response.force_response @ rows.T)[1 : n_band + 1]
    used = fitted.spectra.weights[..., None, None] > 0
    pull = G.conj().swapaxes(-1, -2) @ np.linalg.inv(S[:, :n_band]) * used
    weights, given = weights[:, :n_band], np.repeat(given[None], len(S), axis=0)
    given[:, :n_band] -= weights @ G
    return _Seen(weights, given, pull, pull @ G, std, np.maximum(unseen, SETTINGS.unseen * std))
