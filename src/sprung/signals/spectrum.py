"""Spectral matrices: Welch's averaged spectra of all pairs of channels."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

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
    total = np.zeros((n_channels, n_channels, n_per_segment // 2 + 1), dtype=np.complex128)
    n_segments = 0
    for block in _short_time_spectra(recording, n_per_segment):
        for p, spectra in enumerate(block):
            # Products with the channels from this one on: the other half of the matrix is their conjugate.
            total[p, p:] += np.sum(spectra * block[p:].conj(), axis=1)
        n_segments += block.shape[1]
    below, above = np.tril_indices(n_channels, -1)
    total[below, above] = total[above, below].conj()
    frequencies = np.arange(n_per_segment // 2 + 1, dtype=np.float64)
    frequencies *= recording.sampling_rate / n_per_segment
    return SpectralMatrix(frequencies, total / n_segments, recording.names, segment_length, n_segments)


def _short_time_spectra(recording: Recording, n_per_segment: int) -> Iterator[Complex]:
    """Yield the spectra of consecutive segments in blocks of bounded size, (channels, segments, frequencies)."""
    check_complete(recording.names, recording.samples)
    step = max(1, round(n_per_segment / 2))
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_per_segment) / n_per_segment)
    factors = np.full(n_per_segment // 2 + 1, 2 / (recording.sampling_rate * np.sum(window**2)))
    factors[0] /= 2
    if n_per_segment % 2 == 0:
        factors[-1] /= 2
    per_block = max(1, BLOCK_SIZE // (n_per_segment * len(recording.channels)))
    for stretch in recording.stretches():
        samples = recording.samples[:, stretch]
        if samples.shape[1] < n_per_segment:
            continue
        segments = np.lib.stride_tricks.sliding_window_view(samples, n_per_segment, axis=1)[:, ::step]
        for first in range(0, segments.shape[1], per_block):
            block = segments[:, first : first + per_block]
            block = (block - block.mean(axis=-1, keepdims=True)) * window
            yield np.fft.rfft(block, axis=-1) * np.sqrt(factors)


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
