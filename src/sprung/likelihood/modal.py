"""Whittle likelihood of modes with free shapes, spectra of their forces and noise."""

from dataclasses import dataclass, field

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung.likelihood.hermitian import real_coordinates
from sprung.likelihood.modal_spectra import LineSpectra
from sprung.likelihood.whittle import TOO_FAR

#: Bins are read at three frequencies: Gauss-Hermite nodes in standard deviations of the kernel, and their weights.
_NODES, _WEIGHTS = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)]), np.array([1 / 6, 2 / 3, 1 / 6])
#: Standard deviations of the priors of the exponent of all forces' amplitude over frequency, of that of single modes'
#: forces relative to it, and of those of the noise densities.
_COMMON_EXPONENT_STD, _SINGLE_EXPONENT_STD, _NOISE_EXPONENT_STD = 0.5, 0.05, 0.3
#: Forces that are held from sample to sample, and aliases, bend the spectra of single modes by about this exponent,
#: times the squared frequency over the sampling rate.
_EXPONENT_OF_HOLD = 4.0
#: That of the logarithm of the noise densities: noise far below the motion is not identifiable.
_NOISE_STD = 3.0
#: Those of the priors of neighbouring modes: of the frequency in half-widths, of ln xi, and of the shapes' parts.
_HELD_FREQUENCY_STD, _HELD_DAMPING_STD, _HELD_SHAPE_STD = 0.5, 0.3, 0.1


@dataclass(frozen=True, eq=False, slots=True)
class ModalParameters:
    """Modes with the spectra of their forces and of the noise.

    Parameters
    ----------
    natural_frequency
        Natural frequencies [Hz], shape (modes,).
    damping_ratio
        Damping ratios, above 0, shape (modes,).
    common_exponent
        Exponent of the amplitude of all forces over frequency, shape (1,): 0 for white forces.
    force_exponents
        Exponent of each mode's force amplitude over frequency beyond the common one, shape (modes,).
    mode_shapes
        Complex mode shapes, 1 at one channel each, shape (modes, channels).
    forces
        Spectral matrix of the modal forces, Hermitian, shape (modes, modes).
    noise
        Density of the noise of each channel at the reference frequency, above 0, shape (channels,).
    noise_exponents
        Exponent of each noise density over frequency, shape (channels,).
    """

    natural_frequency: Real
    damping_ratio: Real
    common_exponent: Real
    force_exponents: Real
    mode_shapes: Complex
    forces: Complex
    noise: Real
    noise_exponents: Real


@dataclass(frozen=True, eq=False, slots=True)
class ModalModel:
    """Modes with free complex shapes and force spectra, coloured noise of every channel, and the data.

    Parameters
    ----------
    spectra
        Spectral matrices of the data by bins of frequency.
    begin
        Modes, force and noise spectra at which the search starts; scales of the parameters.
    quantity_exponent
        Power of frequency that turns displacement into the measured quantity: 0, 1 (velocity) or 2 (acceleration).
    n_held
        Number of modes, the last ones, whose poles and shapes have priors around their start: neighbours of the band.

    sampling_rate
        Rate at which the motion was sampled, or simulated with held forces [Hz].

    Notes
    -----
    S(f) = Phi H P H^H Phi^H + N with the columns of Phi the mode shapes, P the Hermitian spectral matrix of the modal
    forces, N = diag(n (f / f0)^a), and the diagonal H of

        h(f) = x^(q + b) / (1 - x^2 + 2 i xi x),  x = f / f_k,

    with q the exponent of the quantity and b = b_0 + b_k that of the force. The parameters are ln f_k, ln xi_k, b_0,
    b_k, the real and imaginary parts of each shape (1 at its largest channel), the real coordinates of P relative to
    the start, ln n and a. The prior of b and a is normal around the start. P need not be positive
    semidefinite, S must be positive definite.

    A bin holds the mean of S over its kernel: of the taper, and of the lines averaged. It is taken at three frequencies
    with the weights of Gauss-Hermite quadrature, exact to the fifth order of the kernel's width.

    References
    ----------
    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953),
    125-139.
    S.-K. Au, Fast Bayesian FFT method for ambient modal identification with separated modes, Journal of Engineering
    Mechanics 137 (2011), 214-226 (modes with real shapes and white forces in a band).
    """

    spectra: LineSpectra
    begin: ModalParameters
    quantity_exponent: float
    n_held: int = 0
    sampling_rate: float = np.inf
    start: Real = field(init=False)
    prior_std: Real = field(init=False)
    _largest: Indices = field(init=False, repr=False)
    scale: Real = field(init=False, repr=False)
    _reference: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        begin = self.begin
        object.__setattr__(self, "_largest", np.argmax(np.abs(begin.mode_shapes), axis=1))
        object.__setattr__(self, "scale", np.sqrt(np.maximum(np.diag(begin.forces).real, np.finfo(float).tiny)))
        object.__setattr__(self, "_reference", self.spectra.middle)
        object.__setattr__(self, "start", self.packed(begin))
        stds = np.full(self.start.size, np.inf)
        stds[self.rows("common_exponent")] = _COMMON_EXPONENT_STD
        held = (begin.natural_frequency / self.sampling_rate) ** 2
        stds[self.rows("force_exponents")] = _SINGLE_EXPONENT_STD + _EXPONENT_OF_HOLD * held
        stds[self.rows("noise")] = _NOISE_STD
        stds[self.rows("noise_exponents")] = _NOISE_EXPONENT_STD
        for k in range(self.n_modes - self.n_held, self.n_modes):
            stds[self.rows("natural_frequency")[k]] = _HELD_FREQUENCY_STD * begin.damping_ratio[k]
            stds[self.rows("damping_ratio")[k]] = _HELD_DAMPING_STD
            stds[self._rows_of_shape(k)] = _HELD_SHAPE_STD
        object.__setattr__(self, "prior_std", stds)
        freeze(self, start=1, prior_std=1)

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.begin.natural_frequency)

    @property
    def n_channels(self) -> int:
        """Number of channels."""
        return self.spectra.matrices.shape[-1]

    def rows(self, name: str) -> Indices:
        """Return the numbers of the parameters of one field of `ModalParameters`."""
        n, m = self.n_modes, self.n_channels
        sizes = {
            "natural_frequency": n,
            "damping_ratio": n,
            "common_exponent": 1,
            "force_exponents": n,
            "mode_shapes": 2 * n * (m - 1),
            "forces": n * n,
            "noise": m,
            "noise_exponents": m,
        }
        first = sum(sizes[other] for other in list(sizes)[: list(sizes).index(name)])
        return np.arange(first, first + sizes[name])

    def _rows_of_shape(self, k: int) -> Indices:
        """Return the numbers of the parameters of one shape: real and imaginary parts in turn."""
        n_each = 2 * (self.n_channels - 1)
        return self.rows("mode_shapes")[k * n_each : (k + 1) * n_each]

    def shape_covariance(self, k: int, covariance: Real) -> Real:
        """Return the covariance of one shape's real and imaginary parts in turn, from that of the parameters.

        Returns
        -------
        ndarray
            Shape (2 channels, 2 channels), 0 at the channel where the shape is 1.
        """
        rows = self._rows_of_shape(k)
        places = np.flatnonzero(np.repeat(self._is_free()[k], 2))
        full = np.zeros((2 * self.n_channels, 2 * self.n_channels))
        full[np.ix_(places, places)] = covariance[np.ix_(rows, rows)]
        return full

    def packed(self, values: ModalParameters) -> Real:
        """Return the vector of parameters."""
        free = values.mode_shapes[self._is_free()].reshape(self.n_modes, self.n_channels - 1)
        return np.concatenate(
            [
                np.log(values.natural_frequency),
                np.log(values.damping_ratio),
                values.common_exponent,
                values.force_exponents,
                np.stack([free.real, free.imag], axis=-1).ravel(),
                real_coordinates(values.forces / np.outer(self.scale, self.scale)),
                np.log(values.noise),
                values.noise_exponents,
            ]
        )

    def unpacked(self, parameters: Real) -> ModalParameters:
        """Return what the vector of parameters states."""
        n, m = self.n_modes, self.n_channels
        shapes = np.ones((n, m), dtype=np.complex128)
        parts = parameters[self.rows("mode_shapes")].reshape(n * (m - 1), 2)
        shapes[self._is_free()] = parts[:, 0] + 1j * parts[:, 1]
        return ModalParameters(
            natural_frequency=np.exp(parameters[self.rows("natural_frequency")]),
            damping_ratio=np.exp(parameters[self.rows("damping_ratio")]),
            common_exponent=parameters[self.rows("common_exponent")],
            force_exponents=parameters[self.rows("force_exponents")],
            mode_shapes=shapes,
            forces=_hermitian(parameters[self.rows("forces")], n) * np.outer(self.scale, self.scale),
            noise=np.exp(parameters[self.rows("noise")]),
            noise_exponents=parameters[self.rows("noise_exponents")],
        )

    def _is_free(self) -> Booleans:
        """Return the mask of the shapes' entries that are parameters, shape (modes, channels)."""
        is_free = np.ones((self.n_modes, self.n_channels), dtype=np.bool_)
        is_free[np.arange(self.n_modes), self._largest] = False
        return is_free

    def matrix(self, parameters: Real) -> Complex:
        """Return the spectral matrix S of every bin, shape (bins, channels, channels)."""
        values = self.unpacked(parameters)
        return self._matrix(values, *self._moved(values))

    def _grid(self) -> tuple[Real, Real]:
        """Return the frequencies at which bins are read, shape (nodes, bins), and their weights, shape (nodes,)."""
        if not self.spectra.spreads.any():
            return self.spectra.frequencies[None], np.ones(1)
        return self.spectra.frequencies + _NODES[:, None] * self.spectra.spreads, _WEIGHTS

    def _moved(self, values: ModalParameters) -> tuple[Complex, Complex, Real]:
        """Return responses (nodes, bins, modes), moved channels (nodes, bins, channels, modes) and weights."""
        frequencies, weights = self._grid()
        x = frequencies[..., None] / values.natural_frequency
        power = self.quantity_exponent + values.common_exponent + values.force_exponents
        responses = np.asarray(x**power / (1 - x**2 + 2j * values.damping_ratio * x), dtype=np.complex128)
        return responses, values.mode_shapes.T * responses[..., None, :], weights

    def _noise(self, values: ModalParameters) -> Real:
        """Return the densities of the noise, shape (bins, channels)."""
        logs = np.log(self.spectra.frequencies / self._reference)
        return values.noise * np.exp(logs[:, None] * values.noise_exponents)

    def _matrix(self, values: ModalParameters, responses: Complex, moved: Complex, weights: Real) -> Complex:
        modal = np.tensordot(weights, moved @ values.forces @ moved.conj().swapaxes(-1, -2), axes=1)
        diagonal = np.arange(self.n_channels)
        modal[:, diagonal, diagonal] += self._noise(values)
        return np.asarray(modal, dtype=np.complex128)

    def forced(self, parameters: Real) -> Complex:
        """Return the cross spectra of the modal motions H u with the channels, shape (bins, modes, channels)."""
        values = self.unpacked(parameters)
        responses, moved, weights = self._moved(values)
        cross = responses[..., None] * (values.forces @ moved.conj().swapaxes(-1, -2))
        return np.asarray(np.tensordot(weights, cross, axes=1), dtype=np.complex128)

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood, the prior included, and its gradient; `TOO_FAR` and 0 if they do not exist.

        Notes
        -----
        sum n [ln det S + tr(S^-1 S^)] over bins, n their counts and S^ the data, + sum deviation^2 / (2 prior_std^2).
        With W = n (S^-1 - S^-1 S^ S^-1), d objective = sum tr(W dS).
        """
        try:
            with np.errstate(all="ignore"):
                value, gradient = self._objective(parameters)
        except np.linalg.LinAlgError:
            return TOO_FAR, np.zeros_like(parameters)
        is_finite = np.isfinite(value) and np.all(np.isfinite(gradient))
        return (value, gradient) if is_finite else (TOO_FAR, np.zeros_like(parameters))

    def _objective(self, parameters: Real) -> tuple[float, Real]:
        values = self.unpacked(parameters)
        responses, moved, weights = self._moved(values)
        S = self._matrix(values, responses, moved, weights)
        counts, data = self.spectra.counts, self.spectra.matrices
        logdet = 2 * np.log(np.einsum("bii->bi", np.linalg.cholesky(S)).real).sum(axis=-1)
        inverse = np.linalg.inv(S)
        ratio = inverse @ data
        value = float(np.sum(counts * (logdet + np.einsum("bii->b", ratio).real)))
        W = counts[:, None, None] * (inverse - ratio @ inverse)
        weighted = weights[:, None, None, None] * W
        pulled = values.forces @ moved.conj().swapaxes(-1, -2) @ weighted  # (nodes, bins, modes, channels)
        at_modes = np.einsum("sbkj,kj->sbk", pulled, values.mode_shapes)
        in_frequency, in_damping, in_exponent = self._response_slopes(values, responses)
        by_shape = 2 * np.einsum("sbkj,sbk->kj", pulled, responses)[self._is_free()]
        by_force = np.einsum("sbjk,sbjl->kl", moved.conj(), weighted @ moved) * np.outer(self.scale, self.scale)
        by_noise = np.einsum("bii->bi", W).real * self._noise(values)
        logs = np.log(self.spectra.frequencies / self._reference)
        by_exponent = 2 * np.einsum("sbk,sbk->k", at_modes, in_exponent).real
        gradient = np.concatenate(
            [
                2 * np.einsum("sbk,sbk->k", at_modes, in_frequency).real,
                2 * np.einsum("sbk,sbk->k", at_modes, in_damping).real,
                by_exponent.sum(keepdims=True),
                by_exponent,
                np.stack([by_shape.real, -by_shape.imag], axis=-1).ravel(),
                real_coordinates(by_force.conj().T),
                by_noise.sum(axis=0),
                logs @ by_noise,
            ]
        )
        deviation = (parameters - self.start) / self.prior_std
        return value + float(deviation @ deviation) / 2, gradient + deviation / self.prior_std

    def _response_slopes(self, values: ModalParameters, responses: Complex) -> tuple[Complex, Complex, Complex]:
        """Return the derivatives of the responses by ln f, ln xi and the exponent of the force."""
        x = self._grid()[0][..., None] / values.natural_frequency
        denominator = 1 - x**2 + 2j * values.damping_ratio * x
        damping = 2j * values.damping_ratio * x / denominator
        power = self.quantity_exponent + values.common_exponent + values.force_exponents
        return (
            responses * (damping - 2 * x**2 / denominator - power),
            -responses * damping,
            responses * np.log(x),
        )

    def _factors(self, parameters: Real) -> tuple[Complex, Complex]:
        """Return u and v of dS/dp = u v^H + v u^H, shapes (channels, parameters) and (bins, channels, parameters).

        Notes
        -----
        For all parameters but the common exponent, whose derivative is the sum of those by all others.
        """
        values = self.unpacked(parameters)
        responses, moved, weights = self._moved(values)
        shapes, unit = values.mode_shapes.T, np.eye(self.n_channels, dtype=np.complex128)
        pulled = weights[:, None, None, None] * (moved @ values.forces)
        by_slope = [np.sum(pulled * s.conj()[:, :, None], axis=0) for s in self._response_slopes(values, responses)]
        by_response = np.sum(pulled * responses.conj()[:, :, None], axis=0)
        of_mode, of_channel = np.nonzero(self._is_free())
        first, second = np.triu_indices(self.n_modes, 1)
        powers = np.tensordot(weights, np.abs(responses) ** 2, axes=1)[:, None] / 2
        crossed = np.tensordot(weights, responses[..., first].conj() * responses[..., second], axes=1) / np.sqrt(2)
        scaled = shapes * self.scale
        halves = scaled[:, second] * crossed[:, None]
        noise, logs = self._noise(values) / 2, np.log(self.spectra.frequencies / self._reference)
        by_noise = noise[:, :, None] * unit
        parts = np.tile([1, 1j], of_mode.size)
        left = [shapes, shapes, shapes, np.repeat(unit[:, of_channel], 2, axis=1) * parts]
        left += [scaled, scaled[:, first], 1j * scaled[:, first], unit, unit]
        right = [*by_slope, np.repeat(by_response[..., of_mode], 2, axis=2)]
        right += [scaled * powers, halves, halves, by_noise, logs[:, None, None] * by_noise]
        return np.concatenate(left, axis=1), np.concatenate(right, axis=2)

    def _with_common_exponent(self, derivatives: Real) -> Real:
        """Return derivatives, the last axis over all other parameters, with that by the common exponent."""
        n = self.n_modes
        by_common = derivatives[..., 2 * n : 3 * n].sum(axis=-1, keepdims=True)
        return np.concatenate([derivatives[..., : 2 * n], by_common, derivatives[..., 2 * n :]], axis=-1)

    def derivatives(self, parameters: Real) -> Real:
        """Return dS/dp for each parameter p in real form, shape (channels, channels, bins, parameters)."""
        left, right = self._factors(parameters)
        return self._with_common_exponent(_real_products(left, right))

    def residuals(self, parameters: Real) -> Complex:
        """Return the whitened deviation L^-1 S^ L^-H - I of the data, S = L L^H, shape (bins, channels, channels)."""
        inverse = np.linalg.inv(np.linalg.cholesky(self.matrix(parameters)))
        whitened = inverse @ self.spectra.matrices @ inverse.conj().swapaxes(-1, -2)
        return np.asarray(whitened - np.eye(self.n_channels), dtype=np.complex128)

    def whitened_derivatives(self, parameters: Real) -> Real:
        """Return sqrt(n) L^-1 (dS/dp) L^-H, S = L L^H, in real form, shape (channels, channels, bins, parameters)."""
        return self._with_common_exponent(_real_products(*self._whitened_factors(parameters)))

    def whitened_densities(self, parameters: Real) -> Real:
        """Return the whitened derivatives by the forces' and noises' densities alone: rows `forces` and `noise`."""
        rows = np.concatenate([self.rows("forces"), self.rows("noise")]) - 1
        left, right = self._whitened_factors(parameters)
        return _real_products(left[..., rows], right[..., rows])

    def _whitened_factors(self, parameters: Real) -> tuple[Complex, Complex]:
        """Return sqrt(n) L^-1 u and L^-1 v of `_factors`, shape (bins, channels, parameters) both."""
        left, right = self._factors(parameters)
        factors = np.linalg.inv(np.linalg.cholesky(self.matrix(parameters)))
        return np.sqrt(self.spectra.counts)[:, None, None] * (factors @ left), factors @ right

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information without the prior: I_pq = sum n tr(S^-1 dS/dp S^-1 dS/dq)."""
        whitened = self.whitened_derivatives(parameters).reshape(-1, parameters.size)
        return whitened.T @ whitened


def _real_products(left: Complex, right: Complex) -> Real:
    """Return u v^H + v u^H in real form, shape (channels, channels, bins, parameters); u and v as in `_factors`."""
    n_bins, size, n_parameters = right.shape
    products = np.empty((size, size, n_bins, n_parameters))
    adjoint_left, adjoint_right = left.conj(), right.conj()
    for i in range(size):
        products[i, i] = 2 * (left[..., i, :] * adjoint_right[:, i]).real
        for j in range(i + 1, size):
            entry = left[..., i, :] * adjoint_right[:, j]
            entry += right[:, i] * adjoint_left[..., j, :]
            products[i, j] = entry.real + entry.imag
            products[j, i] = entry.real - entry.imag
    return products


def _hermitian(coordinates: Real, size: int) -> Complex:
    """Return the Hermitian matrix of real coordinates, the inverse of `real_coordinates`."""
    n_upper = size * (size - 1) // 2
    matrix = np.diag(coordinates[:size]).astype(np.complex128)
    upper = np.triu_indices(size, 1)
    entries = (coordinates[size : size + n_upper] + 1j * coordinates[size + n_upper :]) / np.sqrt(2)
    matrix[upper] = entries
    matrix[upper[::-1]] = entries.conj()
    return matrix
