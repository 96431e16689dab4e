"""Contributions of modes to the correlations between channels, and mode shapes on all channels."""

from collections.abc import Sequence

import numpy as np
from scipy import special

from sprung._arrays import Booleans, Complex, Real
from sprung.identification.correlation import Correlations
from sprung.modal import Modes

#: Probability that a contribution exceeds the bound by chance.
_CHANCE = 1e-2
#: Standard deviation of the frequency over the half-bandwidth up to which a contribution counts in full.
_WELL_KNOWN = 0.2
#: Number of blocks below which the excess of a mode must be larger.
_MANY_BLOCKS = 24
#: Half of a running median of a spectrum is one of this number of parts of it.
_MEDIAN_SHARE = 12


def contributions(poles: Complex, mode_shapes: Complex, correlations: Correlations) -> tuple[Real, Real]:
    """Return the contribution of each mode to the correlations between channels, relative to chance, and its excess.

    Parameters
    ----------
    poles
        Continuous, damped poles [rad/s], shape (modes,).
    mode_shapes
        Mode shapes, shape (modes, channels).
    correlations
        Correlations with blocks and their number of products. Only pairs of different channels count (with a single
        channel, its autocorrelation): the noise of a sensor appears only in the correlation of that sensor with itself.

    Returns
    -------
    numpy.ndarray, numpy.ndarray
        Shape (modes,) each. Contribution: about 1 for a mode that does not exist; infinite for exact correlations.
        Excess: over twice the number of references distributed nearly as chi-squared with as many degrees of freedom
        where there is no mode; infinite for exact correlations, for a single channel, and where not all channels are
        references.

    Notes
    -----
    Lambda_m = sum over modes of 2 Re(shape g^T lambda^(m - 1)) is solved for the participation g of each reference
    by least squares over lags and the other channels, for the average and for each block. The contribution is the
    sum over references of abs(g)^2 of the average, weighted with the shape's power on the channels used, divided by the
    same sum of the variances of g over the blocks.

    The excess is that of independent channels without any mode: with the variance of sum_m w_m Lambda_m, for a pair of
    independent channels a and b of N samples the mean over frequencies of abs(W)^2 S_a S_b / N (Bartlett's formula).
    This variance does not rise with the mode's own random level, which the spread of a few blocks mostly shows. The
    spectra S are running medians: they follow noise, and pass under the peaks of modes.

    References
    ----------
    M. S. Bartlett (1946), On the theoretical specification and sampling properties of autocorrelated time-series,
    Supplement to the Journal of the Royal Statistical Society 8, 27-41.
    """
    spectra, changes = _spectra_of_chance(correlations), correlations.changes
    lagged = correlations.values[:, :, 1:]
    use = correlations.is_cross if correlations.is_cross.any() else ~correlations.is_cross
    powers = np.exp(poles[:, None] / correlations.sampling_rate * np.arange(lagged.shape[-1]))
    signal, scatter, chance = np.zeros((3, len(poles)))
    for reference, is_used in enumerate(use.T):
        others = np.flatnonzero(is_used)
        solve = _participation_operator(_responses(mode_shapes[:, others], powers))
        weight = np.sum(np.abs(mode_shapes[:, others]) ** 2, axis=1)
        signal += weight * np.abs(lagged[others, reference].ravel() @ solve) ** 2
        if len(changes):
            own = changes[:, others, reference, 1:].reshape(len(changes), -1)
            scatter += weight * np.sum(np.abs(own @ solve) ** 2, axis=0)
        if spectra is not None:
            gains = np.abs(np.fft.fft(solve.reshape(len(others), -1, len(poles)), spectra.shape[1], axis=1)) ** 2
            products = spectra[others] * spectra[reference]
            by_chance = np.einsum("ofk,of->k", gains, products)
            chance += weight * by_chance / (spectra.shape[1] * correlations.n_products)
    infinite = np.full(len(poles), np.inf)
    return signal / scatter if len(changes) else infinite, infinite if spectra is None else signal / chance


def _spectra_of_chance(correlations: Correlations) -> Real | None:
    """Return the running medians of the spectra of all channels, shape (channels, frequencies); None if unknown."""
    from scipy import ndimage

    has_own = correlations.references == correlations.channels and len(correlations.channels) > 1
    if not has_own or not np.isfinite(correlations.n_products):
        return None
    n_fft = 2 * correlations.n_lags
    rows = np.arange(len(correlations.channels))
    lags = np.arange(correlations.n_lags)
    own = correlations.values[rows, rows] * (0.5 + 0.5 * np.cos(np.pi * lags / correlations.n_lags))
    spectra = 2 * np.fft.fft(own, n_fft).real - own[:, :1]
    size = max(2 * (n_fft // _MEDIAN_SHARE) + 1, 3)
    medians = ndimage.median_filter(spectra, (1, size), mode="wrap")
    return np.asarray(np.maximum(medians, np.finfo(float).tiny))


def _responses(shapes: Complex, powers: Complex) -> Complex:
    """Return the product of shape and power of the eigenvalue, shape (modes, channels times lags)."""
    return (shapes[:, :, None] * powers[:, None]).reshape(len(shapes), shapes.shape[1] * powers.shape[1])


def _participation_operator(responses: Complex) -> Complex:
    """Return the matrix (samples, modes) that maps real data to the least-squares g of data = 2 Re(responses^T g)."""
    basis = np.concatenate([2 * responses.real, -2 * responses.imag]).T
    inverse = np.linalg.pinv(basis, rcond=1e-8) if basis.size else basis.T
    return np.asarray(inverse[: len(responses)] + 1j * inverse[len(responses) :]).T


def complete_shapes(
    poles: Complex, mode_shapes: Complex, correlations: Correlations, channels: Sequence[str]
) -> Complex:
    """Return the shapes on all channels of modes that were identified on some of them.

    Parameters
    ----------
    poles
        Continuous, damped poles [rad/s], shape (modes,).
    mode_shapes
        Mode shapes on some channels, shape (modes, outputs).
    correlations
        Correlations of all channels, with all of them as references. The correlation of a channel with itself is not
        used.
    channels
        Names of the outputs in `mode_shapes`.

    Returns
    -------
    numpy.ndarray
        Mode shapes, shape (modes, channels of `correlations`).

    Notes
    -----
    Two linear least-squares problems of Lambda_m = sum of 2 Re(shape g^T lambda^(m - 1)): the participations g of all
    references from the known outputs, then the shape of every channel from all references but itself.
    """
    n_channels = len(correlations.channels)
    known = [correlations.channels.index(name) for name in channels]
    lagged = correlations.values[:, :, 1:]
    powers = np.exp(poles[:, None] / correlations.sampling_rate * np.arange(lagged.shape[-1]))
    participations = np.zeros((len(poles), n_channels), dtype=complex)
    for reference in range(n_channels):
        others = [row for row in known if row != reference]
        if others:
            columns = [known.index(row) for row in others]
            responses = _responses(mode_shapes[:, columns], powers)
            participations[:, reference] = lagged[others, reference].ravel() @ _participation_operator(responses)
    shapes = np.zeros((len(poles), n_channels), dtype=complex)
    for channel in range(n_channels):
        others = [reference for reference in range(n_channels) if reference != channel]
        responses = _responses(participations[:, others], powers)
        shapes[:, channel] = lagged[channel, others].ravel() @ _participation_operator(responses)
    return shapes


def significant(modes: Modes, correlations: Correlations, *, least: float) -> Booleans:
    """Return which modes contribute more than chance to the correlations between channels.

    Parameters
    ----------
    modes
        Candidates on the channels of `correlations`.
    correlations
        Correlations of all segments, with blocks.
    least
        Smallest contribution (see `contributions`); 0: all modes are significant.

    Returns
    -------
    numpy.ndarray
        Whether each mode is significant, shape (modes,).

    Notes
    -----
    Backward elimination: the weakest mode is removed and the others are solved for again until all that remain
    contribute enough. A contribution counts in full where the standard deviation of the mode's frequency is up to 0.2
    of its half-bandwidth, and less in proportion beyond. The bound is not below the 99 % quantile of Fisher's
    distribution for the complex participation of each reference, in the average over that in each block but one; this
    matters where there are few channels or few blocks. The excess, too, must reach the bound, and with fewer than 24
    blocks the bound times 24 over their number: in a short record chance offers a mode many places, of which the
    stabilisation diagram shows the best.
    """
    is_kept = np.ones(len(modes), dtype=np.bool_)
    if least <= 0:
        return is_kept
    freedom = 2 * len(correlations.references)
    by_chance = special.fdtri(freedom, freedom * max(len(correlations.blocks) - 1, 1), 1 - _CHANCE)
    least = max(least, float(by_chance))
    spread = modes.natural_frequency_std / (modes.natural_frequency * modes.damping_ratio)
    least_excess = least * max(1.0, _MANY_BLOCKS / len(correlations.blocks))
    while is_kept.any():
        kept = np.flatnonzero(is_kept)
        contribution, excess = contributions(modes.poles[kept], modes.mode_shapes[kept], correlations)
        certainty = contribution / np.fmax(spread[kept] / _WELL_KNOWN, 1.0)
        certainty = np.minimum(certainty / least, excess / least_excess)
        weakest = int(np.argmin(certainty))
        if certainty[weakest] >= 1:
            break
        is_kept[kept[weakest]] = False
    return is_kept
