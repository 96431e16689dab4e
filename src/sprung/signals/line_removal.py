"""Subtraction of the lines of the excitation from a recording, so that modes next to them remain."""

from collections.abc import Iterable

import numpy as np
from scipy import fft

from sprung._arrays import Complex, Real
from sprung.recording import Recording
from sprung.signals.harmonics import Harmonic
from sprung.signals.narrow_lines import NOISE_BANDWIDTH

#: Amplitudes for each length over which the amplitude of a line may change at the fastest.
_PER_LENGTH = 8
#: Zero padding for the exact frequency of a line.
_PADDING = 8
#: Factor by which the residual power has to fall for a shorter length: less may be a mode's own motion.
_WORTH = 4.0


def subtract_lines(recording: Recording, harmonics: Iterable[Harmonic]) -> Recording:
    """Subtract lines of constant frequency: a sine of slowly varying amplitude and phase in each channel.

    Parameters
    ----------
    recording
        Recording without missing values, at any sampling rate.
    harmonics
        Lines; those proportional to speed, and those above half the sampling rate, are left in.

    Returns
    -------
    Recording
        Recording without the lines.

    Notes
    -----
    In every stretch the line is the local mean of 2 y(t) exp(-2 pi i f t) over a length D (weighted with a Hann
    window), at the frequency f at which the channels together have most power within the resolution of the line. D is
    the whole stretch, or a half, a quarter ... of it down to the length that resolved the line, if the residual power
    within that resolution falls by a factor of 4 or more. What goes with the line is the motion within about 1 / D: of
    the energy of a mode at the line's frequency the share 2 / (pi D b) with b its half-power bandwidth, of one that
    lies away from the line by several b next to nothing.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> sine = Recording(np.sin(2 * np.pi * 17.003 * np.arange(12_000) / 200)[None], 200.0, (Channel("a"),))
    >>> line = Harmonic(17.0, "constant", (16.98, 17.02), 0.04, 20.0, ("a",))
    >>> bool(subtract_lines(sine, [line]).samples.std() < 0.01)
    True
    """
    rate = recording.sampling_rate
    lines = [line for line in harmonics if line.kind == "constant" and line.frequency < rate / 2]
    if not lines:
        return recording
    samples = np.array(recording.samples)
    for stretch in recording.stretches():
        motion = samples[:, stretch]
        # The strongest line first: its side lobes reach furthest.
        for line in sorted(lines, key=lambda line: -line.prominence):
            motion -= _sine(motion, line.frequency / rate, line.resolution / rate)
    listed = ", ".join(f"{line.frequency:.4g}" for line in lines[:10]) + (", ..." if len(lines) > 10 else "")
    return recording.changed(f"lines at {listed} Hz subtracted", samples=samples)


def _sine(motion: Real, frequency: float, resolution: float) -> Real:
    """Return the line of a frequency [1/sample] in samples, shape (channels, samples)."""
    n_samples = motion.shape[1]
    shortest = NOISE_BANDWIDTH / resolution
    step = max(1, int(min(shortest, n_samples) / _PER_LENGTH))
    n_blocks = n_samples // step
    if n_blocks < 2:
        return np.zeros_like(motion)
    times = np.arange(n_samples)
    envelope = _block_means(motion * np.exp(-2j * np.pi * frequency * times), step, n_blocks)
    offset = _offset(envelope, resolution * step)
    envelope *= np.exp(-2j * np.pi * offset * np.arange(n_blocks))
    frequency += offset / step
    amplitudes = _smooth(envelope, shortest / step)
    centres = (np.arange(n_blocks) + 0.5) * step - 0.5
    carrier = 2 * np.exp(2j * np.pi * (frequency * times - offset / step * centres[0]))
    if np.ptp(amplitudes, axis=1).max() == 0:
        return np.real(amplitudes[:, :1] * carrier)
    following = np.array([np.interp(times, centres, row) for row in amplitudes])
    return np.real(following * carrier)


def _block_means(samples: Complex, step: int, n_blocks: int) -> Complex:
    """Return means of consecutive blocks, the last of which takes in the rest."""
    starts = np.arange(n_blocks) * step
    sizes = np.append(np.full(n_blocks - 1, step), samples.shape[1] - starts[-1])
    return np.add.reduceat(samples, starts, axis=1) / sizes


def _offset(envelope: Complex, reach: float) -> float:
    """Return the frequency of most power in all channels within `reach` of 0 [1/block]."""
    n_fft = int(fft.next_fast_len(_PADDING * envelope.shape[1]))
    window = np.sin(np.pi * (np.arange(envelope.shape[1]) + 0.5) / envelope.shape[1]) ** 2
    power = np.sum(np.abs(fft.fft(envelope * window, n_fft)) ** 2, axis=0)
    frequencies = fft.fftfreq(n_fft)
    power = np.where(np.abs(frequencies) <= max(reach, 1.5 / envelope.shape[1]), power, 0)
    k = int(np.argmax(power))
    below, at, above = np.log(np.maximum(power[[k - 1, k, (k + 1) % n_fft]], np.finfo(float).tiny))
    curvature = below - 2 * at + above
    vertex = (below - above) / (2 * curvature) if curvature < 0 else 0.0
    return float(frequencies[k] + np.clip(vertex, -0.5, 0.5) / n_fft)


def _smooth(envelope: Complex, shortest: float) -> Complex:
    """Return the mean, or the local means over the longest length that leaves clearly less."""
    n_blocks = envelope.shape[1]
    best = np.broadcast_to(envelope.mean(axis=1, keepdims=True), envelope.shape)
    least = _residual(envelope, best)
    length = n_blocks / 2
    while length >= max(shortest, 2.0):
        half = int(length)
        kernel = np.sin(np.pi * np.arange(1, 2 * half) / (2 * half)) ** 2
        smooth = _convolved(envelope, kernel) / _convolved(np.ones((1, n_blocks)), kernel).real
        residual = _residual(envelope, smooth)
        if _WORTH * residual < least:
            best, least = smooth, residual
        length /= 2
    return np.asarray(best)


def _convolved(rows: Complex | Real, kernel: Real) -> Complex:
    """Return the convolution of rows with a symmetric kernel, as long as the rows."""
    half = (kernel.size - 1) // 2
    n_fft = int(fft.next_fast_len(rows.shape[1] + kernel.size - 1))
    full = fft.ifft(fft.fft(rows, n_fft) * fft.fft(kernel, n_fft))
    return full[:, half : half + rows.shape[1]]


def _residual(envelope: Complex, smooth: Complex) -> float:
    """Return the power that a smooth envelope leaves, each channel relative to its own."""
    scale = np.maximum(np.mean(np.abs(envelope) ** 2, axis=1), np.finfo(float).tiny)
    return float(np.sum(np.mean(np.abs(envelope - smooth) ** 2, axis=1) / scale))
