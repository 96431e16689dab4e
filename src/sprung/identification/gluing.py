"""Merging of the modes of several set-ups: matched by frequency and shape, shapes glued over the shared points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung.modal import Modes, mac

#: Frequencies of one mode differ between set-ups by this share (temperature, the mass of the sensors) ...
_DRIFT = 0.005
#: ... and, in standard deviations of their difference, by up to this.
_DEVIATIONS = 3.0
#: 1 - MAC on the shared points at which modes of equal frequency are two.
_OTHER_SHAPE = 0.3
#: Least share of the set-ups that show a mode.
_LEAST_SHARE = 0.5
_SWEEPS, _CONVERGED = 500, 1e-12


def match_modes(parts: Sequence[Modes], rows: Sequence[Sequence[int]]) -> Indices:
    """Match the modes of several set-ups.

    Parameters
    ----------
    parts
        Modes of each set-up.
    rows
        Index of the point that each channel of each set-up measures.

    Returns
    -------
    numpy.ndarray
        Index of the set-up's mode for each matched mode and set-up, -1 for none; shape (modes, set-ups). Modes that
        fewer than half of the set-ups show are left out.

    Notes
    -----
    Agglomeration with average linkage on the squared distance (f - f')^2 / (9 (s^2 + s'^2 + (0.005 f)^2))
    + ((1 - MAC) / 0.3)^2, up to 1; two modes of one set-up are never the same. The MAC is that on the points that both
    set-ups measure; with a single shared point it carries no information.
    """
    owners = np.concatenate([np.full(len(part), k) for k, part in enumerate(parts)]).astype(np.intp)
    places = np.concatenate([np.arange(len(part)) for part in parts]).astype(np.intp)
    groups = [[k] for k in range(len(owners))]
    distance = _distances(parts, rows)
    while len(groups) > 1:
        closest = np.unravel_index(np.argmin(distance), distance.shape)
        if distance[closest] > 1:
            break
        kept, gone = sorted(int(k) for k in closest)
        sizes = len(groups[kept]), len(groups[gone])
        mean = (sizes[0] * distance[kept] + sizes[1] * distance[gone]) / sum(sizes)
        mean[kept] = np.inf
        distance[kept], distance[:, kept] = mean, mean
        distance = np.delete(np.delete(distance, gone, axis=0), gone, axis=1)
        groups[kept] += groups.pop(gone)
    members = np.full((len(groups), len(parts)), -1, dtype=np.intp)
    for row, group in enumerate(groups):
        members[row, owners[group]] = places[group]
    return members[np.count_nonzero(members >= 0, axis=1) >= _LEAST_SHARE * len(parts)]


def _distances(parts: Sequence[Modes], rows: Sequence[Sequence[int]]) -> Real:
    """Return the squared distance of all modes of all set-ups from each other; infinite within a set-up."""
    edges = np.cumsum([0, *(len(part) for part in parts)])
    distance = np.full((edges[-1], edges[-1]), np.inf)
    for i, part in enumerate(parts):
        for j in range(i):
            other = parts[j]
            shared = sorted(set(rows[i]) & set(rows[j]))
            own, others = ([list(rows[k]).index(point) for point in shared] for k in (i, j))
            frequency, same = part.natural_frequency[:, None], other.natural_frequency
            variance = np.nan_to_num(part.natural_frequency_std[:, None]) ** 2
            variance = variance + np.nan_to_num(other.natural_frequency_std) ** 2 + (_DRIFT * frequency) ** 2
            squared = (frequency - same) ** 2 / (_DEVIATIONS**2 * variance)
            if shared:
                likeness = mac(part.mode_shapes[:, own], other.mode_shapes[:, others])
                squared = squared + ((1 - likeness) / _OTHER_SHAPE) ** 2
            block = slice(edges[i], edges[i + 1]), slice(edges[j], edges[j + 1])
            distance[block], distance[block[::-1]] = squared, squared.T
    return distance


def combine(values: Real, deviations: Real) -> tuple[float, float]:
    """Return the mean of several estimates of one number, and its standard deviation.

    Parameters
    ----------
    values, deviations
        Estimates and their standard deviations, shape (estimates,); NaN for an unknown deviation.

    Notes
    -----
    Weights 1 / (s^2 + t^2) with the variance t^2 between the estimates by moments: where they scatter more than their
    deviations explain, the mean is less certain, and precise estimates weigh less. Where a deviation is unknown, all
    weigh the same and the scatter alone counts.

    References
    ----------
    R. DerSimonian and N. Laird (1986), Meta-analysis in clinical trials, Controlled Clinical Trials 7, 177-188.
    """
    n = len(values)
    if not np.all(np.isfinite(deviations) & (deviations > 0)):
        scatter = float(values.std(ddof=1)) / np.sqrt(n) if n > 1 else float(deviations[0])
        return float(values.mean()), scatter
    weights = deviations**-2.0
    mean = np.sum(weights * values) / weights.sum()
    excess = np.sum(weights * (values - mean) ** 2) - (n - 1)
    between = max(0.0, excess / (weights.sum() - np.sum(weights**2) / weights.sum())) if n > 1 else 0.0
    weights = 1 / (deviations**2 + between)
    return float(np.sum(weights * values) / weights.sum()), float(weights.sum() ** -0.5)


@dataclass(frozen=True, eq=False, slots=True)
class GluedShape:
    """One mode shape on all points of several set-ups.

    Parameters
    ----------
    shape
        Mode shape, 1 at its largest point, shape (points,); NaN at a point of which no set-up shows the mode.
    variance
        Variance of `shape` (of real and imaginary part together), shape (points,); 0 at its largest point, NaN where
        the set-ups share too few points to show their scatter.
    scales
        Factor by which `shape` becomes that of each set-up, shape (set-ups,).
    """

    shape: Complex
    variance: Real
    scales: Complex

    def __post_init__(self) -> None:
        freeze(self, shape=1, scales=1, dtype=np.complex128)
        freeze(self, variance=1)


def glue(
    shapes: Sequence[Complex],
    rows: Sequence[Sequence[int]],
    *,
    n_points: int,
    variances: Sequence[Real] | None = None,
) -> GluedShape:
    """Glue the shapes of one mode in several set-ups by least squares over the points they share.

    Parameters
    ----------
    shapes
        Mode shape in each set-up, of any complex scale, shape (channels of the set-up,).
    rows
        Index of the point that each channel of each set-up measures; the set-ups are connected through shared points.
    n_points
        Number of points.
    variances
        Variance of each shape, shape (channels of the set-up,); None: unknown, the same for all shapes scaled to 1 at
        their largest channel.

    Returns
    -------
    GluedShape

    Notes
    -----
    The weighted sum of abs(shape_j,c - scale_j shape_c)^2 is minimised over all scales and the shape, in turn. The
    variance is that of linear least squares at the minimum; the sum of squares that the shared points leave gives its
    scale where the variances are unknown, and increases it where it is more than they explain.

    References
    ----------
    C. Rainieri and G. Fabbrocino (2014), Operational Modal Analysis of Civil Engineering Structures, Springer, chapter
    4 (merging of set-ups after identification).
    """
    sizes = np.array([np.abs(shape).max() for shape in shapes])
    readings = _Readings(
        values=np.concatenate([shape / size for shape, size in zip(shapes, sizes, strict=True)]),
        weights=np.concatenate(
            [np.ones(len(own)) for own in rows]
            if variances is None
            else [size**2 / known for known, size in zip(variances, sizes, strict=True)]
        ),
        points=np.concatenate([np.asarray(own, dtype=np.intp) for own in rows]),
        owners=np.concatenate([np.full(len(own), k, dtype=np.intp) for k, own in enumerate(rows)]),
    )
    scales = _first_scales(readings, len(shapes))
    shape = np.zeros(n_points, dtype=complex)
    for _ in range(_SWEEPS):
        before = scales
        shape = _ratios(readings, scales[readings.owners], readings.points, n_points)
        shape = shape / np.abs(shape).max()
        scales = _ratios(readings, shape[readings.points], readings.owners, len(shapes))
        if np.abs(scales - before).max() < _CONVERGED:
            break
    largest = int(np.argmax(np.abs(shape)))
    shape, scales = shape / shape[largest], scales * shape[largest]
    variance = _variance(readings, shape, scales, is_known=variances is not None)
    is_measured = np.isin(np.arange(n_points), readings.points)
    return GluedShape(np.where(is_measured, shape, np.nan), np.where(is_measured, variance, np.nan), scales * sizes)


@dataclass(frozen=True, eq=False, slots=True)
class _Readings:
    """Shapes of all set-ups in a row: values with their weights, and the point and the set-up of each."""

    values: Complex
    weights: Real
    points: Indices
    owners: Indices


def _ratios(readings: _Readings, factors: Complex, groups: Indices, n_groups: int) -> Complex:
    """Return for each group the number that times `factors` is nearest to its values; 0 for an empty group."""
    products = readings.weights * factors.conj() * readings.values
    real, imaginary, power = (
        np.bincount(groups, part, n_groups)
        for part in (products.real, products.imag, readings.weights * np.abs(factors) ** 2)
    )
    return np.asarray((real + 1j * imaginary) / np.maximum(power, np.finfo(float).tiny))


def _first_scales(readings: _Readings, n_setups: int) -> Complex:
    """Return scales of the set-ups, each from those before it that share most of its motion."""
    motion = np.zeros((n_setups, readings.points.max() + 1), dtype=complex)
    motion[readings.owners, readings.points] = readings.values
    scales = np.zeros(n_setups, dtype=complex)
    scales[0], joined = 1.0, motion[0].copy()
    waiting = set(range(1, n_setups))
    while waiting:
        strength = {k: np.abs(np.vdot(joined, motion[k])) for k in waiting}
        best = max(sorted(waiting), key=lambda k: strength[k])
        shared = (joined != 0) & (motion[best] != 0)
        power = np.sum(np.abs(joined[shared]) ** 2)
        scales[best] = np.vdot(joined[shared], motion[best, shared]) / power if power else 1.0
        scales[best] = scales[best] if scales[best] else 1.0
        joined = np.where(joined == 0, motion[best] / scales[best], joined)
        waiting.remove(best)
    return scales


def _variance(readings: _Readings, shape: Complex, scales: Complex, *, is_known: bool) -> Real:
    """Return the variance of the shape at all points, the largest of which is held."""
    n_points, n_values = len(shape), len(readings.values)
    jacobian = np.zeros((n_values, n_points + len(scales)), dtype=complex)
    jacobian[np.arange(n_values), readings.points] = scales[readings.owners]
    jacobian[np.arange(n_values), n_points + readings.owners] = shape[readings.points]
    free = np.setdiff1d(np.flatnonzero(np.any(jacobian != 0, axis=0)), [np.argmax(np.abs(shape))])
    reduced = np.sqrt(readings.weights)[:, None] * jacobian[:, free]
    residual = readings.values - scales[readings.owners] * shape[readings.points]
    n_spare = n_values - len(free)
    scatter = np.sum(readings.weights * np.abs(residual) ** 2) / n_spare if n_spare > 0 else np.nan
    inverse = np.linalg.pinv(reduced.conj().T @ reduced, hermitian=True)
    variance = np.zeros(n_points)
    is_point = free < n_points
    variance[free[is_point]] = (np.fmax(scatter, 1.0) if is_known else scatter) * np.diag(inverse).real[is_point]
    return variance
