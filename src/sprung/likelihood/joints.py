"""What repeats itself along a track: joints at equal distances, and the turns of wheels that are not round."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.spectra import OVERCOUNT, ClassSpectra, SegmentSpectra
from sprung.likelihood.uncertainty import whitened_segments
from sprung.likelihood.whittle import Model


@dataclass(frozen=True, slots=True)
class RepetitionSettings:
    """What is searched for, and when it is found."""

    #: Shortest and longest distance of joints [m].
    pitches: tuple[float, float] = (5.0, 60.0)
    #: Smallest and largest circumference of a wheel [m].
    turns: tuple[float, float] = (1.8, 4.0)
    #: Distance over which the turns of a wheel are counted [m].
    reach: float = 40.0
    #: Least correlation at a distance and its multiples, in standard deviations of chance.
    significant: float = 5.0
    #: Departure of a distance from whole turns, in turns, within which it is theirs.
    whole: float = 0.03


SETTINGS = RepetitionSettings()


def comb(spectra: ClassSpectra, pitch: float, offset: float = 0.0) -> Complex:
    """Return the density of a periodic track over that of the same impulses at random places, shape (classes, grid).

    Parameters
    ----------
    spectra
        Grid, speeds and spreads.
    pitch
        Distance between the impulses [m]; infinite: they are at random places themselves.
    offset
        Distance over the pitch by which the impulses of another rail are ahead of these: the cross spectrum of both.

    Notes
    -----
    Lines at k v / pitch are, as a Fourier series over f, sum_m exp(i w s) with the time s = (m + offset) pitch / v
    between two joints, m = ..., -1, 0, 1, ... A Hann window of length T multiplies each term by its autocorrelation at
    u = |s| / T < 1, divided here by 2/3 + cos(2 pi u) / 3, as `through_window` follows; the spread of the speed in a
    segment by exp(-(w s spread)^2 / 2), so that nothing is left of high lines. The mean over the segments of a class.

    References
    ----------
    F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proceedings of the
    IEEE 66 (1978), 51-83 (Hann window).
    """
    pulsation = 2 * np.pi * spectra.grid
    members = spectra.members or np.array([spectra.speeds, spectra.spreads]).T[:, :, None]
    lines = np.ones((spectra.speeds.size, spectra.grid.size), dtype=np.complex128)
    for row, (speeds, spreads) in enumerate(members if np.isfinite(pitch) else ()):
        count = np.ceil(spectra.segment_length * speeds.max() / pitch)
        s = (np.arange(-count, count + 1)[:, None] + offset) * pitch / speeds
        u = np.minimum(np.abs(s) / spectra.segment_length, 1.0)
        share = 1 - u + 3 * np.sin(2 * np.pi * u) / (2 * np.pi * (2 + np.cos(2 * np.pi * u)))
        lag = pulsation[:, None, None] * s
        lines[row] = np.sum(share * np.exp(-((lag * spreads) ** 2) / 2 + 1j * lag), axis=(1, 2)) / speeds.size
    return lines


def repetitions(
    model: Model, parameters: Real, segments: SegmentSpectra, *, width: float
) -> tuple[float | None, float | None]:
    """Return the circumference of wheels and the distance of joints at which the motion repeats itself [m].

    Parameters
    ----------
    model
        Model of a smooth track and round wheels, with data.
    parameters
        Its fitted parameters.
    segments
        Spectra of the segments.
    width
        Relative width of the speed classes of the model's data.

    Returns
    -------
    float or None, float or None
        Distances in the unit of the stated speed times seconds; None where no repetition exceeds chance.

    Notes
    -----
    The power of a segment relative to the model's and to the mean of all segments, as a function of the spatial
    frequency f / v, has a cosine of "quefrency" p where the motion repeats itself after p: the correlation of the
    whitened motion at that distance, summed over segments whose speeds differ. By chance it has the variance of the sum
    of independent powers, which overlapping Hann-windowed segments triple (19/9 times 3/2). Joints every p also repeat
    the track after 2 p, 3 p and 4 p, whose correlations count with that at p, so that no multiple of p is found; wheels
    repeat each turn, all of which count. Whichever of the two repeats more is there; joints beside wheels are sought
    without the lines of these.

    References
    ----------
    R. B. Randall, A history of cepstrum analysis and its application to mechanical problems, Mechanical Systems and
    Signal Processing 97 (2017), 3-19.
    """
    powers = np.abs(whitened_segments(model, parameters, segments, width)) ** 2
    reach = segments.speeds[:, None] * segments.segment_length
    waves = segments.frequencies / segments.speeds[:, None]
    is_free = np.ones(waves.shape, dtype=np.bool_)

    def scores(distances: Real) -> Real:
        """Return the correlations at equidistant distances, in standard deviations of chance, by what is free of lines.

        Phasors turn by the same angles from each distance to the next, which saves most of their cosines.
        """
        means = np.einsum("sfi,sf->fi", powers, is_free) / np.maximum(is_free.sum(axis=0), 1)[:, None]
        power = np.mean(powers / np.maximum(means, 1e-300), axis=2) - 1
        limited = np.where(is_free, np.minimum(power, np.quantile(power[is_free], 0.99)), 0.0)
        variance = 1.5 * OVERCOUNT * limited[is_free].var()
        is_used = reach > 2 * distances  # at least two joints in a segment
        phasors, turns = (np.exp(2j * np.pi * by * waves) for by in (distances[0], distances[1] - distances[0]))
        sums = np.empty((2, distances.size))
        phasors *= is_free
        for row, used in enumerate(is_used.T):
            cosines = phasors.real
            sums[:, row] = [np.einsum("sf,sf->s", cosines, by) @ used for by in (limited, cosines)]
            phasors *= turns
        return np.asarray(sums[0] / np.sqrt(np.maximum(variance * sums[1], 1.0)))

    step = 1 / (8 * float(np.quantile(waves, 0.9)))
    distances = np.arange(SETTINGS.turns[0], SETTINGS.pitches[1], step)
    once = scores(distances)
    pitch, strength = _joints(distances, once, step, scores)
    turns = np.arange(*SETTINGS.turns, step / 8)
    every = [turn * np.arange(1, 1 + int(SETTINGS.reach / turn)) for turn in turns]
    of_turns = [np.sum(np.interp(each, distances, once)) / np.sqrt(each.size) for each in every]
    turn = float(turns[np.argmax(of_turns)])
    if max(of_turns) <= max(strength, SETTINGS.significant):
        return None, pitch if strength > SETTINGS.significant else None
    number = np.rint(turn * waves)
    is_free = (number == 0) | (np.abs(turn * waves - number) * reach > 2 * turn)
    is_other = np.abs(distances / turn - np.rint(distances / turn)) > SETTINGS.whole
    pitch, strength = _joints(distances, np.where(is_other, scores(distances), 0.0), step, scores)
    return turn, pitch if strength > SETTINGS.significant else None


def _joints(distances: Real, once: Real, step: float, scores: Callable[[Real], Real]) -> tuple[float, float]:
    """Return the distance of joints and its score together with its multiples."""
    is_long = distances >= SETTINGS.pitches[0]
    pitches, once = distances[is_long], once[is_long]
    # Joints every p repeat the track after 2 p, 3 p ... too: their scores count together, as many as are largest so.
    times = np.arange(1, 5)
    repeated = np.cumsum([np.interp(count * pitches, pitches, once, right=0.0) for count in times], axis=0)
    together = repeated / np.sqrt(times)[:, None]
    best = int(np.argmax(together.max(axis=0)))
    nearby = pitches[best] + step * np.linspace(-1, 1, 41)
    within = times[times * nearby[-1] < SETTINGS.pitches[1]]
    pitch = float(nearby[np.argmax(sum(scores(count * nearby) for count in within))])
    return pitch, float(together[:, best].max())
