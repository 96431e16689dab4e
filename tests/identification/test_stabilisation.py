"""Stabilisation diagrams made by hand, modes that are merged, and modes that contribute no more than chance."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from tests.identification.runs import modes_of, pole

from sprung.errors import ParameterError
from sprung.identification.correlation import average, correlate_segments
from sprung.identification.stabilisation import (
    THESIS_CRITERIA,
    StabilityCriteria,
    align,
    complete_shapes,
    contributions,
    merge_modes,
    select_modes,
    significant,
    stabilise,
)
from sprung.identification.subspace import poles_of_orders, realise
from sprung.modal import Poles, PoleStatus, mac
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

LOOSE = StabilityCriteria(stable_rate=0.0, unknown_damping=0.1)


def ladder(*rungs, std=np.nan):
    """Poles of rungs, each pole (frequency, damping, shape); the ladder is 2, 4, 6 ..."""
    rows = [(k, *row) for k, rung in enumerate(rungs) for row in rung]
    n_channels = len(rows[0][3])
    return Poles(
        poles=np.array([pole(row[1], row[2]) for row in rows]),
        mode_shapes=np.array([row[3] for row in rows], dtype=complex).reshape(-1, n_channels),
        rungs=np.array([row[0] for row in rows]),
        ladder=tuple(range(2, 2 * len(rungs) + 1, 2)),
        channels=tuple("abcdef"[:n_channels]),
        natural_frequency_std=np.full(len(rows), std),
        damping_ratio_std=np.full(len(rows), std),
    )


def test_a_pole_that_repeats_is_part_of_a_mode_and_the_lowest_rung_has_nothing_below() -> None:
    diagram = stabilise(ladder(*[[(5.0, 0.02, (1, 2))]] * 4))
    assert diagram.status.tolist() == [PoleStatus.FREQUENCY_CHANGED] + [PoleStatus.SELECTED] * 3
    assert diagram.alignments.tolist() == [-1, 0, 0, 0]


@pytest.mark.parametrize(
    ("below", "here", "status"),
    [
        ((5.0, 0.02, (1, 2)), (5.04, 0.0215, (1, 1.9)), PoleStatus.SELECTED),
        ((5.0, 0.02, (1, 2)), (4.96, 0.0185, (1, 2)), PoleStatus.SELECTED),
        ((5.0, 0.02, (1, 2)), (5.06, 0.02, (1, 2)), PoleStatus.FREQUENCY_CHANGED),
        ((5.0, 0.02, (1, 2)), (4.94, 0.02, (1, 2)), PoleStatus.FREQUENCY_CHANGED),
        ((5.0, 0.02, (1, 2)), (5.04, 0.0225, (1, 2)), PoleStatus.DAMPING_CHANGED),
        ((5.0, 0.02, (1, 2)), (5.04, 0.0175, (1, 2)), PoleStatus.DAMPING_CHANGED),
        ((5.0, 0.02, (1, 2)), (5.0, 0.02, (1, 3.2)), PoleStatus.SHAPE_CHANGED),
        ((5.0, 0.02, (1, 2)), (5.0, 0.02, (1, 2j)), PoleStatus.SHAPE_CHANGED),
        ((5.0, 0.02, (1, 2)), (5.0, 0.02, (-3j, -6j)), PoleStatus.SELECTED),
        ((5.0, 0.3, (1, 2)), (5.14, 0.3, (1, 2)), PoleStatus.SELECTED),
        ((5.0, 0.3, (1, 2)), (5.17, 0.3, (1, 2)), PoleStatus.FREQUENCY_CHANGED),
        ((5.0, -0.02, (1, 2)), (5.0, -0.02, (1, 2)), PoleStatus.UNPHYSICAL_DAMPING),
        ((5.0, 0.59, (1, 2)), (5.0, 0.59, (1, 2)), PoleStatus.SELECTED),
        ((5.0, 0.61, (1, 2)), (5.0, 0.61, (1, 2)), PoleStatus.UNPHYSICAL_DAMPING),
        ((1.9, 0.02, (1, 2)), (1.9, 0.02, (1, 2)), PoleStatus.OUT_OF_BAND),
        ((10.1, 0.02, (1, 2)), (10.1, 0.02, (1, 2)), PoleStatus.OUT_OF_BAND),
    ],
)
def test_the_first_criterion_that_fails_is_the_reason(below, here, status) -> None:
    """Tolerances 1 % of the frequency (or 10 % of the half-bandwidth), 10 % of the damping, 1 - MAC of 0.02."""
    diagram = stabilise(ladder([below], [here]), criteria=LOOSE, band=(2.0, 10.0))
    assert diagram.status[1] == status
    assert diagram.alignments[1] == (0 if status == PoleStatus.SELECTED else -1)


def test_incoherent_shapes_are_dropped_where_a_bound_is_set() -> None:
    """MPC of (1, 0.5i) is ((1 - 0.25) / (1 + 0.25))^2 = 0.36."""
    poles = ladder(*[[(5.0, 0.02, (1, 0.5j))]] * 2)
    assert stabilise(poles, criteria=LOOSE).status[1] == PoleStatus.SELECTED
    assert stabilise(poles, criteria=replace(LOOSE, mpc=0.35)).status[1] == PoleStatus.SELECTED
    assert stabilise(poles, criteria=replace(LOOSE, mpc=0.37)).status[1] == PoleStatus.INCOHERENT_SHAPE


def test_known_harmonics_are_named_and_not_aligned() -> None:
    poles = ladder(*[[(5.0, 0.02, (1, 2)), (7.0, 0.001, (1, 1))]] * 3)
    diagram = stabilise(poles, is_harmonic=np.array([False, True] * 3))
    assert set(diagram.status[1::2]) == {PoleStatus.HARMONIC}
    assert diagram.status[0::2].tolist()[1:] == [PoleStatus.SELECTED] * 2
    modes = select_modes(diagram).modes
    assert modes.natural_frequency == pytest.approx([5.0])


@pytest.mark.parametrize(
    ("n_rungs", "n_stable", "status"),
    [
        (10, 1, PoleStatus.RARE),
        (10, 2, PoleStatus.SELECTED),
        (11, 2, PoleStatus.RARE),
        (11, 3, PoleStatus.SELECTED),
    ],
)
def test_an_alignment_on_too_few_rungs_is_rare(n_rungs, n_stable, status) -> None:
    """At a rate of 0.2 two stable rungs of ten are enough, and two of eleven are not."""
    other = [(20.0, 0.02, (1, 0))]
    rungs = [[*other, (5.0, 0.02, (1, 2))] if k <= n_stable else other for k in range(n_rungs)]
    diagram = stabilise(ladder(*rungs))
    found = diagram.status[np.isclose(diagram.poles.natural_frequency, 5.0)]
    assert found.tolist() == [PoleStatus.FREQUENCY_CHANGED] + [status] * n_stable


def test_a_frequency_as_uncertain_as_its_bandwidth_is_not_a_mode() -> None:
    """Half-bandwidth 5 Hz x 0.02 = 0.1 Hz and the bound 0.6: a standard deviation of 0.061 Hz is too much."""
    rungs = [[(5.0, 0.02, (1, 2))]] * 3
    assert stabilise(ladder(*rungs, std=0.059)).status[1:].tolist() == [PoleStatus.SELECTED] * 2
    assert stabilise(ladder(*rungs, std=0.061)).status[1:].tolist() == [PoleStatus.UNCERTAIN] * 2
    one_certain = replace(ladder(*rungs, std=0.061), natural_frequency_std=np.array([1.0, 1.0, 0.01]))
    assert stabilise(one_certain).status[1:].tolist() == [PoleStatus.SELECTED] * 2


def test_a_frequency_is_as_certain_as_the_duration_allows() -> None:
    """A record of 20 periods gives a mode of 1 Hz and 1 % damping 0.63 half-bandwidths of 0.01 Hz: 1.3 are kept.

    Of 400 s, where the least is 0.14, the bound of 0.6 half-bandwidths stays.
    """
    poles = ladder(*[[(1.0, 0.01, (1, 2))]] * 3, std=0.013)
    assert stabilise(poles, duration=20.0).status[1:].tolist() == [PoleStatus.SELECTED] * 2
    assert stabilise(poles, duration=5 * 20.0).status[1:].tolist() == [PoleStatus.UNCERTAIN] * 2
    assert stabilise(poles, duration=400.0).status[1:].tolist() == [PoleStatus.UNCERTAIN] * 2


def test_a_pole_that_grows_by_no_more_than_chance_in_a_short_record_is_a_mode() -> None:
    """Over 20 periods a damping ratio of -0.3 % grows by 0.38 nepers (kept up to 0.5), over 30 one of -0.5 % by 0.94.

    Damping ratios may differ as much. Where standard deviations are known, or there are 40 periods, none may grow.
    """
    poles = ladder(*[[(1.0, xi, (1, 2)), (1.5, -0.005, (2, 1))] for xi in (-0.003, 0.0005, -0.002)])
    diagram = stabilise(poles, duration=20.0)
    assert diagram.status[2::2].tolist() == [PoleStatus.SELECTED] * 2
    assert select_modes(diagram).modes.damping_ratio[0] == pytest.approx(0.002)
    assert set(diagram.status[1::2]) == {PoleStatus.UNPHYSICAL_DAMPING}
    line = stabilise(ladder(*[[(2.1, -1e-4, (1, 2))]] * 3), duration=20.0)
    assert line.status[-1] == PoleStatus.UNPHYSICAL_DAMPING
    known = replace(poles, natural_frequency_std=np.full(6, 1e-3), damping_ratio_std=np.full(6, 1e-3))
    for other, duration in ((known, 20.0), (poles, 40.0)):
        assert stabilise(other, duration=duration).status[0] == PoleStatus.UNPHYSICAL_DAMPING


def test_a_diagram_without_poles_has_no_modes() -> None:
    nothing, no_shapes = np.zeros(0), np.zeros((0, 2), dtype=complex)
    empty = Poles(nothing.astype(complex), no_shapes, np.zeros(0, dtype=int), (2, 4, 6), ("a", "b"), nothing, nothing)
    selected = select_modes(stabilise(empty))
    assert len(selected.modes) == 0
    assert selected.alignments.shape == (0,)


def test_the_thesis_thresholds_are_those_printed() -> None:
    """F. Liu (2020), section 4.3: 0.1, 0.2 and 0.5 in eq. 3-53 to 3-56, rate 0.5 of eq. 3-57."""
    assert (THESIS_CRITERIA.frequency, THESIS_CRITERIA.damping, THESIS_CRITERIA.shape) == (0.1, 0.2, 0.5)
    assert THESIS_CRITERIA.stable_rate == 0.5
    assert (THESIS_CRITERIA.bandwidth, THESIS_CRITERIA.mpc, THESIS_CRITERIA.contribution) == (0, 0, 0)
    assert np.isinf(THESIS_CRITERIA.uncertainty)


@pytest.mark.parametrize("name", ["frequency", "damping", "shape", "max_damping"])
def test_tolerances_lie_between_0_and_1(name) -> None:
    with pytest.raises(ParameterError) as refusal:
        StabilityCriteria(**{name: 0.0})
    assert str(refusal.value) == f"{name}=0 must be above 0 and at most 1"
    with pytest.raises(ParameterError):
        StabilityCriteria(**{name: 1.5})


def naive_status(poles, criteria, band):
    """The criteria of eq. 3-53 to 3-56, pole by pole."""
    found = []
    for k, here in enumerate(poles.poles):
        f, xi = np.abs(here) / (2 * np.pi), -here.real / np.abs(here)
        if not 0 < xi <= criteria.max_damping:
            found.append(PoleStatus.UNPHYSICAL_DAMPING)
            continue
        if not band[0] <= f <= band[1]:
            found.append(PoleStatus.OUT_OF_BAND)
            continue
        reached = 0
        for j in np.flatnonzero(poles.rungs == poles.rungs[k] - 1):
            old = poles.poles[j]
            df = abs(f - np.abs(old) / (2 * np.pi)) / f
            dxi = abs(xi + old.real / np.abs(old)) / xi
            a, b = poles.mode_shapes[k], poles.mode_shapes[j]
            likeness = abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a) * np.vdot(b, b)).real
            if df > max(criteria.frequency, criteria.bandwidth * xi):
                continue
            passed = 1 if dxi > criteria.unknown_damping else 2 if 1 - likeness > criteria.shape else 3
            reached = max(reached, passed)
        names = ("FREQUENCY_CHANGED", "DAMPING_CHANGED", "SHAPE_CHANGED", "SELECTED")
        found.append(PoleStatus[names[reached]])
    return found


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    counts=st.lists(st.integers(0, 6), min_size=1, max_size=8),
    criteria=st.sampled_from([LOOSE, replace(THESIS_CRITERIA, stable_rate=0.0)]),
)
def test_the_vectorised_comparison_equals_a_plain_loop(seed, counts, criteria) -> None:
    generator = np.random.default_rng(seed)
    n = sum(counts)
    frequency = generator.choice([3.0, 3.1, 5.0, 9.0], n) * generator.normal(1, 0.01, n)
    damping = generator.choice([0.02, 0.3, 0.58, -0.01], n, p=[0.5, 0.3, 0.1, 0.1]) * generator.normal(1, 0.08, n)
    shapes = generator.choice([1.0, -1.0], (n, 2)) + 0.1 * generator.normal(size=(n, 2))
    poles = Poles(
        pole(frequency, damping),
        shapes.astype(complex),
        np.repeat(np.arange(len(counts)), counts),
        tuple(range(2, 2 * len(counts) + 1, 2)),
        ("a", "b"),
        np.full(n, np.nan),
        np.full(n, np.nan),
    )
    diagram = stabilise(poles, criteria=criteria, band=(2.98, 8.0))
    assert diagram.status.tolist() == naive_status(poles, criteria, (2.98, 8.0))
    np.testing.assert_array_equal(diagram.alignments >= 0, diagram.status == PoleStatus.SELECTED)


def test_the_stable_rate_is_the_share_of_rungs_with_a_stable_pole() -> None:
    """Eq. 3-57: stable on 3 of 5 rungs; two stable poles on one rung count once."""
    mode, twin = (5.0, 0.02, (1, 2)), (5.001, 0.02, (1, 2))
    selected = select_modes(stabilise(ladder([mode], [mode], [mode, twin], [mode], [])))
    assert selected.modes.stable_rate == pytest.approx([0.6])
    assert selected.alignments.tolist() == [0]


def test_modes_come_by_rising_frequency_with_unit_shapes() -> None:
    rungs = [[(9.0, 0.05, (4, 2j)), (3.0, 0.02, (1, -2))]] * 5
    selected = select_modes(stabilise(ladder(*rungs)))
    modes = selected.modes
    np.testing.assert_allclose(modes.natural_frequency, [3.0, 9.0])
    np.testing.assert_allclose(modes.damping_ratio, [0.02, 0.05])
    np.testing.assert_allclose(modes.mode_shapes, np.array([[-0.5, 1], [1, 0.5j]]))
    assert selected.alignments.tolist() == [0, 1]
    assert modes.labels == (None, None)


def test_the_pole_of_least_variance_near_the_median_stands_for_the_mode() -> None:
    frequencies = [5.0, 5.0, 5.02, 5.0, 5.01, 4.99]
    poles = ladder(*[[(f, 0.02, (1, 2))] for f in frequencies])
    deviations = np.array([0.0, 0.05, 0.05, 0.002, 0.05, 0.05])
    line = stabilise(ladder(*[[(2.1, -1e-4, (1, 2))]] * 3), duration=20.0)
    assert line.status[-1] == PoleStatus.UNPHYSICAL_DAMPING
    known = replace(poles, natural_frequency_std=deviations, damping_ratio_std=deviations / 100)
    modes = select_modes(stabilise(known)).modes
    assert modes.natural_frequency == pytest.approx([5.0])
    assert modes.natural_frequency_std == pytest.approx([0.002])
    unknown = select_modes(stabilise(poles)).modes
    assert unknown.natural_frequency == pytest.approx([5.0])
    assert np.isnan(unknown.natural_frequency_std).all()


def test_poles_of_one_mode_are_one_group_numbered_by_frequency() -> None:
    poles = pole(np.array([9.0, 3.0, 3.005, 9.02, 5.0]), np.full(5, 0.02))
    assert align(poles, np.ones((5, 2), dtype=complex)).tolist() == [2, 0, 0, 2, 1]


def test_close_frequencies_of_different_shape_are_different_modes() -> None:
    poles = pole(np.array([3.0, 3.001, 3.0, 3.001]), np.full(4, 0.02))
    groups = align(poles, np.array([[1, 1], [1, -1], [1, 1.02], [1, -1.02]], dtype=complex))
    assert groups[0] == groups[2] != groups[1] == groups[3]


def test_the_width_of_a_group_is_its_bandwidth() -> None:
    """0.01 f + 0.5 xi f: 3 Hz at 20 % damping is 0.33 Hz wide, at 1 % it is 0.045 Hz wide."""
    shapes = np.ones((2, 2), dtype=complex)
    for damping, width in ((0.2, 0.33), (0.01, 0.045)):
        near = pole(np.array([3.0, 3.0 + 0.9 * width]), np.full(2, damping))
        far = pole(np.array([3.0, 3.0 + 1.2 * width]), np.full(2, damping))
        assert align(near, shapes).tolist() == [0, 0]
        assert align(far, shapes).tolist() == [0, 1]


def test_free_damping_groups_by_frequency_and_shape_only() -> None:
    """Three subsets of one mode: 2.0, 1.1 and 0.6 %."""
    poles = pole(np.array([3.0, 3.0, 3.0]), np.array([0.1, 0.05, 0.02]))
    shapes = np.ones((3, 2), dtype=complex)
    assert align(poles, shapes, has_free_damping=True).tolist() == [0, 0, 0]
    assert len(set(align(poles, shapes))) > 1


@pytest.fixture(scope="module")
def judged():
    structure = chain()
    run = simulate(structure, usual_excitation(structure), duration=60.0, sampling_rate=125.0, snr=10.0, seed=1)
    correlations = average(correlate_segments(run, n_lags=40, segment=2.0, is_continued=True))
    exact = structure.modes()
    frequency, damping = exact.natural_frequency, exact.damping_ratio
    ghosts = [(f, 0.02, shape) for f, shape in ((12.0, (1, -1, 1)), (24.0, (1, 2, -1)), (40.0, (1, 1, 1)))]
    rows = [*zip(frequency, damping, exact.mode_shapes, strict=True), *ghosts]
    modes = modes_of(*(np.array(column) for column in zip(*rows, strict=True)), std=1e-3)
    return modes, correlations


def test_modes_that_contribute_no_more_than_chance_are_not_significant(judged) -> None:
    modes, correlations = judged
    assert significant(modes, correlations, least=4.0).tolist() == [True] * 3 + [False] * 3
    assert significant(modes, correlations, least=0.0).all()
    assert not significant(modes, correlations, least=1e9).any()


def test_an_uncertain_mode_counts_less(judged) -> None:
    """The contribution is divided by (deviation / half-bandwidth) / 0.2."""
    modes, correlations = judged
    true = modes.take(np.arange(3))
    least = 0.8 * contributions(true.poles, true.mode_shapes, correlations)[0][0]
    assert significant(true, correlations, least=least).all()
    half_bandwidth = true.natural_frequency * true.damping_ratio
    for spread, is_kept in ((0.19, True), (0.24, True), (0.26, False)):
        deviations = half_bandwidth * [spread, 0.01, 0.01]
        found = significant(replace(true, natural_frequency_std=deviations), correlations, least=least)
        assert found.tolist() == [is_kept, True, True]


def test_the_bound_is_higher_with_few_blocks(judged) -> None:
    """One participation for each of three references: Fisher's F exceeds 8.47 once in a hundred with 6 and 6 degrees.

    Between two halves that differ by a quarter of the average, a participation has the contribution 1 / 0.25^2 = 16:
    enough; by 0.4 of it, 6.25: not enough, though above the criterion, unless the excess shows the mode clearly; by 0.6
    of it, 2.8, less than half of the bound: not enough.
    """
    modes, correlations = judged
    modes = modes.take(np.arange(3))
    excess = contributions(modes.poles, modes.mode_shapes, correlations)[1]
    barely = 1.2 * 6.38 / excess.min()  # chance has an excess of 6.38 once in a million times
    for share, part, is_kept in ((0.25, barely, True), (0.4, barely, False), (0.4, 1.0, True), (0.6, 1.0, False)):
        halves = np.stack([(1 - share) * correlations.values, (1 + share) * correlations.values])
        few = replace(correlations, blocks=halves, weights=np.array([0.5, 0.5]))
        few = replace(few, n_products=part * correlations.n_products)
        assert significant(modes, few, least=4.0)[int(np.argmin(excess))] == is_kept


def test_a_mode_must_stand_out_from_what_independent_channels_show(judged) -> None:
    """The same correlations of a millionth of the samples are chance, whatever their blocks say."""
    modes, correlations = judged
    assert significant(modes, correlations, least=4.0)[:3].all()
    assert not significant(modes, replace(correlations, n_products=correlations.n_products / 1e6), least=4.0).any()


def test_modes_of_parts_merge_with_weights_and_each_part_keeps_its_own() -> None:
    """Damping differs between the subsets of one mode, frequency and shape do not."""
    parts = [
        modes_of([3.0, 9.0], [0.02, 0.05], [(1, 0.5), (1, -1)], std=0.01),
        modes_of([9.1], 0.04, [(1, -1)], std=0.02),
        modes_of([3.01, 9.05, 20.0], [0.011, 0.045, 0.01], [(1, 0.51), (1, -1.1), (1, 1)], std=0.01),
    ]
    merged = merge_modes(parts, weights=[1.0, 2.0, 5.0])
    assert merged.members.tolist() == [[0, -1, 0], [1, 0, 1]]
    poles = [(parts[0].poles[0] + 5 * parts[2].poles[0]) / 6]
    poles.append((parts[0].poles[1] + 2 * parts[1].poles[0] + 5 * parts[2].poles[1]) / 8)
    np.testing.assert_allclose(merged.modes.poles, poles)
    np.testing.assert_allclose(merged.modes.mode_shapes, parts[2].mode_shapes[:2])
    deviations = [np.hypot(0.01, 0.05) / 6, np.sqrt(0.01**2 + 0.04**2 + 0.05**2) / 8]
    np.testing.assert_allclose(merged.modes.natural_frequency_std, deviations)
    assert merged.modes.stable_rate.tolist() == [0.5, 0.5]


@pytest.mark.parametrize(("stds", "weights"), [((np.nan, np.nan), [3.0, 1.0]), ((0.01, 0.01 * np.sqrt(3)), [1.0, 1.0])])
def test_shapes_can_be_averaged_whatever_their_phase_and_scale(stds, weights) -> None:
    """Weights are the inverse variances where these are known."""
    parts = [modes_of([3.0], 0.02, [(1, 0.5)], std=stds[0]), modes_of([3.0], 0.02, [(2j, 1.2j)], std=stds[1])]
    merged = merge_modes(parts, weights=weights, has_mean_shapes=True)
    assert merged.shares == pytest.approx(np.array([[0.75, 0.25]]))
    scaled = np.array([1.0, 0.6]) * 1.25 / 1.3
    expected = 0.75 * np.array([1.0, 0.5]) + 0.25 * scaled
    np.testing.assert_allclose(merged.modes.mode_shapes, [expected / expected[0]])


def test_a_mode_of_less_than_half_of_the_parts_is_left_out() -> None:
    one = modes_of([3.0], 0.02, [(1, 1)], std=0.01)
    none = one.take(np.zeros(0, dtype=int))
    assert len(merge_modes([one, none], weights=[1, 1]).modes) == 1
    assert len(merge_modes([one, none, none], weights=[1, 1, 1]).modes) == 0
    assert merge_modes([one, none, none], weights=[1, 1, 1]).members.shape == (0, 3)
    assert merge_modes([none], weights=[1]).members.shape == (0, 1)


def test_merged_modes_come_by_rising_frequency() -> None:
    part = modes_of([9.0, 3.0, 5.0], [0.02, 0.02, 0.02], [(1, 1), (1, -1), (1, 0)], std=0.01)
    merged = merge_modes([part, part.take(np.array([2, 0, 1]))], weights=[1, 1])
    np.testing.assert_allclose(merged.modes.natural_frequency, [3.0, 5.0, 9.0])
    assert merged.members.tolist() == [[1, 2], [2, 0], [0, 1]]


def test_of_two_modes_of_one_part_that_merge_the_more_stable_one_stands_for_it() -> None:
    twins = replace(modes_of([3.0, 3.01], [0.02, 0.03], [(1, 1), (1, 1)], std=0.01), stable_rate=np.array([0.3, 0.8]))
    merged = merge_modes([twins], weights=[1])
    assert merged.members.tolist() == [[1]]
    np.testing.assert_allclose(merged.modes.poles, twins.poles[1:])


BLOCK_ROWS = 20


def test_contributions_are_large_for_true_modes_and_about_1_for_poles_that_are_not_there(vehicle, measured) -> None:
    exact, generator = vehicle("chain3").modes(), np.random.default_rng(0)
    ghosts = 2 * np.pi * np.array([12.0, 24.0, 40.0]) * (-0.02 + 1j)
    poles = np.concatenate([exact.poles, ghosts])
    found = []
    for seed in range(30):
        shapes = generator.normal(size=(3, 3)) + 1j * generator.normal(size=(3, 3))
        correlations = measured(seed)
        found.append(contributions(poles, np.concatenate([exact.mode_shapes, shapes]), correlations)[0])
    assert np.min(found, axis=0)[:3].min() > 15
    np.testing.assert_allclose(np.mean(found, axis=0)[3:], 1, atol=0.35)


def test_what_a_sensor_has_alone_contributes_nothing(vehicle) -> None:
    """A resonance in the electronics of one sensor, twice as strong as its signal, at 13 Hz."""
    exact, generator = vehicle("chain3").modes(), np.random.default_rng(0)
    own = 2 * np.pi * 13.0 * (-0.01 + 1j * np.sqrt(1 - 0.01**2))
    root = np.exp(own / 125.0)
    found = []
    for seed in range(30):
        chain = vehicle("chain3")
        run = simulate(chain, usual_excitation(chain), duration=60.0, sampling_rate=125.0, snr=10.0, seed=seed)
        ringing = signal.lfilter([1], np.poly([root, root.conj()]).real, generator.normal(size=run.n_samples + 2000))
        ringing = ringing[2000:] / ringing.std()
        samples = run.samples.copy()
        samples[0] += 2 * samples[0].std() * ringing
        correlations = average(
            correlate_segments(run.changed("", samples=samples), n_lags=40, segment=2.0, is_continued=True)
        )
        realised = poles_of_orders(realise(correlations, block_rows=BLOCK_ROWS, max_order=8), [8])
        nearest = np.argmin(np.abs(realised.poles - own))
        assert np.abs(realised.poles[nearest] - own) < 0.05 * np.abs(own)
        poles = np.append(exact.poles, realised.poles[nearest])
        shapes = np.concatenate([exact.mode_shapes, realised.mode_shapes[nearest : nearest + 1]])
        found.append(contributions(poles, shapes, correlations)[0])
    assert np.median(found, axis=0)[3] < 2
    assert np.median(found, axis=0)[:3].min() > 10


def test_auto_correlations_do_not_count_where_there_are_others(vehicle, measured) -> None:
    """The spectra of the channels weight the lags; twice the power, and other blocks of it, change no weights."""
    exact, correlations = vehicle("chain3").modes(), measured(1)
    own = np.eye(3)[:, :, None] * correlations.values
    own_blocks = np.arange(len(correlations.blocks))[:, None, None, None] * own
    changed = replace(correlations, values=correlations.values + own, blocks=correlations.blocks + own_blocks)
    wanted = contributions(exact.poles, exact.mode_shapes, correlations)[0]
    np.testing.assert_allclose(contributions(exact.poles, exact.mode_shapes, changed)[0], wanted, rtol=1e-9)


def test_a_single_channel_is_judged_by_its_auto_correlation(vehicle, measured) -> None:
    exact, correlations = vehicle("chain3").modes(), measured(1).select(["acc_3"], ["acc_3"])
    ghost = 2 * np.pi * 12.0 * (-0.02 + 1j)
    found = contributions(np.append(exact.poles, ghost), np.ones((4, 1), dtype=complex), correlations)[0]
    assert found[:3].min() > 30
    assert found[3] < 5


@pytest.mark.parametrize(
    ("name", "rate", "outputs"),
    [("chain3", 125.0, "2"), ("chain3", 125.0, "13"), ("zafira", 100.0, "14"), ("zafira", 100.0, "231")],
)
def test_shapes_on_some_channels_are_completed_to_all(known, name, rate, outputs) -> None:
    correlations, poles, shapes = known(name, rate)
    rows = [int(channel) - 1 for channel in outputs]
    completed = complete_shapes(poles, (2 - 1j) * shapes[:, rows], correlations, tuple(outputs))
    assert completed.shape == shapes.shape
    assert 1 - np.diag(mac(completed, shapes)).min() < 1e-9
    np.testing.assert_allclose(completed[:, rows], (2 - 1j) * shapes[:, rows], atol=1e-6)
