import numpy as np
import pytest

from sprung.excitation import HammerBlows
from sprung.excitation.noise import corner_weights

RATE = 1000.0


def drawn(excitation, n_samples=20_000, seed=1, start=0.0):
    return excitation.samples(n_samples, sampling_rate=RATE, generator=np.random.default_rng(seed), start=start)


def test_corner_weights_keep_force_and_moments() -> None:
    x, y = np.array([2.0, 2.0, -3.0, -3.0]), np.array([1.0, -1.0, 1.0, -1.0])
    for forward, left in np.random.default_rng(1).uniform(size=(20, 2)):
        weights = corner_weights(forward, left)
        assert [weights.sum(), weights @ x, weights @ y] == pytest.approx([1, -3 + 5 * forward, -1 + 2 * left])


def test_blows_have_their_rate_strength_and_impulse() -> None:
    blows = HammerBlows(rate=2.0, strength=(5.0, 5.0), duration=0.02)
    force = drawn(blows, n_samples=500_000).sum(axis=0)
    impulse = 5.0 * 2 / np.pi * 0.02  # integral of a half sine
    assert -force.sum() / RATE / impulse == pytest.approx(1000, abs=130)  # 500 s, two a second
    assert force.min() < -4.9
    assert force.max() <= 0
