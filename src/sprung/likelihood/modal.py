"""Whittle likelihood of modes with free shapes, spectra of their forces and noise."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung.likelihood.hermitian import hermitian, real_coordinates
from sprung.likelihood.modal_spectra import LineSpectra
from sprung.likelihood.search import TOO_FAR


@dataclass(frozen=True, slots=True)
class ModalPriors:
    """Standard deviations of the parameters of a `ModalModel` around its start."""

    #: Exponent of the amplitude of all forces over frequency: from white noise to half an integration.
    common_exponent: float = 0.5
    #: Exponents of single modes' forces relative to it: the forces of neighbouring modes have one source.
    force_exponents: float = 0.05
    #: Added to it, times the squared frequency over the sampling rate: held forces and aliases bend the spectra.
    exponent_of_hold: float = 4.0
    #: Logarithms of the noise densities: noise far below the motion is not identifiable.
    noise: float = 3.0
    #: Exponents of the noise densities: sensors are white, or nearly so.
    noise_exponents: float = 0.3
    #: Natural frequencies of neighbours of the band, in half-widths of their peaks.
    held_frequency: float = 0.5
    #: Logarithms of the damping ratios of neighbours.
    held_damping: float = 0.3
    #: Real and imaginary parts of the shapes of neighbours.
    held_shape: float = 0.1


_PRIORS = ModalPriors()


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
class _Block:
    """Parameters of one field of `ModalParameters`: the field as a vector and back, and the prior around the start."""

    pack: Callable[[Any], Real] = np.copy
    unpack: Callable[[Real], Any] = np.copy
    prior_std: Real | float = np.inf


@dataclass(frozen=True, eq=False)
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
    has_forces
        Whether the spectra of the forces are parameters; if not, they are those of `begin`.

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
    has_forces: bool = True

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.begin.natural_frequency)

    @property
    def n_channels(self) -> int:
        """Number of channels."""
        return self.spectra.matrices.shape[-1]

    @cached_property
    def scale(self) -> Real:
        """Amplitudes of the forces at the start, to which their coordinates are relative, shape (modes,)."""
        return np.sqrt(np.maximum(np.diag(self.begin.forces).real, np.finfo(float).tiny))

    @cached_property
    def is_free(self) -> Booleans:
        """Whether an entry of the shapes is a parameter, as all but the largest of each are; (modes, channels)."""
        return np.arange(self.n_channels) != np.argmax(np.abs(self.begin.mode_shapes), axis=1)[:, None]

    @cached_property
    def _blocks(self) -> dict[str, _Block]:
        """Blocks of parameters in their order, by the field of `ModalParameters`."""
        begin, scales = self.begin, np.outer(self.scale, self.scale)
        is_held = np.arange(self.n_modes) >= self.n_modes - self.n_held
        hold = _PRIORS.exponent_of_hold * (begin.natural_frequency / self.sampling_rate) ** 2

        def held(std: Real | float) -> Real:
            return np.where(is_held, std, np.inf)

        def shapes(entries: Real) -> Complex:
            whole = np.ones(self.is_free.shape, dtype=np.complex128)
            whole[self.is_free] = entries.view(np.complex128)
            return whole

        logarithm = partial(_Block, np.log, np.exp)
        blocks = {
            "natural_frequency": logarithm(held(_PRIORS.held_frequency * begin.damping_ratio)),
            "damping_ratio": logarithm(held(_PRIORS.held_damping)),
            "common_exponent": _Block(prior_std=_PRIORS.common_exponent),
            "force_exponents": _Block(prior_std=_PRIORS.force_exponents + hold),
            "mode_shapes": _Block(
                lambda whole: whole[self.is_free].view(np.float64),
                shapes,
                np.repeat(held(_PRIORS.held_shape), 2 * (self.n_channels - 1)),
            ),
            "forces": _Block(
                lambda forces: real_coordinates(forces / scales),
                lambda coordinates: hermitian(coordinates) * scales,
            ),
            "noise": logarithm(_PRIORS.noise),
            "noise_exponents": _Block(prior_std=_PRIORS.noise_exponents),
        }
        forced = () if self.has_forces else ("common_exponent", "force_exponents", "forces")
        return {name: block for name, block in blocks.items() if name not in forced}

    @cached_property
    def rows(self) -> dict[str, Indices]:
        """Numbers of the parameters of each field of `ModalParameters`."""
        sizes = [block.pack(getattr(self.begin, name)).size for name, block in self._blocks.items()]
        return dict(zip(self._blocks, np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1]), strict=True))

    def packed(self, values: ModalParameters) -> Real:
        """Return the vector of parameters."""
        return np.concatenate([block.pack(getattr(values, name)) for name, block in self._blocks.items()])

    def unpacked(self, parameters: Real) -> ModalParameters:
        """Return what the vector of parameters states."""
        fields = {name: block.unpack(parameters[self.rows[name]]) for name, block in self._blocks.items()}
        return replace(self.begin, **fields)

    @cached_property
    def start(self) -> Real:
        """Parameters at which the search starts, the centre of the prior."""
        return self.packed(self.begin)

    @cached_property
    def prior_std(self) -> Real:
        """Standard deviation of the prior of each parameter, infinite for a free one."""
        blocks = self._blocks.items()
        return np.concatenate([np.broadcast_to(block.prior_std, self.rows[name].shape) for name, block in blocks])

    def shape_covariance(self, k: int, covariance: Real) -> Real:
        """Return the covariance of one shape's real and imaginary parts in turn, from that of the parameters.

        Returns
        -------
        ndarray
            Shape (2 channels, 2 channels), 0 at the channel where the shape is 1.
        """
        rows = self.rows["mode_shapes"].reshape(self.n_modes, -1)[k]
        places = np.flatnonzero(np.repeat(self.is_free[k], 2))
        full = np.zeros((2 * self.n_channels, 2 * self.n_channels))
        full[np.ix_(places, places)] = covariance[np.ix_(rows, rows)]
        return full

    @cached_property
    def _nodes(self) -> tuple[Real, Real]:
        """Frequencies at which bins are read, Gauss-Hermite nodes of their kernels, (nodes, bins), and weights."""
        if not self.spectra.spreads.any():
            return self.spectra.frequencies[None], np.ones(1)
        nodes = np.sqrt(3.0) * np.array([-1, 0, 1])
        return self.spectra.frequencies + nodes[:, None] * self.spectra.spreads, np.array([1, 4, 1]) / 6

    @cached_property
    def _logarithms(self) -> Real:
        """Logarithms of the frequencies over the reference, shape (bins, 1)."""
        return np.log(self.spectra.frequencies / self.spectra.middle)[:, None]

    def matrix(self, parameters: Real) -> Complex:
        """Return the spectral matrix S of every bin, shape (bins, channels, channels)."""
        return self._state(parameters).matrix

    def forced(self, parameters: Real) -> Complex:
        """Return the cross spectra of the modal motions H u with the channels, shape (bins, modes, channels)."""
        state = self._state(parameters)
        cross = state.responses[..., None] * (state.values.forces @ state.moved.conj().swapaxes(-1, -2))
        return np.asarray(np.tensordot(self._nodes[1], cross, axes=1), dtype=np.complex128)

    def _state(self, parameters: Real) -> "_State":
        """Return responses, spectra of the noise and the spectral matrix."""
        values = self.unpacked(parameters)
        frequencies, weights = self._nodes
        x = frequencies[..., None] / values.natural_frequency
        power = self.quantity_exponent + values.common_exponent + values.force_exponents
        responses = np.asarray(x**power / (1 - x**2 + 2j * values.damping_ratio * x), dtype=np.complex128)
        moved = values.mode_shapes.T * responses[..., None, :]
        noise = values.noise * np.exp(self._logarithms * values.noise_exponents)
        matrix = np.tensordot(weights, moved @ values.forces @ moved.conj().swapaxes(-1, -2), axes=1)
        diagonal = np.arange(self.n_channels)
        matrix[:, diagonal, diagonal] += noise
        return _State(values, x, responses, moved, noise, np.asarray(matrix, dtype=np.complex128))

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood, the prior included, and its gradient; `TOO_FAR` and 0 if they do not exist.

        Notes
        -----
        sum n [ln det S + tr(S^-1 S^)] over bins, n their counts and S^ the data, + sum deviation^2 / (2 prior_std^2).
        With W = n (S^-1 - S^-1 S^ S^-1), d objective = sum tr(W dS), and with M = Phi H: dS = dM P M^H + M P dM^H for
        responses and shapes, M dP M^H for the forces.
        """
        with np.errstate(all="ignore"):
            state, counts = self._state(parameters), self.spectra.counts
            try:
                logdet = 2 * np.log(np.einsum("bii->bi", np.linalg.cholesky(state.matrix)).real).sum(axis=-1)
                inverse = np.linalg.inv(state.matrix)
            except np.linalg.LinAlgError:
                return TOO_FAR, np.zeros_like(parameters)
            ratio = inverse @ self.spectra.matrices
            value = float(np.sum(counts * (logdet + np.einsum("bii->b", ratio).real)))
            W = counts[:, None, None] * (inverse - ratio @ inverse)
            weighted = self._nodes[1][:, None, None, None] * (W @ state.moved)
            pulled = (weighted @ state.values.forces).conj()
            of_responses = 2 * np.einsum("nbck,nbck->nbk", pulled, state.moved)
            by_frequency, by_damping, by_exponent = (
                np.einsum("nbk,nbk->k", of_responses, slope).real for slope in self._slopes(state)
            )
            of_noise = np.einsum("bii->bi", W).real * state.noise
            of_forces = np.einsum("nbck,nbcl->kl", state.moved.conj(), weighted)
            gradients = {
                "natural_frequency": by_frequency,
                "damping_ratio": by_damping,
                "common_exponent": by_exponent.sum(keepdims=True),
                "force_exponents": by_exponent,
                "mode_shapes": 2 * np.einsum("nbck,nbk->kc", pulled, state.responses).conj()[self.is_free].view(float),
                "forces": real_coordinates(of_forces * np.outer(self.scale, self.scale)),
                "noise": of_noise.sum(axis=0),
                "noise_exponents": np.sum(self._logarithms * of_noise, axis=0),
            }
            deviation = (parameters - self.start) / self.prior_std
            value += float(deviation @ deviation) / 2
            gradient = np.concatenate([gradients[name] for name in self._blocks]) + deviation / self.prior_std
        is_finite = np.isfinite(value) and np.all(np.isfinite(gradient))
        return (value, gradient) if is_finite else (TOO_FAR, np.zeros_like(parameters))

    def _slopes(self, state: "_State") -> tuple[Complex, Complex, Real]:
        """Return the derivatives of ln h by ln f, ln xi and the exponents, shape (nodes, bins, modes).

        With the denominator d = 1 - x^2 + 2 i xi x and g = 2 i xi x / d: g - 2 x^2 / d - power, -g and ln x.
        """
        values, x = state.values, state.x
        denominator = 1 - x**2 + 2j * values.damping_ratio * x
        damping = 2j * values.damping_ratio * x / denominator
        power = self.quantity_exponent + values.common_exponent + values.force_exponents
        return damping - 2 * x**2 / denominator - power, -damping, np.log(x)

    def _factors(self, state: "_State") -> tuple[Complex, Complex]:
        """Return u and v of dS/dp = u v^H + v u^H, shapes (channels, parameters) and (bins, channels, parameters).

        For all parameters but the common exponent, whose derivative is the sum of those by all others.
        """
        values, responses = state.values, state.responses
        weights, unit = self._nodes[1], np.eye(self.n_channels, dtype=np.complex128)
        pulled = weights[:, None, None, None] * (state.moved @ values.forces) * responses.conj()[:, :, None]
        by_slope = [np.sum(pulled * slope.conj()[:, :, None], axis=0) for slope in self._slopes(state)]
        of_mode, of_channel = np.nonzero(self.is_free)
        first, second = np.triu_indices(self.n_modes, 1)
        powers = np.tensordot(weights, np.abs(responses) ** 2, axes=1)[:, None] / 2
        crossed = np.tensordot(weights, responses[..., first].conj() * responses[..., second], axes=1) / np.sqrt(2)
        shapes, scaled = values.mode_shapes.T, values.mode_shapes.T * self.scale
        halves = scaled[:, second] * crossed[:, None]
        by_noise = (state.noise / 2)[:, :, None] * unit
        left = [shapes, shapes, shapes, np.repeat(unit[:, of_channel], 2, axis=1) * np.tile([1, 1j], of_mode.size)]
        left += [scaled, scaled[:, first], 1j * scaled[:, first], unit, unit]
        right = [*by_slope, np.repeat(pulled.sum(axis=0)[..., of_mode], 2, axis=2)]
        right += [scaled * powers, halves, halves, by_noise, self._logarithms[:, None] * by_noise]
        return np.concatenate(left, axis=1), np.concatenate(right, axis=2)

    def _with_common_exponent(self, derivatives: Real) -> Real:
        """Return derivatives, the last axis over all other parameters, with that by the common exponent."""
        each = derivatives[..., 2 * self.n_modes : 3 * self.n_modes]
        return np.insert(derivatives, 2 * self.n_modes, each.sum(axis=-1), axis=-1)

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
        rows = np.concatenate([self.rows["forces"], self.rows["noise"]]) - 1
        left, right = self._whitened_factors(parameters)
        return _real_products(left[..., rows], right[..., rows])

    def _whitened_factors(self, parameters: Real) -> tuple[Complex, Complex]:
        """Return sqrt(n) L^-1 u and L^-1 v of `_factors`, shape (bins, channels, parameters) both."""
        state = self._state(parameters)
        left, right = self._factors(state)
        factors = np.linalg.inv(np.linalg.cholesky(state.matrix))
        return np.sqrt(self.spectra.counts)[:, None, None] * (factors @ left), factors @ right

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information without the prior: I_pq = sum n tr(S^-1 dS/dp S^-1 dS/dq)."""
        whitened = self.whitened_derivatives(parameters).reshape(-1, parameters.size)
        return whitened.T @ whitened


@dataclass(frozen=True, eq=False, slots=True)
class _State:
    """A model at one vector of parameters, on the nodes of the bins.

    Parameters
    ----------
    values
        What the parameters state.
    x
        Frequencies over the natural ones, shape (nodes, bins, modes).
    responses, moved
        Responses h of the modes, shape (nodes, bins, modes), and Phi H, shape (nodes, bins, channels, modes).
    noise
        Densities of the noise, shape (bins, channels).
    matrix
        Spectral matrix S, shape (bins, channels, channels).
    """

    values: ModalParameters
    x: Real
    responses: Complex
    moved: Complex
    noise: Real
    matrix: Complex


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
