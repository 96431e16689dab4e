"""Matching of modes over set-ups, means of estimates, and shapes glued over shared points."""

import numpy as np
import pytest

from sprung.identification.setups import combine, glue, match_modes
from sprung.modal import Modes


def modes(frequencies, shapes, *, std=0.001):
    """Return modes of 1 % damping."""
    frequencies = np.asarray(frequencies, dtype=float)
    return Modes(
        poles=2 * np.pi * frequencies * (1j * np.sqrt(1 - 1e-4) - 0.01),
        mode_shapes=np.asarray(shapes, dtype=complex),
        channels=tuple(str(k) for k in range(len(shapes[0]))),
        natural_frequency_std=np.full(len(frequencies), std),
        damping_ratio_std=np.full(len(frequencies), 0.001),
        stable_rate=np.ones(len(frequencies)),
        labels=(None,) * len(frequencies),
    )


def random_setups(generator, n_setups=4, n_references=2, n_roving=3, noise=0.0):
    """Return a complex shape on all points, and its noisy part in each set-up at a random complex scale."""
    n_points = n_references + n_setups * n_roving
    shape = generator.standard_normal(n_points) + 0.3j * generator.standard_normal(n_points)
    shape /= shape[np.argmax(np.abs(shape))]
    rows = [
        [*range(n_references), *range(n_references + n_roving * k, n_references + n_roving * (k + 1))]
        for k in range(n_setups)
    ]
    parts = []
    for own in rows:
        error = generator.standard_normal((2, len(own))) * noise / np.sqrt(2)
        scale = 10 ** generator.uniform(-1, 1) * np.exp(2j * np.pi * generator.uniform())
        parts.append(scale * (shape[own] + error[0] + 1j * error[1]))
    return shape, rows, parts


def test_shapes_without_noise_come_out_exactly() -> None:
    shape, rows, parts = random_setups(np.random.default_rng(1))
    glued = glue(parts, rows, n_points=len(shape))
    assert glued.shape == pytest.approx(shape, abs=1e-9)
    for scale, own, part in zip(glued.scales, rows, parts, strict=True):
        assert scale * shape[own] == pytest.approx(part, abs=1e-9)
    assert glued.variance == pytest.approx(np.zeros(len(shape)), abs=1e-12)


def test_a_chain_of_set_ups_is_glued_link_by_link() -> None:
    shape = np.array([0.2, 0.5, -0.7, 1.0, 0.4j])
    rows = [[0, 1], [1, 2], [2, 3], [3, 4]]
    glued = glue([shape[own] * (k + 1j) for k, own in enumerate(rows, start=1)], rows, n_points=5)
    assert glued.shape == pytest.approx(shape, abs=1e-9)
    assert np.isnan(glued.variance[[0, 1, 2, 4]]).all()


def test_a_point_that_no_set_up_measures_is_unknown() -> None:
    glued = glue([np.array([1.0, 0.5]), np.array([2.0, 1.2])], [[0, 1], [0, 2]], n_points=4)
    assert glued.shape[:3] == pytest.approx([1.0, 0.5, 0.6])
    assert np.isnan(glued.shape[3])


def test_the_order_of_the_set_ups_does_not_matter() -> None:
    shape, rows, parts = random_setups(np.random.default_rng(2), noise=0.03)
    glued = glue(parts, rows, n_points=len(shape))
    turned = glue(parts[::-1], rows[::-1], n_points=len(shape))
    assert turned.shape == pytest.approx(glued.shape, abs=1e-9)
    assert turned.variance == pytest.approx(glued.variance, rel=1e-6)


def test_the_variance_is_the_scatter_over_simulated_set_ups() -> None:
    # Parts are scaled to 1 at their largest channel, so that equal variances need parts that are nearly equal there:
    # all set-ups share the largest point.
    shape, rows, _ = random_setups(np.random.default_rng(3), n_references=3)
    shape[0], noise = 1.5, 0.02
    shape /= shape[0]
    errors, expected = [], []
    generator = np.random.default_rng(4)
    for _ in range(200):
        parts = [
            shape[own] + noise * (generator.standard_normal(len(own)) + 1j * generator.standard_normal(len(own)))
            for own in rows
        ]
        glued = glue(parts, rows, n_points=len(shape))
        errors.append(np.abs(glued.shape - shape) ** 2)
        expected.append(glued.variance)
    ratio = np.mean(errors, axis=0)[1:] / np.mean(expected, axis=0)[1:]
    assert ratio.mean() == pytest.approx(1.0, abs=0.15)
    assert np.all((ratio > 0.6) & (ratio < 1.5))


def test_modes_are_matched_by_frequency_and_shape() -> None:
    one, two = [1.0, 0.5, 0.2], [0.5, -1.0, 0.3]
    parts = [
        modes([2.000, 2.020, 5.0], [one, two, one]),
        modes([2.006, 2.028], [one, two]),
        modes([2.015, 4.99], [two, one]),
    ]
    members = match_modes(parts, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    assert sorted(map(tuple, members.tolist())) == [(0, 0, -1), (1, 1, 0), (2, -1, 1)]


def test_two_modes_of_one_set_up_are_never_the_same() -> None:
    parts = [modes([2.000, 2.001], [[1.0], [1.0]]), modes([2.0005], [[1.0]])]
    members = match_modes(parts, [[0], [0]])
    assert all(np.count_nonzero(row >= 0) <= 2 for row in members)
    assert sorted(members[:, 0].tolist()) == [0, 1]


def test_a_mode_of_fewer_than_half_of_the_set_ups_is_left_out() -> None:
    shape = [[1.0, 0.5]]
    parts = [modes([2.0], shape), modes([2.0], shape), modes([2.001, 7.0], [*shape, *shape])]
    assert match_modes(parts, [[0, 1]] * 3).tolist() == [[0, 0, 0]]


def test_estimates_without_excess_scatter_are_weighted_by_variance() -> None:
    mean, std = combine(np.array([1.0, 1.3]), np.array([1.0, 2.0]))
    assert mean == pytest.approx((1.0 + 1.3 / 4) / 1.25)
    assert std == pytest.approx(1.25**-0.5)


def test_scatter_between_estimates_is_in_the_deviation() -> None:
    values = np.array([0.0, 1.0, 2.0, 3.0])
    mean, std = combine(values, np.full(4, 1e-3))
    assert mean == pytest.approx(1.5)
    assert std == pytest.approx(values.std(ddof=1) / 2, rel=1e-3)
    assert combine(values, np.full(4, np.nan)) == pytest.approx((mean, values.std(ddof=1) / 2))
