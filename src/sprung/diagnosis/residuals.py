"""Subspace residual test: has anything changed, told without a vehicle file."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats
from scipy.linalg import eigh
from scipy.special import polygamma

from sprung._arrays import Real
from sprung._checks import check_number, freeze
from sprung.errors import DataError, ParameterError
from sprung.identification.correlation import correlate_segments
from sprung.identification.subspace import block_hankel
from sprung.recording import Recording
from sprung.signals.conditioning import decimate
from sprung.vehicles.usable import usable

#: Share of the block Hankel matrix' energy that the model order explains.
_EXPLAINED = 0.999
#: Most directions of the residual that are tested, and segments for each.
_MOST_DIRECTIONS, _SEGMENTS_EACH = 40, 4
#: Least standard deviation of ln statistic from window to window, and windows that it is worth.
_LEAST_SCATTER, _PRIOR_WINDOWS = 0.15, 1.0
#: Fewest windows that teach, and chance below which a window that is unlike the others does not.
FEWEST, _SUSPECT = 3, 0.005
#: Rate at which a vehicle's windows are compared [Hz], and chance below which one differs.
VEHICLE_RATE, DIFFERENT = 25.0, 1e-3


@dataclass(frozen=True, eq=False, slots=True)
class ResidualReference:
    """What the residual is when nothing has changed.

    Parameters
    ----------
    channels
        Of the recordings.
    sampling_rate
        At which they are correlated [Hz].
    segment
        Length of a segment [s].
    null_space
        S, shape (block rows x channels, null directions): S^T H = 0 for the healthy system.
    whitening
        Shape (directions, residuals): makes the residual of one segment a unit matrix of covariance.
    center, scatter, n_windows
        Mean and standard deviation of ln statistic over the windows that taught it, and their number.
    """

    channels: tuple[str, ...]
    sampling_rate: float
    segment: float
    null_space: Real
    whitening: Real
    center: float
    scatter: float
    n_windows: int

    def __post_init__(self) -> None:
        freeze(self, null_space=2, whitening=2)

    @property
    def block_rows(self) -> int:
        """Block rows of the Hankel matrix."""
        return int(self.null_space.shape[0]) // len(self.channels)

    def to_dict(self) -> dict[str, Any]:
        """Return the reference as plain values for JSON."""
        return {
            "channels": list(self.channels),
            "sampling_rate": self.sampling_rate,
            "segment": self.segment,
            "null_space": self.null_space.round(12).tolist(),
            "whitening": [[float(f"{value:.9g}") for value in row] for row in self.whitening],
            "center": self.center,
            "scatter": self.scatter,
            "n_windows": self.n_windows,
        }


def residual_reference_from_dict(document: dict[str, Any]) -> ResidualReference:
    """Return the reference of plain values."""
    return ResidualReference(
        channels=tuple(document["channels"]),
        sampling_rate=float(document["sampling_rate"]),
        segment=float(document["segment"]),
        null_space=np.array(document["null_space"], dtype=np.float64),
        whitening=np.array(document["whitening"], dtype=np.float64),
        center=float(document["center"]),
        scatter=float(document["scatter"]),
        n_windows=int(document["n_windows"]),
    )


@dataclass(frozen=True, slots=True)
class ResidualTest:
    """Whether a window differs from the reference.

    Parameters
    ----------
    statistic
        Mean square of the whitened residual, times the number of segments: near 1 where nothing has changed and the
        excitation is steady.
    p_value
        Chance of such a statistic among windows like those that taught.
    """

    statistic: float
    p_value: float


def learn_residuals(
    recordings: Iterable[Recording],
    *,
    sampling_rate: float | None = None,
    segment: float = 5.0,
    block_rows: int = 6,
) -> ResidualReference:
    """Learn the null space and the residuals of a healthy system.

    Parameters
    ----------
    recordings
        Windows of it, at least three, over the conditions it meets.
    sampling_rate
        To decimate to [Hz]: about five times the highest mode of interest; None: as recorded.
    segment
        Length of the segments whose scatter is the yardstick [s].
    block_rows
        Of the Hankel matrix.

    Notes
    -----
    Left null space S of the mean block Hankel matrix of correlations; residual vec(S^T H_k) of each segment, its
    largest directions whitened over all segments. Correlations are divided by each window's own power. ln of a window's
    mean square has a mean and a scatter over the windows, which conditions (speed, road) widen; a new window is
    compared with these by Student's t. Each window's mean square is that against what the others teach: one that took
    part is nearer to the null space than any later one, by (n - 1) / (n + 1) with n windows. A window that is unlike
    all the others, such as one with a shock, does not teach.

    References
    ----------
    M. Basseville, M. Abdelghani, A. Benveniste, Subspace-based fault detection algorithms for vibration monitoring,
    Automatica 36 (2000) 101-109. L. Mevel, M. Goursat, M. Basseville, Stochastic subspace-based structural
    identification and damage detection, MSSP 17 (2003).
    """
    check_number("block_rows", block_rows, at_least=2)
    ready = [outputs_at(recording, sampling_rate) for recording in recordings]
    if len(ready) < FEWEST:
        raise DataError(f"{len(ready)} windows cannot teach the residual test, {FEWEST} can: give more")
    n_channels = len(ready[0].names)
    matrices = [_matrices(recording, segment, block_rows) for recording in ready]
    while True:
        null_space, whitening = _taught(matrices, n_channels)
        logs = np.log([_left_out(matrices, k, n_channels) for k in range(len(matrices))])
        # Chance alone scatters ln of a mean of squares as that of chi square.
        least = max(_LEAST_SCATTER, float(np.sqrt(polygamma(1, len(whitening) / 2))))
        worst = int(np.argmax(logs))
        others = np.delete(logs, worst)
        score = (logs[worst] - others.mean()) / (_scatter(others, least) * np.sqrt(1 + 1 / len(others)))
        if len(logs) <= FEWEST or stats.t.sf(score, len(others) - 1) > _SUSPECT:
            break
        del matrices[worst]
    # The mean of the others, which the null space removes, adds 1 / (n - 1) to the variance, that of all 1 / n.
    center = float(logs.mean() + np.log(1 - len(logs) ** -2.0))
    return ResidualReference(
        ready[0].names,
        ready[0].sampling_rate,
        segment,
        null_space,
        whitening,
        center,
        _scatter(logs, least),
        len(logs),
    )


def compare_residuals(reference: ResidualReference, recording: Recording) -> ResidualTest:
    """Compare a window with the reference.

    Raises
    ------
    ParameterError
        Where the channels are others.
    """
    ready = outputs_at(recording, reference.sampling_rate)
    if ready.names != reference.channels:
        raise ParameterError(f"the window has the channels {', '.join(ready.names)}, the reference others: select them")
    matrices = _matrices(ready, reference.segment, reference.block_rows)
    statistic = _statistic(_residuals(matrices, reference.null_space), reference.whitening)
    spread = reference.scatter * np.sqrt(1 + 1 / reference.n_windows)
    score = (np.log(statistic) - reference.center) / spread
    return ResidualTest(statistic, float(stats.t.sf(score, reference.n_windows - 1)))


def second_opinion(tests: Sequence[ResidualTest]) -> str:
    """Say in a sentence what the residual test makes of windows."""
    different = sum(test.p_value < DIFFERENT for test in tests)
    return (
        f"second opinion without the vehicle file (subspace residuals): {different} of {len(tests)} windows differ "
        f"from those that taught the baseline (p < {DIFFERENT:g})"
    )


def outputs_at(recording: Recording, sampling_rate: float | None) -> Recording:
    """Return the outputs, without speed and temperature, at the rate of the test; None: as recorded."""
    ready = usable(recording)
    outputs = ready.select([c.name for c in ready.channels if c.quantity not in {"speed", "temperature"}])
    if sampling_rate is None or outputs.sampling_rate <= sampling_rate:
        return outputs
    return decimate(outputs, sampling_rate)


def _matrices(recording: Recording, segment: float, block_rows: int) -> Real:
    """Return the block Hankel matrix of each segment, channels scaled by their power in the whole window."""
    samples = recording.samples - recording.samples.mean(axis=1, keepdims=True)
    scaled = recording.changed("scaled", samples=samples / samples.std(axis=1, keepdims=True))
    segments = correlate_segments(scaled, n_lags=2 * block_rows + 1, segment=segment)
    values = segments.sums / segments.n_products[:, None, None, :]
    return np.array([block_hankel(one, block_rows, first_lag=1, n_columns=block_rows) for one in values])


def _taught(matrices: Sequence[Real], n_channels: int) -> tuple[Real, Real]:
    """Return the null space and the whitening that windows teach."""
    every = np.concatenate(matrices)
    left, values, _ = np.linalg.svd(every.mean(axis=0), full_matrices=True)
    explained = np.cumsum(values**2) / np.sum(values**2)
    order = min(int(np.searchsorted(explained, _EXPLAINED)) + 1, len(left) - n_channels)
    null_space = left[:, order:]
    residuals = _residuals(every, null_space)
    away = residuals - residuals.mean(axis=0)
    count = max(1, min(_MOST_DIRECTIONS, len(away) // _SEGMENTS_EACH))
    return null_space, _whitening(away, count)


def _whitening(away: Real, count: int) -> Real:
    """Return what whitens the largest directions; not by SVD, which fails to converge on some such low ranks."""
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
    squares = np.sum((logs - logs.mean()) ** 2) + _PRIOR_WINDOWS * least**2
    return max(float(np.sqrt(squares / (len(logs) - 1 + _PRIOR_WINDOWS))), least)


def _left_out(matrices: Sequence[Real], row: int, n_channels: int) -> float:
    """Return the statistic of a window against what the others teach."""
    null_space, whitening = _taught([*matrices[:row], *matrices[row + 1 :]], n_channels)
    return _statistic(_residuals(matrices[row], null_space), whitening)


def _residuals(matrices: Real, null_space: Real) -> Real:
    """Return vec(S^T H) of each segment."""
    return (null_space.T @ matrices).reshape(len(matrices), -1)


def _statistic(residuals: Real, whitening: Real) -> float:
    """Return the mean square of the whitened mean residual, times the number of segments."""
    mean = whitening @ residuals.mean(axis=0)
    return float(len(residuals) * np.mean(mean**2))
