"""Correlations at a lower sampling rate, in which as many lags reach further."""

from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.identification.correlation import Correlations

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
    taps = np.sinc((STOPPED + PASSED) / factor * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, _beta())
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


def _beta() -> float:
    """Return the parameter of the Kaiser window for the stop band."""
    return 0.1102 * (_STOP_BAND - 8.7)
