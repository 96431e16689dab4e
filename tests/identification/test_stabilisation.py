"""Stabilisation diagrams of ladders made by hand, against plain loops."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import ParameterError
from sprung.identification.stabilisation import (
    THESIS_CRITERIA,
    StabilityCriteria,
    select_modes,
    stabilise,
    with_status,
)
from sprung.modal import Poles, PoleStatus

LOOSE = StabilityCriteria(stable_rate=0.0, unknown_damping=0.1)


def pole(frequency, damping=0.02):
    return 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))


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


# Why a pole was dropped


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


def test_a_diagram_without_poles_has_no_modes() -> None:
    nothing, no_shapes = np.zeros(0), np.zeros((0, 2), dtype=complex)
    empty = Poles(nothing.astype(complex), no_shapes, np.zeros(0, dtype=int), (2, 4, 6), ("a", "b"), nothing, nothing)
    selected = select_modes(stabilise(empty))
    assert len(selected.modes) == 0
    assert selected.alignments.shape == (0,)


def test_an_empty_rung_breaks_a_ladder_and_nothing_else() -> None:
    mode = (5.0, 0.02, (1, 2))
    diagram = stabilise(ladder([mode], [mode], [], [mode], [mode]), criteria=LOOSE)
    dropped, kept = PoleStatus.FREQUENCY_CHANGED, PoleStatus.SELECTED
    assert diagram.status.tolist() == [dropped, kept, dropped, kept]


# Thresholds


def test_the_thesis_thresholds_are_those_printed() -> None:
    """F. Liu (2020), section 4.3: 0.1, 0.2 and 0.5 in eq. 3-53 to 3-56, rate 0.5 of eq. 3-57."""
    assert (THESIS_CRITERIA.frequency, THESIS_CRITERIA.damping, THESIS_CRITERIA.shape) == (0.1, 0.2, 0.5)
    assert THESIS_CRITERIA.stable_rate == 0.5
    assert (THESIS_CRITERIA.bandwidth, THESIS_CRITERIA.mpc, THESIS_CRITERIA.contribution) == (0, 0, 0)
    assert np.isinf(THESIS_CRITERIA.uncertainty)


@pytest.mark.parametrize(
    ("here", "status"),
    [
        ((5.54, 0.02, (1, 0)), PoleStatus.SELECTED),
        ((5.57, 0.02, (1, 0)), PoleStatus.FREQUENCY_CHANGED),
        ((5.0, 0.0249, (1, 0)), PoleStatus.SELECTED),
        ((5.0, 0.0251, (1, 0)), PoleStatus.DAMPING_CHANGED),
        ((5.0, 0.02, (1, 0.99)), PoleStatus.SELECTED),
        ((5.0, 0.02, (1, 1.01)), PoleStatus.SHAPE_CHANGED),
    ],
)
def test_the_thesis_thresholds_act_as_their_equations_say(here, status) -> None:
    """Relative to the higher rung: 0.54/5.54 < 0.1 < 0.57/5.57; 0.0049/0.0249 < 0.2 < 0.0051/0.0251; MAC 0.5."""
    diagram = stabilise(ladder([(5.0, 0.02, (1, 0))], [here]), criteria=replace(THESIS_CRITERIA, stable_rate=0.0))
    assert diagram.status[1] == status


@pytest.mark.parametrize("name", ["frequency", "damping", "shape", "max_damping"])
def test_tolerances_lie_between_0_and_1(name) -> None:
    with pytest.raises(ParameterError) as refusal:
        StabilityCriteria(**{name: 0.0})
    assert str(refusal.value) == f"{name}=0 must be above 0 and at most 1"
    with pytest.raises(ParameterError):
        StabilityCriteria(**{name: 1.5})


@pytest.mark.parametrize("name", ["mpc", "stable_rate"])
def test_rates_lie_between_0_and_1(name) -> None:
    with pytest.raises(ParameterError) as refusal:
        StabilityCriteria(**{name: -0.1})
    assert str(refusal.value) == f"{name}=-0.1 must be at least 0 and at most 1"


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


# Selection


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
    known = replace(poles, natural_frequency_std=deviations, damping_ratio_std=deviations / 100)
    modes = select_modes(stabilise(known)).modes
    assert modes.natural_frequency == pytest.approx([5.0])
    assert modes.natural_frequency_std == pytest.approx([0.002])
    unknown = select_modes(stabilise(poles)).modes
    assert unknown.natural_frequency == pytest.approx([5.0])
    assert np.isnan(unknown.natural_frequency_std).all()


def test_another_status_is_given_to_whole_alignments() -> None:
    diagram = stabilise(ladder(*[[(3.0, 0.02, (1, 2)), (9.0, 0.02, (1, 2))]] * 3))
    changed = with_status(diagram, [1], PoleStatus.INSIGNIFICANT)
    expected = [PoleStatus.FREQUENCY_CHANGED] * 2 + [PoleStatus.SELECTED, PoleStatus.INSIGNIFICANT] * 2
    assert changed.status.tolist() == expected
    assert (diagram.status != PoleStatus.INSIGNIFICANT).all()
    assert select_modes(changed).modes.natural_frequency == pytest.approx([3.0])
    assert with_status(diagram, [], PoleStatus.RARE).status.tolist() == diagram.status.tolist()
