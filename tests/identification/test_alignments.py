"""Which stable poles are one mode, and which modes are chance."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.identification.contribution import contributions, significant
from sprung.identification.correlation import average, correlate_segments
from sprung.identification.stabilisation import align
from sprung.modal import Modes
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain


def pole(frequency, damping=0.02):
    return 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))


def modes_of(*rows, std=0.01, channels=("a", "b")):
    """Modes from (frequency, damping, shape)."""
    n = len(rows)
    return Modes(
        poles=np.array([pole(row[0], row[1]) for row in rows]),
        mode_shapes=np.array([row[2] for row in rows], dtype=complex).reshape(n, len(channels)),
        channels=channels,
        natural_frequency_std=np.full(n, std),
        damping_ratio_std=np.full(n, std / 10),
        stable_rate=np.full(n, 0.5),
        labels=(None,) * n,
    )


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


@pytest.mark.parametrize("n", [0, 1])
def test_few_poles_align_with_themselves(n) -> None:
    assert align(pole(np.full(n, 3.0)), np.ones((n, 2), dtype=complex)).tolist() == [0] * n


@settings(max_examples=30, deadline=None)
@given(order=st.permutations(range(12)), phase=st.floats(0, 6.3), size=st.floats(1e-3, 1e3))
def test_groups_do_not_depend_on_order_or_scale_of_shapes(order, phase, size) -> None:
    generator = np.random.default_rng(0)
    poles = pole(np.repeat([3.0, 5.0, 9.0], 4) * generator.normal(1, 0.002, 12), np.full(12, 0.03))
    shapes = np.repeat(np.array([[1, 1], [1, -1], [1, 0]], dtype=complex), 4, axis=0)
    shapes += 0.02 * generator.normal(size=(12, 2))
    groups = align(poles, shapes)
    assert groups.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    turned = align(poles[order], size * np.exp(1j * phase) * shapes[order])
    np.testing.assert_array_equal(turned, groups[order])


@pytest.fixture(scope="module")
def measured():
    structure = chain()
    run = simulate(structure, usual_excitation(structure), duration=60.0, sampling_rate=125.0, snr=10.0, seed=1)
    correlations = average(correlate_segments(run, n_lags=40, segment=2.0, is_continued=True))
    exact = structure.modes()
    frequency, damping = exact.natural_frequency, exact.damping_ratio
    ghosts = [(f, 0.02, shape) for f, shape in ((12.0, (1, -1, 1)), (24.0, (1, 2, -1)), (40.0, (1, 1, 1)))]
    rows = [*zip(frequency, damping, exact.mode_shapes, strict=True), *ghosts]
    return modes_of(*rows, channels=exact.channels, std=1e-3), correlations


def test_modes_that_contribute_no_more_than_chance_are_not_significant(measured) -> None:
    modes, correlations = measured
    assert significant(modes, correlations, least=4.0).tolist() == [True] * 3 + [False] * 3
    assert significant(modes, correlations, least=0.0).all()
    assert not significant(modes, correlations, least=1e9).any()


def test_an_uncertain_mode_counts_less(measured) -> None:
    """The contribution is divided by (deviation / half-bandwidth) / 0.2."""
    modes, correlations = measured
    true = modes.take(np.arange(3))
    least = 0.8 * contributions(true.poles, true.mode_shapes, correlations)[0][0]
    assert significant(true, correlations, least=least).all()
    half_bandwidth = true.natural_frequency * true.damping_ratio
    for spread, is_kept in ((0.19, True), (0.24, True), (0.26, False)):
        deviations = half_bandwidth * [spread, 0.01, 0.01]
        found = significant(replace(true, natural_frequency_std=deviations), correlations, least=least)
        assert found.tolist() == [is_kept, True, True]


def test_the_bound_is_higher_with_few_blocks(measured) -> None:
    """One participation for each of three references: Fisher's F exceeds 8.47 once in a hundred with 6 and 6 degrees.

    Between two halves that differ by a quarter of the average, a participation has the contribution 1 / 0.25^2 = 16:
    enough; by 0.4 of it, 6.25: not enough, though above the criterion.
    """
    modes, correlations = measured
    for share, is_kept in ((0.25, True), (0.4, False)):
        halves = np.stack([(1 - share) * correlations.values, (1 + share) * correlations.values])
        few = replace(correlations, blocks=halves, weights=np.array([0.5, 0.5]))
        assert (significant(modes, few, least=4.0)[:3] == is_kept).all()


def test_a_mode_must_stand_out_from_what_independent_channels_show(measured) -> None:
    """The same correlations of a millionth of the samples are chance, whatever their blocks say."""
    modes, correlations = measured
    assert significant(modes, correlations, least=4.0)[:3].all()
    assert not significant(modes, replace(correlations, n_products=correlations.n_products / 1e6), least=4.0).any()


def test_no_modes_are_judged_without_complaint(measured) -> None:
    modes, correlations = measured
    assert significant(modes.take(np.zeros(0, dtype=int)), correlations, least=4.0).shape == (0,)
