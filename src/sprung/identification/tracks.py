"""One mode over time, and all of them: values of a tracking."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import check_number, freeze
from sprung._display import Drawable, Savable, Tabular, counted, in_short, listed
from sprung.modal import Modes, mac, unit_shapes

#: Fewest windows for a scatter, and for a trend.
FEWEST_FOR_SCATTER, _FOR_TREND = 3, 4
#: Standard deviations from the running median of this many values beyond which a value is an outlier.
_OUTLIER, _NEIGHBOURS = 4.0, 7
#: Largest correlation of neighbouring residuals that the deviation of a trend allows for.
_MOST_CORRELATED = 0.9
#: Median of the absolute value of a standard normal number.
MEDIAN_NORMAL = 0.6745


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """Settings of `track_modes`.

    Parameters
    ----------
    drift
        Standard deviation of the relative change of a natural frequency from one window to the next, beyond that of
        its estimates, 0 to 0.1.
    reach
        Largest relative change of a natural frequency at once that is followed as a jump of the same mode, 0 to 0.5.
    least_mac
        Smallest MAC of a mode with the recent shape of its track, 0 to 1.
    gap
        Longest time for which a mode may be absent, in the unit of the times; None: 48 median distances of the windows.
    least_count, out_of
        A track is confirmed where it has `least_count` modes in `out_of` windows that follow each other; fewer where
        there are fewer windows.

    Raises
    ------
    ParameterError
        If a setting is out of range.
    """

    drift: float = 0.003
    reach: float = 0.1
    least_mac: float = 0.5
    gap: float | None = None
    least_count: int = 3
    out_of: int = 10

    def __post_init__(self) -> None:
        check_number("drift", self.drift, above=0, at_most=0.1)
        check_number("reach", self.reach, above=0, at_most=0.5)
        check_number("least_mac", self.least_mac, at_least=0, at_most=1)
        check_number("least_count", self.least_count, at_least=1)
        check_number("out_of", self.out_of, at_least=self.least_count)
        if self.gap is not None:
            check_number("gap", self.gap, above=0)


@dataclass(frozen=True, slots=True)
class Jump:
    """Sudden change of a mode's natural frequency between two windows.

    Parameters
    ----------
    window
        Number of the first window after the change.
    before, after
        Natural frequencies on either side of it [Hz]: medians of up to ten windows.
    """

    window: int
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class TrackTrend:
    """Straight line through the values of a track over time.

    Parameters
    ----------
    slope, slope_std
        Change per unit of time, and its standard deviation from the scatter of the values about the line.
    change, change_std
        Change from the first to the last window of the track, and its standard deviation.
    """

    slope: float
    slope_std: float
    change: float
    change_std: float


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """One mode over time.

    Parameters
    ----------
    windows
        Numbers of the windows that have the mode, rising, shape (members,).
    members
        Index of the mode among those of each such window, shape (members,).
    times
        Times of these windows, shape (members,).
    modes
        The modes by time.
    jumps
        Sudden changes of the natural frequency that were followed.
    presence
        Share of the windows with results, from the first to the last of the track, that have the mode, 0 to 1.
    """

    windows: Indices
    members: Indices
    times: Real
    modes: Modes
    jumps: tuple[Jump, ...]
    presence: float

    def __post_init__(self) -> None:
        freeze(self, windows=1, dtype=np.intp)
        freeze(self, members=1, dtype=np.intp)
        freeze(self, times=1)

    def __len__(self) -> int:
        return len(self.windows)

    def __repr__(self) -> str:
        """Return mean and range of the frequency, and the number of windows."""
        value, label = self.natural_frequency, f" {self.label}" if self.label else ""
        mean = f"{value.mean:.4g} Hz{label}, 95 % of windows {value.low:.4g} to {value.high:.4g} Hz"
        return in_short(f"Track: {mean}; {counted(len(self), 'window')}, {counted(len(self.jumps), 'jump')}")

    @property
    def label(self) -> str | None:
        """Most frequent label of the modes."""
        labels = [label for label in self.modes.labels if label is not None]
        return max(sorted(set(labels)), key=labels.count) if 2 * len(labels) > len(self) else None

    @property
    def mode_shape(self) -> Complex:
        """Mean mode shape, 1 at its largest channel: first singular vector of all shapes; shape (channels,)."""
        return mean_shape(self.modes.mode_shapes)

    @property
    def likeness(self) -> Real:
        """MAC of each mode with the mean mode shape, shape (members,)."""
        return mac(self.modes.mode_shapes, self.mode_shape[None])[:, 0]

    @property
    def natural_frequency(self) -> "TrackedValue":
        """Natural frequency over time [Hz]."""
        return _tracked(self.times, self.modes.natural_frequency, self.modes.natural_frequency_std)

    @property
    def damping_ratio(self) -> "TrackedValue":
        """Damping ratio over time."""
        return _tracked(self.times, self.modes.damping_ratio, self.modes.damping_ratio_std)


@dataclass(frozen=True, slots=True)
class TrackedValue:
    """Natural frequency or damping ratio of a track over time.

    Parameters
    ----------
    mean
        Mean over the windows, without values that are more than 4 times the scatter off the median of their neighbours.
    low, high
        Range of 95 % of the values: 2.5 and 97.5 % quantiles.
    scatter
        Standard deviation from window to window, of differences of neighbouring values, so that trends and jumps do not
        count: median of their absolute values over 0.6745 sqrt(2). NaN with fewer than three windows.
    stated
        Median of the standard deviations that the identifications state; NaN where none is known.
    trend
        Straight line; None with fewer than four windows.
    """

    mean: float
    low: float
    high: float
    scatter: float
    stated: float
    trend: TrackTrend | None


@dataclass(frozen=True, eq=False, slots=True)
class TrackedModes(Tabular, Savable, Drawable):
    """Modes followed over windows.

    Parameters
    ----------
    times
        Times of all windows, rising, shape (windows,).
    has_result
        Which windows have modes, shape (windows,).
    channels
        Names of the channels of the mode shapes.
    tracks
        Confirmed tracks by rising natural frequency.
    strays
        Tracks of too few modes, and second estimates of the modes of other tracks.
    settings
        Settings, with the longest absence filled in.
    """

    times: Real
    has_result: Booleans
    channels: tuple[str, ...]
    tracks: tuple[Track, ...]
    strays: tuple[Track, ...]
    settings: TrackingSettings

    def __post_init__(self) -> None:
        freeze(self, times=1)
        freeze(self, has_result=1, dtype=np.bool_)

    def __repr__(self) -> str:
        """Return the numbers of tracks and windows, and the mean frequencies."""
        windows = f"{counted(len(self.times), 'window')}, {int(self.has_result.sum())} of them with modes"
        means = (
            f"{track.natural_frequency.mean:.4g} Hz{f' {track.label}' if track.label else ''} ({len(track)})"
            for track in self.tracks
        )
        return in_short(f"TrackedModes: {counted(len(self.tracks), 'track')} over {windows}", listed(means))

    @property
    def has_times(self) -> bool:
        """Whether the times of the windows are more than their numbers from 0."""
        return not np.array_equal(self.times, np.arange(len(self.times)))


def mean_shape(mode_shapes: Complex) -> Complex:
    """Return the mean of mode shapes of any phase and scale, 1 at its largest channel: first right singular vector."""
    norms = np.linalg.norm(mode_shapes, axis=1, keepdims=True)
    directions = np.linalg.svd(mode_shapes / np.maximum(norms, np.finfo(float).tiny), full_matrices=False)[2]
    shape: Complex = unit_shapes(directions[:1])[0]
    return shape


def scatter(values: Real) -> float:
    """Return the standard deviation of values by time, from differences of neighbouring ones; NaN for fewer than three.

    Median of their absolute values over 0.6745 sqrt(2): neither a trend nor a jump or a single outlier counts.
    """
    if len(values) < FEWEST_FOR_SCATTER:
        return float("nan")
    return float(np.median(np.abs(np.diff(values)))) / (MEDIAN_NORMAL * np.sqrt(2))


def _tracked(times: Real, values: Real, deviations: Real) -> TrackedValue:
    """Return the summary of values over time."""
    known = deviations[np.isfinite(deviations)]
    low, high = np.percentile(values, [2.5, 97.5])
    own = scatter(values)
    is_usual = np.ones(len(values), dtype=np.bool_)
    if len(values) >= FEWEST_FOR_SCATTER:
        away = np.abs(values - median_filter(values, size=_NEIGHBOURS, mode="nearest"))
        is_usual = away <= _OUTLIER * own
    return TrackedValue(
        mean=float(np.mean(values[is_usual])),
        low=float(low),
        high=float(high),
        scatter=own,
        stated=float(np.median(known)) if len(known) else float("nan"),
        trend=_trend(times[is_usual], values[is_usual]) if is_usual.sum() >= _FOR_TREND else None,
    )


def _trend(times: Real, values: Real) -> TrackTrend:
    """Return the line of least squares; its deviation allows for residuals that are alike in neighbouring windows."""
    lever = times - times.mean()
    squares = float(lever @ lever)
    slope = float(lever @ values) / squares
    residuals = values - values.mean() - slope * lever
    power = float(residuals @ residuals)
    alike = float(residuals[1:] @ residuals[:-1]) / power if power > 0 else 0.0
    alike = min(max(alike, 0.0), _MOST_CORRELATED)
    variance = power / (len(values) - 2) / squares * (1 + alike) / (1 - alike)
    span = float(np.ptp(times))
    return TrackTrend(slope, float(np.sqrt(variance)), slope * span, float(np.sqrt(variance)) * span)
