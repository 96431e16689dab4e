"""From the poles of a ladder to modes: criteria, alignments, selection; modes of several ladders merged."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import check_number, freeze
from sprung._display import Tabular, counted, in_short
from sprung.identification.correlation import Correlations, deviation_of_mean
from sprung.identification.subspace import frequency_and_damping_changes, with_deviations
from sprung.modal import Modes, Poles, PoleStatus, join_modes, mac, mpc, unit_shapes


@dataclass(frozen=True, slots=True)
class _Rules:
    """Which poles, and which modes of several parts, are one mode."""

    #: Distance of poles between rungs as a multiple of their half-power half-bandwidth ...
    aligned_bandwidth: float = 0.5
    #: ... and between modes whose damping may differ: there, if their half-power bands overlap; ...
    merged_bandwidth: float = 2.0
    #: ... both plus this share of their frequency.
    merged_frequency: float = 0.01
    #: Two shapes are one if 1 - MAC is below this.
    merged_mac: float = 0.1
    #: Fewest blocks whose spread gives standard deviations.
    min_blocks: int = 10
    #: Largest deviation of a frequency over the least that the duration of the records allows, where that is more than
    #: the criterion.
    over_least: float = 3.0
    #: Growth or decay, in nepers over the record, that a record of few blocks does not distinguish from none ...
    indistinct: float = 0.5
    #: ... of a mode with up to this many periods in it: with more, that little damping is that of a line.
    few_periods: float = 40.0


_RULES = _Rules()


_Found = TypeVar("_Found", Poles, Modes)


@dataclass(frozen=True, slots=True)
class StabilityCriteria:
    """Criteria for stable poles, and for alignments of stable poles that are modes.

    Parameters
    ----------
    frequency, damping
        Largest relative change from the nearest pole of the rung below, 0 to 1.
    bandwidth
        Largest change of frequency from that pole as a share of the half-power half-bandwidth (damping ratio times
        frequency), where this allows more than `frequency`: a heavily damped mode has no sharper frequency.
    unknown_damping
        As `damping`, where standard deviations are not available: in records of few blocks damping is known to some
        30 % only, so it changes as much from rung to rung.
    shape
        Largest 1 - MAC with that pole, 0 to 1.
    mpc
        Smallest modal phase collinearity; 0 for no bound (road vehicles have truly complex modes).
    max_damping
        Largest physical damping ratio.
    stable_rate
        Smallest share of rungs with a stable pole (delta of eq. 3-57), 0 to 1.
    contribution
        Smallest contribution and smallest excess of a mode (see `contribution`); 0 for no bound.
    uncertainty
        Largest standard deviation of the frequency over the half-power half-bandwidth; infinite for no bound.

    Raises
    ------
    ParameterError
        If a criterion is out of range.

    References
    ----------
    F. Liu (2020), eq. 3-53 to 3-57.
    """

    frequency: float = 0.01
    bandwidth: float = 0.1
    damping: float = 0.1
    unknown_damping: float = 0.3
    shape: float = 0.02
    mpc: float = 0.0
    max_damping: float = 0.6
    stable_rate: float = 0.2
    contribution: float = 4.0
    uncertainty: float = 0.6

    def __post_init__(self) -> None:
        for name in ("frequency", "damping", "unknown_damping", "shape", "max_damping"):
            check_number(name, getattr(self, name), above=0, at_most=1)
        for name in ("mpc", "stable_rate"):
            check_number(name, getattr(self, name), at_least=0, at_most=1)


#: Thresholds of the thesis (section 4.3): very loose, without the tests of significance.
THESIS_CRITERIA = StabilityCriteria(
    frequency=0.1,
    bandwidth=0.0,
    damping=0.2,
    unknown_damping=0.2,
    shape=0.5,
    stable_rate=0.5,
    contribution=0.0,
    uncertainty=np.inf,
)


@dataclass(frozen=True, eq=False, slots=True)
class StabilisationDiagram(Tabular):
    """Poles of all rungs of a ladder, each with its status.

    Parameters
    ----------
    poles
        Poles of all rungs.
    status
        `PoleStatus` of each pole, shape (poles,).
    alignments
        Number of the alignment of each stable pole, -1 for none; shape (poles,).
    criteria
        Criteria applied.
    """

    poles: Poles
    status: NDArray[np.int8]
    alignments: Indices
    criteria: StabilityCriteria

    def __post_init__(self) -> None:
        freeze(self, status=1, dtype=np.int8)
        freeze(self, alignments=1, dtype=np.intp)

    def __repr__(self) -> str:
        """Return the numbers of poles and rungs, and the commonest statuses."""
        rungs = counted(len(self.poles.ladder), "rung")
        counts = sorted(zip(*np.unique(self.status, return_counts=True), strict=True), key=lambda pair: -pair[1])
        words = ", ".join(f"{count} {PoleStatus(status).name.lower()}" for status, count in counts)
        head = f"StabilisationDiagram: {counted(len(self.status), 'pole')} on {rungs}"
        return in_short(head, words.replace("_", " "))


def with_known_deviations(found: _Found, correlations: Correlations) -> _Found:
    """Return poles or refined modes, without standard deviations where the correlations have too few blocks.

    Parameters
    ----------
    found
        Poles of a ladder, or modes.
    correlations
        Correlations of all segments. The spread of fewer than ten blocks is known to no better than 25 %, and in a
        record as short as that a block hardly holds the ring-down of a mode. The likelihood of refined modes holds for
        many independent lines within a bandwidth; such a record has a few, and deviations of its curvature are two
        thirds of the errors.

    Returns
    -------
    Poles or Modes
        The same with standard deviations, or with NaN in their place.
    """
    if len(correlations.blocks) >= _RULES.min_blocks:
        return found
    unknown = np.full(len(found.poles), np.nan)
    changes: dict[str, Any] = {"natural_frequency_std": unknown, "damping_ratio_std": unknown}
    if hasattr(found, "mode_shape_std"):
        changes["mode_shape_std"] = np.full(found.mode_shapes.shape, complex(np.nan, np.nan))
    return replace(found, **changes)


def stabilise(
    poles: Poles,
    *,
    criteria: StabilityCriteria | None = None,
    band: tuple[float, float] = (0.0, np.inf),
    is_harmonic: Booleans | None = None,
    duration: float = np.inf,
) -> StabilisationDiagram:
    """Compare every pole with the rung below, align the stable ones and keep the alignments that are modes.

    Parameters
    ----------
    poles
        Poles of all rungs; NaN as standard deviation leaves the criterion `uncertainty` out. Those that are stable get
        their standard deviations where these are not yet computed.
    criteria
        Criteria; default: `StabilityCriteria()`.
    band
        Lowest and highest natural frequency [Hz].
    is_harmonic
        Which poles are harmonics of the excitation, shape (poles,); None: none.
    duration
        Duration of the records [s], above 0.

    Returns
    -------
    StabilisationDiagram

    Notes
    -----
    The least deviation that records of the duration T allow a frequency f is sqrt(damping ratio x f / (4 pi T)), which
    in a short record exceeds the bound `uncertainty`: then three times as much is the bound. The decay of light damping
    over few periods is less than its error, so that poles may grow: where standard deviations are not available, a pole
    of less than 40 periods that grows by less than half a neper over the records stands for the decaying one of the
    same spectrum, and damping ratios that differ by no more are equal.

    References
    ----------
    F. Liu (2020), eq. 3-53 to 3-57.
    W. Gersch, On the achievable accuracy of structural system parameter estimates, Journal of Sound and Vibration 34
    (1974), 63-79.
    """
    criteria = criteria or StabilityCriteria()
    is_short = np.isnan(poles.damping_ratio_std) & (poles.natural_frequency * duration < _RULES.few_periods)
    indistinct = np.where(is_short, _RULES.indistinct / duration, 0.0)
    grows = (poles.poles.real > 0) & (poles.poles.real < indistinct)
    poles = replace(poles, poles=np.where(grows, -poles.poles.conj(), poles.poles))
    status = _status_alone(poles, criteria, band)
    if is_harmonic is not None:
        status[(status == PoleStatus.SELECTED) & is_harmonic] = PoleStatus.HARMONIC
    _compare_with_rung_below(poles, criteria, status, indistinct)
    stable = np.flatnonzero(status == PoleStatus.SELECTED)
    alignments = np.full(len(status), -1)
    alignments[stable] = align(poles.poles[stable], poles.mode_shapes[stable])
    poles = with_deviations(poles, alignments >= 0)
    for alignment in range(alignments.max(initial=-1) + 1):
        members = np.flatnonzero(alignments == alignment)
        status[members] = _verdict(poles, members, criteria, duration)
    return StabilisationDiagram(poles, status, alignments, criteria)


def _status_alone(poles: Poles, criteria: StabilityCriteria, band: tuple[float, float]) -> NDArray[np.int8]:
    """Return the status that follows from each pole alone; SELECTED if none does."""
    frequency, damping = poles.natural_frequency, poles.damping_ratio
    status = np.full(len(frequency), PoleStatus.SELECTED, dtype=np.int8)
    status[mpc(poles.mode_shapes) < criteria.mpc] = PoleStatus.INCOHERENT_SHAPE
    status[(frequency < band[0]) | (frequency > band[1])] = PoleStatus.OUT_OF_BAND
    status[(damping <= 0) | (damping > criteria.max_damping)] = PoleStatus.UNPHYSICAL_DAMPING
    return status


def _compare_with_rung_below(
    poles: Poles, criteria: StabilityCriteria, status: NDArray[np.int8], indistinct: Real
) -> None:
    """Write into `status` the first criterion that no pole of the rung below meets."""
    frequency, damping = poles.natural_frequency, poles.damping_ratio
    unstable = np.full(len(status), PoleStatus.FREQUENCY_CHANGED, dtype=np.int8)
    damping_change = np.where(np.isnan(poles.damping_ratio_std), criteria.unknown_damping, criteria.damping)
    damping_change = np.maximum(damping_change * np.abs(damping), indistinct / np.abs(poles.poles))
    tolerance = np.maximum(criteria.frequency, criteria.bandwidth * damping) * frequency
    new, old = _near_pairs(poles, frequency, tolerance)
    same_damping = np.abs(damping[new] - damping[old]) <= damping_change[new]
    same_shape = 1 - _mac_of_pairs(poles.mode_shapes[new], poles.mode_shapes[old]) <= criteria.shape
    # A pole of several pairs has the status of the one that meets most criteria.
    unstable[new] = PoleStatus.DAMPING_CHANGED
    unstable[new[same_damping]] = PoleStatus.SHAPE_CHANGED
    unstable[new[same_damping & same_shape]] = PoleStatus.SELECTED
    undecided = status == PoleStatus.SELECTED
    status[undecided] = unstable[undecided]


def _near_pairs(poles: Poles, frequency: Real, tolerance: Real) -> tuple[Indices, Indices]:
    """Return the poles, and those of the rungs below them, whose frequencies agree within the tolerance."""
    starts = np.searchsorted(poles.rungs, np.arange(len(poles.ladder) + 1))
    new, old = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    for below, here, end in zip(starts[:-2], starts[1:-1], starts[2:], strict=True):
        is_near = np.abs(frequency[here:end, None] - frequency[below:here]) <= tolerance[here:end, None]
        rows, columns = np.nonzero(is_near)
        new.append(rows + here)
        old.append(columns + below)
    return np.concatenate(new), np.concatenate(old)


def _mac_of_pairs(shapes: Complex, others: Complex) -> Real:
    """Return the modal assurance criterion of each shape with the other shape of its pair."""
    norms = np.sum(np.abs(shapes) ** 2, axis=1) * np.sum(np.abs(others) ** 2, axis=1)
    products = np.abs(np.sum(shapes.conj() * others, axis=1)) ** 2
    return np.asarray(products / np.maximum(norms, np.finfo(float).tiny))


def align(poles: Complex, mode_shapes: Complex, *, has_free_damping: bool = False) -> Indices:
    """Group the poles of one mode.

    Parameters
    ----------
    poles
        Continuous poles [rad/s], shape (poles,).
    mode_shapes
        Mode shapes, shape (poles, channels).
    has_free_damping
        Whether only frequency and shape are compared: between subsets of different level the damping may differ.

    Returns
    -------
    numpy.ndarray
        Number of the group of each pole, from 0 by rising frequency of the groups, shape (poles,).

    Notes
    -----
    Average linkage on the distance abs(p - q) / (0.01 abs(p) + 0.5 abs(Re p)) + (1 - MAC) / 0.1, cut at 1: poles
    within half of their half-bandwidth and of one shape are one mode. With free damping p and q are moduli, and 2
    stands for 0.5: modes of one shape whose half-power bands overlap are one.
    """
    from scipy.cluster import hierarchy

    if len(poles) < 2:
        return np.zeros(len(poles), dtype=np.intp)
    share = _RULES.merged_bandwidth if has_free_damping else _RULES.aligned_bandwidth
    width = _RULES.merged_frequency * np.abs(poles) + share * np.abs(poles.real)
    places = np.abs(poles) if has_free_damping else poles
    distance = np.abs(places[:, None] - places) / ((width[:, None] + width) / 2)
    distance += (1 - mac(mode_shapes, mode_shapes)) / _RULES.merged_mac
    condensed = np.maximum(distance, distance.T)[np.triu_indices(len(poles), 1)]
    groups = hierarchy.fcluster(hierarchy.linkage(condensed, "average"), 1.0, "distance") - 1
    mean = np.bincount(groups, np.abs(poles)) / np.bincount(groups)
    return np.argsort(np.argsort(mean))[groups]


def _verdict(poles: Poles, members: Indices, criteria: StabilityCriteria, duration: float) -> PoleStatus:
    """Return the status of one alignment of stable poles."""
    rungs = np.unique(poles.rungs[members])
    if len(rungs) < criteria.stable_rate * len(poles.ladder):
        return PoleStatus.RARE
    if np.min(uncertainty(poles, criteria, duration)[members]) > 1:
        return PoleStatus.UNCERTAIN
    return PoleStatus.SELECTED


def uncertainty(found: Poles | Modes, criteria: StabilityCriteria, duration: float) -> Real:
    """Return the standard deviation of each frequency over the largest that records of a duration [s] may leave it."""
    bandwidth = found.natural_frequency * found.damping_ratio
    allowed = _RULES.over_least / np.sqrt(4 * np.pi * np.maximum(bandwidth, np.finfo(float).tiny) * duration)
    return np.asarray(found.natural_frequency_std / (bandwidth * np.maximum(criteria.uncertainty, allowed)))


def _representatives(poles: Poles, alignments: Indices, chosen: Indices) -> Indices:
    """Return for each chosen alignment the pole of least variance plus squared distance from the median pole."""
    representatives = []
    for alignment in chosen:
        members = np.flatnonzero(alignments == alignment)
        values = poles.poles[members]
        median = np.median(values.real) + 1j * np.median(values.imag)
        variance = poles.natural_frequency_std[members] ** 2
        variance = variance + (poles.natural_frequency * poles.damping_ratio_std)[members] ** 2
        deviation = np.abs(values - median) ** 2 / (2 * np.pi) ** 2
        representatives.append(members[np.argmin(np.nan_to_num(variance) + deviation)])
    return np.array(representatives, dtype=np.intp)


@dataclass(frozen=True, eq=False, slots=True)
class SelectedModes:
    """Modes selected from a stabilisation diagram.

    Parameters
    ----------
    modes
        Modes by rising frequency.
    alignments
        Number of the alignment behind each mode, shape (modes,).
    deviations
        Standard deviations of frequency and damping ratio that hold slow variation and the choice of the model order,
        shape (2, modes); those of the modes are from independent blocks.
    """

    modes: Modes
    alignments: Indices
    deviations: Real

    def __post_init__(self) -> None:
        freeze(self, alignments=1, dtype=np.intp)
        freeze(self, deviations=2)


def select_modes(diagram: StabilisationDiagram, records: Sequence[int] = ()) -> SelectedModes:
    """Return the modes of the selected alignments, each from its most reliable pole.

    Parameters
    ----------
    diagram
        Stabilisation diagram from `stabilise`.
    records
        Number of the record of each block; empty: one record.

    Returns
    -------
    SelectedModes

    Notes
    -----
    The pole with the smallest sum of its variance and its squared distance from the alignment's median pole represents
    the mode, with its own shape and standard deviations: high orders scatter more than low ones, and the lowest may
    still be biased. The poles of the alignment scatter by more than chance where no order holds the system (an
    excitation with a spectrum of its own): that scatter is added to the variance.
    """
    poles = diagram.poles
    kept = np.unique(diagram.alignments[diagram.status == PoleStatus.SELECTED])
    chosen = _representatives(poles, diagram.alignments, kept)
    rates = [len(np.unique(poles.rungs[diagram.alignments == alignment])) / len(poles.ladder) for alignment in kept]
    modes = Modes(
        poles=poles.poles[chosen],
        mode_shapes=unit_shapes(poles.mode_shapes[chosen]),
        channels=poles.channels,
        natural_frequency_std=poles.natural_frequency_std[chosen],
        damping_ratio_std=poles.damping_ratio_std[chosen],
        stable_rate=np.array(rates),
        labels=(None,) * len(chosen),
    )
    order = np.argsort(modes.natural_frequency)
    return SelectedModes(modes.take(order), kept[order], _total_deviations(diagram, chosen, records)[:, order])


def _total_deviations(diagram: StabilisationDiagram, chosen: Indices, records: Sequence[int]) -> Real:
    """Return the standard deviations of the chosen poles, with slow variation and the scatter of their alignments."""
    poles = diagram.poles
    independent = np.array([poles.natural_frequency_std[chosen], poles.damping_ratio_std[chosen]])
    if not len(poles.changes) or not len(chosen):
        return independent
    members = [diagram.alignments == diagram.alignments[pole] for pole in chosen]
    scatter = [[np.std(values[own]) for own in members] for values in (poles.natural_frequency, poles.damping_ratio)]
    changes = frequency_and_damping_changes(poles.poles[chosen], poles.changes[:, chosen])
    numbers = np.array(records, dtype=np.intp) if len(records) else None
    deviations = np.array([deviation_of_mean(change, numbers) for change in changes])
    return np.where(np.isnan(independent), np.nan, np.hypot(deviations, scatter))


def with_total_deviations(modes: Modes, deviations: Real) -> Modes:
    """Return modes with other standard deviations of frequency and damping ratio, shape (2, modes)."""
    return replace(modes, natural_frequency_std=deviations[0], damping_ratio_std=deviations[1])


def with_status(diagram: StabilisationDiagram, alignments: Iterable[int], status: PoleStatus) -> StabilisationDiagram:
    """Return the diagram with `status` for all poles of the given alignments."""
    changed = np.where(np.isin(diagram.alignments, list(alignments)), np.int8(status), diagram.status)
    return replace(diagram, status=changed)


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


#: Probability that a contribution exceeds the bound by chance ...
_CHANCE = 1e-2
#: ... and that the excess does, which has many places to occur.
_CHANCE_OF_EXCESS = 1e-6
#: Standard deviation of the frequency over the half-bandwidth up to which a contribution counts in full.
_WELL_KNOWN = 0.2
#: Largest factor on the bound of a contribution where the frequency is less certain.
_MOST_DEMANDED = 3.0
#: Number of blocks below which the mode's own random level shows between them.
_MANY_BLOCKS = 24
#: Excess over its bound from which a short record shows a mode clearly.
_CLEAR = 1.5


def contributions(poles: Complex, mode_shapes: Complex, correlations: Correlations) -> tuple[Real, Real]:
    """Return the contribution of each mode to the correlations between channels, relative to chance, and its excess.

    Parameters
    ----------
    poles
        Continuous, damped poles [rad/s], shape (modes,).
    mode_shapes
        Mode shapes, shape (modes, channels).
    correlations
        Correlations with blocks and their number of products. Only pairs of different channels count (with a single
        channel, its autocorrelation): the noise of a sensor appears only in the correlation of that sensor with itself.

    Returns
    -------
    numpy.ndarray, numpy.ndarray
        Shape (modes,) each. Contribution: about 1 for a mode that does not exist; infinite for exact correlations.
        Excess: times twice the number of references distributed nearly as chi-squared with as many degrees of freedom
        where the channels are independent; infinite for exact correlations, for a single channel, and where not all
        channels are references.

    Notes
    -----
    Lambda_m = sum over modes of 2 Re(shape g^T lambda^(m - 1)) is solved for the participation g of each reference
    by least squares over lags and the other channels, for the average and for each block. The contribution is the
    sum over references of abs(g)^2 of the average, weighted with the shape's power on the channels used, divided by the
    same sum of the variances of g over the blocks.

    The errors of neighbouring lags are alike: those of independent channels a and b of N samples have the spectrum
    S_a S_b / N (Bartlett's formula). The squares are weighted by the inverse of the covariance of lags with the
    spectrum S^2, S the mean of the channels' spectra; without the weights, the random level of a strong mode hides a
    weak one. The excess is relative to the variance of g by Bartlett's formula, which a few blocks do not show well;
    where it is not known and cannot refuse what the weights raise, all lags count alike.

    References
    ----------
    M. S. Bartlett (1946), On the theoretical specification and sampling properties of autocorrelated time-series,
    Supplement to the Journal of the Royal Statistical Society 8, 27-41.
    """
    return _relative_to_chance(_projections(poles, mode_shapes, correlations), np.arange(len(poles)))


@dataclass(frozen=True, eq=False, slots=True)
class _Projection:
    """Weighted correlations with one reference, projected on the responses of all candidates.

    `triangle` maps real and imaginary participations to the coordinates in which the average, the changes of blocks
    (one a row) and the covariance by chance are; `power` is that of each shape on the channels used.
    """

    triangle: Real
    average: Real
    changes: Real
    chance: Real
    power: Real


def _projections(poles: Complex, mode_shapes: Complex, correlations: Correlations) -> list[_Projection]:
    """Return the projection of each reference."""
    spectra, changes = _spectra(correlations), correlations.changes
    lagged = correlations.values[:, :, 1:]
    use = correlations.is_cross if correlations.is_cross.any() else ~correlations.is_cross
    powers = np.exp(poles[:, None] / correlations.sampling_rate * np.arange(lagged.shape[-1]))
    has_chance = len(spectra) == len(correlations.channels) > 1 and np.isfinite(correlations.n_products)
    whitener = _whitener(spectra, lagged.shape[-1]) if has_chance else np.eye(lagged.shape[-1])
    projections = []
    for reference, is_used in enumerate(use.T):
        others = np.flatnonzero(is_used)
        basis = _basis(_responses(mode_shapes[:, others], powers)).reshape(len(others), len(whitener), -1)
        directions, triangle = np.linalg.qr((whitener @ basis).reshape(-1, basis.shape[-1]))
        weights = whitener.T @ directions.reshape(len(others), len(whitener), -1)
        chance = np.full((len(triangle), len(triangle)), 0.0 if has_chance else np.nan)
        if has_chance:
            gains = np.fft.rfft(weights, spectra.shape[1], axis=1)
            n_same = np.where(np.arange(gains.shape[1]) % (gains.shape[1] - 1) == 0, 1, 2)
            densities = n_same * (spectra[others] * spectra[reference])[:, : gains.shape[1]]
            densities /= spectra.shape[1] * correlations.n_products
            weighted = (gains.conj() * densities[..., None]).reshape(-1, len(triangle))
            chance = (weighted.T @ gains.reshape(weighted.shape)).real
        weights = weights.reshape(-1, len(triangle))
        own = changes[:, others, reference, 1:].reshape(len(changes), len(weights))
        average = lagged[others, reference].ravel() @ weights
        power = np.sum(np.abs(mode_shapes[:, others]) ** 2, axis=1)
        projections.append(_Projection(triangle, average, own @ weights, chance, power))
    return projections


def _relative_to_chance(projections: Sequence[_Projection], kept: Indices) -> tuple[Real, Real]:
    """Return contributions and excess of some of the candidates, without the others."""
    sums = np.zeros((3, len(kept)))
    for each in projections:
        n_modes = len(each.power)
        solve = np.linalg.pinv(each.triangle[:, np.concatenate([kept, n_modes + kept])], rcond=1e-8)
        of_blocks = np.sum((each.changes @ solve.T) ** 2, axis=0)
        squares = np.array([(solve @ each.average) ** 2, of_blocks, np.sum(solve @ each.chance * solve, axis=1)])
        sums += each.power[kept] * squares.reshape(3, 2, -1).sum(axis=1)
    signal, scatter, chance = sums
    infinite = np.full(len(kept), np.inf)
    has_blocks = len(projections[0].changes) > 0
    return signal / scatter if has_blocks else infinite, np.where(np.isnan(chance), np.inf, signal / chance)


def _spectra(correlations: Correlations) -> Real:
    """Return the smoothed spectra of the channels that are references, shape (these channels, frequencies)."""
    channels, references = correlations.channels, correlations.references
    pairs = np.array([(channels.index(name), k) for k, name in enumerate(references) if name in channels])
    own = correlations.values[pairs[:, 0], pairs[:, 1]]
    taper = 0.5 + 0.5 * np.cos(np.pi * np.arange(correlations.n_lags) / correlations.n_lags)
    spectra = 2 * np.fft.fft(own * taper, 2 * correlations.n_lags).real - own[:, :1]
    return np.asarray(np.maximum(spectra, 1e-3 * own[:, :1]))


def _whitener(spectra: Real, n_lags: int, *, floor: float = 0.3) -> Real:
    """Return the matrix that makes errors of lags independent; spectra count as at least a share of their mean."""
    mean = np.mean(spectra / spectra.mean(axis=1, keepdims=True), axis=0)
    covariance = np.fft.ifft(np.maximum(mean, floor) ** 2).real[:n_lags]
    factor = linalg.cholesky(linalg.toeplitz(covariance), lower=True)
    return np.asarray(linalg.solve_triangular(factor, np.eye(n_lags), lower=True))


def _responses(shapes: Complex, powers: Complex) -> Complex:
    """Return the product of shape and power of the eigenvalue, shape (modes, channels times lags)."""
    return (shapes[:, :, None] * powers[:, None]).reshape(len(shapes), shapes.shape[1] * powers.shape[1])


def _basis(responses: Complex) -> Real:
    """Return what real and imaginary parts of g add to 2 Re(responses^T g), shape (samples, 2 modes)."""
    return np.concatenate([2 * responses.real, -2 * responses.imag]).T


def _participation_operator(responses: Complex) -> Complex:
    """Return the matrix (samples, modes) that maps real data to the least-squares g of data = 2 Re(responses^T g)."""
    basis = _basis(responses)
    inverse = np.linalg.pinv(basis, rcond=1e-8) if basis.size else basis.T
    return np.asarray(inverse[: len(responses)] + 1j * inverse[len(responses) :]).T


def complete_shapes(
    poles: Complex, mode_shapes: Complex, correlations: Correlations, channels: Sequence[str]
) -> Complex:
    """Return the shapes on all channels of modes that were identified on some of them.

    Parameters
    ----------
    poles
        Continuous, damped poles [rad/s], shape (modes,).
    mode_shapes
        Mode shapes on some channels, shape (modes, outputs).
    correlations
        Correlations of all channels, with all of them as references. The correlation of a channel with itself is not
        used.
    channels
        Names of the outputs in `mode_shapes`.

    Returns
    -------
    numpy.ndarray
        Mode shapes, shape (modes, channels of `correlations`).

    Notes
    -----
    Two linear least-squares problems of Lambda_m = sum of 2 Re(shape g^T lambda^(m - 1)): the participations g of all
    references from the known outputs, then the shape of every channel from all references but itself.
    """
    n_channels = len(correlations.channels)
    known = [correlations.channels.index(name) for name in channels]
    lagged = correlations.values[:, :, 1:]
    powers = np.exp(poles[:, None] / correlations.sampling_rate * np.arange(lagged.shape[-1]))
    participations = np.zeros((len(poles), n_channels), dtype=complex)
    for reference in range(n_channels):
        others = [row for row in known if row != reference]
        if others:
            columns = [known.index(row) for row in others]
            responses = _responses(mode_shapes[:, columns], powers)
            participations[:, reference] = lagged[others, reference].ravel() @ _participation_operator(responses)
    shapes = np.zeros((len(poles), n_channels), dtype=complex)
    for channel in range(n_channels):
        others = [reference for reference in range(n_channels) if reference != channel]
        responses = _responses(participations[:, others], powers)
        shapes[:, channel] = lagged[channel, others].ravel() @ _participation_operator(responses)
    return shapes


def significant(modes: Modes, correlations: Correlations, *, least: float) -> Booleans:
    """Return which modes contribute more than chance to the correlations between channels.

    Parameters
    ----------
    modes
        Candidates on the channels of `correlations`.
    correlations
        Correlations of all segments, with blocks.
    least
        Smallest contribution (see `contributions`); 0: all modes are significant.

    Returns
    -------
    numpy.ndarray
        Whether each mode is significant, shape (modes,).

    Notes
    -----
    Backward elimination: the weakest mode is removed and the others are solved for again until all that remain
    contribute enough. The bound is not below the 99 % quantile of Fisher's distribution for the complex participation
    of each reference, in the average over that in each block but one; this matters where there are few channels or few
    blocks. The bound of the excess is not below what chance exceeds once in a million times: it offers a mode many
    places, of which the stabilisation diagram shows the best. Where the standard deviation of a mode's frequency is
    more than 0.2 of its half-bandwidth, the bounds are that many times, up to three times, higher, that of the excess
    by the square: what is left of a line, or of a strong mode that the other modes do not fully explain, contributes
    more than chance, too, but its frequency is not certain. With fewer than 24 blocks half of the bound of the
    contribution suffices, however uncertain the frequency, where the excess is 1.5 times its bound: few blocks differ
    by the mode's own random level, and a short record gives no frequency to a share of its bandwidth.
    """
    is_kept = np.ones(len(modes), dtype=np.bool_)
    if least <= 0 or not len(modes):
        return is_kept
    freedom = 2 * len(correlations.references)
    least_excess = max(least, float(special.chdtri(freedom, _CHANCE_OF_EXCESS)) / freedom)
    by_chance = special.fdtri(freedom, freedom * max(len(correlations.blocks) - 1, 1), 1 - _CHANCE)
    least = max(least, float(by_chance))
    spread = modes.natural_frequency_std / (modes.natural_frequency * modes.damping_ratio)
    projections = _projections(modes.poles, modes.mode_shapes, correlations)
    while is_kept.any():
        kept = np.flatnonzero(is_kept)
        contribution, excess = _relative_to_chance(projections, kept)
        is_clear = (excess > _CLEAR * least_excess) & (len(correlations.blocks) < _MANY_BLOCKS)
        most = np.where(np.isfinite(excess), _MOST_DEMANDED, np.inf)
        demand = np.where(is_clear, 0.5, np.clip(np.nan_to_num(spread[kept]) / _WELL_KNOWN, 1.0, most))
        certainty = np.minimum(contribution / demand / least, excess / demand**2 / least_excess)
        weakest = int(np.argmin(certainty))
        if certainty[weakest] >= 1:
            break
        is_kept[kept[weakest]] = False
    return is_kept
