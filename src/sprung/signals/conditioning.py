"""Conditioning of recordings: scaling, trends, filters, decimation, missing values, equal distances, delays.

All functions work stretch by stretch: nothing is filtered, fitted or interpolated across a gap of a recording.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from sprung._arrays import Booleans, Real
from sprung._checks import check_complete, check_number
from sprung._display import counted
from sprung.errors import DataError, ParameterError
from sprung.recording import Recording, join
from sprung.signals.data_faults import equal_runs

#: Share of the new band that decimation passes unchanged (ripple below 0.01 %).
PASS_BAND = Fraction(4, 5)
#: Attenuation of everything that decimation would fold into the new band [dB], and shape of the Kaiser window for it.
STOP_BAND = 90.0
_KAISER = 0.1102 * (STOP_BAND - 8.7)
#: Largest numerator and denominator of a resampling ratio.
LARGEST_DENOMINATOR = 10_000
#: Speed below which a vehicle counts as standing [m/s], unless it is given.
SLOWEST = 3.0
#: Smallest number of samples of a moving part; shorter ones are not worth a spline.
FEWEST_MOVING_SAMPLES = 10


@dataclass(frozen=True, slots=True)
class Filling:
    """Which gaps of single channels are filled, and how."""

    #: Longest gap [s], and largest share of a stretch that such gaps may have.
    longest: float = 0.04
    share: float = 0.01
    #: Order of the autoregressive process.
    order: int = 30
    #: Power of white noise that is added to the signal's, over it: a process of no noise is singular.
    floor: float = 1e-6


FILLING = Filling()


def scale(recording: Recording, factors: float | Mapping[str, float]) -> Recording:
    """Multiply all channels, or the channels named in `factors`, by a constant.

    Parameters
    ----------
    recording
        Any recording.
    factors
        One factor for all channels, or factors by channel name; channels that are not named do not change.

    Returns
    -------
    Recording
        Recording with scaled samples.

    Raises
    ------
    ParameterError
        If a factor is not a finite number, or a channel does not exist.
    """
    named = dict(factors) if isinstance(factors, Mapping) else dict.fromkeys(recording.names, factors)
    gains = np.ones(len(recording.channels))
    for name, factor in named.items():
        gains[recording.index(name)] = check_number(f"factor of channel {name!r}: ", factor)
    return recording.changed(f"scaled by {factors}", samples=recording.samples * gains[:, None])


def detrend(recording: Recording, *, degree: int = 0) -> Recording:
    """Remove the mean or the least-squares line from each channel of each stretch.

    Parameters
    ----------
    recording
        Recording without missing values.
    degree
        Degree of the trend: 0 for the mean, 1 for the straight line.

    Returns
    -------
    Recording
        Recording without the trend.

    Raises
    ------
    DataError
        If a channel has missing values.
    ParameterError
        If `degree` is neither 0 nor 1.
    """
    if degree not in (0, 1):
        raise ParameterError(f"degree={degree} must be 0 (mean) or 1 (straight line)")
    check_complete(recording.names, recording.samples)
    samples = np.empty_like(recording.samples)
    for stretch in recording.stretches():
        samples[:, stretch] = _without_trend(recording.samples[:, stretch], degree)
    return recording.changed(f"{('mean', 'straight line')[degree]} of each stretch removed", samples=samples)


def band_pass(recording: Recording, low: float | None, high: float | None, *, order: int = 4) -> Recording:
    """Filter with a zero-phase Butterworth high-pass, low-pass or band-pass.

    Parameters
    ----------
    recording
        Recording without missing values.
    low, high
        Band edges [Hz], 0 < low < high < half the sampling rate; None leaves that side open.
    order
        Order of the Butterworth prototype, 1 to 12.

    Returns
    -------
    Recording
        Filtered recording. Stretches not longer than one period of the lower edge (and than the padding of the filter)
        are left out, which the history states.

    Raises
    ------
    ParameterError
        If the edges or the order are out of range.
    DataError
        If a channel has missing values, or every stretch is too short.

    Notes
    -----
    The filter runs forwards and backwards over second-order sections, so the phase is zero and the gain is the
    square of the Butterworth gain: one half (-6 dB) at each edge, and twice the order's slope beyond it. Ends
    are extended by odd reflection over the padding.
    """
    nyquist = recording.sampling_rate / 2
    edges = [check_number("band edge", edge, above=0) for edge in (low, high) if edge is not None]
    if not edges or edges != sorted(set(edges)) or edges[-1] >= nyquist:
        raise ParameterError(
            f"low={low}, high={high} must be 0 < low < high < {nyquist:g} Hz, half the sampling rate: "
            "give at least one of them"
        )
    check_number("order", order, at_least=1, at_most=12)
    check_complete(recording.names, recording.samples)
    from scipy import signal

    kind: Literal["bandpass", "lowpass", "highpass"]
    kind = "bandpass" if len(edges) == 2 else "lowpass" if low is None else "highpass"
    sections = signal.butter(
        order, edges if len(edges) == 2 else edges[0], kind, fs=recording.sampling_rate, output="sos"
    )
    padding = max(3 * (2 * len(sections) + 1), round(recording.sampling_rate / edges[0]))
    pieces = [
        (onset, signal.sosfiltfilt(sections, recording.samples[:, stretch], padlen=padding))
        for onset, stretch in _stretches_with_onset(recording)
        if stretch.stop - stretch.start > padding
    ]
    dropped = len(recording.gaps) + 1 - len(pieces)
    step = f"zero-phase Butterworth {kind} of order {order}, {' to '.join(f'{edge:g}' for edge in edges)} Hz"
    if dropped:
        step += f"; {counted(dropped, 'stretch', 'es')} of up to {padding} samples left out"
    return _join_pieces(recording, pieces, step=step, advice=f"stretches must exceed {padding} samples")


def decimate(recording: Recording, sampling_rate: float) -> Recording:
    """Lower the sampling rate, without aliases and without phase.

    Parameters
    ----------
    recording
        Recording without missing values.
    sampling_rate
        New sampling rate [Hz], not above the old one; any ratio.

    Returns
    -------
    Recording
        Recording at the new rate (as close to it as a ratio of two integers up to 10,000 comes). The first sample of
        each stretch keeps its time; an incomplete last sample of a stretch becomes part of the gap.

    Raises
    ------
    ParameterError
        If the new rate is above the old one, or not above 0.
    DataError
        If a channel has missing values, or every stretch is shorter than one new sample.

    Notes
    -----
    Linear-phase FIR filters (Kaiser windows) with the delay compensated, in two stages for ratios of 4 and more.
    The band 0 to 0.8 of the new Nyquist frequency passes with a ripple below 0.01 %; everything that would fold into
    the new band is attenuated by 90 dB. Ends are extended by odd reflection.

    References
    ----------
    J. F. Kaiser (1974), Nonrecursive digital filter design using the I0-sinh window function, Proceedings of the IEEE
    International Symposium on Circuits and Systems, 20-23.
    """
    old_rate = recording.sampling_rate
    check_number("sampling_rate", sampling_rate, above=0, at_most=old_rate, advice="decimation only lowers it")
    check_complete(recording.names, recording.samples)
    ratio = Fraction(sampling_rate / old_rate).limit_denominator(LARGEST_DENOMINATOR)
    if ratio == 0:
        raise ParameterError(
            f"sampling_rate={sampling_rate:g} must be at least {old_rate / LARGEST_DENOMINATOR:g} Hz, "
            f"{LARGEST_DENOMINATOR} times below the old rate: decimate in steps"
        )
    new_rate = old_rate * ratio.numerator / ratio.denominator
    stages = _stages(ratio)
    pieces = []
    for onset, stretch in _stretches_with_onset(recording):
        n_new = int((stretch.stop - stretch.start) * ratio)
        samples = recording.samples[:, stretch]
        for stage_ratio, taps in stages:
            samples = _resample(samples, stage_ratio, taps)
        pieces.append((onset, samples[:, :n_new]))
    return _join_pieces(
        recording,
        [(onset, samples) for onset, samples in pieces if samples.shape[1]],
        step=f"decimated from {old_rate:g} to {new_rate:g} Hz",
        sampling_rate=new_rate,
        advice="every stretch is shorter than one sample at the new rate",
    )


def without_missing(recording: Recording) -> Recording:
    """Turn the samples at which any channel is missing (NaN) or infinite into gaps.

    Parameters
    ----------
    recording
        Any recording.

    Returns
    -------
    Recording
        Recording without missing values.

    Raises
    ------
    DataError
        If no sample has a value in every channel.
    """
    is_complete = np.asarray(np.isfinite(recording.samples).all(axis=0))
    if is_complete.all():
        return recording
    pieces = [
        (onset + part.start / recording.sampling_rate, recording.samples[:, stretch][:, part])
        for onset, stretch in _stretches_with_onset(recording)
        for part in _runs(is_complete[stretch])
    ]
    step = f"{counted(int(np.count_nonzero(~is_complete)), 'sample')} with missing values turned into gaps"
    return _join_pieces(recording, pieces, step=step, advice="no sample has a value in every channel")


def with_short_gaps_filled(recording: Recording, channels: Sequence[str]) -> Recording:
    """Return a recording whose channels have values where a few samples in a row are missing (NaN) or infinite.

    Parameters
    ----------
    recording
        Any recording.
    channels
        Names of channels with random motion.

    Notes
    -----
    Each channel is taken for an autoregressive process, estimated from its own correlations. The missing samples are
    those of greatest likelihood given all others, which make the sum of the squared residuals least. Gaps of up to
    0.04 s are filled, where they are at most 1 % of a stretch: their error is less than the signal in that share of it.

    References
    ----------
    A. J. E. M. Janssen, R. N. J. Veldhuis and L. B. Vries, Adaptive interpolation of discrete-time signals that can be
    modeled as autoregressive processes, IEEE Transactions on Acoustics, Speech, and Signal Processing 34 (1986),
    317-330.
    """
    longest = int(FILLING.longest * recording.sampling_rate)
    samples, n_filled = recording.samples.copy(), 0
    for row, stretch in itertools.product(map(recording.index, channels), recording.stretches()):
        values, reach = samples[row, stretch], FILLING.order
        is_missing = ~np.isfinite(values)
        runs = [run for run in _runs(is_missing) if reach <= run.start and run.stop <= values.size - reach]
        runs = [run for run in runs if run.stop - run.start <= longest]
        if runs and sum(run.stop - run.start for run in runs) <= FILLING.share * values.size:
            predicted, n_filled = _predicted(values, is_missing), n_filled + len(runs)
            for run in runs:
                values[run] = predicted[run]
    return (
        recording.changed(f"{counted(n_filled, 'gap')} of channels filled", samples=samples) if n_filled else recording
    )


def _predicted(values: Real, is_missing: Booleans) -> Real:
    """Return values whose missing samples are those of least residuals of an autoregressive process."""
    from scipy.linalg import solve_toeplitz, solveh_banded

    order = FILLING.order
    mean = values[~is_missing].mean()
    known = np.where(is_missing, 0.0, values - mean)
    correlations = np.array([known[lag:] @ known[: known.size - lag] for lag in range(order + 1)])
    correlations[0] *= 1 + FILLING.floor
    filter_ = np.concatenate([[1.0], -solve_toeplitz(correlations[:-1], correlations[1:])])
    b = np.correlate(filter_, filter_, mode="full")
    places = np.flatnonzero(is_missing)
    bands = np.zeros((order + 1, places.size))
    for lag in range(min(order + 1, places.size)):
        distance = places[lag:] - places[: places.size - lag]
        bands[lag, : distance.size] = np.where(distance <= order, b[order + np.minimum(distance, order)], 0.0)
    values = np.array(values)
    values[is_missing] = mean - solveh_banded(bands, np.convolve(known, b, mode="same")[places], lower=True)
    return values


def distance_travelled(recording: Recording, speed: str) -> Real:
    """Return the distance since the first sample at each sample [m], from the channel named `speed` [m/s].

    By the trapezoidal rule; during a gap, the speed is taken as the mean of those on its two sides.
    """
    v = recording.samples[recording.index(speed)]
    steps = np.full(recording.n_samples - 1, 1 / recording.sampling_rate)
    for gap in recording.gaps:
        steps[gap.index - 1] += gap.duration
    return np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * steps)])


def moving_parts(recording: Recording, speed: str, *, minimum_speed: float) -> list[slice]:
    """Return the sample ranges, within stretches, of at least ten samples at or above `minimum_speed` [m/s].

    Raises
    ------
    ParameterError
        If the channel does not exist, or `minimum_speed` is not above 0.
    DataError
        If the speed has missing values.
    """
    check_number("minimum_speed", minimum_speed, above=0)
    check_complete(recording.names, recording.samples)
    is_moving = recording.samples[recording.index(speed)] >= minimum_speed
    return [
        slice(stretch.start + part.start, stretch.start + part.stop)
        for stretch in recording.stretches()
        for part in _runs(is_moving[stretch])
        if part.stop - part.start >= FEWEST_MOVING_SAMPLES
    ]


def while_moving(recording: Recording, speed: str, *, minimum_speed: float = SLOWEST) -> Recording:
    """Keep the parts at or above `minimum_speed` [m/s], from the channel named `speed`; the rest becomes gaps."""
    rate = recording.sampling_rate
    onsets = {stretch.start: onset for onset, stretch in _stretches_with_onset(recording)}
    pieces = []
    for part in moving_parts(recording, speed, minimum_speed=minimum_speed):
        first = max(start for start in onsets if start <= part.start)
        pieces.append((onsets[first] + (part.start - first) / rate, recording.samples[:, part]))
    return _join_pieces(
        recording,
        pieces,
        step=f"parts below {minimum_speed:g} m/s left out",
        advice=f"no part reaches {minimum_speed:g} m/s: lower minimum_speed",
    )


def over_distance(
    recording: Recording,
    speed: str,
    *,
    interval: float,
    minimum_speed: float = SLOWEST,
    channels: Sequence[str] | None = None,
) -> Recording:
    """Resample onto equal steps of distance, in which lines proportional to speed stand still.

    Parameters
    ----------
    recording
        Recording without missing values.
    speed
        Name of the channel with the speed [m/s].
    interval
        Distance between samples of the result [m].
    minimum_speed
        Speed below which parts are left out [m/s].
    channels
        Names of the channels of the result; None: all.

    Returns
    -------
    Recording
        Recording whose `sampling_rate` is in samples per metre, so that everything that is in Hz or seconds elsewhere
        is in cycles per metre or metres here, the durations of the gaps included. It has no start time.

    Raises
    ------
    ParameterError
        If the channel does not exist, or `interval` or `minimum_speed` is not above 0.
    DataError
        If a channel has missing values, or no part is fast enough.

    Notes
    -----
    Distance is the integral of speed (trapezoidal rule). A spline of degree 5 through the samples is evaluated at steps
    fine enough to avoid aliasing at the lowest speed of these parts, and the result is decimated to `interval`.

    References
    ----------
    M. Unser (1999), Splines: a perfect fit for signal and image processing, IEEE Signal Processing Magazine 16, 22-38.
    """
    check_number("interval", interval, above=0)
    parts = moving_parts(recording, speed, minimum_speed=minimum_speed)
    distance = distance_travelled(recording, speed)
    resampled = recording if channels is None else recording.select(channels)
    v = recording.samples[recording.index(speed)]
    slowest = min((float(v[part].min()) for part in parts), default=minimum_speed)
    oversampling = int(np.ceil(interval * recording.sampling_rate / slowest - 1e-9))
    pieces = []
    for part in parts:
        metres = distance[part]
        grid = np.arange(metres[0], metres[-1], interval / max(1, oversampling))
        places = np.interp(grid, metres, np.arange(metres.size))
        pieces.append((float(metres[0]), _spline_values(resampled.samples[:, part], places)))
    fine = _join_pieces(
        resampled,
        pieces,
        step=f"resampled every {interval:g} m of distance; parts below {minimum_speed:g} m/s left out",
        sampling_rate=max(1, oversampling) / interval,
        start=None,
        advice=f"no part reaches {minimum_speed:g} m/s: lower minimum_speed",
    )
    return decimate(fine, 1 / interval) if oversampling > 1 else fine


def _spline_values(samples: Real, places: Real) -> Real:
    """Return the values of the spline of degree 5 through samples, which goes on as their mirror image, at places."""
    from scipy import ndimage

    return np.array([ndimage.map_coordinates(row, places[None], order=5, mode="mirror") for row in samples])


def _stretches_with_onset(recording: Recording) -> list[tuple[float, slice]]:
    """Return each stretch with the time of its first sample after the recording's first [s]."""
    lost = np.concatenate([[0.0], np.cumsum([gap.duration for gap in recording.gaps])])
    return [
        (stretch.start / recording.sampling_rate + float(time), stretch)
        for stretch, time in zip(recording.stretches(), lost, strict=True)
    ]


def _join_pieces(
    recording: Recording, pieces: list[tuple[float, Real]], *, step: str, advice: str, **fields: Any
) -> Recording:
    """Return a recording of `pieces`, each with its onset after the old first sample, and gaps between them."""
    if not pieces:
        raise DataError(f"nothing is left of a recording of {recording.n_samples} samples: {advice}")
    rate = fields.get("sampling_rate", recording.sampling_rate)
    onsets = np.array([onset for onset, _ in pieces])
    lengths = np.array([samples.shape[1] for _, samples in pieces])
    waits = np.maximum(0.0, onsets[1:] - onsets[:-1] - lengths[:-1] / rate)
    parts = [replace(recording, samples=samples, sampling_rate=rate, gaps=()) for _, samples in pieces]
    whole = join(parts, waits=waits.tolist())
    if recording.start is not None:
        fields.setdefault("start", recording.start + round(onsets[0] * 1e9))
    return recording.changed(step, **{"samples": whole.samples, "gaps": whole.gaps, **fields})


def _runs(is_wanted: Booleans) -> list[slice]:
    """Return the ranges in which `is_wanted` holds throughout."""
    edges = np.flatnonzero(np.diff(is_wanted, prepend=False, append=False))
    return [slice(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


@lru_cache(maxsize=32)
def _stages(ratio: Fraction) -> list[tuple[Fraction, Real]]:
    """Return the stages of a resampling ratio with their filters: a coarse one first if that saves work."""
    if ratio == 1:
        return []
    whole = int(1 / ratio) // 2
    if whole < 2:
        return [(ratio, _low_pass(PASS_BAND * ratio / 2, ratio / 2, ratio))]
    coarse = Fraction(1, whole)
    rest = ratio / coarse
    # The coarse stage may fold into what lies outside the new band, which the fine stage removes.
    return [
        (coarse, _low_pass(PASS_BAND * ratio / 2, coarse - ratio / 2, coarse)),
        (rest, _low_pass(PASS_BAND * rest / 2, rest / 2, rest)),
    ]


def _low_pass(pass_edge: Fraction, stop_edge: Fraction, ratio: Fraction) -> Real:
    """Design the filter of one stage; edges in cycles per input sample, taps at `ratio.numerator` times its rate."""
    width = float(stop_edge - pass_edge) / ratio.numerator
    n_taps = int(np.ceil((STOP_BAND - 7.95) / (2.285 * 2 * np.pi * width))) | 1
    cutoff = float(pass_edge + stop_edge) / ratio.numerator
    taps = np.sinc(cutoff * (np.arange(n_taps) - n_taps // 2)) * np.kaiser(n_taps, _KAISER)
    return np.asarray(taps / taps.sum() * ratio.numerator, dtype=np.float64)


def _resample(samples: Real, ratio: Fraction, taps: Real) -> Real:
    """Filter and resample one stretch, so that the first new sample is at the first old one."""
    up, down = ratio.numerator, ratio.denominator
    padding = taps.size // 2 // up + 1
    extended = np.pad(samples, ((0, 0), (padding, padding)), mode="reflect", reflect_type="odd")
    n_new = -(-samples.shape[1] * up // down)
    resample = _resample_in_blocks if down <= 2 * padding else _resample_by_phases
    return resample(extended, ratio, taps, padding)[:, :n_new]


def _resample_in_blocks(extended: Real, ratio: Fraction, taps: Real, padding: int) -> Real:
    """Return at least the new samples of a padded stretch, as products of its blocks with one matrix of taps.

    Twice to three times the multiplications of `_resample_by_phases`, ten times as fast.
    """
    n_periods = max(1, padding // ratio.denominator)
    old, new = n_periods * ratio.denominator, n_periods * ratio.numerator
    places = taps.size // 2 + np.arange(new) * ratio.denominator
    places = places - np.arange(-padding, old + padding)[:, None] * ratio.numerator
    matrix = np.where((places >= 0) & (places < taps.size), taps[places.clip(0, taps.size - 1)], 0.0)
    n_channels, n_samples = extended.shape
    n_blocks = -(-(n_samples - 2 * padding) // old)
    whole = np.pad(extended, ((0, 0), (0, n_blocks * old + 2 * padding - n_samples)))
    blocks = np.lib.stride_tricks.sliding_window_view(whole, len(matrix), axis=1)[:, ::old]
    return np.asarray(np.ascontiguousarray(blocks) @ matrix, dtype=np.float64).reshape(n_channels, -1)


def _resample_by_phases(extended: Real, ratio: Fraction, taps: Real, padding: int) -> Real:
    """Return at least the new samples of a padded stretch, one by one: for ratios of large numbers."""
    from scipy.signal import upfirdn

    up, down = ratio.numerator, ratio.denominator
    delay = padding * up + taps.size // 2
    shifted = np.concatenate([np.zeros(-delay % down), taps])
    first = (delay + (-delay % down)) // down
    return np.asarray(upfirdn(shifted, extended, up, down)[:, first:], dtype=np.float64)


def _without_trend(samples: Real, degree: int) -> Real:
    """Remove the mean (degree 0) or the straight line of least squares (degree 1) from every channel."""
    centred = samples - samples.mean(axis=1, keepdims=True)
    if degree == 0:
        return centred
    time = np.arange(samples.shape[1]) - (samples.shape[1] - 1) / 2
    return np.asarray(centred - np.outer(centred @ time / max(time @ time, 1.0), time), dtype=np.float64)


#: Samples on each side that an interpolated one is computed from.
_REACH = 32
#: Shape of their Kaiser window: flat within 0.01 % up to 0.85 of half the sampling rate.
_TAPER = 8.0
#: Samples in a plateau, which stays one: clipped and stuck values remain recognisable.
_PLATEAU = 3
#: Part of a sample that counts as none.
_NONE = 1e-6


def advanced(values: Real, shift: float, *, breaks: Sequence[int] = ()) -> Real:
    """Return the samples of a channel at times later by `shift` samples; missing where nothing was recorded.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,); missing ones are NaN.
    shift
        Time by which the channel is late, in samples; negative: early.
    breaks
        Indices at which a new run begins, such as those of gaps.

    Returns
    -------
    ndarray
        Values x(k + shift), shape (samples,): NaN where k + shift lies outside the run of values around sample k.

    Notes
    -----
    Interpolation by a sinc with a Kaiser window of 64 samples, the ends of each run extended by odd reflection. Runs of
    three or more equal values are moved by whole samples, and nothing exceeds those at the limits of a clipped channel.

    References
    ----------
    J. F. Kaiser (1974), Nonrecursive digital filter design using the I0-sinh window function, Proceedings of the IEEE
    International Symposium on Circuits and Systems, 20-23.

    Examples
    --------
    >>> advanced(np.array([0.0, 1.0, 2.0, 4.0]), 2.0)
    array([ 2.,  4., nan, nan])
    """
    moved = _by_run(values, shift, breaks, _interpolated)
    starts, lengths = equal_runs(values, breaks=breaks)
    starts, lengths = starts[lengths >= _PLATEAU], lengths[lengths >= _PLATEAU]
    whole = round(shift)
    for start, length in zip(starts, lengths, strict=True):
        first, last = max(0, start - whole), max(0, start + length - whole)
        moved[first:last] = np.where(np.isnan(moved[first:last]), np.nan, values[start])
    return _within_limits(moved, values, values[starts])


def _within_limits(moved: Real, values: Real, plateaus: Real) -> Real:
    """Return moved samples not beyond the extreme values of a channel that has plateaus there."""
    if not plateaus.size:
        return moved
    low, high = np.nanmin(values), np.nanmax(values)
    return np.clip(moved, low if low in plateaus else -np.inf, high if high in plateaus else np.inf)


def advanced_linearly(values: Real, shift: float, *, breaks: Sequence[int] = ()) -> Real:
    """Return the samples of a slow channel, such as a speed, at times later by `shift` samples.

    Parameters
    ----------
    values, shift, breaks
        As for `advanced`.

    Notes
    -----
    Interpolation by straight lines: a constant stays exactly that.
    """
    return _by_run(values, shift, breaks, _on_lines)


def _by_run(values: Real, shift: float, breaks: Sequence[int], method: Callable[[Real, float], Real]) -> Real:
    """Return each run of values that are not missing moved by a method for fractions of a sample."""
    moved = np.full(values.size, np.nan)
    for start, stop in _runs_of_values(values, breaks):
        whole = int(np.floor(shift + _NONE))
        part = shift - whole
        run = values[start:stop]
        inside = run if part <= _NONE else method(run, part)
        first, last = start + max(0, -whole), start + min(run.size, inside.size - whole)
        if first < last:
            moved[first:last] = inside[first + whole - start : last + whole - start]
    return moved


def _runs_of_values(values: Real, breaks: Sequence[int]) -> list[tuple[int, int]]:
    """Return first and last index (not included) of each run of finite values."""
    is_finite = np.isfinite(values)
    is_edge = np.diff(is_finite, prepend=False) != 0
    is_edge[[index for index in breaks if index < values.size]] = True
    edges = [*np.flatnonzero(is_edge).tolist(), values.size]
    return [(start, stop) for start, stop in itertools.pairwise(edges) if is_finite[start]]


def _interpolated(run: Real, part: float) -> Real:
    """Return the band-limited signal between samples, shape (samples - 1,)."""
    if run.size < 2:
        return np.zeros(0)
    extended = np.pad(run, _REACH, mode="reflect", reflect_type="odd")
    distances = np.arange(1 - _REACH, _REACH + 1) - part
    window = np.i0(_TAPER * np.sqrt(np.clip(1 - (distances / _REACH) ** 2, 0, 1)))
    kernel = np.sinc(distances) * window
    moved = np.convolve(extended, kernel[::-1] / kernel.sum(), mode="valid")
    return np.asarray(moved[1 : run.size], dtype=np.float64)


def _on_lines(run: Real, part: float) -> Real:
    """Return the values on straight lines between samples, shape (samples - 1,)."""
    return np.asarray(run[:-1] + part * np.diff(run), dtype=np.float64)
