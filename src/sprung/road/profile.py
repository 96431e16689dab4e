"""Profile of the road under a fitted vehicle: the motion of the body, inverted."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sprung._arrays import Booleans, Complex, Real
from sprung._checks import freeze
from sprung.errors import DataError
from sprung.likelihood import CornerFit, CornerSettings
from sprung.likelihood.fitting import FitSetup
from sprung.likelihood.spectra import SLOWEST, ClassSpectra, between_updates
from sprung.likelihood.transfer import Transfer, transfer
from sprung.likelihood.vehicle import Kind
from sprung.recording import Recording
from sprung.road.tracks import Track, filled, runs_of
from sprung.vehicles.window import Window


@dataclass(frozen=True, slots=True)
class ProfileSettings:
    """Settings of the inversion."""

    #: Length of a piece that is inverted at one speed [s]; pieces overlap by half.
    piece: float = 8.0
    #: Lowest frequency [Hz], and highest over the sampling rate.
    lowest: float = 0.25
    highest: float = 0.4
    #: Highest frequency that matters [Hz].
    most: float = 40.0
    #: Ratio of the speeds for which the inverse is computed.
    speed_step: float = 1.03
    #: Relative error of the model's spectra, as noise: what the fit leaves unexplained at best.
    model_error: float = 0.02
    #: Distance between the points of the profile [m], and that from which on two points have a gap between them.
    spacing: float = 0.05
    jump: float = 1.0


@dataclass(frozen=True, slots=True)
class TrackSettings(ProfileSettings):
    """Settings of the inversion on tracks, whose level counts up to wavelengths of 70 m."""

    piece: float = 24.0
    lowest: float = 0.1


SETTINGS, TRACK = ProfileSettings(), TrackSettings()


@dataclass(frozen=True, eq=False, slots=True)
class RoadProfile:
    """Heights of the left and the right track where the front axle drove.

    Parameters
    ----------
    heights
        Heights without wavelengths that the vehicle does not feel [m], shape (2, points).
    is_valid
        Whether the vehicle was fast enough, shape (points,).
    times
        Time at which the front axle was there, in s from the start of the first recording, shape (points,).
    distances
        Distance from the start of the first recording by the speed, gaps included [m], shape (points,); it jumps where
        a part of the way has no heights.
    speeds
        Speed there [m/s], shape (points,).
    missing_density
        Density of the error of the heights over temporal frequency, shape (2, speeds, frequencies) [m^2/Hz].
    frequencies, at_speeds
        Frequencies [Hz] and speeds [m/s] of that density.
    sensitivity
        Derivatives of the logarithm of the density of the heights with the vehicle's uncertain parameters, each times
        its standard deviation and independent of the others, at the median speed, shape (parameters, 2, frequencies).
    """

    heights: Real
    is_valid: Booleans
    times: Real
    distances: Real
    speeds: Real
    missing_density: Real
    frequencies: Real
    at_speeds: Real
    sensitivity: Real

    def __post_init__(self) -> None:
        freeze(self, times=1, distances=1, speeds=1, frequencies=1, at_speeds=1)
        freeze(self, heights=2, missing_density=3, sensitivity=3)
        freeze(self, is_valid=1, dtype=np.bool_)

    @property
    def spacing(self) -> float:
        """Distance between points [m]."""
        return SETTINGS.spacing

    def blocks(self) -> list[slice]:
        """Return the ranges of points without a gap between them."""
        jumps = 1 + np.flatnonzero(np.diff(self.distances) > SETTINGS.jump)
        edges = [0, *jumps.tolist(), self.distances.size]
        return [slice(first, last) for first, last in pairwise(edges)]


def road_profile(windows: Sequence[Window], fit: CornerFit, track: Track) -> RoadProfile:
    """Return the profile of the road from drives of a fitted vehicle.

    Parameters
    ----------
    windows
        Windows of one vehicle, with its speed, in the order of time.
    fit
        Vehicle fitted to these windows.
    track
        Where the vehicle was during the windows, by `track_of`.

    Raises
    ------
    DataError
        If the speed was not recorded, or no stretch is fast and long enough.

    Notes
    -----
    In pieces of 8 s (on a track 24 s) the motions y of the body and the heights u under the front wheels are jointly
    Gaussian: with the fitted response H, spectrum S_u of the inputs of all wheels (rear ones delayed) and noise N, the
    most likely heights are S_u H^H (H S_u H^H + N)^-1 y at each frequency (Wiener), and
    S_u - S_u H^H (...)^-1 H S_u is the density of their error. Pieces are tapered by the root of a Hann window before
    and after, and added. The error is taken as 2 % of the motion at least.

    References
    ----------
    N. Wiener, Extrapolation, Interpolation, and Smoothing of Stationary Time Series, MIT Press, 1949.
    """
    inverse = Inverse(windows[0], fit)
    heights, is_valid, times, speeds = [], [], [], []
    clock = 0.0
    for window in windows:
        for motion, speed, start in _stretches(window):
            found = inverse.along(motion, speed)
            if found is not None:
                heights.append(found.heights)
                is_valid.append(found.is_valid)
                times.append(found.times + clock + start)
                speeds.append(found.speeds)
        clock += window.recording.duration
    if not heights:
        raise DataError(
            f"no stretch is {inverse.settings.piece:g} s long at more than {SLOWEST:g} m/s: give a longer drive"
        )
    when = np.concatenate(times)
    return RoadProfile(
        np.concatenate(heights, axis=1),
        np.concatenate(is_valid),
        when,
        np.interp(when, track.times, track.distances),
        np.concatenate(speeds),
        inverse.missing,
        inverse.frequencies,
        inverse.speeds,
        inverse.sensitivity(float(np.median(np.concatenate(speeds)))),
    )


def _stretches(window: Window) -> Iterator[tuple[Recording, Real, float]]:
    """Yield the motion and the speed of each stretch without a gap or a missing value, and its start [s]."""
    recording = window.recording
    motion = recording.select(window.outputs)
    speed = filled(recording.samples[recording.index(window.speed or "")])
    is_known: Booleans = np.logical_and.reduce(np.isfinite(motion.samples))
    for stretch in recording.stretches():
        values = between_updates(speed[stretch], recording.sampling_rate)
        for run in runs_of(is_known[stretch]):
            first = stretch.start + run.start
            yield motion.part(first, stretch.start + run.stop), values[run], first / recording.sampling_rate


@dataclass(frozen=True, eq=False, slots=True)
class _Along:
    heights: Real
    is_valid: Booleans
    times: Real
    speeds: Real


class Inverse:
    """Inverse of a fitted vehicle for a range of speeds.

    Parameters
    ----------
    window
        Window of the vehicle.
    fit
        Its fit.
    """

    def __init__(self, window: Window, fit: CornerFit) -> None:
        rate = window.motion.sampling_rate
        self.settings = TRACK if window.vehicle.kind == "rail" else SETTINGS
        self._rate, self._layout = rate, fit.model.layout
        self._n_piece = 2 * round(self.settings.piece * rate / 2)
        n_padded = 2 * self._n_piece
        frequencies = np.arange(1, n_padded // 2) * rate / n_padded
        highest = min(SETTINGS.highest * rate, SETTINGS.most)
        self._in_band = np.flatnonzero((frequencies >= self.settings.lowest) & (frequencies <= highest)) + 1
        self.frequencies: Real = self._in_band * rate / n_padded
        low, high = 0.9 * SLOWEST, 70.0
        n_speeds = 1 + int(np.log(high / low) / np.log(SETTINGS.speed_step))
        self.speeds: Real = np.geomspace(low, high, n_speeds)
        self._fit, self._window, self._length = fit, window, n_padded / rate
        response = self._response(fit.parameters, self.speeds)
        of_front = response.driven[:, :, :2]
        weights = of_front @ np.linalg.inv(self._spectra(response))
        explained = np.einsum("cfki,cfki->kcf", weights, of_front.conj()).real
        own = np.einsum("cfkk->kcf", response.terms.inputs[:, :, :2, :2]).real
        self._weights = weights[:, 1:-1]
        self.missing: Real = np.maximum(own - explained, 0.0)[:, :, 1:-1]

    def _response(self, values: Real, speeds: Real) -> Transfer:
        """Return the response of the vehicle with fitted parameters at given speeds, and its two neighbours'."""
        fit = self._fit
        vehicle = self._window.vehicle
        kind: Kind = "rail" if vehicle.kind == "rail" else "road"
        setup = FitSetup(vehicle, fit.model.structure, self._layout, CornerSettings(), kind)
        size, n_speeds = len(self._layout.rows), speeds.size
        spectra = ClassSpectra(
            frequencies=self.frequencies,
            counts=np.ones(n_speeds),
            speeds=speeds,
            spreads=np.full(n_speeds, (SETTINGS.speed_step - 1) / 2),
            matrices=np.broadcast_to(np.eye(size, dtype=np.complex128), (n_speeds, self.frequencies.size, size, size)),
            segment_length=self._length,
            weights=np.ones((n_speeds, self.frequencies.size)),
        )
        model = setup.model(spectra)
        known = dict(zip(fit.model.names, values, strict=True))
        parameters = np.array([0.0 if name.startswith("class_") else known.get(name, 0.0) for name in model.names])
        return transfer(model.terms(parameters))

    def _spectra(self, response: Transfer) -> Complex:
        """Return the spectra of the motion with the least error of the model, shape (speeds, frequencies, n, n)."""
        S = response.spectral_matrix
        return S + SETTINGS.model_error**2 * np.einsum("cfii->cfi", S)[..., None] * np.eye(S.shape[-1])

    def sensitivity(self, speed: float) -> Real:
        """Return the derivatives of the logarithm of the heights' density with independent unit errors of the fit.

        The measured motion stays, and the weights follow the vehicle: d ln(W S W^H), by differences of one standard
        deviation along the principal axes of the covariance of the vehicle's parameters, times `_birge_ratio`.
        """
        fit = self._fit
        rows = np.array([row for row, name in enumerate(fit.model.names) if not name.startswith("class_")])
        variances, axes = np.linalg.eigh(fit.covariance[np.ix_(rows, rows)])
        speeds = np.array([speed])
        S = self._spectra(self._response(fit.parameters, speeds))

        def density(step: Real) -> Real:
            values = fit.parameters.copy()
            values[rows] += step
            response = self._response(values, speeds)
            weights = response.driven[:, :, :2] @ np.linalg.inv(self._spectra(response))
            return np.einsum("cfki,cfij,cfkj->kf", weights, S, weights.conj()).real[:, 1:-1]

        steps = axes * np.sqrt(np.maximum(variances, 0.0)) * _birge_ratio(fit)
        return np.array([np.log(density(step) / density(-step)) / 2 for step in steps.T])

    def along(self, motion: Recording, speed: Real) -> _Along | None:
        """Return the heights along a stretch without a gap; None if it is too short or slow."""
        n_piece, hop = self._n_piece, self._n_piece // 2
        n_pieces = (motion.n_samples - n_piece) // hop + 1
        if n_pieces < 2 or not np.any(speed > SLOWEST):
            return None
        taper = np.sqrt(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_piece) / n_piece))
        samples = self._layout.differenced(motion.select(list(self._layout.names)).samples, self._rate)
        heights = np.zeros((2, n_pieces * hop + hop))
        order = self._layout.differentiator(self.frequencies, self._rate)
        for number in range(n_pieces):
            begin = number * hop
            values = samples[:, begin : begin + n_piece]
            values = (values - values.mean(axis=1, keepdims=True)) * taper
            spectrum = np.fft.rfft(values, 2 * n_piece)[:, self._in_band].T
            coordinates = (spectrum * order) @ self._layout.reduction.T
            mean = float(np.mean(speed[begin : begin + n_piece]))
            nearest = int(np.argmin(np.abs(np.log(self.speeds / max(mean, self.speeds[0])))))
            found = np.zeros((2, n_piece + 1), dtype=np.complex128)
            found[:, self._in_band] = np.einsum("fki,fi->kf", self._weights[nearest], coordinates)
            heights[:, begin : begin + n_piece] += np.fft.irfft(found, 2 * n_piece)[:, :n_piece] * taper
        inner = slice(hop, n_pieces * hop)  # where two pieces add up to one
        return self._over_distance(heights[:, inner], speed[inner], hop / self._rate)

    def _over_distance(self, heights: Real, speed: Real, start: float) -> _Along:
        """Return heights at equal distances."""
        from scipy.interpolate import CubicSpline

        travelled = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2) / self._rate])
        travelled += 1e-9 * np.arange(travelled.size)  # rises while the vehicle stands, too
        places = np.arange(0.0, travelled[-1], SETTINGS.spacing)
        times = np.interp(places, travelled, np.arange(travelled.size) / self._rate)
        speeds = np.interp(places, travelled, speed)
        along = CubicSpline(np.arange(heights.shape[1]) / self._rate, heights, axis=1)(times)
        return _Along(along, speeds > SLOWEST, times + start, speeds)


def _birge_ratio(fit: CornerFit) -> float:
    """Return by how much more than their standard deviations a fit moves masses, bars and tyres from the vehicle file.

    chi^2 of these numbers over the number that the drive determines, p - tr(V P) with covariance V and prior P; its
    root, at least 1, is the factor of standard deviations of data that disagree (R. T. Birge, The calculation of errors
    by the method of least squares, Physical Review 40 (1932) 207-227).
    """
    rows = fit.model.rows("payload", "unsprung", "elements")
    stds = fit.model.prior_std[rows]
    determined = np.sum(np.maximum(1 - np.diag(fit.covariance)[rows] / stds**2, 0.0))
    return float(np.sqrt(max(1.0, np.sum((fit.parameters[rows] / stds) ** 2) / max(determined, 1.0))))
