import numpy as np
import pytest
import scipy.signal

from sprung.errors import ParameterError
from sprung.excitation import BAND_ORDER, RandomInputs, noise


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


@pytest.mark.parametrize(
    ("band", "message"),
    [
        ((60.0, 70.0), "band 60 to 70 Hz lies above half the sampling rate 100 Hz: lower it"),
        ((20.0, 10.0), "upper edge of the band=10 must be above 20"),
        ((-1.0, 10.0), "lower edge of the band=-1 must be at least 0"),
        ((1e-9, 10.0), "lower edge of the band=1e-09 must be at least 0.0001: use 0"),
        ((0.0, np.nan), "upper edge of the band=nan must be finite and above"),
    ],
)
def test_impossible_bands_are_refused(band, message) -> None:
    with pytest.raises(ParameterError, match=message):
        noise((5,), band=band, sampling_rate=100.0, generator=generator())


def test_random_inputs_scale_and_repeat() -> None:
    inputs = RandomInputs(3, standard_deviation=2.5)
    first, again = (inputs.samples(50_000, sampling_rate=100.0, generator=generator(7)) for _ in range(2))
    assert first.shape == (3, 50_000)
    assert first.std(axis=1) == pytest.approx([2.5] * 3, rel=0.02)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, inputs.samples(50_000, sampling_rate=100.0, generator=generator(8)))
    with pytest.raises(ParameterError, match="n_inputs=0 must be at least 1"):
        RandomInputs(0)
    with pytest.raises(ParameterError, match="standard_deviation=0 must be above 0"):
        RandomInputs(1, standard_deviation=0.0)
