"""Settings of the thesis, and formatted numbers for its pages."""

import numpy as np
from numpy.typing import ArrayLike

from sprung.identification import IdentificationSettings, as_in_thesis
from sprung.signals.cepstrum import Lifter

BODY_MODES = ("bounce", "pitch", "roll")
THRESHOLDS = (
    "Thresholds of the thesis: relative change of frequency 0.1, of damping 0.2, 1 - MAC 0.5 against the rung below; one "
    "realisation for each number of block rows, block Hankel matrix of correlations divided by the number of samples."
)


def thesis_settings(
    *,
    rows: tuple[int, int],
    stable_rate: float,
    segment: float | None = None,
    n_subsets: int = 3,
    sampling_rate: float | None = None,
    lifter: Lifter | None = None,
    band: tuple[float, float] | None = None,
) -> IdentificationSettings:
    """Return the settings of the thesis.

    Parameters
    ----------
    rows
        Smallest and largest number of block rows.
    stable_rate
        Smallest rate of stable points of a mode, delta of eq. 3-57.
    segment
        Length of the segments [s].
    n_subsets
        Number J of subsets of CoSS-SSI.
    sampling_rate
        Sampling rate of the correlations [Hz].
    lifter
        Lifter for cepstrum editing; None: no editing.
    band
        Lowest and highest natural frequency of interest [Hz].
    """
    chosen = IdentificationSettings(
        decimate_to=sampling_rate, segment=segment, n_subsets=n_subsets, lifter=lifter, band=band
    )
    return as_in_thesis(chosen, rows=rows, stable_rate=stable_rate)


def number(value: float, *, digits: int = 2) -> str:
    """Return a number, or a dash where there is none."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "–"


def of_runs(values: ArrayLike, *, digits: int = 2) -> str:
    """Return the number of runs with a value, their median and range."""
    return f"{found_in(values)}: {spread(values, digits=digits)}"


def worst_error(values: ArrayLike, truth: ArrayLike) -> float:
    """Return the largest relative error of the medians over the runs; columns without values do not count.

    Parameters
    ----------
    values
        Values, shape (runs, ..., modes), NaN where a run has none.
    truth
        True values, shape (modes,), above 0.
    """
    relative = np.asarray(values) / np.asarray(truth)
    columns = relative.reshape(len(relative), -1).T
    medians = [np.median(column[np.isfinite(column)]) for column in columns if np.isfinite(column).any()]
    return float(np.max(np.abs(np.array(medians) - 1), initial=0.0))


def share(values: ArrayLike) -> float:
    """Return the share of the runs with a value."""
    return float(np.isfinite(np.asarray(values)).mean())


def deviation(ours: float, published: float) -> str:
    """Return the relative deviation from a published number in percent; a dash where there is none.

    Examples
    --------
    >>> deviation(7.03, 7.01)
    '+0.29 %'
    """
    if not (np.isfinite(ours) and np.isfinite(published)) or published == 0:
        return "–"
    return f"{100 * (ours / published - 1):+.2f} %"


def spread(values: ArrayLike, *, digits: int = 2) -> str:
    """Return the median of runs with the range of 90 % of them; a dash where none has a value.

    Examples
    --------
    >>> spread([1.0, 2.0, 3.0, float("nan")])
    '2.00 (1.10 to 2.90)'
    """
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return "–"
    low, middle, high = np.percentile(finite, [5, 50, 95])
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def found_in(values: ArrayLike) -> str:
    """Return the number of runs with a value.

    Examples
    --------
    >>> found_in([1.0, float("nan"), 2.0])
    '2 of 3'
    """
    values = np.asarray(values, dtype=np.float64)
    return f"{np.isfinite(values).sum()} of {values.size}"
