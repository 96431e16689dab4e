"""Standard deviations with slow variation: coverage on independent and on slowly varying blocks."""

import numpy as np
import pytest

from sprung.identification.correlation import deviation_of_mean

N_BLOCKS, N_RUNS = 48, 2000


def influences_of(values):
    """Influences of blocks on their mean, of which the squares add up to its variance for independent blocks."""
    n_blocks = len(values)
    return (values - values.mean(axis=0)) / n_blocks * np.sqrt(n_blocks / (n_blocks - 1))


def score(values, records=None):
    """Means over their standard deviations; the true mean is 0."""
    return values.mean(axis=0) / deviation_of_mean(influences_of(values), records)


def slow(generator, n_blocks, memory):
    """Unit variation that forgets over `memory` blocks."""
    forgetting = np.exp(-1 / memory)
    values = generator.normal(size=(n_blocks, N_RUNS))
    for k in range(1, n_blocks):
        values[k] = forgetting * values[k - 1] + np.sqrt(1 - forgetting**2) * values[k]
    return values


@pytest.mark.parametrize("n_blocks", [8, 24, 48, 64])
def test_independent_blocks_are_covered(n_blocks) -> None:
    scores = score(np.random.default_rng(1).normal(size=(n_blocks, N_RUNS)))
    assert 0.93 < np.mean(np.abs(scores) < 1.96) < 0.975
    assert 0.85 < np.sqrt(np.mean(scores**2)) < 1.1


def test_slow_variation_is_in_the_deviation() -> None:
    """Blocks alone would give scores of 1.7 and 2.3: most of the variance in excess is in the deviation."""
    generator = np.random.default_rng(2)
    chance = generator.normal(size=(N_BLOCKS, N_RUNS))
    for size, largest in ((0.7, 1.5), (2.0, 1.8)):
        values = chance + size * slow(generator, N_BLOCKS, 3.0)
        alone = values.mean(axis=0) / np.sqrt(np.sum(influences_of(values) ** 2, axis=0))
        assert np.sqrt(np.mean(score(values) ** 2)) < min(largest, 0.85 * np.sqrt(np.mean(alone**2)))


@pytest.mark.parametrize("size", [0.0, 0.5, 2.0])
def test_variation_between_records_is_in_the_deviation(size) -> None:
    generator = np.random.default_rng(3)
    records = np.repeat(np.arange(12), 5)
    values = generator.normal(size=(60, N_RUNS)) + size * generator.normal(size=(12, N_RUNS))[records]
    assert 0.8 < np.sqrt(np.mean(score(values, records) ** 2)) < 1.2


def test_a_drift_over_the_record_widens_the_deviation() -> None:
    """A ramp: the eight parts differ from each other far more than chance."""
    values = np.random.default_rng(4).normal(size=(N_BLOCKS, 50)) + np.linspace(-4, 4, N_BLOCKS)[:, None]
    influences = influences_of(values)
    ratio = deviation_of_mean(influences) / np.sqrt(np.sum(influences**2, axis=0))
    assert np.median(ratio) > 2


def test_every_value_is_on_its_own_and_scales() -> None:
    influences = influences_of(np.random.default_rng(5).normal(size=(N_BLOCKS, 3)))
    together = deviation_of_mean(influences * [1.0, 10.0, 0.1])
    alone = [deviation_of_mean(influences[:, k : k + 1])[0] for k in range(3)]
    np.testing.assert_allclose(together, np.array(alone) * [1.0, 10.0, 0.1], rtol=1e-12)


def test_too_few_blocks_give_no_deviation() -> None:
    assert np.isnan(deviation_of_mean(np.ones((3, 2)))).all()
    assert np.isfinite(deviation_of_mean(influences_of(np.random.default_rng(6).normal(size=(4, 2))))).all()


def test_no_scatter_at_all_is_a_deviation_of_zero() -> None:
    assert deviation_of_mean(np.zeros((N_BLOCKS, 2))).tolist() == [0.0, 0.0]
