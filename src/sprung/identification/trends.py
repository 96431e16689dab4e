"""Dependence of modes on the level of the motion, and the test whether there is one."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from scipy import special

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung.identification.correlation import Correlations
from sprung.identification.levels import LevelSet
from sprung.identification.subspace import eigenvalue_weights, frequency_and_damping_changes, poles_of_orders, realise
from sprung.modal import Modes, Poles, mac

#: Probability of calling a trend in any mode of a record without one.
FALSE_TRENDS = 0.01
#: Number of ranges of level between which the test compares.
N_LEVELS = 6
#: Orders up to this one are searched for a mode, and shapes with at least this MAC are the same.
_MAX_ORDER, _SAME_SHAPE = 40, 0.8
#: Size of the largest block matrix, and fewest block rows where many channels would need more.
_LARGEST_MATRIX, _FEWEST_ROWS = 400, 20
#: Smallest number of blocks, of all levels and (effectively) of one, and smallest ratio of a mode's share in a range of
#: levels to its standard deviation.
_FEWEST_BLOCKS, _FEWEST_OF_LEVEL, _LEAST_SHARE = 8, 4.0, 2.0
#: Change over its standard deviation from which frequency or damping is named.
_CLEAR = 2.5


@dataclass(frozen=True, eq=False, slots=True)
class LevelTrends:
    """Change of frequency and damping of each mode with the level of the motion, NaN where unknown.

    Parameters
    ----------
    natural_frequency
        Relative change of the natural frequency for twice the level, shape (modes,).
    natural_frequency_std
        Its standard deviation, shape (modes,).
    damping_ratio
        Change of the damping ratio for twice the level, shape (modes,).
    damping_ratio_std
        Its standard deviation, shape (modes,).
    p_value
        Probability of changes at least as large in a linear system, for frequency and damping together, shape (modes,).
    contrast
        Level in the highest subset over that in the lowest, during the ring-down of each mode, shape (modes,).
    """

    natural_frequency: Real
    natural_frequency_std: Real
    damping_ratio: Real
    damping_ratio_std: Real
    p_value: Real
    contrast: Real

    def __post_init__(self) -> None:
        freeze(self, natural_frequency=1, natural_frequency_std=1, damping_ratio=1, damping_ratio_std=1)
        freeze(self, p_value=1, contrast=1)

    def of(self, modes: Indices) -> "LevelTrends":
        """Return the dependence of the modes with these indices, unknown for -1."""
        rows = [np.append(getattr(self, field.name), np.nan)[modes] for field in fields(self)]
        return LevelTrends(*rows)

    @property
    def is_detected(self) -> Booleans:
        """Whether each mode depends on the level beyond chance (1 % for any mode of a linear system)."""
        return np.asarray(self.p_value * max(len(self.p_value), 1) < FALSE_TRENDS, dtype=np.bool_)


def level_trends(modes: Modes, average: Correlations, sets: Sequence[LevelSet]) -> LevelTrends:
    """Return the dependence of modes on the level.

    Parameters
    ----------
    modes
        Modes on the channels of the correlations.
    average
        Correlations of all levels.
    sets
        Correlations by rising level, with the same blocks.

    Returns
    -------
    LevelTrends

    Notes
    -----
    The modal filter of each mode (`subspace.eigenvalue_weights`), made from the average, gives the pole of each range
    of levels without a new realisation, and its change with each block. Slope: least squares, weighted with the number
    of products, of ln frequency and of the damping ratio over log2 of the level. That is the RMS of all channels during
    the ring-down that follows, weighted with the mode's decay: it acts on the mode, while the expected level only sorts
    the products (an instrument), so that its error does not flatten the slope. p: Hotelling's T^2 of both slopes over
    the blocks.

    References
    ----------
    H. Hotelling (1931), The generalization of Student's ratio, Annals of Mathematical Statistics 2, 360-378.
    """
    rows = np.full((6, len(modes)), np.nan)
    if len(modes) and len(sets) > 1 and len(average.blocks) >= _FEWEST_BLOCKS:
        block_rows = min(average.n_lags // 2, max(_LARGEST_MATRIX // len(average.channels), _FEWEST_ROWS))
        largest = min((block_rows - 1) * len(average.channels), block_rows * len(average.references), _MAX_ORDER)
        realisation = realise(average, block_rows=block_rows, max_order=largest - largest % 2)
        poles = poles_of_orders(realisation, range(2, largest + 1, 2))
        for k in range(len(modes)):
            chosen = _nearest(poles, modes.take(np.array([k])))
            if chosen is not None:
                eigenvalue = np.exp(poles.poles[chosen] / average.sampling_rate)
                weights = eigenvalue_weights(realisation, poles.ladder[poles.rungs[chosen]], complex(eigenvalue))
                rows[:, k] = _trend(weights, abs(eigenvalue), sets)
    return LevelTrends(*rows)


def _nearest(poles: Poles, mode: Modes) -> int | None:
    """Return the most certain pole of the mode's shape near its frequency; None without one."""
    half_width = np.abs(mode.poles.real[0]) + 0.01 * np.abs(mode.poles[0])
    distance = np.abs(np.abs(poles.poles) - np.abs(mode.poles[0]))
    is_near = (distance <= half_width) & (mac(poles.mode_shapes, mode.mode_shapes)[:, 0] >= _SAME_SHAPE)
    is_near &= poles.poles.real < 0
    if not is_near.any():
        return None
    variance = poles.natural_frequency_std**2 + (poles.natural_frequency * poles.damping_ratio_std) ** 2
    squares = np.abs(poles.poles - mode.poles[0]) ** 2 / (2 * np.pi) ** 2 + variance
    return int(np.argmin(np.where(is_near, squares, np.inf)))


def _trend(weights: tuple[Complex, Complex], modulus: float, sets: Sequence[LevelSet]) -> Real:
    """Return slopes with standard deviations, p and contrast of one mode; NaN where a subset hardly has the mode."""
    values, changes, levels = [], [], []
    for part in sets:
        value, change = _pole(weights, part.correlations)
        values.append(value)
        changes.append(change)
        decay = modulus ** (2 * np.arange(len(part.powers)))
        levels.append(np.log2(np.sum(decay * part.powers) / decay.sum()) / 2)
    y, blocks, x = np.array(values), np.array(changes), np.array(levels)
    is_known = np.isfinite(y).all(axis=1)
    shares = np.array([part.correlations.n_segments for part in sets], dtype=np.float64)[is_known, None]
    y, blocks, x = y[is_known], blocks[is_known], x[is_known, None]
    if len(x) < 2 or np.ptp(x) <= 0:
        return np.full(6, np.nan)
    away = x - np.sum(shares * x) / shares.sum()
    contrasts = shares * away / np.sum(shares * away**2)
    slopes = np.sum(contrasts * y, axis=0)
    spread = np.sum(contrasts[..., None] * blocks, axis=0)
    covariance = spread @ spread.T
    degrees = _degrees_of_freedom(spread)
    statistic = slopes @ np.linalg.solve(covariance, slopes) * (degrees - 1) / (2 * degrees)
    p_value = special.fdtrc(2, degrees - 1, statistic)
    deviations = np.sqrt(np.diag(covariance))
    return np.array([slopes[0], deviations[0], slopes[1], deviations[1], p_value, float(2 ** (x[-1, 0] - x[0, 0]))])


def _degrees_of_freedom(spread: Real) -> float:
    """Return the degrees of freedom of a variance from blocks that may differ in power, spread (values, blocks).

    Satterthwaite's: for n equally powerful normal blocks, 3 (sum of squares)^2 / sum of fourth powers is near n.
    """
    squares = spread**2
    of_equal = 3 * np.sum(squares, axis=1) ** 2 / np.sum(squares**2, axis=1)
    return max(min(float(np.min(of_equal)), spread.shape[1]) - 1, 3.0)


def _pole(weights: tuple[Complex, Complex], correlations: Correlations) -> tuple[Real, Real]:
    """Return ln frequency and damping ratio by the modal filter, and their changes with each block, (2, blocks)."""
    n_lags = weights[0].shape[-1]
    terms = [
        np.einsum("bcrm,crm->b", correlations.blocks[..., 1 : n_lags + 1], weight) * correlations.weights
        for weight in weights
    ]
    numerator, denominator = (term.sum() for term in terms)
    n_effective = 1 / np.sum(correlations.weights**2)
    scale = np.sqrt(n_effective / max(n_effective - 1, 0.1))
    eigenvalue = numerator / denominator
    share = np.sqrt(np.sum(np.abs(terms[1] - correlations.weights * denominator) ** 2))
    if n_effective < _FEWEST_OF_LEVEL or abs(denominator) < _LEAST_SHARE * scale * share:
        return np.full(2, np.nan), np.full((2, len(terms[0])), np.nan)
    pole = np.log(eigenvalue) * correlations.sampling_rate
    change = scale * (terms[0] - eigenvalue * terms[1]) / numerator * correlations.sampling_rate
    frequency, damping = frequency_and_damping_changes(pole, change)
    modulus = np.abs(pole)
    return (
        np.array([np.log(modulus), -pole.real / modulus]),
        np.array([2 * np.pi * frequency / modulus, damping]),
    )


def trends_in_words(modes: Modes, trends: LevelTrends) -> list[str]:
    """Return a sentence for each dependence on the level that stands out of chance, or that there is none."""
    sentences = []
    for k in np.flatnonzero(trends.is_detected):
        name = f"of the mode at {modes.natural_frequency[k]:.3g} Hz"
        change, std = 100 * trends.natural_frequency[k], 100 * trends.natural_frequency_std[k]
        damping, damping_std = 100 * trends.damping_ratio[k], 100 * trends.damping_ratio_std[k]
        is_clear = [abs(change) > _CLEAR * std, abs(damping) > _CLEAR * damping_std]
        is_clear = is_clear if any(is_clear) else [True, True]
        if is_clear[0]:
            way = "rises" if change > 0 else "falls"
            sentences.append(
                f"the frequency {name} {way} by {abs(change):.2g} % ± {std:.2g} % for twice the level: a nonlinearity"
            )
        if is_clear[1]:
            way = "rises" if damping > 0 else "falls"
            sentences.append(
                f"the damping ratio {name} {way} by {abs(damping):.2g} ± {damping_std:.2g} percentage points for twice"
                " the level: a nonlinearity"
            )
    if sentences:
        return sentences
    if not np.isfinite(trends.p_value).any():
        return []
    contrast = np.nanmedian(trends.contrast)
    return [f"no dependence on the level detected (highest subset over lowest: {contrast:.2f})"]
