"""Evidence of many simulated vehicles at once: `sprung.learn` and `lasting_evidence` for cars of equal windows.

Where all windows report the same variance for each part, the model of the change test falls apart into blocks: left
against right of each kind and axle is one number, and the sums of both axles of a kind are two. `test_patience.py`
compares this with the functions of the package.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv, gammaln

from sprung import read_vehicle, structure
from sprung.diagnosis import learning
from sprung.diagnosis.baseline import SETTINGS
from sprung.diagnosis.hypotheses import PRIORS
from sprung.diagnosis.ratios import Hypotheses
from sprung.diagnosis.scatter import (
    COMMON_AT_A_TEMPERATURE,
    FRONT_REAR_STD,
    LASTING,
    ROUNDS,
    WEIGHTS,
    _widening,
    independent_directions,
    whitened,
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
TOGETHER = np.ones(2) / np.sqrt(2)
OWN, COMMON = SETTINGS.slope**2, np.square(SETTINGS.common_slopes)
#: Covariance of the slopes with each condition before any window: blocks of differences and of sums.
SLOPES = np.full((6, 4, 1, 1), OWN), np.tile(OWN * np.eye(2) + 2 * COMMON[:, None, None] * SUMS, (3, 1, 1, 1))
CORRELATIONS = np.array(LASTING.correlations)
#: Coordinates of the parts: differences, front against rear, all of a kind; variance of their slopes with conditions.
ROWS, _ = independent_directions(PARTS)
OF_SLOPES = OWN + 4 * COMMON[:, None] * (np.arange(len(PARTS)) >= 9)


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
    weights: np.ndarray
    variances: np.ndarray
    squares: np.ndarray
    own_degrees: np.ndarray
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
    own = _own_scatter(parts, rows, scatter[1])
    *learnt, degrees = _learnt(deviations, whole, squared, is_widened=True)
    scatter = _covariances(*learnt)
    _, information = _regressions(rows, parts, squared, [own + other for own, other in zip(*scatter, strict=True)])
    met = at.min(axis=1), at.max(axis=1)
    return Baselines(
        centre, met, coefficients, information, *scatter, degrees, *own, units.shape[1]
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


def _own_scatter(parts, rows, nuisance):
    """Return weights, sums of squares by correlation and their degrees of freedom, as `own_scatter`."""
    variances = _variances(nuisance)
    values = np.concatenate([np.squeeze(parts[0], -1), parts[1] @ ENDS, parts[1] @ TOGETHER], axis=-1)
    along = _alone(variances)
    values = _extended(values / np.sqrt(variances)[:, None], along)
    slopes = np.moveaxis(OF_SLOPES[:, None] / variances, 0, -1)
    slopes = np.concatenate([slopes, along**2 @ slopes], axis=1)
    known = np.zeros((*slopes.shape[:2], 5, 5))
    at = np.arange(1, 5)
    known[..., at, at] = 1 / slopes
    m, logs, squares = rows.shape[1] - 1, [], []
    f = np.array([LASTING.same, LASTING.spread])[:, None, None, None]
    nodes = np.sqrt((2 / m + 2 / f) / 6) * np.arange(-6, 6.5, 0.5)[:, None, None]
    for correlation in CORRELATIONS:
        X, y = (whitened(each.swapaxes(0, 1), correlation).swapaxes(0, 1) for each in (rows, values))
        J = np.einsum("vnk,vnl->vkl", X, X)[:, None] + known
        pulled = np.einsum("vnk,vnb->vbk", X, y)
        rest = np.sum(y**2, axis=1) - np.sum(pulled * np.linalg.solve(J, pulled[..., None])[..., 0], axis=-1)
        squares.append(rest)
        volume = np.sum(np.linalg.slogdet(J[:, :6])[1], axis=1) + 6 * m * np.log1p(-(correlation**2))
        common = (np.sum(rest[:, :6], axis=1) + WEIGHTS.reported) / (6 * m + WEIGHTS.reported)
        scaled = f * common[:, None] * np.exp(nodes)
        each = gammaln((f + m) / 2) - gammaln(f / 2) + f / 2 * np.log(scaled)
        each = np.sum(each - (f + m) / 2 * np.log(scaled + rest[:, :6]), axis=-1)
        logs.append(logsumexp(each, axis=1) + np.log(np.ptp(nodes, axis=1)[..., 0]) - volume / 2)
    logs = np.moveaxis(logs, (0, 1, 2), (2, 1, 0))
    weights = LASTING.prior * np.exp(logs - logs.max(axis=(1, 2), keepdims=True))
    weights = weights / weights.sum(axis=(1, 2), keepdims=True)
    return weights, variances, np.moveaxis(squares, 0, 1), np.full(squares[0].shape, float(m))


def _alone(variances):
    """Return the estimate of each change alone as weights of coordinates, shape (vehicles, hypotheses, 12)."""
    moved = MOVED / np.sqrt(variances)[:, None]
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True)


def _extended(values, along):
    """Return coordinates of windows and the estimates of changes, shape (vehicles, windows, rows)."""
    return np.concatenate([values, np.einsum("vhk,vnk->vnh", along, values)], axis=-1)


def _scales(baseline, j):
    """Return groups of coordinates with one variance, their sums of squares and degrees; those of changes."""
    squares, own = baseline.squares[:, j], baseline.own_degrees
    n_windows = np.sum(own[:, :6], axis=1)
    before = np.maximum(baseline.degrees - n_windows, WEIGHTS.reported)[:, None]
    common = (np.sum(squares[:, :6], axis=1)[:, None] + before) / (n_windows[:, None] + before)
    spreads = np.where(np.arange(own.shape[1]) < 12, WEIGHTS.common, LASTING.spread)
    squares_of, degrees_of = squares + spreads * common, own + spreads
    groups = np.vstack([np.arange(12) < 9, np.eye(12)[9:]]).astype(float)
    alike = [np.concatenate([np.sum(each[:, :9], axis=1, keepdims=True) + before, other[:, 9:12]], axis=1)
             for each, other in ((squares, squares_of), (own, degrees_of))]  # fmt: skip
    return (groups, *alike), (squares_of[:, 12:], degrees_of[:, 12:])


def _variances(nuisance):
    """Return the variance of each coordinate where parts scatter alike: differences, ends, and all of a kind."""
    of_sums = REPORTED**2 * np.eye(2) + nuisance[1]
    ends, means = (np.einsum("i,vbij,j->vb", row, of_sums, row) for row in (ENDS, TOGETHER))
    return np.concatenate([np.full((len(ends), 6), REPORTED**2), ends, means], axis=-1)


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
    one = {
        name: getattr(found, name)[which]
        for name in ("centre", "degrees", "weights", "variances", "squares", "own_degrees")
    }
    return Baselines(**both, **one, n_windows=found.n_windows)


def logsumexp(values, axis):
    """Return ln of a sum, as that of SciPy: in a third of its time."""
    most = np.max(values, axis=axis, keepdims=True)
    most[~np.isfinite(most)] = 0.0
    return np.log(np.sum(np.exp(values - most), axis=axis)) + np.squeeze(most, axis)


HYPOTHESES = Hypotheses.of(PARTS)
#: Change of each coordinate by each hypothesis with one size, and ln of their prior probabilities.
MOVED = HYPOTHESES.directions @ ROWS.T
PRIOR = HYPOTHESES.log_prior[: len(MOVED)] - logsumexp(HYPOTHESES.log_prior[: len(MOVED)], axis=0)
SPREAD = 1.2
#: Correlations of the first, rough evidence, as indices of `CORRELATIONS`, unless fewer have a probability above 2 %;
#: nodes of the mean over sizes.
ROUGHLY, FEW, ALL = (0, 3, 6), 1, 9


def evidence(baseline, units, values, looks, above=-np.inf):
    """Return ln of the e-detector of vehicles at each look, as `lasting_evidence`, shape (vehicles, looks).

    A vehicle of which it is below `above` by some of the correlations and one size has that instead.
    """
    at = baseline.units(units)
    beyond = baseline.beyond(at)
    away, variances = baseline.residuals(at, values), baseline.variances
    along = _alone(variances)
    slopes = np.moveaxis(OF_SLOPES[:, None] / variances, 0, -1)
    slopes = np.concatenate([slopes, along**2 @ slopes], axis=1)
    rows = np.concatenate([np.ones((*at.shape[:2], 1)), at, beyond], axis=-1)
    y = np.concatenate([np.squeeze(away[0], -1), away[1] @ ENDS, away[1] @ TOGETHER], axis=-1)
    y = _extended(y / np.sqrt(variances)[:, None], along)
    moved = MOVED / np.sqrt(variances)[:, None]
    share = np.sum(along[:, :, :9] ** 2, axis=-1)
    start = np.linalg.inv(_starts(baseline, variances, along, slopes))
    weights = np.log(np.maximum(baseline.weights, np.finfo(float).tiny))
    counted = np.clip(np.log(LASTING.caution / LASTING.prior) + weights, np.log(LASTING.rare), 0.0)
    found = np.empty((len(units), len(looks)))
    likely = np.flatnonzero(weights.max(axis=(0, 1)) > np.log(0.02))
    roughly = likely if len(likely) <= len(ROUGHLY) else ROUGHLY

    def both(which, look, j, n_nodes=ALL):
        """Return ln of the likelihoods without a change, and of the ratios: alike and unequal, vehicles, hypotheses."""
        n_learning, correlation = baseline.n_windows, CORRELATIONS[j]
        known = start[which]
        known[..., :5, :5] *= (1 - correlation * (1 - 2 / n_learning)) / (1 + correlation)
        series = _series(rows[which, :look, None], y[which, :look], known, correlation)
        (groups, *alike), own = _scales(baseline, j)
        alike, own = [each[which] for each in alike], [each[which] for each in own]
        first, alone = ([each[:, part] for each in series] for part in (slice(12), slice(12, None)))
        likelihood, ratios = _likelihoods(*first, groups, *alike, look, moved[which], n_nodes)
        ratios_alone = _ratios_alone(*alone[1:], own[0], own[1] + look, np.linalg.norm(moved[which], axis=-1))
        rest, taken = first[1][:, :9].sum(axis=1)[:, None], share[which] * alone[1]
        one = [each[:, :1] for each in alike]
        apart = _student(*one, look * 8, np.maximum(rest - taken, 0.0)) - _student(*one, look * 9, rest)
        apart = np.where(share[which] > 0.5, apart + _student(*own, look, taken), -np.inf)
        return np.array([np.zeros_like(apart), apart]) + likelihood[:, None], np.array([ratios, ratios_alone])

    def weighed(which, tables):
        with_change, without = [], []
        for j, (likelihoods, ratios) in tables.items():
            without.append(counted[which, :, j].T[..., None] + likelihoods)
            with_change.append((weights[which, :, j].T[..., None] + likelihoods)[..., None] + ratios)
        each = logsumexp(with_change, axis=(0, 1)) - logsumexp(without, axis=(0, 1))[..., None]
        return logsumexp(each + PRIOR[:, None], axis=(1, 2)) - np.log1p(1 / LASTING.caution)

    for column, look in enumerate(looks):
        every = np.arange(len(units))
        found[:, column] = weighed(every, {j: both(every, look, j, FEW) for j in roughly})
        which = np.flatnonzero(found[:, column] >= above)
        if len(which):
            found[which, column] = weighed(which, {j: both(which, look, j) for j in range(len(CORRELATIONS))})
    return found


def _starts(baseline, variances, along, slopes):
    """Return the covariance of means, slopes and their changes of each row over its variance."""
    count = len(variances)
    errors, own = np.zeros((count, 12, 12, 5, 5)), np.zeros((count, 12, 12))
    at = np.arange(6)
    errors[:, at, at] = np.linalg.inv(baseline.information[0])
    own[:, at, at] = np.squeeze(baseline.scatter[0] + baseline.nuisance[0], (-1, -2))
    of_sums = np.linalg.inv(baseline.information[1]).reshape(count, 3, 5, 2, 5, 2)
    turned = np.array([ENDS, TOGETHER])
    for kind in range(3):
        rows = np.array([6 + kind, 9 + kind])
        errors[:, rows[:, None], rows] = np.einsum("ai,vkilj,bj->vabkl", turned, of_sums[:, kind], turned)
        own[:, rows[:, None], rows] = turned @ (baseline.scatter[1] + baseline.nuisance[1])[:, kind] @ turned.T
    scales = 1 / np.sqrt(variances)
    both = scales[:, :, None] * scales[:, None]
    errors, own = errors * both[..., None, None], own * both
    of_rows = [np.concatenate([np.einsum("vkk...->vk...", each),
                               np.einsum("vhk,vkl...,vhl->vh...", along, each, along, optimize=True)], axis=1)
               for each in (errors, own)]  # fmt: skip
    known = np.zeros((*of_rows[1].shape, 9, 9))
    known[..., :5, :5] = of_rows[0]
    known[..., np.arange(5, 9), np.arange(5, 9)] = slopes
    return known / of_rows[1][..., None, None]


def _series(X, y, known, correlation):
    step = np.tril(np.ones((y.shape[1],) * 2))[None, :, None]
    X, y, step = (whitened(each.swapaxes(0, 1), correlation) for each in (X, y, step))
    X, y, D = X.transpose(1, 2, 0, 3), y.transpose(1, 2, 0), step.transpose(1, 2, 0, 3)
    J = known + X.swapaxes(-1, -2) @ X
    pulled = (X.swapaxes(-1, -2) @ y[..., None])[..., 0]
    doubt = np.linalg.inv(J)
    errors = (doubt @ pulled[..., None])[..., 0]
    crossed = X.swapaxes(-1, -2) @ D
    volume = (np.linalg.slogdet(J)[1] - np.linalg.slogdet(known)[1]) / 2
    volume += (y.shape[-1] - 1) / 2 * np.log1p(-(correlation**2))
    scores = (D.swapaxes(-1, -2) @ y[..., None])[..., 0] - np.einsum("vkao,vka->vko", crossed, errors)
    informations = np.sum(D**2, axis=-2) - np.sum(crossed * (doubt @ crossed), axis=-2)
    return -volume, np.sum(y**2, axis=-1) - np.sum(pulled * errors, axis=-1), scores, informations


def _student(squares, degrees, count, rest):
    """Return ln of the density of values by their count and their sum of squares, up to a constant."""
    after = degrees + count
    each = gammaln(after / 2) - gammaln(degrees / 2) + degrees / 2 * np.log(squares)
    return each - after / 2 * np.log(squares + rest)


def _ratios_alone(rest, scores, informations, squares, after, moved):
    """Return ln of the ratios of changes by their estimates alone, shape (vehicles, hypotheses, windows)."""
    prior, known = 1 / PRIORS.size**2, moved[..., None] ** 2 * informations
    explained = (moved[..., None] * scores) ** 2 / (known + prior) / (squares + rest)[..., None]
    return -after[..., None] / 2 * np.log1p(-explained) - np.log1p(known / prior) / 2


def _likelihoods(volume, rest, scores, informations, groups, squares, degrees, n_windows, moved, n_nodes):
    """Return ln of the likelihoods without a change, shape (vehicles,), and of the ratios of changes."""
    count, rest = n_windows * groups.sum(axis=1), rest @ groups.T
    without = np.sum(volume, axis=1) + np.sum(_student(squares, degrees, count, rest), axis=1)
    after, rest = degrees + count, squares + rest
    weights, prior = (after / rest) @ groups, 1 / PRIORS.size**2
    known = moved**2 @ (weights[..., None] * informations) + prior
    centre, std = moved @ (weights[..., None] * scores) / known, SPREAD / np.sqrt(known)
    twice, squared = (np.einsum("gk,vhk,vko->vgho", groups, *each, optimize=True)
                      for each in ((2 * moved, scores), (moved**2, informations)))  # fmt: skip
    logs = []
    for node, weight in zip(*np.polynomial.hermite_e.hermegauss(n_nodes), strict=True):
        sizes = centre + std * node
        log = np.log(weight) + node**2 / 2 - sizes**2 * prior / 2
        for g in range(len(groups)):
            at = np.flatnonzero(np.any(np.abs(MOVED[:, groups[g] > 0]) > 1e-9, axis=1))
            explained = sizes[:, at] * (twice[:, g, at] - sizes[:, at] * squared[:, g, at]) / rest[:, g, None, None]
            log[:, at] -= after[:, g, None, None] / 2 * np.log1p(-explained)
        logs.append(log)
    return without, logsumexp(logs, axis=0) + np.log(std) + np.log(prior / (2 * np.pi)) / 2
