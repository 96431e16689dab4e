"""Lines of wheels, engine and mains, found where the measured spectra stand above the fitted ones."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.whittle import Model

#: How far a line stands above its neighbourhood, in standard deviations of chance and relative to it.
_SCORE, _EXCESS = 6.0, 0.25
#: Half width of a line and of its neighbourhood on either side, in steps of the search: half spectral lines.
_NARROW, _BESIDE = 2, 6


@dataclass(frozen=True, slots=True)
class SpectralLine:
    """A line at a constant frequency [Hz], or at a constant number of cycles per metre."""

    place: float
    follows_speed: bool


def residual_lines(model: Model, parameters: Real, *, lowest: float = 0.0) -> tuple[SpectralLine, ...]:
    """Return lines that stand out of a fit.

    Parameters
    ----------
    model
        With data.
    parameters
        Of the fit.
    lowest
        Frequency from which on lines are looked for [Hz].

    Notes
    -----
    q = tr(S^-1 S^) / coordinates is 1 in the mean for every class and frequency. Averaged along lines of constant
    frequency, and of constant cycles per metre where speeds differ, a line stands above both its sides by more than
    chance. What the vehicle itself does is broader, and stands above neither or one.
    """
    spectra = model.spectra
    ratio = np.einsum("cfij,cfji->cf", np.linalg.inv(model.matrix(parameters)), spectra.matrices).real
    ratio /= len(model.layout.rows)
    weights = spectra.counts[:, None] * (spectra.frequencies > lowest) * len(model.layout.rows)
    frequencies = np.broadcast_to(spectra.frequencies, ratio.shape)
    step = 0.5 / spectra.segment_length
    found: list[SpectralLine] = []
    known = np.isfinite(spectra.speeds)
    if known.all() and np.ptp(spectra.speeds) > 0.1 * spectra.speeds.mean():
        orders = frequencies / spectra.speeds[:, None]
        mean_speed = float(np.average(spectra.speeds, weights=spectra.counts))
        found += [SpectralLine(place, True) for place in _peaks(orders, ratio, weights, step / mean_speed)]
    rest = weights * without_lines(spectra, tuple(found))  # what a line of the wheels adds at a steady speed is none
    found += [SpectralLine(place, False) for place in _peaks(frequencies, ratio, rest, step)]
    return tuple(found)


def _peaks(places: Real, ratio: Real, weights: Real, step: float) -> list[float]:
    """Return the places at which the weighted mean of the ratio stands out."""
    bins = np.floor(places / step).astype(np.intp).ravel()
    total = np.bincount(bins, weights.ravel())
    mean = np.bincount(bins, (weights * ratio).ravel()) / np.maximum(total, 1.0)
    window = np.ones(2 * _NARROW + 1)
    count = np.convolve(total, window, "same")
    level = np.convolve(total * mean, window, "same") / np.maximum(count, 1.0)
    apart = _NARROW + _BESIDE
    padded = np.pad(level, apart, mode="edge")
    base = np.maximum(padded[: -2 * apart], padded[2 * apart :])
    excess = np.where(count > 0, level - base, 0.0)
    stands_out = (excess > _SCORE * level / np.sqrt(np.maximum(count, 1.0))) & (excess > _EXCESS * base)
    highest = np.array([excess[k] == excess[max(k - _NARROW, 0) : k + _NARROW + 1].max() for k in range(excess.size)])
    return [float((k + 0.5) * step) for k in np.flatnonzero(stands_out & highest)]


def without_lines(spectra: ClassSpectra, lines: tuple[SpectralLine, ...]) -> Booleans:
    """Tell which classes and frequencies are free of lines, shape (classes, frequencies)."""
    is_free = np.ones((spectra.speeds.size, spectra.frequencies.size), dtype=np.bool_)
    for line in lines:
        if line.follows_speed:
            places = (line.place * spectra.speeds)[:, None]
            reach = 2 / spectra.segment_length + 2 * spectra.spreads[:, None] * places
        else:
            places, reach = np.array(line.place), np.array(2 / spectra.segment_length)
        is_free &= ~(np.abs(spectra.frequencies - places) <= reach)
    return is_free
