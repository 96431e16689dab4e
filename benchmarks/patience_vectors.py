"""Evidence of many simulated vehicles at once: `sprung.learn` and `Series.evidence` for cars of equal windows.

Where all windows report the same variance for each part, the model of the change test falls apart into blocks: left
against right of each kind and axle is one number, and the sums of both axles of a kind are two. `test_patience.py`
compares this with the functions of the package.
"""

from dataclasses import dataclass
from math import exp, log, sqrt

import numba
import numpy as np
from scipy.special import betaincinv

from sprung import read_vehicle, structure
from sprung.diagnosis import learning
from sprung.diagnosis.baseline import SETTINGS, slope_covariances
from sprung.diagnosis.hypotheses import PRIORS
from sprung.diagnosis.lasting import OWN_SCATTER, Series, witnesses_of
from sprung.diagnosis.ratios import Hypotheses
from sprung.diagnosis.scatter import (
    COMMON_AT_A_TEMPERATURE,
    FRONT_REAR_STD,
    ROUNDS,
    SERIAL,
    WEIGHTS,
    _whitened,
    _widening,
)

PARTS = tuple(structure(read_vehicle("zafira")).components())
CONDITIONS = ("payload", "roughness", "speed", "temperature")
KINDS = ("damper", "spring", "tyre")
#: Standard deviation that windows report, ln values.
REPORTED = 0.02
#: Pairs of parts: damper front and rear, spring front ..., left and right of each as indices of `PARTS`.
LEFT, RIGHT = (
    np.array([PARTS.index(part) for kind in KINDS for axle in ("front", "rear") for part in PARTS
              if (part.kind, part.axle, part.side) == (kind, axle, side)])
    for side in ("left", "right")
)  # fmt: skip
SUMS, ENDS, MEANS = np.ones((2, 2)), np.array([1.0, -1.0]) / np.sqrt(2), np.sqrt(2) / 4 * np.ones(2)
OWN, COMMON = SETTINGS.slope**2, np.square(SETTINGS.common_slopes)
#: Covariance of the slopes with each condition before any window: blocks of differences and of sums.
SLOPES = np.full((6, 4, 1, 1), OWN), np.tile(OWN * np.eye(2) + 2 * COMMON[:, None, None] * SUMS, (3, 1, 1, 1))
CORRELATIONS = np.array(SERIAL.correlations)


def blocks(values):
    """Return left against right, shape (.., 6, 1), and sums of left and right, shape (.., 3, 2), of ln values."""
    left, right = values[..., LEFT], values[..., RIGHT]
    sums = (left + right) / np.sqrt(2)
    return ((left - right) / np.sqrt(2))[..., None], sums.reshape(*sums.shape[:-1], 3, 2)


def inverse(matrices):
    """Return the inverses of matrices of 1 or 2 rows."""
    if matrices.shape[-1] == 1:
        return 1 / matrices
    (a, b), (c, d) = np.moveaxis(matrices, (-2, -1), (0, 1))
    return np.moveaxis(np.array([[d, -b], [-c, a]]), (0, 1), (-2, -1)) / (a * d - b * c)[..., None, None]


def chained(first, *others):
    """Return a block diagonal matrix of blocks with equal rows, each (.., rows, rows); leading axes broadcast."""
    every = [first, *others]
    shape = np.broadcast_shapes(*(each.shape[:-2] for each in every))
    size = sum(each.shape[-1] for each in every)
    whole, at = np.zeros((*shape, size, size)), 0
    for each in every:
        whole[..., at : at + each.shape[-1], at : at + each.shape[-1]] = each
        at += each.shape[-1]
    return whole


@dataclass(frozen=True)
class Baselines:
    """Baselines of vehicles, by blocks: differences, then sums. Leading axis: vehicles."""

    centre: np.ndarray
    met: np.ndarray
    coefficients: tuple
    information: tuple
    scatter: tuple
    nuisance: tuple
    degrees: np.ndarray
    correlations: np.ndarray
    squares: np.ndarray
    n_windows: int

    def units(self, units):
        return np.clip(units - self.centre[:, None], -SETTINGS.farthest, SETTINGS.farthest)

    def beyond(self, units):
        return units - np.clip(units, self.met[0][:, None], self.met[1][:, None])

    def residuals(self, units, values):
        rows = np.concatenate([np.ones((*units.shape[:2], 1)), units], axis=-1)
        return [each - np.einsum("vnk,vkbc->vnbc", rows, fit)
                for each, fit in zip(blocks(values), self.coefficients, strict=True)]  # fmt: skip

    def distances(self, units, values):
        """Return the squared distance of each window from the prediction for its conditions."""
        rows = np.concatenate([np.ones((*units.shape[:2], 1)), units], axis=-1)
        total = 0.0
        for away, J, own, nuisance in zip(
            self.residuals(units, values), self.information, self.scatter, self.nuisance, strict=True
        ):
            size = away.shape[-1]
            doubt = np.linalg.inv(J).reshape(*J.shape[:2], 5, size, 5, size)
            doubt = np.einsum("vnk,vbkclm,vnl->vnbcm", rows, doubt, rows)
            total = total + np.einsum("vnbc,vnbcm,vnbm->vn", away, inverse(doubt + (own + nuisance)[:, None]), away)
        return total


def estimated(units, values):
    """Return the baselines of vehicles from all of their windows."""
    centre = np.median(units, axis=1)
    roughness = CONDITIONS.index("roughness")
    centre[:, roughness] = np.log(np.median(np.exp(1.4 * units[:, :, roughness]), axis=1)) / 1.4
    at = np.clip(units - centre[:, None], -SETTINGS.farthest, SETTINGS.farthest)
    rows = np.concatenate([np.ones((*at.shape[:2], 1)), at], axis=-1)
    squared, parts = np.einsum("vnk,vnl->vkl", rows, rows), blocks(values)
    ends, together = (np.array([usual[kind] for kind in KINDS]) for usual in (FRONT_REAR_STD, COMMON_AT_A_TEMPERATURE))
    scatter = _covariances(np.ones((len(units), 6)), ends, together)
    for _ in range(ROUNDS):
        whole = [own + other for own, other in zip(*scatter, strict=True)]
        coefficients, _ = _regressions(rows, parts, squared, whole)
        deviations = [y - np.einsum("vnk,vkbc->vnbc", rows, fit) for y, fit in zip(parts, coefficients, strict=True)]
        *learnt, _ = _learnt(deviations, whole, squared, is_widened=False)
        scatter = _covariances(*learnt)
    *learnt, degrees = _learnt(deviations, whole, squared, is_widened=True)
    scatter = _covariances(*learnt)
    _, information = _regressions(rows, parts, squared, [own + other for own, other in zip(*scatter, strict=True)])
    correlations, squares = _serial(deviations[0][..., 0], rows, scatter[0][0][:, :, 0, 0])
    met = at.min(axis=1), at.max(axis=1)
    return Baselines(
        centre, met, coefficients, information, *scatter, degrees, correlations, squares, units.shape[1]
    )  # fmt: skip


def _covariances(scales, ends, together):
    """Return scatter and nuisance of both kinds of blocks; `scales` are variances over those that windows report."""
    variances = REPORTED**2 * scales
    own = variances[:, :, None, None], variances.reshape(-1, 3, 2)[..., None] * np.eye(2)
    of_sums = (ends**2)[..., None, None] * np.outer(ENDS, ENDS) + 2 * (together**2)[..., None, None] * SUMS
    return own, (np.zeros_like(own[0]), np.broadcast_to(of_sums, own[1].shape))


def _regressions(rows, parts, squared, whole):
    coefficients, informations = [], []
    for values, covariance, slopes in zip(parts, whole, SLOPES, strict=True):
        n_blocks, size = values.shape[-2:]
        known = inverse(covariance)
        J = np.einsum("vkl,vbcd->vbkcld", squared, known).reshape(len(rows), n_blocks, 5 * size, 5 * size)
        J = J + chained(np.zeros((n_blocks, size, size)), *np.moveaxis(inverse(slopes), 1, 0))
        pulls = np.einsum("vnk,vnbc,vbcd->vbkd", rows, values, known).reshape(len(rows), n_blocks, -1)
        fit = np.linalg.solve(J, pulls[..., None])[..., 0].reshape(len(rows), n_blocks, 5, size)
        coefficients.append(fit.swapaxes(1, 2))
        informations.append(J)
    return tuple(coefficients), tuple(informations)


def _degrees(n_windows, squared, ridges):
    """Return the degrees of freedom left to directions of a variance over that of each slope, shape (.., 4)."""
    ridges = np.concatenate([np.zeros((*ridges.shape[:-1], 1)), ridges], axis=-1)
    squared = squared[:, None]
    used = np.linalg.solve(squared + ridges[..., None] * np.eye(5), np.broadcast_to(squared, (*ridges.shape, 5)))
    return np.maximum(n_windows - np.trace(used, axis1=-2, axis2=-1), 1.0)


def _learnt(deviations, whole, squared, *, is_widened):
    differences, sums = deviations[0][..., 0], deviations[1]
    n_windows = sums.shape[1]
    left = _degrees(n_windows, squared, np.repeat(whole[0][:, :, :, 0] / OWN, 4, axis=-1))
    squares = np.sum(differences**2, axis=1) / REPORTED**2
    degrees = np.sum(left, axis=1) + WEIGHTS.reported
    common = (np.sum(squares, axis=1) + WEIGHTS.reported) / degrees
    weight = WEIGHTS.pairs + WEIGHTS.reported / 6
    scales = (squares + weight * common[:, None]) / (left + weight)
    if is_widened:
        scales = scales * _widening(left + weight, degrees[:, None])
    stds = []
    for row, usual, weight, slopes in (
        (ENDS, FRONT_REAR_STD, WEIGHTS.front_rear, np.full(4, OWN)),
        (MEANS, COMMON_AT_A_TEMPERATURE, WEIGHTS.common, OWN / 4 + COMMON),
    ):
        left = _degrees(n_windows, squared, (whole[1] @ row @ row)[..., None] / slopes)
        own = np.sum((sums @ row) ** 2, axis=1) / left
        chance = REPORTED**2 * scales.reshape(-1, 3, 2) @ row**2
        share, before = left / (left + weight), np.array([usual[kind] for kind in KINDS])
        variance = share * np.maximum(own - chance, 0.0) + (1 - share) * before**2
        stds.append(np.sqrt(variance * (_widening(left + weight, degrees[:, None]) if is_widened else 1.0)))
    return scales, *stds, degrees


def _serial(differences, rows, variances):
    logs, squares = [], []
    ridges = variances[:, :, None] / OWN * np.array([0.0, 1, 1, 1, 1])
    degrees = 6 * (differences.shape[1] - 1)
    for correlation in CORRELATIONS:
        X, y = (_whitened(each.swapaxes(0, 1), correlation).swapaxes(0, 1) for each in (rows, differences))
        y = y / np.sqrt(variances)[:, None]
        J = np.einsum("vnk,vnl->vkl", X, X)[:, None] + ridges[..., None] * np.eye(5)
        pulled = np.einsum("vnk,vnb->vbk", X, y)
        rest = np.sum(y**2, axis=(1, 2)) - np.sum(pulled * np.linalg.solve(J, pulled[..., None])[..., 0], axis=(1, 2))
        squares.append(WEIGHTS.reported + rest)
        volume = np.sum(np.linalg.slogdet(J)[1], axis=1) + degrees * np.log1p(-(correlation**2))
        logs.append(-volume / 2 - (WEIGHTS.reported + degrees) / 2 * np.log(squares[-1]))
    logs = np.array(logs).T
    weights = SERIAL.prior * np.exp(logs - logs.max(axis=1, keepdims=True))
    return weights / weights.sum(axis=1, keepdims=True), (np.array(squares) / squares[0]).T


def baselines(units, values):
    """Yield vehicles, as indices, and their baselines; suspect windows are left out as by `sprung.learn`.

    Vehicles that have too few windows then are in none of them.
    """
    waiting = [(np.arange(len(units)), units, values)]
    while waiting:
        which, units, values = waiting.pop()
        found, n = estimated(units, values), units.shape[1]
        worst = np.argmax(found.distances(found.units(units), values), axis=1)
        rest = np.arange(n - 1) + (np.arange(n - 1) >= worst[:, None])
        others = [np.take_along_axis(each, rest[..., None], axis=1) for each in (units, values)]
        without = estimated(*others)
        left_out = [np.take_along_axis(each, worst[:, None, None], axis=1) for each in (units, values)]
        distance = without.distances(without.units(left_out[0]), left_out[1])[:, 0]
        share = betaincinv(without.degrees / 2, len(PARTS) / 2, learning.SETTINGS.suspect / n)
        is_suspect = distance > without.degrees * (1 / share - 1)
        if np.any(is_suspect) and n > learning.SETTINGS.min_windows:
            waiting.append((which[is_suspect], others[0][is_suspect], others[1][is_suspect]))
        yield which[~is_suspect], _chosen(found, ~is_suspect)


def _chosen(found, which):
    both = {name: tuple(each[which] for each in getattr(found, name))
            for name in ("met", "coefficients", "information", "scatter", "nuisance")}  # fmt: skip
    one = {name: getattr(found, name)[which] for name in ("centre", "degrees", "correlations", "squares")}
    return Baselines(**both, **one, n_windows=found.n_windows)


HYPOTHESES = Hypotheses.of(PARTS)


def evidence(baseline, units, values, looks):
    """Return ln of the e-detector of vehicles at each look, shape (vehicles, looks), as `Series.evidence` does."""
    whole = series(baseline, units, values)
    known, later = np.linalg.inv(whole.own), np.linalg.inv(whole.beyond)
    return np.array(
        [
            _evidence(
                whole.values[k], whole.variances[k], whole.scatter[k], whole.units[k], known[k], later[k],
                whole.n_learning, whole.correlations[k], whole.squares[k], whole.witnesses[k], whole.log_prior,
                np.array(looks),
            )
            for k in range(len(units))
        ]
    )  # fmt: skip


(SCALES, WEIGHTS_OF), UNEQUAL, FEWEST = OWN_SCATTER.scales, OWN_SCATTER.unequal, WEIGHTS.pairs
RHO, BETWEEN, STRONG = np.array(SERIAL.correlations), 1 / PRIORS.size**2, SERIAL.strong


@numba.njit(fastmath=True)
def _evidence(
    y, variances, scatter, units, known, later, n_learning, correlations, squares, witnesses, log_prior, looks
):
    n_series, n = y.shape
    old = 1.0
    n_looks, n_rho, n_own, width = len(looks), len(RHO), known.shape[-1], units.shape[-1]
    rest, volume = np.empty((n_looks, n_series)), np.empty((n_looks, n_series))
    explained, volumes = np.empty((n_looks, n_series, n)), np.empty((n_looks, n_series, n))
    J, root = np.zeros((width, width)), np.zeros((width, width))
    g, pulled, half, each = np.empty(width), np.empty(width), np.empty(width), np.empty(width)
    first, summed = np.empty((n, width + 2)), np.zeros((n + 1, width + 2))
    top, bottom = np.full((n_looks, n_series), -np.inf), np.full((n_looks, n_series), -np.inf)
    for r in range(n_rho):
        rho, factor = RHO[r], squares[r]
        share = (1 - rho * (1 - 2 / n_learning)) / (1 + rho)
        for k in range(n_series):
            J[:], pulled[:], squared = 0.0, 0.0, 0.0
            J[:n_own, :n_own] = known[k] * share / factor
            J[n_own:, n_own:] = later[k] / factor
            logs, look = _root(J, root), 0
            for w in range(n):
                v, a, z = variances[k, w] + (factor - 1) * scatter[k, w], 0.0, y[k, w]
                left = v
                if w > 0:
                    a = rho * factor * sqrt(scatter[k, w] * scatter[k, w - 1]) / old
                    left -= a * a * old
                    z -= a * y[k, w - 1]
                old = v
                logs -= log(left)
                squared += z * z / left
                for u in range(width):
                    g[u] = units[w, u] - (a * units[w - 1, u] if w > 0 else 0.0)
                for u in range(width):
                    heavy = g[u] / left
                    first[w, u] = heavy
                    summed[w + 1, u] = summed[w, u] + heavy * (1 - a)
                    pulled[u] += heavy * z
                    for i in range(u + 1):
                        J[u, i] += heavy * g[i]
                first[w, width], first[w, width + 1] = z / left, 1 / left
                summed[w + 1, width] = summed[w, width] + z * (1 - a) / left
                summed[w + 1, width + 1] = summed[w, width + 1] + (1 - a) ** 2 / left
                if look == n_looks or w + 1 != looks[look]:
                    continue
                volume[look, k] = logs - _root(J, root)
                half[:] = pulled
                _solve(root, half)
                rest[look, k] = squared - np.sum(half**2)
                for o in range(w + 1):
                    for u in range(width):
                        each[u] = first[o, u] + summed[w + 1, u] - summed[o + 1, u]
                    _solve(root, each)
                    score = first[o, width] + summed[w + 1, width] - summed[o + 1, width]
                    information = first[o, width + 1] + summed[w + 1, width + 1] - summed[o + 1, width + 1]
                    for u in range(width):
                        score -= each[u] * half[u]
                        information -= each[u] ** 2
                    explained[look, k, o] = score**2 / (information + BETWEEN)
                    volumes[look, k, o] = sqrt(1 + information / BETWEEN)
                look += 1
        probable = log(max(correlations[r], 1e-300))
        counted = probable if rho < STRONG else 0.0
        for look in range(n_looks):
            m = looks[look]
            for k in range(n_series):
                common, count = FEWEST, FEWEST
                for i in range(n_series):
                    if witnesses[k, i] and i != k:
                        common += rest[look, i]
                        count += m
                common, free, alike, unequal = common / count, count + m, 0.0, 0.0
                for i in range(n_series):
                    if witnesses[k, i] and i != k:
                        alike += (volume[look, i] - m * log(common) - rest[look, i] / common) / 2
                        logs_of = WEIGHTS_OF - (m * np.log(SCALES) + rest[look, i] / (common * SCALES)) / 2
                        unequal += (volume[look, i] - m * log(common)) / 2 + _log_sum(logs_of)
                for s in range(1 + len(SCALES)):
                    x = common * (SCALES[s - 1] if s else 1.0)
                    own = unequal + log(UNEQUAL) + WEIGHTS_OF[s - 1] if s else alike + log(1 - UNEQUAL)
                    own += (volume[look, k] - m * log(x)) / 2 - free / 2 * log(1 + rest[look, k] / (count * x))
                    whole, total = rest[look, k] + count * x, 0.0
                    for o in range(m):
                        total += (
                            exp(min(-free / 2 * log(1 - explained[look, k, o] / whole), 700.0)) / volumes[look, k, o]
                        )
                    top[look, k] = np.logaddexp(top[look, k], probable + own + log(total))
                    bottom[look, k] = np.logaddexp(bottom[look, k], counted + own)
    found = np.empty(n_looks)
    for look in range(n_looks):
        found[look] = log(np.sum(np.exp(top[look] - bottom[look] + log_prior)))
    return found


@numba.njit(fastmath=True)
def _log_sum(logs):
    largest = logs.max()
    return largest + log(np.sum(np.exp(logs - largest)))


@numba.njit(fastmath=True)
def _root(matrix, root):
    """Write the Cholesky factor L to `root`, from the lower triangle, and return ln of the determinant."""
    total = 0.0
    for i in range(len(matrix)):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= root[i, k] * root[j, k]
            if i == j:
                root[i, i] = sqrt(value)
                total += log(value)
            else:
                root[i, j] = value / root[j, j]
    return total


@numba.njit(fastmath=True)
def _solve(root, column):
    """Replace a column by L^-1 of it, with a lower triangular L."""
    for i in range(len(column)):
        value = column[i]
        for j in range(i):
            value -= root[i, j] * column[j]
        column[i] = value / root[i, i]


def series(baseline, units, values):
    """Return what the e-detector sees of vehicles: `Series` with vehicles as its first axis."""
    at = baseline.units(units)
    beyond = baseline.beyond(at)
    rows = np.concatenate([np.ones((*at.shape[:2], 1)), at, beyond], axis=-1)
    unknown = sum(slope_covariances(PARTS)[len(CONDITIONS) :])[0, 0]
    directions = [np.moveaxis(each, 0, -1) for each in blocks(HYPOTHESES.directions)]
    contrasts = [
        np.linalg.solve(own + nuisance + slopes.sum(axis=1) + unknown * np.eye(slopes.shape[-1]), d[None])
        for own, nuisance, slopes, d in zip(baseline.scatter, baseline.nuisance, SLOPES, directions, strict=True)
    ]
    scale = sum(np.sum(d * each, axis=(1, 2)) for d, each in zip(directions, contrasts, strict=True))
    total = dict.fromkeys(("values", "scatter", "chance", "own", "beyond"), 0.0)
    plain = 0.0
    for contrast, away, own, nuisance, J, slopes in zip(
        contrasts, baseline.residuals(at, values), baseline.scatter, baseline.nuisance, baseline.information, SLOPES,
        strict=True,
    ):  # fmt: skip
        c, size = contrast / scale[:, None, None], contrast.shape[2]
        doubt = np.linalg.inv(J).reshape(*J.shape[:2], 5, size, 5, size)
        total["values"] += np.einsum("vbik,vnbi->vkn", c, away)
        total["scatter"] += np.einsum("vbik,vbij,vbjk->vk", c, own, c)
        plain = plain + np.einsum("vbik,vbij,vbjk->vk", c, REPORTED**2 * np.eye(size) + nuisance, c)
        total["chance"] += np.einsum("vbik,vbij,vbjk->vk", c, own + nuisance, c)
        total["own"] += np.einsum("vbkghj,vbjk->vkgh", np.einsum("vbik,vbgihj->vbkghj", c, doubt), c)
        total["beyond"] += np.einsum("vbkgj,vbjk->vkg", np.einsum("vbik,bgij->vbkgj", c, slopes), c)
    spread = np.einsum("vkg,vng->vkn", total["beyond"], beyond**2)
    count, witnesses = len(HYPOTHESES.directions), []
    for k in range(len(units)):
        (d, m), rows_of = [each[k] / scale[k] for each in contrasts], np.zeros((count, len(PARTS)))
        d, m = d[:, 0].T / np.sqrt(2), m.reshape(6, count).T / np.sqrt(2)
        rows_of[:, LEFT], rows_of[:, RIGHT] = m + d, m - d
        witnesses.append(witnesses_of(rows_of, HYPOTHESES))
    prior = HYPOTHESES.log_prior[:count]
    scale = (plain / total["chance"])[..., None]
    return Series(
        total["values"], scale * (total["chance"][..., None] + spread),
        np.broadcast_to(scale * total["scatter"][..., None], spread.shape), rows, scale[..., None] * total["own"],
        scale[..., None] * total["beyond"][..., None] * np.eye(len(CONDITIONS)), baseline.n_windows,
        baseline.correlations, baseline.squares, np.array(witnesses), prior - np.logaddexp.reduce(prior),
    )  # fmt: skip
