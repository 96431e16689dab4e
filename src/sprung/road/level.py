"""Longitudinal level of a track from the profile under a rail vehicle: standard deviations in D1 and D2 (EN 13848)."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.road.profile import TRACK, RoadProfile


@dataclass(frozen=True, slots=True)
class TrackLevel:
    """Longitudinal level of one rail on one stretch: standard deviations in ranges of wavelengths (EN 13848-1).

    Parameters
    ----------
    d1, d1_std
        Standard deviation of the level between wavelengths of 3 and 25 m [m], and its own standard deviation.
    d2, d2_std
        The same between 25 and 70 m; None where the vehicle is too slow for them.
    d1_scatter
        Standard deviation of `d1` between passes; None for one pass.
    """

    d1: float
    d1_std: float
    d2: float | None
    d2_std: float | None
    d1_scatter: float | None = None


@dataclass(frozen=True, slots=True)
class LevelSettings:
    """Ranges of wavelengths of EN 13848-1."""

    #: Shortest and longest wavelength of D1 and D2 [m].
    ranges: tuple[tuple[float, float], ...] = ((3.0, 25.0), (25.0, 70.0))


RANGES = LevelSettings().ranges


def in_range(heights: Real, wavelengths: tuple[float, float], *, spacing: float) -> Real:
    """Return the part of heights in a range of wavelengths, shape of the heights.

    Parameters
    ----------
    heights
        Heights of one or several rails [m], shape (..., points).
    wavelengths
        Shortest and longest wavelength [m].
    spacing
        Distance between points [m], above 0.

    Notes
    -----
    The gain of two Butterworth filters of the fourth order without their shift of phase: half of the power (-3 dB) at
    both ends of the range, and 24 dB per octave beyond. Heights go on mirrored at both ends.

    References
    ----------
    EN 13848-1:2019, Railway applications, Track, Track geometry quality, Part 1: Characterization of track geometry.

    Examples
    --------
    A sine of 10 m is within D1, and one of 50 m is not:

    >>> x = np.arange(0.0, 2000.0, 0.25)
    >>> found = in_range(np.sin(2 * np.pi * x / np.array([[10.0], [50.0]])), RANGES[0], spacing=0.25)
    >>> np.round(found[:, 2000:6000].std(axis=1), 3).tolist()
    [0.707, 0.044]
    """
    check_number("spacing", spacing, above=0)
    size = heights.shape[-1]
    n = min(size - 1, int(4 * wavelengths[1] / spacing))
    longer = np.pad(heights, (*[(0, 0)] * (heights.ndim - 1), (n, n)), mode="reflect", reflect_type="odd")
    frequencies = np.maximum(np.fft.rfftfreq(longer.shape[-1], spacing), 1e-6)
    shortest, longest = wavelengths
    gain = ((1 + (frequencies * shortest) ** 8) * (1 + (1 / (frequencies * longest)) ** 8)) ** -0.5
    return np.asarray(np.fft.irfft(gain * np.fft.rfft(longer), longer.shape[-1])[..., n : n + size])


class Levels:
    """Level of both rails along a profile.

    Parameters
    ----------
    profile
        Heights of both rails under the first wheelset.
    model_error
        Relative error of the vehicle's spectra beyond chance, of which a level has half.
    """

    def __init__(self, profile: RoadProfile, model_error: float) -> None:
        self._profile, self._error = profile, model_error / 2
        self._filtered = np.zeros((len(RANGES), *profile.heights.shape))
        for block in profile.blocks():
            heights = profile.heights[:, block]
            heights = heights - heights.mean(axis=1, keepdims=True)
            for row, wavelengths in enumerate(RANGES):
                self._filtered[row, :, block] = in_range(heights, wavelengths, spacing=profile.spacing)

    def at(self, side: int, part: slice) -> TrackLevel:
        """Return the level of a rail on a part of the profile."""
        (d1, d1_std), found = (self._deviation(row, side, part) for row in range(len(RANGES)))
        is_fast = float(np.median(self._profile.speeds[part])) >= TRACK.lowest * RANGES[1][1]
        return TrackLevel(d1, d1_std, *(found if is_fast else (None, None)))

    def d1(self, block: slice) -> Real:
        """Return the level of both rails in D1 on a block of the profile [m], shape (2, points)."""
        return np.asarray(self._filtered[0, :, block] * self._profile.is_valid[block])

    def _deviation(self, row: int, side: int, part: slice) -> tuple[float, float]:
        """Return the standard deviation of a level in a range, and its own, by the error, the vehicle and its model."""
        profile, wavelengths = self._profile, RANGES[row]
        heights = self._filtered[row, side, part]
        speed = float(np.median(profile.speeds[part]))
        nearest = int(np.argmin(np.abs(np.log(profile.at_speeds / speed))))
        n = profile.frequencies / speed
        inside = (n >= 1 / wavelengths[1]) & (n <= 1 / wavelengths[0])
        missing = float(np.sum(profile.missing_density[side, nearest, inside])) * float(np.diff(profile.frequencies)[0])
        power = float(np.var(heights)) + missing
        spectrum = np.abs(np.fft.rfft(heights - heights.mean())) ** 2
        shares = spectrum / max(float(spectrum.sum()), 1e-300)
        places = np.fft.rfftfreq(heights.size, profile.spacing)
        of_fit = [np.interp(places, n, each) @ shares / 2 for each in profile.sensitivity[:, side]]
        n_independent = max(1.0, 2 * heights.size * profile.spacing / wavelengths[1])
        share = missing / max(power, 1e-300)
        level = float(np.sqrt(power))
        return level, level * float(np.sqrt(share / n_independent + np.sum(np.square(of_fit)) + self._error**2))
