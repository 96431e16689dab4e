"""Evidence of many simulated vehicles at once: `sprung.learn` and `lasting_evidence` for cars of equal windows.

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
from sprung.diagnosis.baseline import SETTINGS
from sprung.diagnosis.hypotheses import PRIORS, hypotheses_of, log_prior
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


SCOPES = [each.scope for each in hypotheses_of(PARTS)]
PRIOR = np.exp(log_prior(hypotheses_of(PARTS)))
SINGLE, AXLE, ALL, ELSE, PAIR = (float(PRIOR[SCOPES.index(s)]) for s in ("single", "axle", "all", "else", "pair"))
BETWEEN, UNMODELLED = 1 / PRIORS.size**2, 1 / PRIORS.unmodelled_size**2
STRONG, N_UNITS, N_PARTS = SERIAL.strong, 1 + 2 * len(CONDITIONS), len(PARTS)


def evidence(baseline, units, values, looks):
    """Return ln of the e-detector of vehicles at each look, shape (2, vehicles, looks).

    First with consecutive windows as possibly correlated, as `lasting_evidence`, then as independent.
    """
    at = baseline.units(units)
    beyond = baseline.beyond(at)
    rows = np.concatenate([np.ones((*at.shape[:2], 1)), at, beyond], axis=-1)
    parts = []
    for away, own, nuisance, information, slopes in zip(
        baseline.residuals(at, values), baseline.scatter, baseline.nuisance, baseline.information, SLOPES, strict=True
    ):
        whole = (own + nuisance)[:, None] + np.einsum("vnc,bcij->vnbij", beyond**2, slopes)
        later = chained(*np.moveaxis(inverse(slopes), 1, 0))
        later = np.broadcast_to(later, (len(units), *later.shape))
        parts += [away, own, whole, information, later]
    found = np.empty((2, len(units), len(looks)))
    for k in range(len(units)):
        found[:, k] = _evidence(
            rows[k], *(np.ascontiguousarray(each[k]) for each in parts), baseline.degrees[k], baseline.squares[k],
            baseline.correlations[k], baseline.n_windows, np.array(looks),
        )  # fmt: skip
    return found


@numba.njit(fastmath=True)
def _evidence(
    rows, d, d_own, d_whole, d_known, d_later, m, m_own, m_whole, m_known, m_later,
    degrees, squares, probabilities, n_learning, looks,
):  # fmt: skip
    n, n_rho, n_looks = len(rows), len(CORRELATIONS), len(looks)
    top, bottom, found = np.empty((n_looks, n_rho)), np.empty((n_looks, n_rho)), np.empty((2, n_looks))
    D, KD = np.empty((n_looks, 6, 1, n)), np.empty((n_looks, 6, 1, 1, n))
    M, KM = np.empty((n_looks, 3, 2, n)), np.empty((n_looks, 3, 2, 2, n))
    for j in range(n_rho):
        rho, factor, at = CORRELATIONS[j], squares[j], np.zeros((n_looks, 2))
        share = (1 - rho * (1 - 2 / n_learning)) / (1 + rho)
        for b in range(6):
            _block(rows, d[:, b], d_own[b], d_whole[:, b], d_known[b] * share, d_later[b], rho, factor, looks, at,
                   D[:, b], KD[:, b])  # fmt: skip
        for b in range(3):
            _block(rows, m[:, b], m_own[b], m_whole[:, b], m_known[b] * share, m_later[b], rho, factor, looks, at,
                   M[:, b], KM[:, b])  # fmt: skip
        known = log(max(probabilities[j], 1e-300))
        for k in range(n_looks):
            rest, free = degrees + at[k, 0], degrees + N_PARTS * looks[k]
            likelihood = (at[k, 1] + degrees * log(degrees) - free * log(rest)) / 2
            value = log(_mean_over_hypotheses(D[k, :, 0], KD[k, :, 0, 0], M[k], KM[k], rest, free, looks[k]))
            top[k, j] = known + likelihood + value
            bottom[k, j] = (known if rho < STRONG else 0.0) + likelihood
            if j == 0:
                found[1, k] = value
    for k in range(n_looks):
        found[0, k] = _log_sum(top[k]) - _log_sum(bottom[k])
    return found


@numba.njit(fastmath=True)
def _log_sum(logs):
    largest = logs.max()
    return largest + log(np.sum(np.exp(logs - largest)))


@numba.njit(fastmath=True)
def _block(rows, r, own, whole, known, later, rho, factor, looks, at, scores, informations):
    """Add rest and volume of a block at each look to `at`, and fill in score and information of each onset."""
    n, size = r.shape
    width = N_UNITS * size
    J, root = np.zeros((width, width)), np.zeros((width, width))
    J[: len(known), : len(known)] = known / factor
    J[len(known) :, len(known) :] = later / factor
    volume, squared, k = _root(J, root), 0.0, 0
    # Rows: B^T W D, D^T W D and D^T W z of the windows before; the same of each window as the first changed one.
    height = width + size + 1
    summed, first = np.zeros((n + 1, height, size)), np.empty((n, height, size))
    seen, pulled = np.zeros((width, size)), np.zeros((width, 1))
    V, V_old, left, W, A = np.zeros((5, size, size))
    WD, z, half, each = np.zeros((size, size)), np.zeros((size, 1)), np.empty((width, 1)), np.empty((width, size))
    for w in range(n):
        V_old[:] = V
        V[:] = whole[w] + (factor - 1) * own
        left[:] = V
        if w > 0 and rho > 0:
            _inverted(V_old, W)
            for i in range(size):
                for j in range(size):
                    A[i, j] = rho * factor * own[i, i] * W[i, j]
            for i in range(size):
                for j in range(size):
                    left[i, j] -= rho * factor * own[i, i] * A[j, i]  # A V_old A^T
        volume -= log(_inverted(left, W))
        for i in range(size):
            z[i, 0] = r[w, i]
            for j in range(size):
                z[i, 0] -= A[i, j] * r[w - 1, j] if w > 0 else 0.0
            for u in range(N_UNITS):
                for j in range(size):
                    value = rows[w, u] if i == j else 0.0
                    seen[u * size + j, i] = value - (rows[w - 1, u] * A[i, j] if w > 0 else 0.0)
        _product(W, A, WD)
        WD[:] = W - WD
        _product(seen, W, first[w, :width])
        _product(seen, WD, each)
        summed[w + 1] = summed[w]
        summed[w + 1, :width] += each
        for u in range(width):
            for i in range(size):
                pulled[u, 0] += first[w, u, i] * z[i, 0]
                for v in range(u + 1):
                    J[u, v] += first[w, u, i] * seen[v, i]
        for i in range(size):
            total, turned = 0.0, 0.0
            for j in range(size):
                total += W[i, j] * z[j, 0]
                turned += WD[j, i] * z[j, 0]
                value = WD[i, j]
                for c in range(size):
                    value -= A[c, i] * WD[c, j]
                first[w, width + i, j] = W[i, j]
                summed[w + 1, width + i, j] += value
            squared += z[i, 0] * total
            first[w, width + size, i] = total
            summed[w + 1, width + size, i] += turned
        if k == len(looks) or w + 1 != looks[k]:
            continue
        at[k, 1] += volume - _root(J, root)
        half[:] = pulled
        _solve(root, half)
        at[k, 0] += squared - np.sum(half**2)
        for o in range(w + 1):
            every = first[o] + summed[w + 1] - summed[o + 1]
            _solve(root, every[:width])
            for i in range(size):
                total = every[width + size, i]
                for u in range(width):
                    total -= every[u, i] * half[u, 0]
                scores[k, i, o] = total
                for j in range(size):
                    total = every[width + i, j]
                    for u in range(width):
                        total -= every[u, i] * every[u, j]
                    informations[k, i, j, o] = total
        k += 1


@numba.njit(fastmath=True)
def _product(one, two, result):
    """Write the product of small matrices to `result`."""
    for i in range(one.shape[0]):
        for j in range(two.shape[1]):
            total = 0.0
            for c in range(two.shape[0]):
                total += one[i, c] * two[c, j]
            result[i, j] = total


@numba.njit(fastmath=True)
def _inverted(matrix, result):
    """Write the inverse of a matrix of 1 or 2 rows to `result`, and return the determinant."""
    if len(matrix) == 1:
        result[0, 0] = 1 / matrix[0, 0]
        return matrix[0, 0]
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    result[0, 0], result[1, 1] = matrix[1, 1] / determinant, matrix[0, 0] / determinant
    result[0, 1], result[1, 0] = -matrix[0, 1] / determinant, -matrix[1, 0] / determinant
    return determinant


@numba.njit(fastmath=True)
def _root(matrix, root):
    """Write the Cholesky factor L to `root`, from the lower triangle, and return ln of the determinant."""
    total = 0.0
    for i in range(len(matrix)):
        for j in range(i + 1):
            value = matrix[i, j]
            for c in range(j):
                value -= root[i, c] * root[j, c]
            if i == j:
                root[i, i] = sqrt(value)
                total += log(value)
            else:
                root[i, j] = value / root[j, j]
    return total


@numba.njit(fastmath=True)
def _solve(root, columns):
    """Replace columns by L^-1 of them, with a lower triangular L."""
    for i in range(columns.shape[0]):
        for c in range(columns.shape[1]):
            value = columns[i, c]
            for j in range(i):
                value -= root[i, j] * columns[j, c]
            columns[i, c] = value / root[i, i]


@numba.njit(fastmath=True)
def _mean_over_hypotheses(d, of_d, m, of_m, rest, free, n):
    """Return the e-detector: the sum over onsets of the mean over hypotheses."""
    total, power = 0.0, -free / 2
    score, known = np.empty(12), np.empty(12)
    for o in range(n):
        for i in range(12):
            p, sign = i % 6, 1.0 if i < 6 else -1.0
            score[i] = (m[p // 2, p % 2, o] + sign * d[p, o]) / sqrt(2.0)
            known[i] = (of_m[p // 2, p % 2, p % 2, o] + of_d[p, o]) / 2
            total += SINGLE * _ratio(score[i] ** 2 / (known[i] + BETWEEN), 1 + known[i] / BETWEEN, rest, power)
        explained, volume = 0.0, 1.0
        for p in range(6):
            K = 2 * of_m[p // 2, p % 2, p % 2, o]
            total += AXLE * _ratio(2 * m[p // 2, p % 2, o] ** 2 / (K + BETWEEN), 1 + K / BETWEEN, rest, power)
            explained += d[p, o] ** 2 / (of_d[p, o] + UNMODELLED)
            volume *= 1 + of_d[p, o] / UNMODELLED
        for k in range(3):
            one, two = m[k, 0, o], m[k, 1, o]
            x, c, y = of_m[k, 0, 0, o], of_m[k, 0, 1, o], of_m[k, 1, 1, o]
            K = 2 * (x + 2 * c + y)
            total += ALL * _ratio(2 * (one + two) ** 2 / (K + BETWEEN), 1 + K / BETWEEN, rest, power)
            x, y = x + UNMODELLED, y + UNMODELLED
            explained += (one**2 * y - 2 * one * two * c + two**2 * x) / (x * y - c**2)
            volume *= (x * y - c**2) / UNMODELLED**2
        total += ELSE * _ratio(explained, volume, rest, power)
        for i in range(12):
            for j in range(i + 1, 12):
                p, q, c = i % 6, j % 6, 0.0
                if p == q:
                    c = (of_m[p // 2, p % 2, p % 2, o] - of_d[p, o]) / 2
                elif p // 2 == q // 2:
                    c = of_m[p // 2, 0, 1, o] / 2
                x, y = known[i] + BETWEEN, known[j] + BETWEEN
                both = x * y - c * c
                gain = (score[i] ** 2 * y - 2 * score[i] * score[j] * c + score[j] ** 2 * x) / both
                total += PAIR * _ratio(gain, both / BETWEEN**2, rest, power)
    return total


@numba.njit(fastmath=True)
def _ratio(explained, determinant, rest, power):
    return exp(power * log(1 - explained / rest)) / sqrt(determinant)
