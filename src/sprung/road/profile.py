"""Profile of the road under a fitted vehicle: the motion of the body, inverted."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung.errors import DataError
from sprung.likelihood import CornerFit, CornerSettings
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.fitting import FitSetup
from sprung.likelihood.lateral import LateralFit, lateral_layout
from sprung.likelihood.spectra import SLOWEST, ClassSpectra, between_updates
from sprung.likelihood.transfer import transfer
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
    """Heights of the left and the right track where the front axle drove, or the alignment of a track.

    Parameters
    ----------
    heights
        Heights without wavelengths that the vehicle does not feel [m], shape (2, points); the alignment, the lateral
        displacement of the centre line, has the shape (1, points).
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
        Density of the error of the heights over temporal frequency, shape (heights, speeds, frequencies) [m^2/Hz].
    frequencies, at_speeds
        Frequencies [Hz] and speeds [m/s] of that density.
    sensitivity
        Derivatives of the logarithm of the density of the heights with the vehicle's uncertain parameters, each times
        its standard deviation and independent of the others, at the median speed, (parameters, heights, frequencies).
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


def road_profile(windows: Sequence[Window], fit: CornerFit | LateralFit, track: Track) -> RoadProfile:
    """Return the profile of the road, or the alignment of the track, from drives of a fitted vehicle.

    Parameters
    ----------
    windows
        Windows of one vehicle, with its speed, in the order of time.
    fit
        Vehicle fitted to these windows: its vertical motion for heights, its lateral one for the alignment.
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
    inverse = LateralInverse(windows, fit) if isinstance(fit, LateralFit) else VerticalInverse(windows, fit)
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
    motion = window.filled.select(window.outputs)
    speed = filled(recording.samples[recording.index(window.speed or "")])
    is_known: Booleans = np.logical_and.reduce(np.isfinite(motion.samples))
    for stretch in recording.stretches():
        values = between_updates(speed[stretch], recording.sampling_rate)
        for run in runs_of(is_known[stretch]):
            first = stretch.start + run.start
            yield motion.part(first, stretch.start + run.stop), values[run], first / recording.sampling_rate


def _driven(windows: Sequence[Window]) -> tuple[float, float]:
    """Return the lowest and highest speed of windows while the vehicle is not too slow [m/s]."""
    speeds = np.concatenate(
        [window.recording.samples[window.recording.index(window.speed or "")] for window in windows]
    )
    fast = speeds[speeds > 0.9 * SLOWEST]  # NaN is not
    return (float(fast.min()), float(fast.max())) if fast.size else (SLOWEST, SLOWEST)


@dataclass(frozen=True, eq=False, slots=True)
class _Along:
    heights: Real
    is_valid: Booleans
    times: Real
    speeds: Real


class _Response(NamedTuple):
    """Spectra of a vehicle at several speeds: of motion, of heights with it, and densities of the heights.

    Shapes (speeds, grid, n, n), (speeds, grid, heights, n) and (heights, speeds, grid).
    """

    spectra: Complex
    crossed: Complex
    own: Real

    @property
    def weights(self) -> Complex:
        """Weights of the motion in the most likely heights, shape (speeds, grid, heights, n)."""
        S = self.spectra  # with the least error of the model
        error = SETTINGS.model_error**2 * np.einsum("cfii->cfi", S)[..., None] * np.eye(S.shape[-1])
        return np.asarray(self.crossed @ np.linalg.inv(S + error))


class Inverse(ABC):
    """Inverse of a fitted vehicle for a range of speeds.

    Parameters
    ----------
    windows
        Windows of the vehicle.
    fit
        Its fit.
    layout
        Coordinates of the motion.
    """

    def __init__(self, windows: Sequence[Window], fit: CornerFit | LateralFit, layout: RigidLayout) -> None:
        window = windows[0]
        rate = window.motion.sampling_rate
        self.settings = TRACK if window.vehicle.kind == "rail" else SETTINGS
        self._rate, self._layout = rate, layout
        self._n_piece = 2 * round(self.settings.piece * rate / 2)
        n_padded = 2 * self._n_piece
        frequencies = np.arange(1, n_padded // 2) * rate / n_padded
        highest = min(SETTINGS.highest * rate, SETTINGS.most)
        self._in_band = np.flatnonzero((frequencies >= self.settings.lowest) & (frequencies <= highest)) + 1
        self.frequencies: Real = self._in_band * rate / n_padded
        low, high = _driven(windows)
        n_speeds = 2 + int(np.log(high / low) / np.log(SETTINGS.speed_step))
        self.speeds: Real = np.geomspace(low, high, n_speeds)
        self._window, self._length = window, n_padded / rate
        self._parameters, self._covariance = fit.parameters, fit.covariance
        response = self._response(fit.parameters, self.speeds)
        explained = np.einsum("cfki,cfki->kcf", response.weights, response.crossed.conj()).real
        self._weights = response.weights[:, 1:-1]
        self.missing: Real = np.maximum(response.own - explained, 0.0)[:, :, 1:-1]

    @abstractmethod
    def _response(self, values: Real, speeds: Real) -> _Response:
        """Return the response of the vehicle with fitted parameters at given speeds, and its two neighbours'."""

    @abstractmethod
    def _of_vehicle(self) -> tuple[Indices, float]:
        """Return the rows of the vehicle's own parameters, and the factor of their standard deviations."""

    def _no_spectra(self, speeds: Real) -> ClassSpectra:
        """Return classes of given speeds without data."""
        size, n_speeds = len(self._layout.rows), speeds.size
        return ClassSpectra(
            frequencies=self.frequencies,
            counts=np.ones(n_speeds),
            speeds=speeds,
            spreads=np.full(n_speeds, (SETTINGS.speed_step - 1) / 2),
            matrices=np.broadcast_to(np.eye(size, dtype=np.complex128), (n_speeds, self.frequencies.size, size, size)),
            segment_length=self._length,
            weights=np.ones((n_speeds, self.frequencies.size)),
        )

    def sensitivity(self, speed: float) -> Real:
        """Return the derivatives of the logarithm of the heights' density with independent unit errors of the fit.

        The measured motion stays, and the weights follow the vehicle: d ln(W S W^H), by differences of one standard
        deviation along the principal axes of the covariance of the vehicle's parameters, times the factor of
        `_of_vehicle`.
        """
        rows, factor = self._of_vehicle()
        variances, axes = np.linalg.eigh(self._covariance[np.ix_(rows, rows)])
        speeds = np.array([speed])
        S = self._response(self._parameters, speeds).spectra

        def density(step: Real) -> Real:
            values = self._parameters.copy()
            values[rows] += step
            weights = self._response(values, speeds).weights
            return np.einsum("cfki,cfij,cfkj->kf", weights, S, weights.conj()).real[:, 1:-1]

        steps = axes * np.sqrt(np.maximum(variances, 0.0)) * factor
        return np.array([np.log(density(step) / density(-step)) / 2 for step in steps.T])

    def along(self, motion: Recording, speed: Real) -> _Along | None:
        """Return the heights along a stretch without a gap; None if it is too short or slow."""
        n_piece, hop = self._n_piece, self._n_piece // 2
        n_pieces = (motion.n_samples - n_piece) // hop + 1
        if n_pieces < 2 or not np.any(speed > SLOWEST):
            return None
        taper = np.sqrt(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_piece) / n_piece))
        samples = self._layout.differenced(motion.select(list(self._layout.names)).samples, self._rate)
        n_heights = len(self.missing)
        heights = np.zeros((n_heights, n_pieces * hop + hop))
        order = self._layout.differentiator(self.frequencies, self._rate)
        for number in range(n_pieces):
            begin = number * hop
            values = samples[:, begin : begin + n_piece]
            values = (values - values.mean(axis=1, keepdims=True)) * taper
            spectrum = np.fft.rfft(values, 2 * n_piece)[:, self._in_band].T
            coordinates = (spectrum * order) @ self._layout.reduction.T
            mean = float(np.mean(speed[begin : begin + n_piece]))
            nearest = int(np.argmin(np.abs(np.log(self.speeds / max(mean, self.speeds[0])))))
            found = np.zeros((n_heights, n_piece + 1), dtype=np.complex128)
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


class VerticalInverse(Inverse):
    """Inverse to the heights of the left and the right track under the front wheels; parameters as for `Inverse`."""

    def __init__(self, windows: Sequence[Window], fit: CornerFit) -> None:
        self._fit = fit
        super().__init__(windows, fit, fit.model.layout)

    def _response(self, values: Real, speeds: Real) -> _Response:
        fit, vehicle = self._fit, self._window.vehicle
        kind: Kind = "rail" if vehicle.kind == "rail" else "road"
        model = FitSetup(vehicle, fit.model.structure, self._layout, CornerSettings(), kind).model(
            self._no_spectra(speeds)
        )
        known = dict(zip(fit.model.names, values, strict=True))
        parameters = np.array([0.0 if name.startswith("class_") else known.get(name, 0.0) for name in model.names])
        found = transfer(model.terms(parameters))
        own = np.einsum("cfkk->kcf", found.terms.inputs[:, :, :2, :2]).real
        return _Response(found.spectral_matrix, found.driven[:, :, :2], own)

    def _of_vehicle(self) -> tuple[Indices, float]:
        names = self._fit.model.names
        rows = np.array([row for row, name in enumerate(names) if not name.startswith("class_")])
        return rows, _birge_ratio(self._fit)


class LateralInverse(Inverse):
    """Inverse to the alignment of a track under the first wheelset; parameters as for `Inverse`."""

    def __init__(self, windows: Sequence[Window], fit: LateralFit) -> None:
        self._model, self._n = fit.model, len(fit.components)
        super().__init__(windows, fit, lateral_layout(fit.model.outputs))

    def _response(self, values: Real, speeds: Real) -> _Response:
        spectra, crossed, own = replace(self._model, spectra=self._no_spectra(speeds)).of_alignment(values)
        return _Response(spectra, crossed, own[None])

    def _of_vehicle(self) -> tuple[Indices, float]:
        return np.arange(self._n), 1.0


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
