import numpy as np
import pytest
import scipy.signal

from sprung.excitation import BAND_ORDER, HammerBlows, noise
from sprung.excitation.noise import corner_weights


def generator(seed=0):
    return np.random.default_rng(seed)


def test_white_noise_is_white() -> None:
    samples = noise((2, 200_000), band=None, sampling_rate=100.0, generator=generator())
    assert samples.std(axis=1) == pytest.approx([1.0, 1.0], rel=0.01)
    lagged = [np.mean(samples[0, lag:] * samples[0, : 200_000 - lag]) for lag in range(1, 6)]
    assert np.abs(lagged).max() < 4 / np.sqrt(200_000)
    assert abs(np.mean(samples[0] * samples[1])) < 4 / np.sqrt(200_000)


@pytest.mark.parametrize("band", [(0.5, 50.0), (0.0, 20.0), (100.0, 250.0), (40.0, 60.0)])
def test_band_limited_noise_has_the_butterworth_spectrum(band) -> None:
    """Welch spectrum against 1 / (1 + (w/wc)^(2 n)) at each edge, warped by the bilinear transform."""
    rate = 500.0
    samples = noise((40, 20_000), band=band, sampling_rate=rate, generator=generator())
    assert samples.std() == pytest.approx(1.0, rel=0.02)
    frequency, density = scipy.signal.welch(samples, rate, nperseg=4000)
    warped = np.tan(np.pi * frequency[1:-1] / rate)
    expected = np.ones_like(warped)
    if band[0] > 0:
        expected /= 1 + (np.tan(np.pi * band[0] / rate) / warped) ** (2 * BAND_ORDER)
    if band[1] < rate / 2:
        expected /= 1 + (warped / np.tan(np.pi * band[1] / rate)) ** (2 * BAND_ORDER)
    expected /= np.sum(expected) * frequency[1]
    strong = (expected > 0.01 * expected.max()) & (frequency[1:-1] > 0.4)
    assert density.mean(axis=0)[1:-1][strong] == pytest.approx(expected[strong], rel=0.25)
    assert np.mean(density.mean(axis=0)[1:-1][strong] / expected[strong]) == pytest.approx(1.0, abs=0.02)


def test_band_limited_noise_is_stationary_from_the_first_sample() -> None:
    samples = noise((4000, 3), band=(1.0, 10.0), sampling_rate=100.0, generator=generator())
    assert samples.std(axis=0) == pytest.approx(np.ones(3), rel=0.05)


def test_band_of_everything_is_white() -> None:
    everything = noise((5,), band=(0.0, 50.0), sampling_rate=100.0, generator=generator())
    np.testing.assert_array_equal(everything, noise((5,), band=None, sampling_rate=100.0, generator=generator()))


def test_corner_weights_keep_force_and_moments() -> None:
    x, y = np.array([2.0, 2.0, -3.0, -3.0]), np.array([1.0, -1.0, 1.0, -1.0])
    for forward, left in np.random.default_rng(1).uniform(size=(20, 2)):
        weights = corner_weights(forward, left)
        assert [weights.sum(), weights @ x, weights @ y] == pytest.approx([1, -3 + 5 * forward, -1 + 2 * left])


def test_blows_have_their_rate_strength_and_impulse(drawn) -> None:
    blows = HammerBlows(rate=2.0, strength=(5.0, 5.0), duration=0.02)
    force = drawn(blows, n_samples=500_000).sum(axis=0)
    impulse = 5.0 * 2 / np.pi * 0.02  # integral of a half sine
    assert -force.sum() / 1000.0 / impulse == pytest.approx(1000, abs=130)  # 500 s, two a second
    assert force.min() < -4.9
    assert force.max() <= 0
