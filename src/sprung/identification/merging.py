"""Merging of the modes of several identifications of one system."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung.identification.stabilisation import align
from sprung.modal import Modes, join_modes, unit_shapes


@dataclass(frozen=True, eq=False, slots=True)
class MergedModes:
    """Modes merged over parts, and the modes of the parts that they combine.

    Parameters
    ----------
    modes
        Merged modes by rising frequency.
    members
        Index of the part's mode for each merged mode and part, -1 for none; shape (modes, parts).
    shares
        Share of each part in each merged pole, sum 1, 0 for none; shape (modes, parts).
    """

    modes: Modes
    members: Indices
    shares: Real

    def __post_init__(self) -> None:
        freeze(self, members=2, dtype=np.intp)
        freeze(self, shares=2)


def merge_modes(parts: Sequence[Modes], *, weights: Sequence[float], has_mean_shapes: bool = False) -> MergedModes:
    """Merge the modes of several identifications of one system.

    Parameters
    ----------
    parts
        Modes of the same channels: from subsets of segments, or from splits of outputs and references.
    weights
        Weights of the parts, above 0: the numbers of segments for subsets.
    has_mean_shapes
        Whether shapes are weighted means, too, of shapes with one phase and scale, and the weights are the inverse
        variances of the frequencies, where these are known; False: the shape is that of the part of largest weight (the
        form of the thesis).

    Returns
    -------
    MergedModes
        Modes of at least half of the parts. Poles are weighted means. Of several modes of one part that merge, the one
        with the largest stable rate represents the part.

    References
    ----------
    F. Liu (2020), section 4.2, step 8.
    """
    owners = np.concatenate([np.full(len(part), k) for k, part in enumerate(parts)])
    places = np.concatenate([np.arange(len(part)) for part in parts])
    together = join_modes(parts)
    groups = align(together.poles, together.mode_shapes, has_free_damping=True)
    merged, members, shares = [], [], []
    for group in range(groups.max(initial=-1) + 1):
        same = np.flatnonzero(groups == group)
        same = same[np.argsort(-together.stable_rate[same], kind="stable")]
        same = same[np.unique(owners[same], return_index=True)[1]]
        if 2 * len(same) < len(parts):
            continue
        row = np.full(len(parts), -1)
        row[owners[same]] = places[same]
        members.append(row)
        own = np.asarray(weights, dtype=float)[owners[same]]
        if has_mean_shapes and np.all(together.natural_frequency_std[same] > 0):
            own = 1 / together.natural_frequency_std[same] ** 2
        mean = _mean_mode(together.take(same), own)
        if has_mean_shapes:
            mean = replace(mean, mode_shapes=unit_shapes(_mean_shape(together.mode_shapes[same], own)[None]))
        merged.append(mean)
        shares.append(np.zeros(len(parts)))
        shares[-1][owners[same]] = own / own.sum()
    modes = join_modes(merged) if merged else together.take(np.zeros(0, dtype=np.intp))
    order = np.argsort(modes.natural_frequency)
    rows, weighted = np.array(members, dtype=np.intp), np.array(shares, dtype=np.float64)
    return MergedModes(modes.take(order), rows.reshape(-1, len(parts))[order], weighted.reshape(-1, len(parts))[order])


def merged_deviations(deviations: Sequence[Real], merged: MergedModes) -> Real:
    """Return the standard deviations of merged modes from those of the parts.

    Parameters
    ----------
    deviations
        Standard deviations of the modes of each part, shapes (values, modes of the part).
    merged
        Modes of the parts as merged.

    Returns
    -------
    numpy.ndarray
        Standard deviations of the weighted means of independent parts, shape (values, modes).
    """
    combined = np.zeros((2, len(merged.modes)))
    for row, (places, shares) in enumerate(zip(merged.members, merged.shares, strict=True)):
        owners = np.flatnonzero(places >= 0)
        values = np.array([deviations[owner][:, places[owner]] for owner in owners.tolist()]).T
        combined[:, row] = np.sqrt(np.sum((shares[owners] * values) ** 2, axis=1))
    return combined


def _mean_shape(shapes: Complex, weights: Real) -> Complex:
    """Return the weighted mean of shapes, each scaled to the same product with that of largest weight."""
    best = shapes[np.argmax(weights)]
    return np.asarray((weights / (shapes @ np.conj(best))) @ shapes)


def _mean_mode(estimates: Modes, weights: Real) -> Modes:
    """Return one mode from several estimates of it."""
    shares = weights / weights.sum()
    best = estimates.take(np.array([np.argmax(shares)]))
    return replace(
        best,
        poles=np.array([np.sum(shares * estimates.poles)]),
        natural_frequency_std=np.sqrt([np.sum((shares * estimates.natural_frequency_std) ** 2)]),
        damping_ratio_std=np.sqrt([np.sum((shares * estimates.damping_ratio_std) ** 2)]),
        stable_rate=np.array([np.mean(estimates.stable_rate)]),
    )
