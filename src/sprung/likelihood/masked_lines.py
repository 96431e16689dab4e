"""Lines of wheels, engine and mains in the measured spectra, relative to the fitted ones."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.whittle import Model


@dataclass(frozen=True, slots=True)
class LineLimits:
    """When misfit is a line."""

    #: Smallest excess of a line over its neighbourhood, in standard deviations of chance.
    score: float = 6.0
    #: Smallest excess of a line relative to its neighbourhood.
    excess: float = 0.25
    #: Half width of a line in steps of the search: half spectral lines.
    half_width: int = 2
    #: Distance of its neighbourhood on either side, in steps.
    neighbourhood: int = 6
    #: Distance of two lines of the wheels, over the place of the first one, within which they are the same.
    same: float = 0.02


LIMITS = LineLimits()


@dataclass(frozen=True, slots=True)
class SpectralLine:
    """A line at a constant frequency, or of the wheels.

    Parameters
    ----------
    place
        Frequency [Hz], or cycles per metre where the line follows the speed.
    follows_speed
        Whether the frequency of the line is proportional to the speed.
    """

    place: float
    follows_speed: bool


def residual_lines(model: Model, parameters: Real, *, lowest: float = 0.0) -> tuple[SpectralLine, ...]:
    """Return the lines at which the measured spectra exceed the fitted ones.

    Parameters
    ----------
    model
        Model with data.
    parameters
        Fitted parameters of the model.
    lowest
        Lowest frequency of a line [Hz].

    Returns
    -------
    tuple of SpectralLine
        Lines of the wheels first.

    Notes
    -----
    q = tr(S^-1 S^) / coordinates has mean 1 for every class and frequency. It is averaged along constant frequency, and
    along constant cycles per metre where speeds differ. A line exceeds both its sides by 6 standard deviations of
    chance (the mean of n values of variance 1 has standard deviation n^-1/2) and by a quarter; a resonance of the
    vehicle is broader, and exceeds one side at most.

    References
    ----------
    N. R. Goodman, Statistical analysis based on a certain multivariate complex Gaussian distribution, Annals of
    Mathematical Statistics 34 (1963), 152-177 (distribution of spectral matrices).

    Examples
    --------
    A line of the wheels at 0.5 cycles per metre in spectra that are otherwise those of the fitted model:

    >>> from dataclasses import replace
    >>> import numpy as np
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> settings = RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0)
    >>> fit = fit_corners(simulate_drive(vehicle, settings, seed=1).recording, vehicle)
    >>> model, parameters = fit.model, fit.parameters
    >>> near = np.abs(model.spectra.frequencies - 0.5 * model.spectra.speeds[:, None]) < 0.2
    >>> matrices = np.where(near, 20.0, 1.0)[..., None, None] * model.matrix(parameters)
    >>> with_line = replace(model, spectra=replace(model.spectra, matrices=matrices))
    >>> [(round(line.place, 2), line.follows_speed) for line in residual_lines(with_line, parameters)]
    [(0.5, True)]
    """
    spectra = model.spectra
    ratio = model.relative_power(parameters)
    weights = spectra.counts[:, None] * (spectra.frequencies > lowest) * len(model.layout.rows)
    frequencies = np.broadcast_to(spectra.frequencies, ratio.shape)
    step = 0.5 / spectra.segment_length
    lines: list[SpectralLine] = []
    known = np.isfinite(spectra.speeds)
    if known.all() and np.ptp(spectra.speeds) > 0.1 * spectra.speeds.mean():
        orders = frequencies / spectra.speeds[:, None]
        mean_speed = float(np.average(spectra.speeds, weights=spectra.counts))
        lines += [SpectralLine(place, True) for place in _peaks(orders, ratio, weights, step / mean_speed)]
    # at a steady speed a line of the wheels is also one of constant frequency
    rest = weights * without_lines(spectra, tuple(lines))
    lines += [SpectralLine(place, False) for place in _peaks(frequencies, ratio, rest, step)]
    return tuple(lines)


def lines_of_turns(circumference: float, spectra: ClassSpectra) -> tuple[SpectralLine, ...]:
    """Return the lines of wheels of a circumference [m] in the band of spectra: each number of periods in a turn."""
    most = int(circumference * float(spectra.frequencies[-1] / spectra.speeds.min()))
    return tuple(SpectralLine(number / circumference, follows_speed=True) for number in range(1, most + 1))


def with_lines(known: tuple[SpectralLine, ...], found: tuple[SpectralLine, ...]) -> tuple[SpectralLine, ...]:
    """Return known lines of wheels and those found that are none of them, to a fiftieth of the first one's place."""
    near = LIMITS.same * known[0].place if known else 0.0
    others = (
        line
        for line in found
        if not (line.follows_speed and any(abs(line.place - other.place) < near for other in known))
    )
    return (*known, *others)


def _peaks(places: Real, ratio: Real, weights: Real, step: float) -> list[float]:
    """Places at which the weighted mean of the ratio exceeds that on both sides."""
    bins = np.floor(places / step).astype(np.intp).ravel()
    total = np.bincount(bins, weights.ravel())
    mean = np.bincount(bins, (weights * ratio).ravel()) / np.maximum(total, 1.0)
    window = np.ones(2 * LIMITS.half_width + 1)
    count = np.convolve(total, window, "same")
    mean_ratio = np.convolve(total * mean, window, "same") / np.maximum(count, 1.0)
    apart = LIMITS.half_width + LIMITS.neighbourhood
    padded = np.pad(mean_ratio, apart, mode="edge")
    base = np.maximum(padded[: -2 * apart], padded[2 * apart :])
    excess = np.where(count > 0, mean_ratio - base, 0.0)
    chance = mean_ratio / np.sqrt(np.maximum(count, 1.0))
    stands_out = (excess > LIMITS.score * chance) & (excess > LIMITS.excess * base)
    neighbours = np.lib.stride_tricks.sliding_window_view(np.pad(excess, LIMITS.half_width, mode="edge"), window.size)
    is_highest = excess == neighbours.max(axis=1)
    return [float((k + 0.5) * step) for k in np.flatnonzero(stands_out & is_highest)]


def without_lines(spectra: ClassSpectra, lines: tuple[SpectralLine, ...]) -> Booleans:
    """Return whether each class and frequency is free of lines, shape (classes, frequencies).

    Parameters
    ----------
    spectra
        Spectra with frequencies, speeds and spreads of the classes.
    lines
        Lines to leave out.

    Notes
    -----
    A Hann window widens a line to two spectral lines on either side; the spread of the speed widens one of the wheels
    further.

    References
    ----------
    F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proceedings of the
    IEEE 66 (1978), 51-83.
    """
    is_free = np.ones((spectra.speeds.size, spectra.frequencies.size), dtype=np.bool_)
    for line in lines:
        if line.follows_speed:
            places = (line.place * spectra.speeds)[:, None]
            reach = 2 / spectra.segment_length + 2 * spectra.spreads[:, None] * places
        else:
            places, reach = np.array(line.place), np.array(2 / spectra.segment_length)
        is_free &= ~(np.abs(spectra.frequencies - places) <= reach)
    return is_free
