"""Modes followed over windows or runs: which modes of different times are the same one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sprung._arrays import Booleans, Real
from sprung._checks import check_each
from sprung.errors import DataError, ParameterError
from sprung.identification.assignment import Members, estimates_of, follow, with_scatter
from sprung.identification.track_joining import JUMP_WINDOWS, continued, is_confirmed, united
from sprung.identification.tracks import Jump, Track, TrackedModes, TrackingSettings
from sprung.modal import Modes, join_modes

#: Longest absence of a mode in median distances of the windows, unless it is given.
_GAP = 48


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

    where d is the difference of ln f; a pair above 16 or below `least_mac` is not one. Crossing modes are distinguished
    by their shapes; in a veering, where shapes turn over many windows, each track stays on its branch. The shapes of
    two modes whose half-power bands overlap may turn within their common plane from window to window: such a shape is
    accepted at a cost of 8. Variances are those that the identifications state, scaled as modes of one shape scatter
    from window to window (robustly, over all modes), and at most that of a quarter of `reach`. A mode that fits no
    track starts one, which is confirmed by `least_count` of `out_of`.

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
    settings = settings or TrackingSettings()
    instants = np.arange(float(len(windows))) if times is None else np.asarray(times, dtype=np.float64)
    _check_times(instants, len(windows))
    channels = _common_channels(windows)
    distance = float(np.median(np.diff(instants))) if len(instants) > 1 else 1.0
    gap = _GAP * distance if settings.gap is None else settings.gap
    estimates = [None if modes is None or not len(modes) else estimates_of(modes, settings) for modes in windows]
    estimates = with_scatter(estimates, settings)
    trackers = follow(estimates, instants / distance, gap / distance, settings)
    has_result = np.array([part is not None for part in estimates], dtype=np.bool_)
    pieces = united(trackers, estimates, instants, gap)
    chains = continued(pieces, estimates, instants, has_result, gap=gap, settings=settings)
    tracks = [_track(chain, windows, instants, has_result) for chain in chains]
    is_mode = [is_confirmed([pair for part in chain for pair in part], has_result, settings) for chain in chains]
    return TrackedModes(
        times=instants,
        has_result=has_result,
        channels=channels,
        tracks=_by_frequency([track for track, yes in zip(tracks, is_mode, strict=True) if yes]),
        strays=_by_frequency([track for track, yes in zip(tracks, is_mode, strict=True) if not yes]),
        settings=replace(settings, gap=gap),
    )


def _check_times(times: Real, n_windows: int) -> None:
    """Reject times that are not one for each window, or do not rise."""
    if times.shape != (n_windows,):
        raise ParameterError(f"{times.size} times are given for {n_windows} windows: give one for each")
    if not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise ParameterError("times must rise from window to window: sort the windows, and leave out repeated ones")


def _common_channels(windows: Sequence[Modes | None]) -> tuple[str, ...]:
    """Return the channels of all windows with modes."""
    channels: tuple[str, ...] | None = None
    for number, modes in enumerate(windows, start=1):
        if modes is None or not len(modes):
            continue
        if channels is not None and modes.channels != channels:
            raise ParameterError(
                f"window {number} has the channels {', '.join(modes.channels)}, but earlier ones have "
                f"{', '.join(channels)}: modes are compared by shape, select the same channels for all"
            )
        channels = modes.channels
    if channels is None:
        raise DataError("no window has a mode, so there is none to follow: use longer windows, or other settings")
    return channels


def _track(chain: Sequence[Members], windows: Sequence[Modes | None], times: Real, has_result: Booleans) -> Track:
    """Return the track of parts that continue each other."""
    members = [pair for part in chain for pair in part]
    numbers = np.array([window for window, _ in members])
    modes = join_modes([part.take(np.array([member])) for window, member in members if (part := windows[window])])
    between = has_result[numbers[0] : numbers[-1] + 1]
    return Track(
        windows=numbers,
        members=np.array([member for _, member in members]),
        times=times[numbers],
        modes=modes,
        jumps=_jumps(chain, modes.natural_frequency),
        presence=len(members) / int(between.sum()),
    )


def _jumps(chain: Sequence[Members], frequency: Real) -> tuple[Jump, ...]:
    """Return the changes of frequency at the limits of the parts of a track."""
    limits = np.cumsum([len(part) for part in chain])[:-1]
    return tuple(
        Jump(
            window=part[0][0],
            before=float(np.median(frequency[max(limit - JUMP_WINDOWS, 0) : limit])),
            after=float(np.median(frequency[limit : limit + JUMP_WINDOWS])),
        )
        for limit, part in zip(limits, chain[1:], strict=True)
    )


def _by_frequency(tracks: Sequence[Track]) -> tuple[Track, ...]:
    return tuple(sorted(tracks, key=_median_frequency))


def _median_frequency(track: Track) -> float:
    return float(np.median(track.modes.natural_frequency))
