"""Subtraction of the lines of the excitation from a recording, so that modes next to them remain."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy import fft

from sprung._arrays import Complex, Real
from sprung.recording import Recording
from sprung.signals.harmonics import Harmonic, missing_multiples

#: Amplitudes for each length over which the amplitude of a line may change at the fastest.
_PER_LENGTH = 8
#: Zero padding for the exact frequency of a line.
_PADDING = 8
#: Shortest length over which the amplitude of a line is averaged where it comes or goes [s].
_SHORTEST = 2.0
#: Multiple of the median change of an amplitude from length to length that is no chance.
_CONTRADICTION = 5.0


def subtract_lines(recording: Recording, harmonics: Sequence[Harmonic]) -> Recording:
    """Subtract lines of constant frequency: a sine of slowly varying amplitude and phase in each channel.

    Parameters
    ----------
    recording
        Recording without missing values, at any sampling rate.
    harmonics
        Lines; those that drift or are proportional to speed, and those above half the sampling rate, are left in. Of
        large families all multiples are subtracted (`harmonics.missing_multiples`).

    Returns
    -------
    Recording
        Recording without the lines.

    Notes
    -----
    In every stretch the line is the local mean of 2 y(t) exp(-2 pi i f t) over a length D (weighted with a Hann
    window), at the frequency f at which the channels together have most power within the resolution of the line. D is
    at each time the longest of the whole stretch, a half, a quarter ... of it down to 2 s that no shorter length
    contradicts by more than chance (Lepski's method): a steady sine is fitted over the whole stretch, one that starts
    in it over what there is of it. What is removed with the line is the motion within about 1 / D: of the energy of a
    mode at the line's frequency the share 2 / (pi D b) with b its half-power bandwidth, of one that lies away from the
    line by several b next to nothing.

    References
    ----------
    O. V. Lepski (1991), On a problem of adaptive estimation in Gaussian white noise, Theory of Probability and its
    Applications 35, 454-466.

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
    every = (*harmonics, *missing_multiples(harmonics))
    lines = [line for line in every if line.kind == "constant" and line.frequency < rate / 2]
    if not lines:
        return recording
    samples = np.array(recording.samples)
    for stretch in recording.stretches():
        motion = samples[:, stretch]
        # The strongest line first: its side lobes reach furthest.
        for line in sorted(lines, key=lambda line: -line.prominence):
            motion -= _sine(motion, line.frequency / rate, line.resolution / rate, _SHORTEST * rate)
    listed = ", ".join(f"{line.frequency:.4g}" for line in lines[:10]) + (", ..." if len(lines) > 10 else "")
    return recording.changed(f"lines at {listed} Hz subtracted", samples=samples)


def _sine(motion: Real, frequency: float, resolution: float, shortest: float) -> Real:
    """Return the line of a frequency [1/sample] in samples, shape (channels, samples)."""
    n_samples = motion.shape[1]
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
    """Return at each time the mean over the longest length that no shorter one contradicts."""
    n_blocks = envelope.shape[1]
    means = [np.broadcast_to(envelope.mean(axis=1, keepdims=True), envelope.shape)]
    length = n_blocks / 2
    while length >= max(shortest, 2.0):
        half = int(length)
        kernel = np.sin(np.pi * np.arange(1, 2 * half) / (2 * half)) ** 2
        means.append(_convolved(envelope, kernel) / _convolved(np.ones((1, n_blocks)), kernel).real)
        length /= 2
    chosen = means[-1].copy()
    is_valid = np.ones(n_blocks, dtype=np.bool_)
    # Half of the time or more the line is taken to be steady, so that the median change between lengths is noise.
    noise = [np.median(np.abs(b - a), axis=1, keepdims=True) for a, b in pairwise(means)]
    for k in range(len(means) - 2, -1, -1):
        for j in range(k + 1, len(means)):
            is_valid &= np.all(np.abs(means[k] - means[j]) <= _CONTRADICTION * noise[j - 1], axis=0)
        chosen[:, is_valid] = means[k][:, is_valid]
    return chosen


def _convolved(rows: Complex | Real, kernel: Real) -> Complex:
    """Return the convolution of rows with a symmetric kernel, as long as the rows."""
    half = (kernel.size - 1) // 2
    n_fft = int(fft.next_fast_len(rows.shape[1] + kernel.size - 1))
    full = fft.ifft(fft.fft(rows, n_fft) * fft.fft(kernel, n_fft))
    return full[:, half : half + rows.shape[1]]
