"""Frequency domain decomposition: peaks of the singular values of the spectra, and the bells around them (EFDD)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from scipy import special

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung.errors import ParameterError
from sprung.identification.settings import PreparationPlan
from sprung.modal import Modes, mac, unit_shapes
from sprung.recording import Channel, Recording
from sprung.signals.spectrum import SpectralMatrix


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules of finding bells and of fitting oscillators to them."""

    #: Fewest segments of the spectra ...
    min_segments: int = 15
    #: ... and over the number of channels.
    segments_per_channel: int = 2
    #: Least MAC with the peak of the first singular vectors of the lines of its bell.
    min_mac: float = 0.85
    #: Least share of a second singular vector that is of no neighbouring peak.
    min_own: float = 0.2
    #: Fewest lines of a bell.
    min_lines: int = 7
    #: Odd numbers of lines whose matrices are averaged: peaks that the first leaves within chance are of the second.
    smoothed: tuple[int, ...] = (3, 9)
    #: Probability of one peak by chance in a spectrum.
    chance: float = 1e-3
    #: Variance of a sum over lines of half-overlapping Hann segments, over that of independent lines: (1 + 1/18) x 2.
    overlap: float = 19 / 9
    #: Largest relative distance of a peak from a picked frequency.
    near: float = 0.05
    #: Share of the prominence above chance that a picked peak needs.
    picked_prominence: float = 0.25
    #: A bell ends where the spectrum is below this share of the peak: other modes rule its foot.
    foot: float = 0.03
    #: Largest amplification of noise by a filter that leaves the neighbouring modes out.
    max_amplified: float = 1.5
    #: Most steps of Fisher scoring.
    max_steps: int = 60
    #: Largest step of a logarithm.
    max_step: float = 0.5
    #: Improvement of the log likelihood that ends it.
    converged: float = 1e-7


_RULES = _Rules()
#: Times that a signal is differentiated after displacement; of an unknown quantity, the most likely number.
_DERIVATIVES = {"displacement": 0, "angle": 0, "strain": 0, "velocity": 1, "angular_velocity": 1, "acceleration": 2}


@dataclass(frozen=True, eq=False, slots=True)
class Bells:
    """Peaks of the first singular value, and the lines around them with the same shape.

    Parameters
    ----------
    peaks
        Line of each peak, shape (peaks,).
    first, last
        First and last line of each bell, shapes (peaks,).
    shapes
        First singular vector at each peak, channels scaled to a variance of 1, shape (peaks, channels).
    scale
        Factor of each channel that makes its variance 1, shape (channels,).
    """

    peaks: Indices
    first: Indices
    last: Indices
    shapes: Complex
    scale: Real

    def __post_init__(self) -> None:
        freeze(self, peaks=1, first=1, last=1, dtype=np.intp)
        freeze(self, shapes=2, dtype=np.complex128)
        freeze(self, scale=1)


def with_long_segments(
    plan: PreparationPlan, recording: Recording, *, total_duration: float, segment: float | None
) -> PreparationPlan:
    """Return the plan with segments of the spectra as long as the number of channels and the records allow.

    Parameters
    ----------
    plan
        Decisions on the preparation.
    recording
        First record.
    total_duration
        Duration of all records [s].
    segment
        Length of segments that is given [s]; None: chosen.

    Notes
    -----
    15 half-overlapping segments, or twice the number of channels: with fewer than channels, the matrix is singular.
    """
    n_segments = max(_RULES.min_segments, _RULES.segments_per_channel * len(plan.channels))
    longest = max(stretch.stop - stretch.start for stretch in recording.stretches()) / recording.sampling_rate
    chosen = segment or 2 * total_duration / (n_segments + 1)
    return replace(plan, spectrum_segment=min(chosen, longest / 2))


def find_bells(spectra: SpectralMatrix, *, band: tuple[float, float]) -> Bells:
    """Return the peaks of the singular values that rise higher than chance, with their bells.

    Parameters
    ----------
    spectra
        Spectral matrix of half-overlapping Hann-windowed segments.
    band
        Lowest and highest natural frequency [Hz].

    Returns
    -------
    Bells

    Notes
    -----
    The prominence of a peak, in ln of the first singular value of matrices averaged over three lines, is compared with
    the distance between quantiles of the logarithm of a chi-squared variable that all lines together exceed with a
    probability of 0.1 %. Its degrees of freedom are 2 x 3 x segments x 9/19, as windowed lines and overlapping segments
    repeat each other. Broad peaks that do not stand out so far are compared once more, averaged over nine lines.

    A mode beside a stronger one rules the second singular value, which peaks too where two modes are equally strong:
    a peak of it counts where a part of the second singular vector is outside of the shapes of the peaks on either side.
    The mode is at the peak of the spectrum of that part, two lines or more from theirs, and its shape is the product of
    the spectral matrix with it.

    References
    ----------
    R. Brincker, L. Zhang and P. Andersen (2001), Modal identification of output-only systems using frequency domain
    decomposition, Smart Materials and Structures 10, 441-445.
    """
    found: Bells | None = None
    for n_smoothed in _RULES.smoothed:
        values, vectors, scale = _decomposed(spectra, n_smoothed)
        fresh = _prominent(spectra, values[:, 0], n_smoothed, band)
        known = np.zeros(0, dtype=np.intp) if found is None else found.peaks
        fresh = fresh[_distance(fresh, known) > n_smoothed]
        bells = _bells(
            values[:, 0], vectors[:, :, :1], scale, fresh, vectors[fresh, :, 0], among=np.union1d(known, fresh)
        )
        found = bells if found is None else _joined(found, bells)
    assert found is not None
    n_smoothed = _RULES.smoothed[0]
    values, vectors, scale = _decomposed(spectra, n_smoothed)
    for peak in _prominent(spectra, values[:, 1], n_smoothed, band) if values.shape[1] > 1 else ():
        place, shape = _beside(found, int(peak), spectra, vectors, n_smoothed)
        if shape is not None:
            here = np.array([place])
            found = _joined(found, _bells(values[:, 0], vectors, scale, here, shape[None], among=here))
    return found


def _prominent(spectra: SpectralMatrix, values: Real, n_smoothed: int, band: tuple[float, float]) -> Indices:
    """Return the lines within the band at which singular values rise higher than chance."""
    from scipy import signal

    frequencies = spectra.frequencies
    peaks = signal.find_peaks(np.log(values), prominence=_chance(spectra, n_smoothed))[0]
    top = min(band[1], 0.8 * frequencies[-1])
    return np.asarray(peaks[(frequencies[peaks] >= band[0]) & (frequencies[peaks] <= top)], dtype=np.intp)


def _distance(peaks: Indices, known: Indices) -> Indices:
    """Return the number of lines from each peak to the nearest known one."""
    return np.asarray(np.abs(peaks[:, None] - known).min(axis=1, initial=np.iinfo(np.intp).max), dtype=np.intp)


def _joined(bells: Bells, others: Bells) -> Bells:
    """Return all bells by rising frequency."""
    order = np.argsort(np.concatenate([bells.peaks, others.peaks]))
    names = ("peaks", "first", "last", "shapes")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in (bells, others)])[order] for name in names
    }
    return replace(bells, **joined)


def _beside(
    bells: Bells, peak: int, spectra: SpectralMatrix, vectors: Complex, n_smoothed: int
) -> tuple[int, Complex | None]:
    """Return the line and shape of a mode beside stronger ones, from a peak of the second singular value; or None."""
    below, above = np.flatnonzero(bells.peaks < peak)[-1:], np.flatnonzero(bells.peaks > peak)[:1]
    neighbours = np.linalg.qr(bells.shapes[np.concatenate([below, above])].T)[0]
    own = vectors[peak, :, 1] - neighbours @ (neighbours.conj().T @ vectors[peak, :, 1])
    if np.linalg.norm(own) ** 2 < _RULES.min_own:
        return peak, None
    weights = own * bells.scale
    power = np.einsum("p,pqf,q->f", weights.conj(), spectra.matrix, weights, optimize=True).real
    power = scipy.ndimage.uniform_filter1d(power, n_smoothed, mode="nearest")
    start = -1
    while start != peak:
        start, low = peak, max(peak - n_smoothed, 1)
        peak = low + int(np.argmax(power[low : peak + n_smoothed + 1]))
    if _distance(np.array([peak]), bells.peaks)[0] <= n_smoothed // 2:
        return peak, None
    near = slice(peak - n_smoothed // 2, peak + n_smoothed // 2 + 1)
    shape = bells.scale * (spectra.matrix[:, :, near].mean(axis=2) @ weights)
    return peak, shape / np.linalg.norm(shape)


def _chance(spectra: SpectralMatrix, n_smoothed: int) -> float:
    """Return the prominence of ln of a singular value that chance hardly exceeds in a whole spectrum."""
    tail = _RULES.chance / len(spectra.frequencies)
    degrees = 2 * n_smoothed * spectra.n_segments / _RULES.overlap
    return float(np.log(special.chdtri(degrees, tail) / special.chdtri(degrees, 1 - tail)))


def bells_at(spectra: SpectralMatrix, frequencies: Sequence[float]) -> Bells:
    """Return the bells around the clear maxima of the first singular value nearest to given frequencies.

    Parameters
    ----------
    spectra
        Spectral matrix of half-overlapping Hann-windowed segments.
    frequencies
        Frequencies [Hz].

    Raises
    ------
    ParameterError
        If there is no clear maximum within 5 % or two lines of a frequency: none that rises a quarter as high as those
        of `find_bells`.
    """
    from scipy import signal

    values, vectors, scale = _decomposed(spectra, _RULES.smoothed[0])
    prominence = _RULES.picked_prominence * _chance(spectra, _RULES.smoothed[0])
    values, vectors = values[:, 0], vectors[:, :, :1]
    maxima = signal.find_peaks(np.log(values), prominence=prominence)[0]
    places, resolution = spectra.frequencies[maxima], spectra.frequencies[1]
    peaks = []
    for frequency in frequencies:
        near = np.abs(places - frequency) <= max(_RULES.near * frequency, 2 * resolution)
        if not near.any():
            nearest = places[np.argsort(np.abs(places - frequency))[:3]]
            named = ", ".join(f"{place:.4g}" for place in np.sort(nearest))
            raise ParameterError(
                f"no clear maximum of the first singular value near {frequency:.4g} Hz: the nearest are at {named}"
                " Hz, pick one of those"
            )
        peaks.append(maxima[near][np.argmax(values[maxima[near]])])
    chosen = np.unique(peaks)
    return _bells(values, vectors, scale, chosen, vectors[chosen, :, 0], among=chosen)


def _decomposed(spectra: SpectralMatrix, n_smoothed: int) -> tuple[Real, Complex, Real]:
    """Return singular values and vectors of scaled matrices, averaged over neighbouring lines, and the scale.

    Returns
    -------
    ndarray, ndarray, ndarray
        From the largest, shape (lines, channels); shape (lines, channels, singular values); shape (channels,).
    """
    variance = spectra.densities[:, 1:].sum(axis=1) * spectra.frequencies[1]
    scale = 1 / np.sqrt(np.maximum(variance, np.finfo(float).tiny))
    matrices = (spectra.matrix * np.outer(scale, scale)[:, :, None]).transpose(2, 0, 1)
    matrices[0] = matrices[1]
    smooth = scipy.ndimage.uniform_filter1d(matrices, n_smoothed, axis=0, mode="nearest")
    values, vectors = np.linalg.eigh(smooth)
    return np.maximum(values[:, ::-1], np.finfo(float).tiny), vectors[:, :, ::-1], scale


def _bells(values: Real, vectors: Complex, scale: Real, peaks: Indices, shapes: Complex, *, among: Indices) -> Bells:
    """Return the bells of peaks: lines where a vector has their shape, up to the lowest on the way to the next peak."""
    ranks = range(min(2, vectors.shape[2]))
    alike = np.any([mac(shapes, vectors[:, :, k]) >= _RULES.min_mac for k in ranks], axis=0)
    first, last = [], []
    for k, peak in enumerate(peaks):
        below, above = among[among < peak], among[among > peak]
        low = below[-1] + int(np.argmin(values[below[-1] : peak + 1])) if len(below) else 1
        high = peak + int(np.argmin(values[peak : above[0] + 1])) if len(above) else len(values) - 1
        outside = np.flatnonzero(~alike[k])
        least = _RULES.min_lines // 2
        start = max(low, int(outside[outside < peak].max(initial=0)) + 1)
        end = min(high, int(outside[outside > peak].min(initial=len(values))) - 1)
        first.append(max(min(start, peak - least), 1))
        last.append(min(max(end, peak + least), len(values) - 1))
    return Bells(peaks, np.array(first, dtype=np.intp), np.array(last, dtype=np.intp), shapes, scale)


def modes_of_bells(bells: Bells, spectra: SpectralMatrix, *, channels: Sequence[Channel]) -> Modes:
    """Fit the spectrum of one oscillator to each bell (EFDD).

    Parameters
    ----------
    bells
        Bells of `spectra`.
    spectra
        Spectral matrix of half-overlapping Hann-windowed segments.
    channels
        Channels of the spectra; their quantities give the form of the spectrum.

    Returns
    -------
    Modes
        Modes by rising frequency with standard deviations, without stable rates (NaN).

    Notes
    -----
    The spectrum of u^H y, with u the first singular vector of the peak (or where that amplifies noise by less than 1.5,
    the vector that also is orthogonal to those of its neighbours), is compared with that of an oscillator under white
    excitation, differentiated as the measured quantity is, plus a constant floor. Natural frequency, damping ratio,
    height and floor maximise the Whittle likelihood, by Fisher scoring, where the spectrum is above 3 % of the peak.
    The model passes through the window of the segments, as the transform of its correlation times that of the window: a
    bell no wider than the lines of the spectra is not read as damping. Standard deviations are those of the Fisher
    information times 19/9 for overlap. The usual way, the logarithmic decrement of the correlation of the cut bell, is
    biased by the cut and by the window.

    References
    ----------
    R. Brincker, C. Ventura and P. Andersen (2001), Damping estimation by frequency domain decomposition, Proceedings of
    the 19th International Modal Analysis Conference, 698-703.

    L. Zhang, T. Wang and Y. Tamura (2010), A frequency-spatial domain decomposition (FSDD) method for operational modal
    analysis, Mechanical Systems and Signal Processing 24, 1227-1239 (spectrum of u^H y).

    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953),
    125-139.
    """
    fits = [_fitted(bells, k, spectra, channels) for k in range(len(bells.peaks))]
    values = np.array(fits).reshape(-1, 4)
    frequency, damping = values[:, 0], values[:, 1]
    modes = Modes(
        poles=2 * np.pi * frequency * (1j * np.sqrt(1 - damping**2) - damping),
        mode_shapes=unit_shapes(bells.shapes / bells.scale),
        channels=spectra.names,
        natural_frequency_std=values[:, 2],
        damping_ratio_std=values[:, 3],
        stable_rate=np.full(len(values), np.nan),
        labels=(None,) * len(values),
    )
    return modes.take(np.argsort(frequency))


def _fitted(
    bells: Bells, number: int, spectra: SpectralMatrix, channels: Sequence[Channel]
) -> tuple[float, float, float, float]:
    """Return natural frequency, damping ratio and their standard deviations from one bell."""
    lines = np.arange(bells.first[number], bells.last[number] + 1)
    weights = _modal_filter(bells, number) * bells.scale
    power = np.einsum("p,pqf,q->f", weights.conj(), spectra.matrix[:, :, lines], weights, optimize=True).real
    kept = _without_foot(power, int(bells.peaks[number] - lines[0]))
    lines, power = lines[kept], power[kept]
    quantity = channels[int(np.argmax(np.abs(bells.shapes[number])))].quantity
    orders = [_DERIVATIVES[quantity]] if quantity in _DERIVATIVES else sorted(set(_DERIVATIVES.values()))
    fits = [_fitted_bell(spectra, lines, int(bells.peaks[number]), power, _Bell(spectra, lines, n)) for n in orders]
    parameters, information, _ = min(fits, key=lambda fit: fit[2])
    covariance = np.linalg.pinv(information) * _RULES.overlap
    frequency, damping = np.exp(parameters[:2])
    f_std, xi_std = np.exp(parameters[:2]) * np.sqrt(np.diag(covariance)[:2])
    return frequency, min(damping, 0.99), f_std, xi_std


def _modal_filter(bells: Bells, number: int) -> Complex:
    """Return the weights of the channels that keep one mode and, where shapes allow, none of its neighbours."""
    shape = bells.shapes[number]
    nearest = np.argsort(np.abs(bells.peaks - bells.peaks[number]), kind="stable")
    for n_kept in range(min(len(nearest), len(shape)), 1, -1):
        dual = np.linalg.pinv(bells.shapes[nearest[:n_kept]].T)[0].conj()
        if np.linalg.norm(dual) <= _RULES.max_amplified:
            return np.asarray(dual, dtype=np.complex128)
    return shape


def _without_foot(power: Real, peak: int) -> slice:
    """Return the lines of a bell up to the first on either side that is far below the peak."""
    low = np.flatnonzero(power < _RULES.foot * power[peak])
    least = _RULES.min_lines // 2
    first = int(low[low < peak].max(initial=-1)) + 1
    last = int(low[low > peak].min(initial=len(power))) - 1
    return slice(max(min(first, peak - least), 0), max(last, peak + least) + 1)


def _fitted_bell(
    spectra: SpectralMatrix, lines: Indices, peak: int, power: Real, bell: "_Bell"
) -> tuple[Real, Real, float]:
    """Return the parameters of one bell, the information on them and the misfit."""
    frequency = float(spectra.frequencies[peak])
    smallest = float(np.median(np.sort(power)[: max(len(power) // 5, 2)]))
    n_above = float(np.sum(power > 0.5 * power[np.flatnonzero(lines == peak)]))
    width = float(spectra.frequencies[1]) * max(n_above - 1.5, 0.5)
    start = np.log([frequency, width / (2 * frequency), 1.0, smallest / 3])
    start[2] = np.log(max(power.max() - smallest, 0.1 * power.max()) / bell.model(start, with_floor=False).max())
    return _most_likely(bell, power, start, spectra.n_segments)


class _Bell:
    """Spectrum of an oscillator at some lines, seen through the window of the segments."""

    def __init__(self, spectra: SpectralMatrix, lines: Indices, n_derivatives: int) -> None:
        from scipy import signal

        rate = 2 * spectra.frequencies[-1] if spectra.frequencies.size > 1 else 1.0
        n_samples = round(rate / spectra.frequencies[1])
        rate = n_samples * float(spectra.frequencies[1])
        window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_samples) / n_samples)
        overlap = signal.correlate(window, window, method="fft")[n_samples - 1 :] / np.sum(window**2)
        lags = np.arange(n_samples)
        self._times, self._n_derivatives = lags / rate, n_derivatives
        cosines = np.cos(2 * np.pi * np.outer(lines, lags) / n_samples)
        self._transform = cosines * overlap * np.where(lags > 0, 2, 1) / rate

    def model(self, parameters: Real, *, with_floor: bool = True) -> Real:
        """Return the spectrum for ln of frequency, damping ratio, height and floor."""
        frequency, damping, height, floor = np.exp(parameters)
        damping = min(damping, 0.99)
        omega = 2 * np.pi * frequency
        pole = complex(-damping, np.sqrt(1 - damping**2))
        start = (1 - 1j * damping / pole.imag) * (-(pole**2)) ** self._n_derivatives
        correlation = np.real(start * np.exp(pole * omega * self._times))
        spectrum = omega * damping * (self._transform @ correlation)
        if self._n_derivatives == 2:
            spectrum = spectrum + 4 * damping**2
        return np.asarray(height * np.maximum(spectrum, 1e-12) + (floor if with_floor else 0.0))

    def slopes(self, parameters: Real) -> Real:
        """Return the derivatives of ln of the model by the parameters, shape (4, lines)."""
        step = 1e-5
        moves = step * np.eye(len(parameters))
        return np.array(
            [np.log(self.model(parameters + move) / self.model(parameters - move)) / (2 * step) for move in moves]
        )


def _most_likely(bell: _Bell, power: Real, start: Real, n_segments: int) -> tuple[Real, Real, float]:
    """Return the parameters that maximise the Whittle likelihood, the information on them, and the misfit."""

    def misfit(parameters: Real) -> float:
        model = bell.model(parameters)
        return float(n_segments * np.sum(np.log(model) + power / model))

    parameters, value, damped = start, misfit(start), 1e-3
    for _ in range(_RULES.max_steps):
        slopes = bell.slopes(parameters)
        information = n_segments * slopes @ slopes.T
        gradient = n_segments * slopes @ (power / bell.model(parameters) - 1)
        ridge = damped * np.diag(np.diag(information)) + 1e-9 * np.eye(len(start))
        step = np.clip(np.linalg.solve(information + ridge, gradient), -_RULES.max_step, _RULES.max_step)
        attempt = misfit(parameters + step)
        if attempt > value:
            damped *= 10
            if damped > 1e8:
                break
            continue
        parameters, improvement, value, damped = parameters + step, value - attempt, attempt, max(damped / 10, 1e-9)
        if improvement < _RULES.converged:
            break
    slopes = bell.slopes(parameters)
    return parameters, n_segments * slopes @ slopes.T, value
