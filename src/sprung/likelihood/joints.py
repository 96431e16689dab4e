"""Rail joints at equal distances: their lines in the spectrum of a track, and their distance from the data."""

import numpy as np

from sprung._arrays import Real
from sprung.likelihood.spectra import OVERCOUNT, ClassSpectra, SegmentSpectra
from sprung.likelihood.uncertainty import whitened_segments
from sprung.likelihood.whittle import Model

#: Shortest and longest distance of joints that are searched for [m].
PITCHES = (5.0, 60.0)
#: Least correlation at that distance and its multiples, in standard deviations of chance.
SIGNIFICANT = 5.0
#: Least density between the lines: sharper than a bin of a segment, they would make it negative on its grid.
_LEAST = 1e-3


def comb(spectra: ClassSpectra, pitch: float) -> Real:
    """Return the density of a periodic track over that of the same impulses at random places, shape (classes, grid).

    Parameters
    ----------
    spectra
        Grid, speeds and spreads.
    pitch
        Distance between the impulses [m].

    Notes
    -----
    Lines at k v / pitch are, as a Fourier series over f, 1 + 2 sum_m cos(w m t) with the time t = pitch / v between two
    joints. A Hann window of length T multiplies term m by its autocorrelation at u = m t / T < 1, divided here by
    2/3 + cos(2 pi u) / 3, as `through_window` follows; the spread of the speed in a segment by
    exp(-(w m t spread)^2 / 2), so that nothing is left of high lines. The mean over the segments of a class.

    References
    ----------
    F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proceedings of the
    IEEE 66 (1978), 51-83 (Hann window).
    """
    pulsation = 2 * np.pi * spectra.grid
    members = spectra.members or np.array([spectra.speeds, spectra.spreads]).T[:, :, None]
    lines = np.ones((spectra.speeds.size, spectra.grid.size))
    for row, (speeds, spreads) in enumerate(members):
        seconds = pitch / speeds
        m = np.arange(1, np.ceil(spectra.segment_length / seconds.min()))[:, None]
        u = np.minimum(m * seconds / spectra.segment_length, 1.0)
        share = 1 - u + 3 * np.sin(2 * np.pi * u) / (2 * np.pi * (2 + np.cos(2 * np.pi * u)))
        lag = pulsation[:, None, None] * m * seconds
        lines[row] += 2 * np.sum(share * np.exp(-((lag * spreads) ** 2) / 2) * np.cos(lag), axis=(1, 2)) / speeds.size
    return np.maximum(lines, _LEAST)


def joint_pitch(model: Model, parameters: Real, segments: SegmentSpectra, *, width: float) -> float | None:
    """Return the distance of joints at which the motion repeats itself beyond what the model explains [m].

    Parameters
    ----------
    model
        Model of a smooth track, with data.
    parameters
        Its fitted parameters.
    segments
        Spectra of the segments.
    width
        Relative width of the speed classes of the model's data.

    Returns
    -------
    float or None
        Distance in the unit of the stated speed times seconds; None where no repetition exceeds chance.

    Notes
    -----
    The power of a segment relative to the model's and to the mean of all segments, as a function of the spatial
    frequency f / v, has a cosine of "quefrency" p where the track repeats itself after p: the correlation of the
    whitened motion at that distance, summed over segments whose speeds differ. By chance it has the variance of the sum
    of independent powers, which overlapping Hann-windowed segments triple (19/9 times 3/2). Joints every p also repeat
    the track after 2 p, 3 p and 4 p, whose correlations count with that at p, so that no multiple of p is found.

    References
    ----------
    R. B. Randall, A history of cepstrum analysis and its application to mechanical problems, Mechanical Systems and
    Signal Processing 97 (2017), 3-19.
    """
    power = np.abs(whitened_segments(model, parameters, segments, width)) ** 2
    power = np.mean(power / power.mean(axis=0), axis=2) - 1
    waves = segments.frequencies / segments.speeds[:, None]
    limited = np.minimum(power, np.quantile(power, 0.99))
    variance = np.full_like(power, 1.5 * OVERCOUNT * limited.var())

    def scores(distances: Real) -> Real:
        """Return the correlations at distances, in standard deviations of chance."""
        is_used = segments.speeds[:, None] * segments.segment_length > 2 * distances  # at least two joints in a segment
        cosines = np.array([np.cos(2 * np.pi * distance * waves) for distance in distances])
        sums = np.einsum("psf,sf,sp->p", cosines, limited, is_used)
        chance = np.einsum("psf,sf,sp->p", cosines**2, variance, is_used)
        return np.asarray(sums / np.sqrt(np.maximum(chance, 1.0)))

    step = 1 / (8 * float(np.quantile(waves, 0.9)))
    pitches = np.arange(*PITCHES, step)
    once = scores(pitches)
    # Joints every p repeat the track after 2 p, 3 p ... too: their scores count together, as many as are largest so.
    times = np.arange(1, 5)
    repeated = np.cumsum([np.interp(count * pitches, pitches, once, right=0.0) for count in times], axis=0)
    together = repeated / np.sqrt(times)[:, None]
    best = int(np.argmax(together.max(axis=0)))
    if together[:, best].max() <= SIGNIFICANT:
        return None
    nearby = pitches[best] + step * np.linspace(-1, 1, 41)
    within = times[times * nearby[-1] < PITCHES[1]]
    return float(nearby[np.argmax(sum(scores(count * nearby) for count in within))])
