"""Whittle likelihood of modes that move freely from unknown initial states, in noise and under random forces."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung.likelihood.modal import ModalModel, ModalParameters
from sprung.likelihood.modal_spectra import LineSpectra
from sprung.likelihood.search import TOO_FAR
from sprung.modal import unit_shapes
from sprung.recording import Recording

#: Least noise over the motion, in power: below it, rounding decides.
_LEAST_NOISE = 1e-26
#: Standard deviations of the priors around the start of ln frequency, ln damping ratio, and parts of shapes: they hold
#: modes that the data hardly determine, along which a search would run away.
_PRIOR_STD = {"natural_frequency": 0.5, "damping_ratio": 1.0, "mode_shapes": 10.0}


@dataclass(frozen=True, eq=False)
class FreeLines:
    """Fourier lines of records that are not tapered, scaled so that their mean squares are one-sided densities.

    Parameters
    ----------
    frequencies
        Frequency of each line [Hz], above 0, shape (lines,).
    values
        Lines of the channels, shape (lines, channels).
    records
        Number of the record of each line, from 0, shape (lines,).
    gains
        Factor from the sum over samples to each line, shape (lines,).
    sampling_rate
        Sampling rate [Hz].
    """

    frequencies: Real
    values: Complex
    records: Indices
    gains: Real
    sampling_rate: float

    def __post_init__(self) -> None:
        freeze(self, frequencies=1, gains=1)
        freeze(self, values=2, dtype=np.complex128)
        freeze(self, records=1, dtype=np.intp)

    @property
    def n_records(self) -> int:
        """Number of records."""
        return int(self.records[-1]) + 1

    @cached_property
    def of_records(self) -> list[slice]:
        """Lines of each record."""
        ends = np.searchsorted(self.records, np.arange(self.n_records + 1))
        return [slice(int(first), int(last)) for first, last in pairwise(ends)]

    @cached_property
    def turn(self) -> Complex:
        """e^(-iw) of every line, shape (lines, 1)."""
        return np.exp(-2j * np.pi * self.frequencies[:, None] / self.sampling_rate)

    def scaled(self, factors: Real) -> "FreeLines":
        """Return the lines of channels multiplied by factors, shape (channels,)."""
        return replace(self, values=self.values * factors)


def free_lines(recordings: Iterable[Recording], *, band: tuple[float, float]) -> FreeLines:
    """Return the Fourier lines of records within a band [Hz], ends included; the line of the mean is left out.

    Parameters
    ----------
    recordings
        Records of the same channels and rate without missing values or gaps, each free from its first sample on.
    band
        Lowest and highest frequency [Hz].
    """
    frequencies, values, gains, rate = [], [], [], 1.0
    for recording in recordings:
        rate, n_samples = recording.sampling_rate, recording.n_samples
        lines = np.arange(1, n_samples // 2 + 1) * rate / n_samples
        used = np.flatnonzero((band[0] <= lines) & (lines <= band[1]) & (lines < 0.495 * rate))
        gain = np.sqrt(2 / (rate * n_samples))
        frequencies.append(lines[used])
        values.append(np.fft.rfft(recording.samples, axis=1)[:, used + 1].T * gain)
        gains.append(np.full(used.size, gain))
    records = np.repeat(np.arange(len(gains)), [each.size for each in gains])
    return FreeLines(np.concatenate(frequencies), np.concatenate(values), records, np.concatenate(gains), rate)


@dataclass(frozen=True, eq=False)
class FreeResponse:
    """Modes that decay from an unknown initial state in each record, with noise, and random forces if they are free.

    Parameters
    ----------
    data
        Lines of the records.
    begin
        Modes, forces and noise at which the search starts.
    quantity_exponent
        As in `ModalModel`.
    has_forces
        Whether random forces act during the decay; if not, those of `begin` must be 0.

    Notes
    -----
    The lines Y of a record of N samples y(n) = sum x_k z_k^n + random motion are

        Y(w) = sum over k of phi_k a_k B_k(w) + conj(phi_k a_k) B_k(-w)^* + E(w),  B_k(w) = 1 / (1 - z_k e^(-iw)),

    exactly, with z_k = exp(pole / sampling rate): a_k = x_k - z_k^N x_k for a free decay, and the initial less the
    final state where random forces act as well, whose lines E are then independent, without leakage. E has the
    spectral matrix S of `ModalModel`. The real and imaginary parts of a are estimated by generalised least squares for
    every value of the other parameters, so that they are not parameters themselves.

    References
    ----------
    R. Pintelon, J. Schoukens and G. Vandersteen, Frequency domain system identification using arbitrary signals, IEEE
    Transactions on Automatic Control 42 (1997), 1717-1720 (the term of the states).
    G. H. Golub and V. Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose
    variables separate, SIAM Journal on Numerical Analysis 10 (1973), 413-432.
    """

    data: FreeLines
    begin: ModalParameters
    quantity_exponent: float = 2.0
    has_forces: bool = False

    @cached_property
    def modal(self) -> ModalModel:
        """Model of the random part, with the same parameters."""
        n_lines, size = self.data.values.shape
        empty = np.zeros((n_lines, size, size), dtype=np.complex128)
        spectra = LineSpectra(self.data.frequencies, np.zeros(n_lines), np.ones(n_lines), empty)
        rate, exponent = self.data.sampling_rate, self.quantity_exponent
        return ModalModel(spectra, self.begin, exponent, sampling_rate=rate, has_forces=self.has_forces)

    @property
    def start(self) -> Real:
        """Parameters at which the search starts."""
        return self.modal.start

    @cached_property
    def prior_std(self) -> Real:
        """Standard deviation of the prior of each parameter."""
        stds = self.modal.prior_std.copy()
        for name, std in _PRIOR_STD.items():
            stds[self.modal.rows[name]] = std
        return stds

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood, the prior included, and its gradient; `TOO_FAR` and 0 if they do not exist.

        Notes
        -----
        sum over lines of ln det S + |L^-1 (Y - mean)|^2 with S = L L^H. At the best amplitudes its derivative by them
        is 0, so that the gradient is that of the random part with the residuals' products as data, less
        2 Re (dmean)^H S^-1 (Y - mean).
        """
        nothing = TOO_FAR, np.zeros_like(parameters)
        with np.errstate(all="ignore"):
            try:
                fit = self.fitted(parameters)
            except np.linalg.LinAlgError:
                return nothing
            value, gradient = self._of_random_part(parameters, fit)
            rows, slopes = self._slopes(fit)
            gradient[rows] -= 2 * np.einsum("lip,li->p", slopes.conj(), fit.whitened).real
        return (value, gradient) if value < TOO_FAR and np.all(np.isfinite(gradient)) else nothing

    def _of_random_part(self, parameters: Real, fit: "Fit") -> tuple[float, Real]:
        """Return the objective and its gradient by the parameters of the random part; noise alone has a short form."""
        if self.has_forces:
            products = fit.residuals[:, :, None] * fit.residuals[:, None, :].conj()
            model = replace(self.modal, spectra=replace(self.modal.spectra, matrices=products))
            value, gradient = model.objective(parameters)
            deviation = (parameters - self.modal.start) / np.where(np.isinf(model.prior_std), self.prior_std, np.inf)
            return value + float(deviation @ deviation) / 2, gradient + deviation / self.prior_std
        excess = 1 - np.abs(fit.whitened) ** 2
        deviation = (parameters - self.modal.start) / self.prior_std
        gradient = deviation / self.prior_std
        gradient[self.modal.rows["noise"]] += np.sum(excess, axis=0)
        gradient[self.modal.rows["noise_exponents"]] += np.sum(self._logarithms * excess, axis=0)
        value = float(-2 * np.sum(np.log(fit.whitening)) + np.sum(1 - excess) + deviation @ deviation / 2)
        return value, gradient

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information without the prior, for unknown amplitudes."""
        fit, size = self.fitted(parameters), parameters.size
        total = np.zeros((size, size))
        if self.has_forces:
            of_random = self.modal.whitened_derivatives(parameters).reshape(-1, size)
            total += of_random.T @ of_random
        else:
            powers = np.stack([np.ones_like(self._logarithms), self._logarithms], axis=-1)
            for own in zip(self.modal.rows["noise"], self.modal.rows["noise_exponents"], strict=True):
                total[np.ix_(own, own)] = np.sum(powers[:, 0, :, None] * powers[:, 0, None, :], axis=0)
        rows, slopes = self._slopes(fit)
        for lines in self.data.of_records:
            slope = _projected(_stacked(fit.columns[lines]), _stacked(slopes[lines]))[1]
            total[np.ix_(rows, rows)] += 2 * slope.T @ slope
        return total

    def leverages(self, parameters: Real) -> Real:
        """Return the share of each line that the fitted mean takes from its noise, shape (lines, channels)."""
        fit, (n_lines, n_channels) = self.fitted(parameters), self.data.values.shape
        slopes, columns = self._slopes(fit)[1], fit.columns
        shares, left = np.zeros((n_lines, n_channels)), np.empty((2, n_lines, n_channels, slopes.shape[2]))
        for own in self.data.of_records:
            basis, slope = _projected(_stacked(columns[own]), _stacked(slopes[own]))
            shares[own] = np.sum(basis**2, axis=1).reshape(2, -1, n_channels).mean(axis=0)
            left[:, own] = slope.reshape(2, -1, n_channels, slopes.shape[2])
        of_modes = np.linalg.qr(left.reshape(-1, slopes.shape[2]))[0]
        return np.asarray(shares + np.sum(of_modes**2, axis=1).reshape(2, n_lines, n_channels).mean(axis=0))

    def with_noise(self, parameters: Real) -> "FreeResponse":
        """Return the model that starts at parameters, with the noise that they leave, white in each channel.

        Notes
        -----
        Shapes are 1 at their largest channel again, which a search may have moved: the model starts where it ended.
        """
        fit = self.fitted(parameters)
        noise = np.mean(np.abs(fit.residuals) ** 2, axis=0)
        least = _LEAST_NOISE * np.mean(np.abs(self.data.values) ** 2, axis=0)
        white = np.zeros(noise.size)
        shapes = unit_shapes(fit.values.mode_shapes)
        begin = replace(fit.values, mode_shapes=shapes, noise=np.maximum(noise, least), noise_exponents=white)
        return replace(self, begin=begin)

    def fitted(self, parameters: Real) -> "Fit":
        """Return the amplitudes by generalised least squares, and what they leave.

        Raises
        ------
        LinAlgError
            If a mode does not swing or decay, or the spectral matrix is not positive definite.
        """
        key = parameters.tobytes()
        if key not in self._last:  # objective and information of a point are asked for one after the other
            self._last.clear()
            self._last[key] = self._fit(parameters)
        return self._last[key]

    @cached_property
    def _last(self) -> "dict[bytes, Fit]":
        """The fit at the parameters that were asked for last."""
        return {}

    def _fit(self, parameters: Real) -> "Fit":
        values = self.modal.unpacked(parameters)
        if not np.all(values.damping_ratio < 1):
            raise np.linalg.LinAlgError("the modes do not swing")
        whitening: Complex | Real
        if self.has_forces:
            whitening = np.asarray(np.linalg.inv(np.linalg.cholesky(self.modal.matrix(parameters))))
        else:
            whitening = (values.noise * np.exp(self._logarithms * values.noise_exponents)) ** -0.5
        kernels = self._kernels(values)
        forward, backward = kernels
        columns = self._columns(values, whitening, kernels)
        wanted = _whitened(whitening, self.data.values[:, :, None])
        if not np.all(np.isfinite(columns)):
            raise np.linalg.LinAlgError("the modes do not decay")
        n = len(values.natural_frequency)
        amplitudes = np.zeros((self.data.n_records, n), dtype=np.complex128)
        for number, own in enumerate(self.data.of_records):
            solved = np.linalg.lstsq(_stacked(columns[own]), _stacked(wanted[own])[:, 0], rcond=None)[0]
            amplitudes[number] = solved[:n] + 1j * solved[n:]
        each = amplitudes[self.data.records]
        mean = (forward * each) @ values.mode_shapes + (backward * each.conj()) @ values.mode_shapes.conj()
        residuals = self.data.values - mean
        whitened = _whitened(whitening, residuals[:, :, None])[:, :, 0]
        return Fit(values, whitening, residuals, whitened, amplitudes, kernels, columns)

    @cached_property
    def _logarithms(self) -> Real:
        """Logarithms of the frequencies over the reference of the noise, shape (lines, 1)."""
        return np.log(self.data.frequencies / self.modal.spectra.middle)[:, None]

    def _kernels(self, values: ModalParameters) -> tuple[Complex, Complex]:
        """Return B_k(w) and B_k(-w)^* of every line, scaled as the lines are, shape (lines, modes)."""
        z = np.exp(poles_of(values) / self.data.sampling_rate)
        gains = self.data.gains[:, None]
        return gains / (1 - z * self.data.turn), gains / (1 - z.conj() * self.data.turn)

    @staticmethod
    def _columns(values: ModalParameters, whitening: Complex | Real, kernels: tuple[Complex, Complex]) -> Complex:
        """Return the whitened lines of unit real and imaginary amplitudes, shape (lines, channels, 2 modes)."""
        forward, backward = kernels
        ahead = values.mode_shapes.T * forward[:, None, :]
        behind = values.mode_shapes.T.conj() * backward[:, None, :]
        return _whitened(whitening, np.concatenate([ahead + behind, 1j * (ahead - behind)], axis=2))

    def _slopes(self, fit: "Fit") -> tuple[Indices, Complex]:
        """Return parameters on which the mean depends, and its whitened derivatives, (lines, channels, parameters).

        Notes
        -----
        dB/dpole = B^2 z e^(-iw) / rate; a factor of the frequency moves a pole by itself, one of the damping ratio xi
        by 2 pi f (-xi - i xi^2 / sqrt(1 - xi^2)).
        """
        values, rate, each = fit.values, self.data.sampling_rate, fit.amplitudes[self.data.records]
        forward, backward = fit.kernels
        poles = poles_of(values)
        z, gains = np.exp(poles / rate), self.data.gains[:, None]
        xi = values.damping_ratio
        by_damping = 2 * np.pi * values.natural_frequency * (-xi - 1j * xi**2 / np.sqrt(1 - xi**2))
        ahead = each * forward**2 * z * self.data.turn / (rate * gains)
        behind = each.conj() * backward**2 * z.conj() * self.data.turn / (rate * gains)
        shapes = values.mode_shapes.T
        slopes = [
            shapes * (ahead * step)[:, None, :] + shapes.conj() * (behind * step.conj())[:, None, :]
            for step in (poles, by_damping)
        ]
        of_mode, of_channel = np.nonzero(self.modal.is_free)
        waves, mirrored = (forward * each)[:, of_mode], (backward * each.conj())[:, of_mode]
        unit = np.eye(self.modal.n_channels)[of_channel].T
        pairs = np.stack([waves + mirrored, 1j * (waves - mirrored)], axis=2).reshape(len(waves), 1, -1)
        slopes.append(np.repeat(unit, 2, axis=1) * pairs)
        rows = [self.modal.rows[name] for name in ("natural_frequency", "damping_ratio", "mode_shapes")]
        return np.concatenate(rows), _whitened(fit.whitening, np.concatenate(slopes, axis=2))


@dataclass(frozen=True, eq=False, slots=True)
class Fit:
    """A `FreeResponse` at some parameters.

    Parameters
    ----------
    values
        What the parameters state.
    whitening
        Factors L^-1 of S^-1, shape (lines, channels, channels), or their diagonals, shape (lines, channels).
    residuals, whitened
        Lines Y - mean that the modes leave, and L^-1 times them, of mean square 1 where the model holds; shape (lines,
        channels).
    amplitudes
        Amplitudes a of every record and mode, shape (records, modes).
    kernels
        B_k(w) and B_k(-w)^* of every line, shape (lines, modes).
    columns
        Whitened lines of unit real and imaginary amplitudes, shape (lines, channels, 2 modes).
    """

    values: ModalParameters
    whitening: Complex | Real
    residuals: Complex
    whitened: Complex
    amplitudes: Complex
    kernels: tuple[Complex, Complex]
    columns: Complex


def _whitened(whitening: Complex | Real, columns: Complex) -> Complex:
    """Return the products of the factors with columns, shape (lines, channels, columns)."""
    product = whitening[:, :, None] * columns if whitening.ndim == 2 else whitening @ columns
    return np.asarray(product, dtype=np.complex128)


def poles_of(values: ModalParameters) -> Complex:
    """Return the continuous poles [rad/s]."""
    xi = values.damping_ratio
    return np.asarray(2 * np.pi * values.natural_frequency * (1j * np.sqrt(1 - xi**2) - xi))


def _stacked(matrix: Complex) -> Real:
    """Return lines and channels as rows, real parts above imaginary ones."""
    flat = matrix.reshape(-1, matrix.shape[-1])
    return np.concatenate([flat.real, flat.imag])


def _projected(columns: Real, slopes: Real) -> tuple[Real, Real]:
    """Return an orthonormal basis of columns, and what they leave of slopes."""
    basis = np.linalg.qr(columns)[0]
    return basis, slopes - basis @ (basis.T @ slopes)


def realised_poles(data: FreeLines, *, n_states: Sequence[int], block_rows: int) -> list[tuple[Complex, Complex]]:
    """Return the oscillating poles and shapes of free responses, by a data-driven realisation in the frequency domain.

    Parameters
    ----------
    data
        Lines of the records, whose channels should be of about equal size.
    n_states
        Numbers of states, each above 0 and at most block rows less one, times the channels.
    block_rows
        Number of block rows, at least 2.

    Returns
    -------
    list of (ndarray, ndarray)
        For each number of states the continuous poles [rad/s] with positive imaginary part, shape (poles,), and complex
        shapes of any scale, shape (poles, channels).

    Notes
    -----
    A free response is the impulse response of its states, Y(z) = D + C (z I - A)^-1 B with an input of 1 in each
    record. Stacked as [Y, z Y, z^2 Y ..], lines lie in the range of the observability matrix after the powers of z are
    projected out, exactly in any band, by the triangular factor of both. The bilinear map z -> (1 + s) / (1 - s),
    s' = s / a turns the band into most of the unit circle, which keeps the powers independent where the band is
    narrow; it keeps the number of states and the directions of the shapes.

    References
    ----------
    T. McKelvey, H. Akcay and L. Ljung, Subspace-based multivariable system identification from frequency response data,
    IEEE Transactions on Automatic Control 41 (1996), 960-979.
    """
    tangents = np.tan(np.pi * data.frequencies / data.sampling_rate)
    stretch = tangents.max() / np.tan(0.4 * np.pi)
    turn = np.exp(2j * np.arctan(tangents / stretch))
    n_channels, parts = data.values.shape[1], []
    for own in data.of_records:
        powers = turn[own] ** np.arange(block_rows)[:, None]
        stacked = (powers[:, None, :] * data.values[own].T).reshape(block_rows * n_channels, -1)
        inputs = np.hstack([powers.real, powers.imag])
        outputs = np.hstack([stacked.real, stacked.imag])
        triangle = np.asarray(np.linalg.qr(np.vstack([inputs, outputs]).T, mode="r"))
        parts.append(triangle[block_rows:, block_rows:].T)
    left = np.linalg.svd(np.hstack(parts), full_matrices=False)[0]
    found = []
    for size in n_states:
        observability = left[:, :size]
        state_matrix = np.linalg.lstsq(observability[:-n_channels], observability[n_channels:], rcond=None)[0]
        eigenvalues, vectors = np.linalg.eig(state_matrix)
        with np.errstate(all="ignore"):  # a pole at the ends of the band is none
            s = stretch * (eigenvalues - 1) / (eigenvalues + 1)
            poles = data.sampling_rate * np.log((1 + s) / (1 - s))
        chosen = np.flatnonzero((poles.imag > 0) & (poles.real < 0))
        found.append((poles[chosen], (observability[:n_channels] @ vectors[:, chosen]).T))
    return found
