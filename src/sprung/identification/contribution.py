"""Contributions of modes to the correlations between channels, and mode shapes on all channels."""

from collections.abc import Sequence

import numpy as np

from sprung._arrays import Complex, Real
from sprung.identification.correlation import Correlations


def contributions(poles: Complex, mode_shapes: Complex, correlations: Correlations) -> Real:
    """Return the contribution of each mode to the correlations between channels, relative to chance.

    Parameters
    ----------
    poles
        Continuous, damped poles [rad/s], shape (modes,).
    mode_shapes
        Mode shapes, shape (modes, channels).
    correlations
        Correlations with blocks. Only pairs of different channels count (with a single channel, its autocorrelation):
        the noise of a sensor appears only in the correlation of that sensor with itself.

    Returns
    -------
    numpy.ndarray
        Contribution of each mode, shape (modes,): about 1 for a mode that does not exist; infinite for exact
        correlations.

    Notes
    -----
    Lambda_m = sum over modes of 2 Re(shape g^T lambda^(m - 1)) is solved for the participation g of each reference
    by least squares over lags and the other channels, for the average and for each block. The contribution is the
    sum over references of abs(g)^2 of the average, weighted with the shape's power on the channels used, divided by the
    same sum of the variances of g over the blocks.
    """
    lagged = correlations.values[:, :, 1:]
    changes = correlations.changes[..., 1:]
    if not len(changes):
        return np.full(len(poles), np.inf)
    use = correlations.is_cross if correlations.is_cross.any() else ~correlations.is_cross
    powers = np.exp(poles[:, None] / correlations.sampling_rate * np.arange(lagged.shape[-1]))
    signal, noise = np.zeros(len(poles)), np.zeros(len(poles))
    for reference in range(use.shape[1]):
        others = np.flatnonzero(use[:, reference])
        responses = _responses(mode_shapes[:, others], powers)
        solve = _participation_operator(responses)
        weight = np.sum(np.abs(mode_shapes[:, others]) ** 2, axis=1)
        signal += weight * np.abs(lagged[others, reference].ravel() @ solve) ** 2
        spread = changes[:, others, reference].reshape(len(changes), -1) @ solve
        noise += weight * np.sum(np.abs(spread) ** 2, axis=0)
    return signal / noise


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
