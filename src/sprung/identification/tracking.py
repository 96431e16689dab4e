"""Modes followed over windows or runs: which modes of different times are the same one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, permutations

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import check_each, check_number, freeze, settings_of
from sprung._display import Drawable, Savable, Tabular, counted, in_short, listed
from sprung.errors import DataError, ParameterError
from sprung.modal import Modes, join_modes, mac, unit_shapes


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules of tracking beside the settings."""

    #: Fewest windows for a scatter: two differences.
    min_for_scatter: int = 3
    #: Fewest windows for a trend: two degrees of freedom.
    min_for_trend: int = 4
    #: Standard deviations from the running median beyond which a value is an outlier.
    outlier: float = 4.0
    #: Neighbouring values of the running median: three on either side.
    neighbours: int = 7
    #: Largest correlation of neighbouring residuals that the deviation of a trend allows for.
    max_correlation: float = 0.9
    #: Longest absence of a mode in median distances of the windows, unless it is given: a day of half hours.
    gap: float = 48
    #: Cost above which a mode is not that of a track: four standard deviations.
    gate: float = 16.0
    #: Difference 1 - MAC that costs as much as one standard deviation.
    shape: float = 0.05
    #: Further cost of a track that is not yet confirmed, as established tracks choose first, and of a shape in the
    #: plane of those of two tracks whose half-power bands overlap, within which shapes turn: half the gate.
    doubtful: float = 8.0
    #: Relative distance at which bands overlap in any case.
    close: float = 0.005
    #: Modes whose shapes are the recent shape of a track, and windows on each side of a jump that are compared.
    recent: int = 10
    #: Largest standard deviation of an estimate over the reach.
    max_std: float = 0.25
    #: Share of the damping ratio in place of an unknown standard deviation.
    unknown_std: float = 0.2
    #: Fewest such pairs.
    min_pairs: int = 10
    #: Bounds of the scatter over the stated deviations.
    scatter_bounds: tuple[float, float] = (0.2, 5.0)
    #: Least MAC of shapes that are certainly of one mode, or in one plane.
    same_mac: float = 0.9
    #: How many times their scatter the frequencies of one mode may differ.
    same: float = 2.0
    #: Which share of the half-power half-bandwidth they may differ.
    same_bandwidth: float = 0.5
    #: Least MAC of the shapes on both sides of a jump.
    jump_mac: float = 0.8


_RULES = _Rules()
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
    min_mac
        Smallest MAC of a mode with the recent shape of its track, 0 to 1.
    gap
        Longest time for which a mode may be absent, in the unit of the times; None: 48 median distances of the windows.
    min_count, out_of
        A track is confirmed where it has `min_count` modes in `out_of` windows that follow each other; fewer where
        there are fewer windows.

    Raises
    ------
    ParameterError
        If a setting is out of range.
    """

    drift: float = 0.003
    reach: float = 0.1
    min_mac: float = 0.5
    gap: float | None = None
    min_count: int = 3
    out_of: int = 10

    def __post_init__(self) -> None:
        check_number("drift", self.drift, above=0, at_most=0.1)
        check_number("reach", self.reach, above=0, at_most=0.5)
        check_number("min_mac", self.min_mac, at_least=0, at_most=1)
        check_number("min_count", self.min_count, at_least=1)
        check_number("out_of", self.out_of, at_least=self.min_count)
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
    untracked_modes
        Tracks of too few modes, and second estimates of the modes of other tracks.
    settings
        Settings, with the longest absence filled in.
    """

    times: Real
    has_result: Booleans
    channels: tuple[str, ...]
    tracks: tuple[Track, ...]
    untracked_modes: tuple[Track, ...]
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
    shape: Complex = unit_shapes(_main_directions(mode_shapes / np.maximum(norms, np.finfo(float).tiny), 1))[0]
    return shape


def scatter(values: Real) -> float:
    """Return the standard deviation of values by time, from differences of neighbouring ones; NaN for fewer than three.

    Median of their absolute values over 0.6745 sqrt(2): neither a trend nor a jump or a single outlier counts.
    """
    if len(values) < _RULES.min_for_scatter:
        return float("nan")
    return float(np.median(np.abs(np.diff(values)))) / (MEDIAN_NORMAL * np.sqrt(2))


def _tracked(times: Real, values: Real, deviations: Real) -> TrackedValue:
    """Return the summary of values over time."""
    from scipy.ndimage import median_filter

    known = deviations[np.isfinite(deviations)]
    low, high = np.percentile(values, [2.5, 97.5])
    own = scatter(values)
    is_usual = np.ones(len(values), dtype=np.bool_)
    if len(values) >= _RULES.min_for_scatter:
        away = np.abs(values - median_filter(values, size=_RULES.neighbours, mode="nearest"))
        is_usual = away <= _RULES.outlier * own
    return TrackedValue(
        mean=float(np.mean(values[is_usual])),
        low=float(low),
        high=float(high),
        scatter=own,
        stated=float(np.median(known)) if len(known) else float("nan"),
        trend=_trend(times[is_usual], values[is_usual]) if is_usual.sum() >= _RULES.min_for_trend else None,
    )


def _trend(times: Real, values: Real) -> TrackTrend:
    """Return the line of least squares; its deviation allows for residuals that are alike in neighbouring windows."""
    lever = times - times.mean()
    squares = float(lever @ lever)
    slope = float(lever @ values) / squares
    residuals = values - values.mean() - slope * lever
    power = float(residuals @ residuals)
    alike = float(residuals[1:] @ residuals[:-1]) / power if power > 0 else 0.0
    alike = min(max(alike, 0.0), _RULES.max_correlation)
    variance = power / (len(values) - 2) / squares * (1 + alike) / (1 - alike)
    span = float(np.ptp(times))
    return TrackTrend(slope, float(np.sqrt(variance)), slope * span, float(np.sqrt(variance)) * span)


@dataclass(frozen=True, eq=False, slots=True)
class _Estimates:
    """Modes of all windows in a row, by rising number of the window.

    Parameters
    ----------
    modes
        The modes.
    windows, members
        Number of the window of each mode, and of the mode in it.
    times
        Time of the window of each mode.
    position, variance
        ln of the frequencies, and the variance of that.
    shapes
        Shapes of norm 1.
    """

    modes: Modes
    windows: Indices
    members: Indices
    times: Real
    position: Real
    variance: Real
    shapes: Complex


#: Numbers of the modes of a track in `_Estimates`, by time.
_Rows = list[int]


class _Tracker:
    """State of one track: ln frequency with its variance, damping and shape, as of the last mode."""

    def __init__(self, estimates: _Estimates, row: int) -> None:
        self._estimates = estimates
        self.rows = [row]
        self.position = float(estimates.position[row])
        self.variance = float(estimates.variance[row])

    @property
    def damping(self) -> float:
        """Median damping ratio of the last modes."""
        return float(np.median(self._estimates.modes.damping_ratio[self.rows[-_RULES.recent :]]))

    @property
    def recent(self) -> Complex:
        """Shapes of the last modes, shape (modes, channels)."""
        return self._estimates.shapes[self.rows[-_RULES.recent :]]

    @property
    def shape(self) -> Complex:
        """Main direction of the last shapes."""
        return self.recent[0] if len(self.rows) == 1 else _main_directions(self.recent, 1)[0]

    def update(self, row: int, predicted: float) -> None:
        """Take the next mode, given the variance predicted for its window."""
        gain = predicted / (predicted + self._estimates.variance[row])
        self.position += gain * float(self._estimates.position[row] - self.position)
        self.variance = (1 - gain) * predicted
        self.rows.append(row)


def _estimates(windows: Sequence[Modes | None], times: Real, settings: TrackingSettings) -> _Estimates:
    """Return the modes for comparisons, with variances as modes of one shape scatter between neighbouring windows."""
    parts = [part for part in windows if part]
    modes = join_modes(parts)
    numbers = np.repeat([k for k, part in enumerate(windows) if part], [len(part) for part in parts])
    frequency = modes.natural_frequency
    relative = modes.natural_frequency_std / frequency
    is_known = np.isfinite(relative) & (relative > 0)
    relative = np.where(is_known, relative, _RULES.unknown_std * np.abs(modes.damping_ratio))
    norms = np.linalg.norm(modes.mode_shapes, axis=1, keepdims=True)
    largest = _RULES.max_std * settings.reach
    estimates = _Estimates(
        modes=modes,
        windows=numbers,
        members=np.concatenate([np.arange(len(part)) for part in parts]),
        times=times[numbers],
        position=np.log(frequency),
        variance=np.minimum(relative, largest) ** 2,
        shapes=modes.mode_shapes / np.maximum(norms, np.finfo(float).tiny),
    )
    pairs = pairwise(_by_window(estimates))
    deviations = [z for before, after in pairs for z in _differences(estimates, before, after, settings)]
    if len(deviations) < _RULES.min_pairs:
        return estimates
    scale = float(np.clip(np.median(deviations) / MEDIAN_NORMAL, *_RULES.scatter_bounds))
    return replace(estimates, variance=np.minimum(scale**2 * estimates.variance, largest**2))


def _by_window(estimates: _Estimates) -> list[Indices]:
    """Return the numbers of the modes of each window with modes."""
    return np.split(np.arange(len(estimates.windows)), 1 + np.flatnonzero(np.diff(estimates.windows)))


def _differences(estimates: _Estimates, before: Indices, after: Indices, settings: TrackingSettings) -> list[float]:
    """Return the differences of modes that are nearest to each other and of one shape, in standard deviations."""
    distance = np.abs(estimates.position[before][:, None] - estimates.position[after])
    likeness = np.abs(np.conj(estimates.shapes[before]) @ estimates.shapes[after].T) ** 2
    cost = np.where(likeness >= _RULES.same_mac, distance, np.inf)
    rows, columns = np.arange(len(before)), np.argmin(cost, axis=1)
    is_mutual = (np.argmin(cost, axis=0)[columns] == rows) & (cost[rows, columns] <= settings.reach)
    rows, columns = rows[is_mutual], columns[is_mutual]
    variance = estimates.variance[before][rows] + estimates.variance[after][columns]
    return list((distance[rows, columns] / np.sqrt(variance)).tolist())


def _follow(estimates: _Estimates, gap: float, distance: float, settings: TrackingSettings) -> list[_Rows]:
    """Assign the modes of each window to tracks, and start tracks; `distance` of the windows sets the drift."""
    ended: list[_Tracker] = []
    alive: list[_Tracker] = []
    for part in _by_window(estimates):
        waits = [(estimates.times[part[0]] - estimates.times[tracker.rows[-1]]) / distance for tracker in alive]
        ended += [tracker for tracker, wait in zip(alive, waits, strict=True) if wait > gap / distance]
        alive = [tracker for tracker, wait in zip(alive, waits, strict=True) if wait <= gap / distance]
        waits = [wait for wait in waits if wait <= gap / distance]
        predicted = np.array([t.variance + settings.drift**2 * wait for t, wait in zip(alive, waits, strict=True)])
        predicted = np.minimum(predicted, (settings.reach / np.sqrt(_RULES.gate)) ** 2)
        taken = _assigned(_costs(alive, estimates, part, predicted, settings))
        for number, member in taken:
            alive[number].update(int(part[member]), float(predicted[number]))
        new = set(range(len(part))) - {member for _, member in taken}
        alive += [_Tracker(estimates, int(part[member])) for member in sorted(new)]
    return sorted(tracker.rows for tracker in (*ended, *alive))


def _costs(
    trackers: Sequence[_Tracker], estimates: _Estimates, part: Indices, predicted: Real, settings: TrackingSettings
) -> Real:
    """Return the cost of each mode for each track, infinite where it is not the same mode; shape (tracks, modes)."""
    if not trackers:
        return np.zeros((0, len(part)))
    positions, shapes = np.array([tracker.position for tracker in trackers]), estimates.shapes[part].T
    likeness = np.abs(np.conj(np.array([tracker.shape for tracker in trackers])) @ shapes) ** 2
    unlike = np.where(likeness >= settings.min_mac, (1 - likeness) / _RULES.shape, np.inf)
    is_established = np.array([len(tracker.rows) >= settings.min_count for tracker in trackers])
    dampings = np.array([tracker.damping for tracker in trackers])
    is_close = np.abs(positions[:, None] - positions) <= _RULES.close + dampings[:, None] + dampings
    is_close &= is_established & is_established[:, None]
    for row in np.flatnonzero(is_close.sum(axis=1) > 1).tolist():
        near = [shape for other in np.flatnonzero(is_close[row]).tolist() for shape in trackers[other].recent]
        in_plane = np.sum(np.abs(np.conj(_main_directions(near, 2)) @ shapes) ** 2, axis=0)
        turned = np.where(in_plane >= _RULES.same_mac, _RULES.doubtful + (1 - in_plane) / _RULES.shape, np.inf)
        unlike[row] = np.minimum(unlike[row], turned)
    variance = predicted[:, None] + estimates.variance[part]
    distance = (positions[:, None] - estimates.position[part]) ** 2
    cost = distance / variance + np.log1p(variance / settings.drift**2) + unlike
    cost += np.where(is_established, 0.0, _RULES.doubtful)[:, None]
    return np.where(cost <= _RULES.gate, cost, np.inf)


def _main_directions(shapes: Complex | Sequence[Complex], rank: int) -> Complex:
    """Return the orthonormal shapes that explain most of some shapes, shape (rank, channels) or fewer."""
    directions: Complex = np.linalg.svd(np.array(shapes), full_matrices=False)[2][:rank]
    return directions


def _assigned(costs: Real) -> list[tuple[int, int]]:
    """Return the pairs of least total cost, in which a track or mode without a partner costs half the gate."""
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(np.minimum(costs, _RULES.gate))
    return [
        (int(row), int(column)) for row, column in zip(rows, columns, strict=True) if costs[row, column] < _RULES.gate
    ]


def _united(tracks: Sequence[_Rows], estimates: _Estimates, gap: float) -> list[_Rows]:
    """Return the tracks, those of one frequency and shape united; what they have twice is left apart.

    A shape that turns between windows, as those of two nearly equal natural frequencies do, leaves one mode in several
    tracks whose mean shapes are alike.
    """
    whole: list[_Rows] = []
    left: list[_Rows] = []
    for rows in sorted(tracks, key=lambda rows: -len(rows)):
        same = next((k for k, others in enumerate(whole) if _is_same(others, rows, estimates, gap)), None)
        if same is None:
            whole.append(rows)
            continue
        is_taken = np.isin(estimates.windows[rows], estimates.windows[whole[same]])
        whole[same] = sorted([*whole[same], *np.array(rows)[~is_taken].tolist()])
        left += [[row] for row in np.array(rows)[is_taken].tolist()]
    return sorted([*whole, *left])


def _is_same(rows: _Rows, fewer: _Rows, estimates: _Estimates, gap: float) -> bool:
    """Whether a track of fewer modes is the same mode as another: near it in time and frequency, and of one shape."""
    positions, when, then = estimates.position[rows], estimates.times[rows], estimates.times[fewer]
    if len(rows) < _RULES.min_for_scatter:
        return False
    after = np.clip(np.searchsorted(when, then), 1, len(when) - 1)
    wait = np.min(np.minimum(np.abs(then - when[after]), np.abs(then - when[after - 1])))
    apart = abs(float(np.median(estimates.position[fewer] - np.interp(then, when, positions))))
    bandwidth = _RULES.same_bandwidth * float(np.median(estimates.modes.damping_ratio[fewer]))
    if wait > gap or apart > max(_RULES.same * scatter(positions), bandwidth):
        return False
    return _likeness(rows, fewer, estimates) >= _RULES.same_mac


def _likeness(rows: _Rows, others: _Rows, estimates: _Estimates) -> float:
    """Return the MAC of the mean shapes of two tracks."""
    one, other = (mean_shape(estimates.shapes[own]) for own in (rows, others))
    return float(mac(one[None], other[None])[0, 0])


def _continued(
    tracks: Sequence[_Rows], estimates: _Estimates, is_confirmed: Sequence[bool], gap: float, reach: float
) -> list[list[_Rows]]:
    """Return the parts of each track: confirmed ones that end are continued by confirmed ones that start later."""
    confirmed = np.flatnonzero(is_confirmed).tolist()
    costs = np.full((len(confirmed), len(confirmed)), np.inf)
    for row, column in permutations(range(len(confirmed)), 2):
        end, start = tracks[confirmed[row]][-_RULES.recent :], tracks[confirmed[column]][: _RULES.recent]
        wait = estimates.times[start[0]] - estimates.times[end[-1]]
        apart = abs(float(np.median(estimates.position[start])) - float(np.median(estimates.position[end])))
        if not 0 < wait <= gap or apart > reach:
            continue
        unlike = 1 - _likeness(start, end, estimates)
        if unlike <= 1 - _RULES.jump_mac:
            costs[row, column] = apart / reach + unlike / (1 - _RULES.jump_mac) + wait / gap
    successors = {confirmed[row]: confirmed[column] for row, column in _assigned(costs)}
    chains = []
    for head in sorted(set(range(len(tracks))) - set(successors.values())):
        numbers = [head]
        while numbers[-1] in successors:
            numbers.append(successors[numbers[-1]])
        chains.append([tracks[k] for k in numbers])
    return chains


def _is_confirmed(rows: _Rows, estimates: _Estimates, settings: TrackingSettings) -> bool:
    """Whether a track has enough modes in windows that follow each other, of those with results."""
    occurring, places = np.unique(estimates.windows, return_inverse=True)
    least = min(settings.min_count, len(occurring))
    own = places[rows]
    return bool(np.any(own[least - 1 :] - own[: len(own) - least + 1] < settings.out_of))


def track_modes(
    windows: Sequence[Modes | None],
    *,
    times: Sequence[float] | Real | None = None,
    settings: TrackingSettings | None = None,
) -> TrackedModes:
    """Follow modes over windows by frequency, shape and standard deviations, with births and deaths.

    Parameters
    ----------
    windows
        Modes of each window, of the same channels, in the order of time; None or no modes for a window without result.
    times
        Times of the windows, rising, in any unit; None: 0, 1, 2 ...
    settings
        Settings; None: the defaults.

    Returns
    -------
    TrackedModes

    Raises
    ------
    DataError
        If no window has a mode.
    ParameterError
        If the windows differ in channels, or `times` do not rise or are not one for each window.

    Notes
    -----
    A track keeps ln f with its variance (a random walk with the standard deviation `drift` per median distance of the
    windows, by a Kalman filter) and the main direction of its last ten shapes. In each window the modes are assigned
    to the tracks at once, with the least sum of

        d^2 / S + ln(1 + S / drift^2) + (1 - MAC) / 0.05,     S = variance of the track + variance of the mode,

    where d is the difference of ln f; a pair above 16 or below `min_mac` is not one. Crossing modes are distinguished
    by their shapes; in a veering, where shapes turn over many windows, each track stays on its branch. The shapes of
    two modes whose half-power bands overlap may turn within their common plane from window to window: such a shape is
    accepted at a cost of 8. Variances are those that the identifications state, scaled as modes of one shape scatter
    from window to window (robustly, over all modes), and at most that of a quarter of `reach`. A mode that fits no
    track starts one, which is confirmed by `min_count` of `out_of`.

    Tracks whose frequencies agree (within two standard deviations of their scatter, or half a half-power
    half-bandwidth) and whose mean shapes have a MAC of 0.9 are united: they are one mode.

    A jump is followed, not taken for a death and a birth: a confirmed track that ends is continued by a confirmed one
    that starts later, within `gap`, if their frequencies differ by at most `reach` and their shapes have a MAC of at
    least 0.8; these pairs, too, are assigned at once. A single outlier cannot move a track.

    References
    ----------
    Y. Bar-Shalom, X. R. Li and T. Kirubarajan (2001), Estimation with Applications to Tracking and Navigation, Wiley:
    gating by innovations and track confirmation by m of n. F. Magalhaes, A. Cunha and E. Caetano (2009), Online
    automatic identification of the modal parameters of a long span arch bridge, Mechanical Systems and Signal
    Processing 23, 316-329.

    Examples
    --------
    >>> from sprung.vehicles import chain
    >>> exact = [chain(stiffness=9800.0 * (1 - 0.01 * hour)).modes() for hour in range(10)]
    >>> unknown, rate = np.full(3, np.nan), np.ones(3)
    >>> windows = [Modes(m.poles, m.mode_shapes, m.channels, unknown, unknown, rate, m.labels) for m in exact]
    >>> tracked = track_modes(windows)
    >>> [len(track) for track in tracked.tracks]
    [10, 10, 10]
    >>> tracked.tracks[0].modes.natural_frequency[[0, -1]].round(2).tolist()
    [7.01, 6.69]
    """
    windows = list(check_each("windows", windows, Modes, type(None)))
    settings = settings_of(TrackingSettings, settings)
    instants = np.arange(float(len(windows))) if times is None else np.asarray(times, dtype=np.float64)
    if instants.shape != (len(windows),):
        raise ParameterError(f"{instants.size} times are given for {len(windows)} windows: give one for each")
    if not np.all(np.isfinite(instants)) or np.any(np.diff(instants) <= 0):
        raise ParameterError("times must rise from window to window: sort the windows, and leave out repeated ones")
    channels = _common_channels(windows)
    distance = float(np.median(np.diff(instants))) if len(instants) > 1 else 1.0
    settings = replace(settings, gap=_RULES.gap * distance if settings.gap is None else settings.gap)
    gap = float(settings.gap or 0.0)
    estimates = _estimates(windows, instants, settings)
    pieces = _united(_follow(estimates, gap, distance, settings), estimates, gap)
    confirmed = [_is_confirmed(rows, estimates, settings) for rows in pieces]
    tracks: dict[bool, list[Track]] = {True: [], False: []}
    for chain in _continued(pieces, estimates, confirmed, gap, settings.reach):
        rows = [row for part in chain for row in part]
        tracks[_is_confirmed(rows, estimates, settings)].append(_track(chain, estimates))
    for own in tracks.values():
        own.sort(key=lambda track: float(np.median(track.modes.natural_frequency)))
    return TrackedModes(
        times=instants,
        has_result=np.array([bool(modes) for modes in windows], dtype=np.bool_),
        channels=channels,
        tracks=tuple(tracks[True]),
        untracked_modes=tuple(tracks[False]),
        settings=settings,
    )


def _common_channels(windows: Sequence[Modes | None]) -> tuple[str, ...]:
    """Return the channels of all windows with modes."""
    layouts = {number: modes.channels for number, modes in enumerate(windows, start=1) if modes}
    if not layouts:
        raise DataError("no window has a mode, so there is none to follow: use longer windows, or other settings")
    channels = next(iter(layouts.values()))
    for number, own in layouts.items():
        if own != channels:
            raise ParameterError(
                f"window {number} has the channels {', '.join(own)}, but earlier ones have "
                f"{', '.join(channels)}: modes are compared by shape, select the same channels for all"
            )
    return channels


def _track(chain: Sequence[_Rows], estimates: _Estimates) -> Track:
    """Return the track of parts that continue each other."""
    rows = np.array([row for part in chain for row in part])
    numbers, modes = estimates.windows[rows], estimates.modes.take(rows)
    occurring = np.unique(estimates.windows)
    n_between = np.count_nonzero((occurring >= numbers[0]) & (occurring <= numbers[-1]))
    jumps = []
    for limit in np.cumsum([len(part) for part in chain])[:-1].tolist():
        sides = (slice(max(limit - _RULES.recent, 0), limit), slice(limit, limit + _RULES.recent))
        before, after = (float(np.median(modes.natural_frequency[side])) for side in sides)
        jumps.append(Jump(int(numbers[limit]), before, after))
    return Track(
        windows=numbers,
        members=estimates.members[rows],
        times=estimates.times[rows],
        modes=modes,
        jumps=tuple(jumps),
        presence=len(rows) / n_between,
    )
