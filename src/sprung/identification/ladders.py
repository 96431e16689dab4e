"""Ladders: over model orders, over numbers of block rows as in the thesis, or over orders of polynomials (pLSCF)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.identification.correlation import Correlations
from sprung.identification.plscf import PolynomialLadder
from sprung.identification.subspace import block_row_ladder, join_poles, realise, undetermined_poles
from sprung.modal import Poles

#: Edges of the low-pass as shares of the lower rate: what lies above the second folds to above the first.
PASSED, STOPPED = 0.35, 0.65
#: Attenuation above the stop edge, in power [dB].
_STOP_BAND = 60.0


def filter_half_width(factor: int) -> int:
    """Return the number of lags that the low-pass needs on each side of a lag."""
    if factor == 1:
        return 0
    width = (STOPPED - PASSED) / factor
    return int(np.ceil((_STOP_BAND - 7.95) / (2.285 * 2 * np.pi * width) / 2))


def decimate_correlations(correlations: Correlations, factor: int, *, n_lags: int) -> Correlations:
    """Return correlations with a low-pass, at every `factor`-th lag.

    Parameters
    ----------
    correlations
        Correlations whose references are all channels, or none of the channels.
    factor
        Ratio of the old to the new sampling rate, at least 1; 1 returns the correlations as they are.
    n_lags
        Largest number of lags of the result.

    Returns
    -------
    Correlations
        Lags 0, `factor`, 2 `factor`, ..., as many as the low-pass leaves, up to `n_lags`.

    Notes
    -----
    Lambda'_m = sum over k of c_k Lambda_(m D + k) with a symmetric low-pass c. A sum of exponentials keeps its poles
    and shapes; only the participations change, by the response of the low-pass. Negative lags are those of the
    exchanged channels, Lambda_(-m) = Lambda_m^T: not one sum of exponentials with the positive ones, so the first few
    lags deviate by the stop band (poles by 1e-5). Where no reference is a channel they are not known: all lags are then
    later by the half-width of the low-pass, which the participations absorb, and the poles are exact.
    """
    if factor == 1:
        return correlations
    half = filter_half_width(factor)
    taps = np.sinc((STOPPED + PASSED) / factor * np.arange(-half, half + 1)) * np.kaiser(
        2 * half + 1, 0.1102 * (_STOP_BAND - 8.7)
    )
    taps /= taps.sum()
    has_all = correlations.references == correlations.channels
    return replace(
        correlations,
        values=_filtered(correlations.values, taps, factor, n_lags, has_all),
        blocks=_filtered(correlations.blocks, taps, factor, n_lags, has_all),
        sampling_rate=correlations.sampling_rate / factor,
    )


def _filtered(values: Real, taps: Real, factor: int, n_lags: int, has_all: bool) -> Real:
    """Return values (..., channels, references, lags) after the low-pass, at every `factor`-th lag."""
    if has_all:
        earlier = values[..., len(taps) // 2 : 0 : -1].swapaxes(-3, -2)
        values = np.concatenate([earlier, values], axis=-1)
    windows = np.lib.stride_tricks.sliding_window_view(values, len(taps), axis=-1)[..., : n_lags * factor : factor, :]
    return np.asarray(windows @ taps)


#: Time constants within the lags after which a pole has decayed.
_DECAYED = 3.0


@dataclass(frozen=True, slots=True)
class OrderLadder:
    """Every even model order of one realisation, or of several at different rates.

    A realisation is that of a block Toeplitz matrix of correlations without bias, weighted for canonical variates.

    Parameters
    ----------
    block_rows
        Number i of block rows, at least 2.
    max_order
        Largest model order, at least 2.
    strides
        Lags from one block row to the next, rising from 1: one realisation for each, of correlations decimated by that
        factor. Where the matrix may not have enough block rows to span the ring-down of the slowest mode at the rate of
        the fastest, the slow modes are those of a larger stride.

    Raises
    ------
    ParameterError
        If the block rows or the largest order are below 2, or the strides do not rise from 1.

    Notes
    -----
    A rung holds the poles of its order from every realisation: below 0.35 of the rate of the next larger stride those
    of that stride, above it those of the smaller one.
    """

    #: Number of lags for each block row, and whether correlations are divided by the number of samples.
    lags_per_row: ClassVar[int] = 2
    is_biased: ClassVar[bool] = False

    block_rows: int
    max_order: int
    strides: Sequence[int] = (1,)

    def __post_init__(self) -> None:
        check_number("block_rows", self.block_rows, at_least=2)
        check_number("max_order", self.max_order, at_least=2)
        object.__setattr__(self, "strides", tuple(self.strides))
        if self.strides[:1] != (1,) or sorted(set(self.strides)) != list(self.strides):
            raise ParameterError(f"strides {self.strides} must rise from 1")

    @property
    def n_lags(self) -> int:
        """Number of lags of the block matrices, with those that the low-pass of the largest stride needs."""
        return self.span + 2 * filter_half_width(self.strides[-1])

    @property
    def span(self) -> int:
        """Number of lags that the block rows of the largest stride span."""
        return self.lags_per_row * self.block_rows * self.strides[-1]

    def poles(self, correlations: Correlations) -> Poles:
        """Return the poles of all orders, without their standard deviations (`with_deviations`).

        Below its edge a stride takes over the poles that outlast the lags of the one before: heavily damped ones decay
        within them, and longer lags would hold noise alone.
        """
        n_lags, rate, parts = self.lags_per_row * self.block_rows, correlations.sampling_rate, []
        for stride in self.strides:
            decimated = decimate_correlations(correlations, stride, n_lags=n_lags)
            realisation = realise(decimated, block_rows=self.block_rows, max_order=self.max_order)
            parts.append(undetermined_poles(realisation, range(2, self.max_order + 1, 2)))
        if len(parts) == 1:
            return parts[0]
        taken = [np.ones(len(part.poles), dtype=np.bool_) for part in parts]
        for k, (before, stride) in enumerate(pairwise(self.strides)):
            for number, part in enumerate(parts):
                has_decayed = -part.poles.real * n_lags * before / rate > _DECAYED
                is_later = (part.natural_frequency < PASSED * rate / stride) & ~has_decayed
                taken[number] &= is_later if number > k else ~is_later
        return join_poles(parts, taken)


@dataclass(frozen=True, slots=True)
class BlockRowLadder:
    """One realisation for each number of block rows, the model order following it: the ladder of the thesis.

    Each realisation is that of correlations as data in block Hankel matrices, without weights. The correlations are
    divided by the number of samples (1/N), not of products.

    Parameters
    ----------
    first, last
        Smallest and largest number of block rows, 2 <= first <= last.

    Raises
    ------
    ParameterError
        If the block rows do not rise from 2 or more.

    References
    ----------
    F. Liu (2020), eq. 3-35 to 3-45 and sections 4.3 and 7.3.
    """

    lags_per_row: ClassVar[int] = 3
    is_biased: ClassVar[bool] = True

    first: int
    last: int

    def __post_init__(self) -> None:
        if not 2 <= self.first <= self.last:
            raise ParameterError(f"block rows {self.first} to {self.last} must rise from 2 or more")

    @property
    def n_lags(self) -> int:
        """Number of lags of the largest block matrix."""
        return self.lags_per_row * self.last

    @property
    def span(self) -> int:
        """Number of lags that the block rows span."""
        return self.n_lags

    def poles(self, correlations: Correlations) -> Poles:
        """Return the poles of all realisations."""
        return block_row_ladder(correlations, range(self.first, self.last + 1), is_hankel=True)


Ladder = OrderLadder | BlockRowLadder | PolynomialLadder
