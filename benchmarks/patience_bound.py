"""What methods that keep the promise of the list where parts scatter unequally can find, in a simpler world.

Four parts of a kind, of which one loses some of its stiffness after three windows. The scatter of each part is 2 %
times e^(0.4 z), with a standard normal z that nobody knows. The world is simpler than that of `patience.py`: conditions
have no effect, and windows are known to be independent; what moves a whole kind in a window says nothing. The mean over
z is a sum over a grid, without and with a change: their ratio is the most powerful statistic (Neyman and Pearson).
Where parts in fact scatter alike, the likelihood with a change is that of z = 0, which no method knows.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.patience import N_VEHICLES, ONSET, RATE
from benchmarks.patience_vectors import HYPOTHESES, PARTS, REPORTED
from scipy.special import logsumexp

from sprung.diagnosis.changes import PATIENCE_DAYS
from sprung.diagnosis.hypotheses import PRIORS

#: Probability of a change of the first part alone.
SINGLE = float(np.exp(HYPOTHESES.log_prior[0]))
UNEQUAL = 0.4
#: ln of the mean of a value that one in a hundred vehicles needs for the list of a year.
THRESHOLD = np.log(N_VEHICLES * 48 * PATIENCE_DAYS / RATE)
#: Steps of z, small beside what 60 windows leave open; the changed part may seem to scatter far more.
STEPS = [np.arange(-3.6, last, 0.6) for last in (7.3, 3.7, 3.7, 3.7)]
TRIANGLE = np.triu_indices(4)
AT_ONCE = 50
#: Losses, and windows after which somebody looks.
CASES = (0.05, 24), (0.05, 48), (0.1, 6), (0.1, 12), (0.1, 24), (0.2, 6), (0.2, 12)


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--vehicles", type=int, default=400)
    given = arguments.parse_args()
    heads = ("scatter of parts", "baseline", "lost", "windows", "known", "any method", "e-detector")
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for name, unequal in (("unequal", UNEQUAL), ("alike, but nobody knows", 0.0)):
        for n_learning in (6, 12):
            for loss, n in CASES:
                found = powers((unequal, n_learning, n, np.log1p(-loss)), given.vehicles)
                heading = f"| {name} | {n_learning} | {100 * loss:.0f} % | {n} |"
                print(heading, *(f"{share:.0f} |" for share in found), flush=True)


def powers(world, count):
    """Return the shares of faults named [%] by an e-detector that knows z, by any method, and by an e-detector.

    A world is the scatter of parts, the windows of the baseline and those compared, and the change [ln]. Which part it
    is, and since when, is not known: the ratio is the mean over both. Any method knows the size, e-detectors its prior.
    A method that keeps the promise names a healthy vehicle within n windows with a probability of at most
    n e^-THRESHOLD. That of a ratio above a limit is the mean of its inverse above it, with a change.
    """
    generator, n = np.random.default_rng(1), world[2]
    nodes = np.array(np.meshgrid(*STEPS, indexing="ij")).reshape(4, -1)
    weights = -np.sum(nodes**2, axis=0) / 2
    weights -= logsumexp(weights)
    is_true = np.full(len(weights), True) if world[0] else np.sum(nodes**2, axis=0) < 1e-9
    grid = precisions(nodes), weights, np.where(is_true, weights if world[0] else 0.0, -np.inf)
    onsets = generator.integers(0, n, count)
    anywhere, _, _ = ratios(world, onsets, grid, generator)
    limits = np.sort(anywhere)[::-1]
    sizes = np.cumsum(np.exp(-limits)) / count
    limit = limits[min(np.searchsorted(sizes, n * np.exp(-THRESHOLD)), count - 1)]
    ratio, evidence, known = ratios(world, np.full(count, ONSET), grid, generator)
    named = known >= THRESHOLD, ratio >= limit, evidence >= THRESHOLD
    return [100 * np.mean(each) for each in named]


def precisions(z):
    """Return the precision of a window, without what moves all four parts, and ln of its determinant, for each z."""
    each = 1 / (REPORTED * np.exp(UNEQUAL * z)) ** 2
    whole = each[:, None] * np.eye(4)[..., None] - each[:, None] * each / each.sum(axis=0)
    return whole, np.log(each).sum(axis=0) - np.log(each.sum(axis=0))


def ratios(world, onsets, grid, generator):
    """Return ln of ratio, e-detector and that with known z, each of shape (vehicles,)."""
    (whole, volumes), weights, of_change = grid
    unequal, n_learning, n, change = world
    count, every = len(onsets), n_learning + n
    z = unequal / UNEQUAL * generator.standard_normal((count, 4))
    values = REPORTED * np.exp(UNEQUAL * z)[:, None] * generator.standard_normal((count, every, 4))
    values[..., 0] += change * (np.arange(every) >= n_learning + onsets[:, None])
    values -= values.mean(axis=1, keepdims=True)
    squares = np.einsum("vni,vnj->vij", values, values)[:, *TRIANGLE] * np.where(np.equal(*TRIANGLE), 1, 2)
    after = np.cumsum(values[:, ::-1], axis=1)[:, ::-1][:, n_learning:]
    left = np.arange(n, 0, -1)
    shares = left * (every - left) / every
    own, _ = precisions(z.T)
    scores = np.einsum("iv,vni->nv", own[0], after)
    known = logsumexp(averaged(scores, own[0, 0] * shares[:, None]), axis=0) + np.log(SINGLE)
    found = []
    for first in range(0, count, AT_ONCE):
        chosen = slice(first, first + AT_ONCE)
        likelihood = (every - 1) / 2 * volumes - squares[chosen] @ whole[TRIANGLE] / 2
        at = np.isfinite(of_change)
        changed = (likelihood + of_change)[:, at]
        rows = []
        for k, share in enumerate(shares):
            score, information = after[chosen, k] @ whole[0][:, at], share * whole[0, 0][at]
            with_size = change * score - change**2 * information / 2
            rows.append([logsumexp(changed + each, axis=1) for each in (with_size, averaged(score, information))])
        found.append(logsumexp(rows, axis=0) - logsumexp(likelihood + weights, axis=1))
    ratio, evidence = np.concatenate(found, axis=1)
    return ratio - np.log(n * len(PARTS)), evidence + np.log(SINGLE), known


def averaged(score, information):
    """Return ln of the likelihood ratio of a change, averaged over its size."""
    before = 1 / PRIORS.size**2
    return score**2 / (information + before) / 2 - np.log1p(information / before) / 2


if __name__ == "__main__":
    main()
