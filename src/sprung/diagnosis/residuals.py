"""Subspace residual test: whether a window differs from those of the baseline, without a model of the vehicle."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.special import polygamma, stdtr

from sprung._arrays import Real
from sprung._checks import check_number, freeze
from sprung.errors import DataError, ParameterError
from sprung.identification.correlation import correlate_segments
from sprung.identification.subspace import block_hankel
from sprung.recording import Recording
from sprung.signals.conditioning import decimate
from sprung.signals.data_faults import CONDITIONS
from sprung.vehicles.sensor_layout import usable


@dataclass(frozen=True, slots=True)
class ResidualSettings:
    """Settings of the residual test."""

    #: Share of the energy of the block Hankel matrix that the model order explains.
    explained: float = 0.999
    #: Largest number of directions of the residual that are tested.
    max_directions: int = 40
    #: Smallest number of segments for each direction.
    segments_each: int = 4
    #: Smallest standard deviation of ln statistic from window to window.
    min_scatter: float = 0.15
    #: Its weight in windows.
    prior_windows: float = 1.0
    #: Smallest number of windows of a reference.
    min_windows: int = 3
    #: p-value below which an outlying window is left out of the reference.
    suspect: float = 0.005
    #: Rate at which the windows of a vehicle are compared [Hz].
    vehicle_rate: float = 25.0
    #: p-value below which a window differs.
    different: float = 1e-3
    #: Length of a segment [s], unless stated.
    segment: float = 5.0
    #: Block rows of the Hankel matrix, unless stated.
    block_rows: int = 6


RESIDUALS = ResidualSettings()


@dataclass(frozen=True, eq=False, slots=True)
class ResidualStatistics:
    """Statistics of a window for the residual test: correlations of its outputs instead of samples.

    Parameters
    ----------
    channels
        Names of the outputs.
    sampling_rate
        Sampling rate of the correlations [Hz].
    segment
        Length of a segment [s].
    n_segments
        Number of segments in the window.
    mean
        Mean correlations of the segments, shape (channels, references, lags), with lags from 1 to 2 i - 1 for i block
        rows; channels are scaled to unit variance over the window.
    segments
        Correlations of each segment, shape (segments, channels, references, lags), for learning; None: not kept.

    Notes
    -----
    With four outputs and six block rows the mean takes 1.4 kB, as does each segment: 170 kB for ten minutes in segments
    of five seconds. A comparison needs the mean only, as the residual is linear in the correlations.
    """

    channels: tuple[str, ...]
    sampling_rate: float
    segment: float
    n_segments: int
    mean: Real
    segments: Real | None = None

    def __post_init__(self) -> None:
        freeze(self, mean=3)
        if self.segments is not None:
            freeze(self, segments=4)

    @property
    def block_rows(self) -> int:
        """Block rows of the Hankel matrix."""
        return (int(self.mean.shape[2]) + 1) // 2

    def is_like(self, other: "ResidualStatistics | ResidualReference") -> bool:
        """Return whether channels, rate, segments and block rows agree."""
        settings = [(value.channels, value.segment, value.block_rows) for value in (self, other)]
        return settings[0] == settings[1] and bool(np.isclose(self.sampling_rate, other.sampling_rate, rtol=1e-6))

    def without_segments(self) -> "ResidualStatistics":
        """Return the statistics without the correlations of single segments."""
        return replace(self, segments=None)


@dataclass(frozen=True, eq=False, slots=True)
class ResidualReference:
    """Reference of the residual test, from windows of a healthy vehicle.

    Parameters
    ----------
    channels
        Names of the outputs.
    sampling_rate
        Sampling rate of the correlations [Hz].
    segment
        Length of a segment [s].
    null_space
        Left null space S of the healthy system's block Hankel matrix H, S^T H = 0, shape (block rows x channels, null
        directions).
    whitening
        Matrix that maps residuals to unit covariance in one segment, shape (directions, residuals).
    mean, scatter, n_windows
        Mean and standard deviation of ln statistic over the windows that it was learnt from, and their number.
    """

    channels: tuple[str, ...]
    sampling_rate: float
    segment: float
    null_space: Real
    whitening: Real
    mean: float
    scatter: float
    n_windows: int

    def __post_init__(self) -> None:
        freeze(self, null_space=2, whitening=2)

    @property
    def block_rows(self) -> int:
        """Block rows of the Hankel matrix."""
        return int(self.null_space.shape[0]) // len(self.channels)


@dataclass(frozen=True, slots=True)
class ResidualTest:
    """Comparison of a window with the reference.

    Parameters
    ----------
    statistic
        Mean square of the whitened residual, times the number of segments: near 1 without a change under steady
        excitation.
    p_value
        Probability of a statistic at least as large among windows like those of the reference.
    """

    statistic: float
    p_value: float

    @property
    def is_different(self) -> bool:
        """Whether the p-value is below 0.1 %."""
        return self.p_value < RESIDUALS.different


def residual_statistics(
    recording: Recording,
    *,
    sampling_rate: float | None = None,
    segment: float = RESIDUALS.segment,
    block_rows: int = RESIDUALS.block_rows,
) -> ResidualStatistics:
    """Return the statistics of a window for the residual test.

    Parameters
    ----------
    recording
        Window of outputs; speed and temperature are left out.
    sampling_rate
        Rate to decimate to [Hz], about five times the highest mode of interest; None: as recorded.
    segment
        Length of the segments whose scatter is the measure of chance [s].
    block_rows
        Block rows of the Hankel matrix, at least 2.

    Raises
    ------
    DataError
        If an output is dead, or no stretch is long enough.
    ParameterError
        If there are fewer than 2 block rows.

    Examples
    --------
    Five-second segments of a minute, and correlations at lags up to 7 samples for 4 block rows:

    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> noise = np.random.default_rng(1).standard_normal((2, 1200))
    >>> run = Recording(noise, 20.0, (Channel("a", "acceleration"), Channel("b", "acceleration")))
    >>> statistics = residual_statistics(run, block_rows=4)
    >>> statistics.n_segments, statistics.mean.shape
    (12, (2, 2, 7))
    """
    check_number("block_rows", block_rows, at_least=2)
    motion = usable(recording)
    outputs = motion.select([c.name for c in motion.channels if c.quantity not in CONDITIONS])
    if sampling_rate is not None and outputs.sampling_rate > sampling_rate:
        outputs = decimate(outputs, sampling_rate)
    samples = outputs.samples - outputs.samples.mean(axis=1, keepdims=True)
    scaled = outputs.changed("scaled", samples=samples / samples.std(axis=1, keepdims=True))
    correlations = correlate_segments(scaled, n_lags=2 * block_rows + 1, segment=segment)
    segments = np.ascontiguousarray((correlations.sums / correlations.n_products[:, None, None, :])[..., 1:-1])
    return ResidualStatistics(
        outputs.names, outputs.sampling_rate, segment, len(segments), segments.mean(axis=0), segments
    )


def learn_reference(windows: Sequence[ResidualStatistics]) -> ResidualReference:
    """Learn the null space and the residuals of a healthy system.

    Parameters
    ----------
    windows
        Windows of the system with their segments, at least three, over the conditions it meets, with equal settings.

    Returns
    -------
    ResidualReference
        Null space, whitening, and the distribution of the statistic over the windows.

    Raises
    ------
    DataError
        If there are fewer than three windows.
    ParameterError
        If a window lacks the correlations of its segments.

    Notes
    -----
    S is the left null space of the mean block Hankel matrix of correlations. The residual of a segment is vec(S^T H_k),
    of which the largest directions are whitened over all segments. Correlations are divided by each window's own power.
    ln of a window's mean square has a mean and a scatter over the windows, which conditions (speed, road) widen; a new
    window is compared with these by Student's t. The mean square of each window is evaluated against the other windows:
    one that took part is nearer to the null space than any later one, by (n - 1) / (n + 1) with n windows. An outlying
    window, such as one with a shock, is left out.

    References
    ----------
    M. Basseville, M. Abdelghani, A. Benveniste, Subspace-based fault detection algorithms for vibration monitoring,
    Automatica 36 (2000) 101-109. L. Mevel, M. Goursat, M. Basseville, Stochastic subspace-based structural
    identification and damage detection, MSSP 17 (2003).

    Examples
    --------
    >>> from sprung.diagnosis import residual_statistics
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> force = usual_excitation(masses)
    >>> runs = [simulate(masses, force, duration=60.0, sampling_rate=100.0, snr=10.0, seed=k) for k in range(3)]
    >>> reference = learn_reference([residual_statistics(run, block_rows=4) for run in runs])
    >>> reference.n_windows, reference.block_rows
    (3, 4)
    """
    if len(windows) < RESIDUALS.min_windows:
        needed = f"the residual test needs at least {RESIDUALS.min_windows} usable windows"
        raise DataError(f"{needed}, got {len(windows)}: give more")
    if any(window.segments is None for window in windows):
        raise ParameterError("the window lacks the correlations of its segments: keep them until it is learnt from")
    first = windows[0]
    matrices = [np.array([_hankel(values) for values in np.asarray(window.segments)]) for window in windows]
    while True:
        null_space, whitening = _estimate(matrices, len(first.channels))
        logs = np.log([_statistic_against_others(matrices, k, len(first.channels)) for k in range(len(matrices))])
        # Chance alone scatters ln of a mean of squares as that of chi square.
        least = max(RESIDUALS.min_scatter, float(np.sqrt(polygamma(1, len(whitening) / 2))))
        worst = int(np.argmax(logs))
        others = np.delete(logs, worst)
        score = (logs[worst] - others.mean()) / (_scatter(others, least) * np.sqrt(1 + 1 / len(others)))
        if len(logs) <= RESIDUALS.min_windows or stdtr(len(others) - 1, -score) > RESIDUALS.suspect:
            break
        del matrices[worst]
    # The mean of the others, which the null space removes, adds 1 / (n - 1) to the variance, that of all 1 / n.
    mean = float(logs.mean() + np.log(1 - len(logs) ** -2.0))
    return ResidualReference(
        first.channels,
        first.sampling_rate,
        first.segment,
        null_space,
        whitening,
        mean,
        _scatter(logs, least),
        len(logs),
    )


def residual_test(reference: ResidualReference, window: ResidualStatistics) -> ResidualTest:
    """Compare a window with the reference.

    Parameters
    ----------
    reference
        Reference from `learn_reference`.
    window
        Statistics of the window, with or without its segments.

    Returns
    -------
    ResidualTest
        Probability of a residual as large in a healthy system.

    Raises
    ------
    ParameterError
        If channels, rate, segments or block rows differ from the reference's.

    References
    ----------
    As for `learn_reference`.

    Examples
    --------
    A further healthy run, of which only the mean correlations are kept:

    >>> from sprung.diagnosis import learn_reference, residual_statistics
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> force = usual_excitation(masses)
    >>> runs = [simulate(masses, force, duration=60.0, sampling_rate=100.0, snr=10.0, seed=k) for k in range(4)]
    >>> *healthy, other = map(residual_statistics, runs)
    >>> residual_test(learn_reference(healthy), other.without_segments()).is_different
    False
    """
    if not window.is_like(reference):
        raise ParameterError(
            f"the window has the channels {', '.join(window.channels)} at {window.sampling_rate:g} Hz, the reference "
            f"{', '.join(reference.channels)} at {reference.sampling_rate:g} Hz: select the same ones"
        )
    statistic = _statistic(_hankel(window.mean), window.n_segments, reference.null_space, reference.whitening)
    spread = reference.scatter * np.sqrt(1 + 1 / reference.n_windows)
    score = (np.log(statistic) - reference.mean) / spread
    return ResidualTest(statistic, float(stdtr(reference.n_windows - 1, -score)))


def _hankel(correlations: Real) -> Real:
    """Return the square block Hankel matrix of correlations at lags from 1."""
    block_rows = (correlations.shape[2] + 1) // 2
    return block_hankel(correlations, block_rows, first_lag=0, n_columns=block_rows)


def _estimate(matrices: Sequence[Real], n_channels: int) -> tuple[Real, Real]:
    """Return the null space and the whitening of windows."""
    every = np.concatenate(matrices)
    left, values, _ = np.linalg.svd(every.mean(axis=0), full_matrices=True)
    explained = np.cumsum(values**2) / np.sum(values**2)
    order = min(int(np.searchsorted(explained, RESIDUALS.explained)) + 1, len(left) - n_channels)
    null_space = left[:, order:]
    residuals = (null_space.T @ every).reshape(len(every), -1)
    away = residuals - residuals.mean(axis=0)
    count = max(1, min(RESIDUALS.max_directions, len(away) // RESIDUALS.segments_each))
    return null_space, _whitening(away, count)


def _whitening(away: Real, count: int) -> Real:
    """Return the whitening of the largest directions; an SVD does not converge on some matrices of such low rank."""
    if len(away) < away.shape[1]:
        squares, left = eigh(away @ away.T, subset_by_index=(len(away) - count, len(away) - 1))
        directions = left.T @ away / np.sqrt(squares)[:, None]
    else:
        size = away.shape[1]
        squares, right = eigh(away.T @ away, subset_by_index=(max(0, size - count), size - 1))
        directions = right.T
    return directions * np.sqrt((len(away) - 1) / squares)[:, None]


def _scatter(logs: Real, least: float) -> float:
    """Return the standard deviation of ln statistic from window to window, at least that of chance."""
    squares = np.sum((logs - logs.mean()) ** 2) + RESIDUALS.prior_windows * least**2
    return max(float(np.sqrt(squares / (len(logs) - 1 + RESIDUALS.prior_windows))), least)


def _statistic_against_others(matrices: Sequence[Real], row: int, n_channels: int) -> float:
    """Return the statistic of a window against the null space and whitening of the others."""
    null_space, whitening = _estimate([*matrices[:row], *matrices[row + 1 :]], n_channels)
    return _statistic(matrices[row].mean(axis=0), len(matrices[row]), null_space, whitening)


def _statistic(matrix: Real, n_segments: int, null_space: Real, whitening: Real) -> float:
    """Return the mean square of the whitened residual vec(S^T H) of a mean matrix, times the number of segments."""
    return float(n_segments * np.mean((whitening @ (null_space.T @ matrix).ravel()) ** 2))
