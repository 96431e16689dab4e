"""Spectral matrices: Welch's averaged spectra of all pairs of channels; the cepstrum, and lifters that edit it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from sprung._arrays import Complex, Real
from sprung._checks import check_complete, check_number, freeze
from sprung._display import counted, in_short, listed
from sprung.errors import DataError, ParameterError
from sprung.recording import Recording

#: Number of samples of windowed segments held at a time, which bounds the memory.
BLOCK_SIZE = 2**20


@dataclass(frozen=True, eq=False, slots=True)
class SpectralMatrix:
    """Averaged one-sided auto and cross spectral densities of all channels.

    Parameters
    ----------
    frequencies
        Frequencies from 0 to half the sampling rate [Hz], shape (frequencies,).
    matrix
        Averages of X_p conj(X_q) in entries [p, q], in squared units per Hz, shape (channels, channels, frequencies);
        Hermitian and positive semidefinite at each frequency.
    names
        Names of the channels.
    segment_length
        Length of the averaged segments [s].
    n_segments
        Number of segments averaged, at least 1.

    Raises
    ------
    ParameterError
        If the shapes or the number of segments are inconsistent.
    """

    frequencies: Real
    matrix: Complex
    names: tuple[str, ...]
    segment_length: float
    n_segments: int

    def __post_init__(self) -> None:
        freeze(self, frequencies=1)
        freeze(self, matrix=3, dtype=np.complex128)
        shape = (len(self.names), len(self.names), self.frequencies.size)
        if self.matrix.shape != shape:
            raise ParameterError(f"matrix has shape {self.matrix.shape}, but must have {shape}")
        check_number("n_segments", self.n_segments, at_least=1)

    def __repr__(self) -> str:
        """Return the channels, the frequencies and the segments."""
        segments = f"{counted(self.n_segments, 'segment')} of {self.segment_length:.4g} s"
        grid = f"{self.frequencies.size} frequencies to {self.frequencies[-1]:.5g} Hz"
        return in_short(f"SpectralMatrix of {listed(self.names)}", f"{grid}, {segments}")

    @property
    def densities(self) -> Real:
        """Power spectral density of each channel, shape (channels, frequencies)."""
        return np.einsum("ppf->pf", self.matrix).real

    def __add__(self, other: "SpectralMatrix") -> "SpectralMatrix":
        """Average with `other`, of the same channels and settings, as if all segments came from one recording."""
        if self.names != other.names or not np.array_equal(self.frequencies, other.frequencies):
            raise ParameterError(
                f"spectra of {', '.join(self.names)} and of {', '.join(other.names)} cannot be averaged: channels, "
                "sampling rate and segment_length must agree"
            )
        n_segments = self.n_segments + other.n_segments
        total = self.matrix * self.n_segments + other.matrix * other.n_segments
        return SpectralMatrix(self.frequencies, total / n_segments, self.names, self.segment_length, n_segments)


def spectral_matrix(recording: Recording, *, segment_length: float) -> SpectralMatrix:
    """Average the spectra of half-overlapping Hann-windowed segments (Welch's method).

    Parameters
    ----------
    recording
        Recording without missing values.
    segment_length
        Length of a segment [s]; the resolution is 1.5 / segment_length [Hz].

    Returns
    -------
    SpectralMatrix
        Spectral matrix of all channels. No segment spans a gap; `+` averages over recordings.

    Raises
    ------
    DataError
        If a channel has missing values, or no stretch is as long as a segment.
    ParameterError
        If `segment_length` is out of range.

    Notes
    -----
    S_pq(f) = 2 / (fs sum w^2) mean[X_p(f) conj(X_q(f))] with X the transform of the segment, its mean removed,
    times the periodic Hann window w; without the factor 2 at zero and at the Nyquist frequency.

    References
    ----------
    P. D. Welch (1967), The use of fast Fourier transform for the estimation of power spectra, IEEE Transactions on
    Audio and Electroacoustics 15, 70-73.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> t = np.arange(10_000) / 100
    >>> tone = Recording(np.sin(2 * np.pi * 5 * t)[None], 100.0, (Channel("a"),))
    >>> spectra = spectral_matrix(tone, segment_length=4)
    >>> float(spectra.frequencies[np.argmax(spectra.densities[0])])
    5.0
    """
    n_per_segment = _n_per_segment(recording, segment_length)
    n_channels = len(recording.channels)
    total = np.zeros((n_per_segment // 2 + 1, n_channels, n_channels), dtype=np.complex128)
    n_segments = 0
    for block in _short_time_spectra(recording, n_per_segment):
        by_frequency = np.ascontiguousarray(block.transpose(2, 0, 1))
        total += by_frequency @ by_frequency.conj().swapaxes(1, 2)
        n_segments += block.shape[1]
    matrix = (total + total.conj().swapaxes(1, 2)).transpose(1, 2, 0) / (2 * n_segments)
    frequencies = np.arange(n_per_segment // 2 + 1, dtype=np.float64)
    frequencies *= recording.sampling_rate / n_per_segment
    return SpectralMatrix(frequencies, matrix, recording.names, segment_length, n_segments)


def _short_time_spectra(recording: Recording, n_per_segment: int) -> Iterator[Complex]:
    """Yield the spectra of consecutive segments in blocks of bounded size, (channels, segments, frequencies)."""
    check_complete(recording.names, recording.samples)
    step = max(1, round(n_per_segment / 2))
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_per_segment) / n_per_segment)
    window *= np.sqrt(2 / (recording.sampling_rate * np.sum(window**2)))
    one_sided = [0, -1] if n_per_segment % 2 == 0 else [0]
    per_block = max(1, BLOCK_SIZE // (n_per_segment * len(recording.channels)))
    for stretch in recording.stretches():
        samples = recording.samples[:, stretch]
        if samples.shape[1] < n_per_segment:
            continue
        segments = np.lib.stride_tricks.sliding_window_view(samples, n_per_segment, axis=1)[:, ::step]
        for first in range(0, segments.shape[1], per_block):
            block = segments[:, first : first + per_block]
            block = block - block.mean(axis=-1, keepdims=True)
            block *= window
            spectra = np.fft.rfft(block, axis=-1)
            spectra[..., one_sided] /= np.sqrt(2)
            yield spectra


def singular_values(spectra: SpectralMatrix) -> Real:
    """Return the singular values of the spectral matrix at each frequency.

    Parameters
    ----------
    spectra
        Spectral matrix.

    Returns
    -------
    ndarray
        Singular values, largest first, shape (channels, frequencies). The number of prominent ones at a frequency is
        the number of modes (or other independent sources) there.

    Notes
    -----
    The matrix is Hermitian and positive semidefinite, so they are its eigenvalues, none below 0.
    """
    eigenvalues = np.linalg.eigvalsh(spectra.matrix.transpose(2, 0, 1))
    return np.maximum(eigenvalues.T[::-1], 0.0)


def _n_per_segment(recording: Recording, segment_length: float) -> int:
    """Return the number of samples of a segment, if the recording has a stretch of that length."""
    check_number("segment_length", segment_length, above=0)
    n_per_segment = round(segment_length * recording.sampling_rate)
    if n_per_segment < 4:
        raise ParameterError(
            f"segment_length={segment_length:g} s must hold at least 4 samples: use "
            f"{4 / recording.sampling_rate:g} s or more"
        )
    longest = max(stretch.stop - stretch.start for stretch in recording.stretches())
    if n_per_segment > longest:
        raise DataError(
            f"segment_length={segment_length:g} s is longer than the longest stretch without a gap: use at most "
            f"{longest / recording.sampling_rate:g} s"
        )
    return n_per_segment


#: Spectral amplitudes below this share of the spectrum's RMS are raised to it, to avoid ln 0.
AMPLITUDE_FLOOR = 1e-9


class Lifter(Protocol):
    """Weights over quefrency; the history of an edited recording states its `repr`."""

    def weights(self, quefrency: Real) -> Real:
        """Return the weights at quefrencies from 0 [s], shape (quefrencies,)."""


@dataclass(frozen=True, slots=True)
class ShortPass:
    """Lifter that keeps the cepstrum below a quefrency and nothing beyond it.

    Quasi-periodic excitation appears at long quefrencies, the modes at short ones: the log spectrum is smoothed over
    about 1/(2 length) Hz, so that any narrower line disappears, at any frequency.

    Parameters
    ----------
    length
        Quefrency up to which the cepstrum is kept [s], above 0.

    Raises
    ------
    ParameterError
        If the length is not above 0.

    References
    ----------
    F. Liu (2020), eq. 5-4, with `length` = 0.25 s in chapter 5.
    """

    length: float

    def __post_init__(self) -> None:
        check_number("length of the short-pass lifter", self.length, above=0)

    def weights(self, quefrency: Real) -> Real:
        """Return 1 below `length`, 0 from there on."""
        return (quefrency < self.length).astype(np.float64)


@dataclass(frozen=True, slots=True)
class Exponential:
    """Lifter exp(-quefrency / time_constant), which adds a known damping to every mode.

    `subtract_lifter_damping` removes that damping from the poles.

    Parameters
    ----------
    time_constant
        Time constant tau [s], above 0; every pole moves to the left by 1/tau.

    Raises
    ------
    ParameterError
        If the time constant is not above 0.

    References
    ----------
    R. B. Randall (2017), A history of cepstrum analysis and its application to mechanical problems, Mechanical Systems
    and Signal Processing 97, 3-19.
    """

    time_constant: float

    def __post_init__(self) -> None:
        check_number("time_constant", self.time_constant, above=0)

    def weights(self, quefrency: Real) -> Real:
        """Return the exponential."""
        return np.exp(-quefrency / self.time_constant)


@dataclass(frozen=True, slots=True)
class Comb:
    """Lifter that removes the rahmonics of one period.

    It removes pulse trains and other families of many multiples of 1 / period, with little effect on the rest of the
    spectrum. A single sine has no rahmonics: only a short-pass or exponential lifter removes it.

    Parameters
    ----------
    period
        Period [s], above 0.
    width
        Width of the notch around each multiple of the period [s], 0 to `period`. A notch covers at least the samples on
        both sides of its multiple; a wider one follows a period that is not quite constant.

    Raises
    ------
    ParameterError
        If the period is not above 0, or the width is not within 0 to the period.
    """

    period: float
    width: float = 0.0

    def __post_init__(self) -> None:
        check_number("period", self.period, above=0)
        check_number("width", self.width, at_least=0, at_most=self.period, advice="a notch cannot exceed a period")

    def weights(self, quefrency: Real) -> Real:
        """Return 0 near the period's multiples from the first on, 1 elsewhere."""
        multiple = np.round(quefrency / self.period)
        spacing = quefrency[1] - quefrency[0] if quefrency.size > 1 else 0.0
        is_near = np.abs(quefrency - multiple * self.period) <= max(self.width / 2, spacing * (1 + 1e-9))
        return np.where(is_near & (multiple >= 1), 0.0, 1.0)


def edit(recording: Recording, lifter: Lifter) -> Recording:
    """Multiply the real cepstrum of each channel by a lifter and return to samples with the original phase.

    Parameters
    ----------
    recording
        Recording without missing values. After resampling over distance, quefrencies are in metres.
    lifter
        `ShortPass`, `Exponential`, `Comb` or another value with `weights(quefrency)`.

    Returns
    -------
    Recording
        Recording with each stretch edited separately, its mean removed. A constant channel does not change.

    Raises
    ------
    DataError
        If a channel has missing values.
    ParameterError
        If the weights of the lifter are not one finite number for each quefrency.

    Notes
    -----
    c = IFFT(ln |X|); X_edited = exp(FFT(lifter c)) X / |X|. The lifter also sees the mirrored half of the
    symmetric cepstrum. The amplitude at zero frequency, which the removed mean leaves empty, is taken from its
    neighbour. In effect each spectrum is multiplied by a real, positive gain: a zero-phase filter that acts
    circularly over the stretch (extended by zeros to a good FFT length), so that within a few lengths of the
    filter's response the end of a stretch leaks into its beginning.

    A lifter that keeps no long quefrencies replaces |X| by its smooth geometric mean, which for noise is
    exp(-gamma / 2) = 0.749 times its RMS at all frequencies alike (gamma: Euler's constant).

    References
    ----------
    F. Liu (2020), section 5.2.

    B. P. Bogert, M. J. R. Healy and J. W. Tukey (1963), The quefrency alanysis of time series for echoes, Proceedings
    of the Symposium on Time Series Analysis, 209-243.

    D. G. Childers, D. P. Skinner and R. C. Kemerait (1977), The cepstrum: a guide to processing, Proceedings of the
    IEEE 65, 1428-1443.

    R. B. Randall (2017), A history of cepstrum analysis and its application to mechanical problems, Mechanical Systems
    and Signal Processing 97, 3-19.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> noise = np.random.default_rng(1).standard_normal((1, 6000))
    >>> recording = Recording(noise, 100.0, (Channel("a"),))
    >>> edit(recording, ShortPass(0.25)).history
    ('cepstrum edited with ShortPass(length=0.25)',)
    """
    check_complete(recording.names, recording.samples)
    samples = np.empty_like(recording.samples)
    for stretch in recording.stretches():
        samples[:, stretch] = _edit_stretch(recording.samples[:, stretch], recording.sampling_rate, lifter)
    return recording.changed(f"cepstrum edited with {lifter}", samples=samples)


def subtract_lifter_damping(poles: ArrayLike, time_constant: float) -> Complex:
    """Remove the damping that an exponential lifter added from the poles identified after it.

    Parameters
    ----------
    poles
        Continuous poles [rad/s], any shape.
    time_constant
        Time constant of the lifter [s], above 0.

    Returns
    -------
    ndarray
        Continuous poles + 1 / time_constant [rad/s], same shape.

    Raises
    ------
    ParameterError
        If `time_constant` is not above 0.

    Notes
    -----
    The cepstrum of a minimum-phase pole is a damped cosine over its quefrency, so that the lifter adds 1 / tau to the
    decay and nothing to the damped frequency: xi_true = xi - 1 / (tau omega), to first order in the damping ratios.
    For poles the correction is exact.
    """
    check_number("time_constant", time_constant, above=0)
    return np.asarray(poles, dtype=np.complex128) + 1 / time_constant


def _edit_stretch(samples: Real, sampling_rate: float, lifter: Lifter) -> Real:
    """Edit one stretch, shape (channels, samples)."""
    n_samples = samples.shape[1]
    length = fft.next_fast_len(n_samples, real=True)
    centred = samples - samples.mean(axis=1, keepdims=True)
    spectrum = fft.rfft(centred, length, axis=1)
    log_amplitude = _log_amplitude(spectrum)
    cepstrum = fft.irfft(log_amplitude, length, axis=1)
    weights = _checked_weights(lifter, np.arange(length // 2 + 1) / sampling_rate)
    cepstrum *= np.concatenate([weights, weights[1 : (length + 1) // 2][::-1]])
    gain = np.exp(fft.rfft(cepstrum, axis=1).real - log_amplitude)
    edited = fft.irfft(spectrum * gain, length, axis=1)[:, :n_samples]
    return np.where(centred.any(axis=1, keepdims=True), edited, samples)


def _log_amplitude(spectrum: Complex) -> Real:
    """Return ln |X| with a floor, the empty bin at zero frequency taken from its neighbour."""
    amplitude = np.abs(spectrum)
    amplitude[..., 0] = amplitude[..., min(1, amplitude.shape[-1] - 1)]
    level = np.sqrt(np.mean(amplitude**2, axis=-1, keepdims=True))
    floor = np.where(level > 0, AMPLITUDE_FLOOR * level, 1.0)
    return np.log(np.maximum(amplitude, floor))


def _checked_weights(lifter: Lifter, quefrency: Real) -> Real:
    """Return the lifter's weights if they are finite and fit the quefrencies."""
    weights = np.asarray(lifter.weights(quefrency), dtype=np.float64)
    if weights.shape != quefrency.shape or not np.isfinite(weights).all():
        raise ParameterError(
            f"{lifter} gave weights of shape {weights.shape}: they must be one finite number for each of the "
            f"{quefrency.size} quefrencies"
        )
    return weights
