import numpy as np
import pytest
import scipy.signal

from sprung.errors import ParameterError
from sprung.excitation import BAND_ORDER, QUARTER_CASES, BaseMotion, RandomInputs, noise, pulse_indices


def generator(seed=0):
    return np.random.default_rng(seed)


def test_white_noise_is_white():
    samples = noise((2, 200_000), band=None, sampling_rate=100.0, generator=generator())
    assert samples.std(axis=1) == pytest.approx([1.0, 1.0], rel=0.01)
    lagged = [np.mean(samples[0, lag:] * samples[0, : 200_000 - lag]) for lag in range(1, 6)]
    assert np.abs(lagged).max() < 4 / np.sqrt(200_000)
    assert abs(np.mean(samples[0] * samples[1])) < 4 / np.sqrt(200_000)


@pytest.mark.parametrize("band", [(0.5, 50.0), (0.0, 20.0), (100.0, 250.0), (40.0, 60.0)])
def test_band_limited_noise_has_the_butterworth_spectrum(band):
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


def test_band_limited_noise_is_stationary_from_the_first_sample():
    samples = noise((4000, 3), band=(1.0, 10.0), sampling_rate=100.0, generator=generator())
    assert samples.std(axis=0) == pytest.approx(np.ones(3), rel=0.05)


def test_band_of_everything_is_white():
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
def test_impossible_bands_are_refused(band, message):
    with pytest.raises(ParameterError, match=message):
        noise((5,), band=band, sampling_rate=100.0, generator=generator())


def test_random_inputs_scale_and_repeat():
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


def test_base_motion_is_the_printed_sum():
    """Eqs 5-5 to 5-8, written out sample by sample."""
    motion = BaseMotion(random=0.0, harmonic=0.5, frequencies=(3.65, 17.0), phases=(0.3, -1.0), pulse=7.0)
    found = motion.samples(2000, sampling_rate=1000.0, generator=generator())[0]
    for sample in range(2000):
        t = sample / 1000.0
        expected = 0.5 * (np.sin(2 * np.pi * 3.65 * t + 0.3) + np.sin(2 * np.pi * 17.0 * t - 1.0))
        nearest = round(t * 3.65) / 3.65
        expected += 7.0 * (round(nearest * 1000) == sample)
        assert found[sample] == pytest.approx(expected, abs=1e-12)


def test_base_motion_continues_from_any_start():
    motion = QUARTER_CASES[3]
    settings = {"sampling_rate": 1000.0}
    quiet = BaseMotion(0.0, motion.harmonic, motion.frequencies, motion.phases, motion.pulse, motion.pulse_frequency)
    whole = quiet.samples(3000, generator=generator(), start=-1.0, **settings)
    later = quiet.samples(2000, generator=generator(), start=0.0, **settings)
    np.testing.assert_array_equal(whole[:, 1000:], later)
    assert later[0, 0] == pytest.approx(1e-4 * (np.sin(np.pi / 3) + np.sin(np.pi / 4)) + 5e-3)


def test_pulses_fall_on_the_nearest_samples():
    assert pulse_indices(1000, 3.65 / 1000.0).tolist() == [0, 274, 548, 822]
    assert pulse_indices(10, 0.25, first=-6).tolist() == [2, 6]
    assert len(pulse_indices(60_000, 3.65 / 1000.0)) == 219
    assert pulse_indices(0, 0.1).tolist() == []


def test_quarter_cases_are_those_of_the_thesis():
    assert [case.pulse for case in QUARTER_CASES] == [0.0, 5e-3, 5e-3, 5e-3]
    assert [len(case.frequencies) for case in QUARTER_CASES] == [0, 0, 1, 2]
    assert {case.random for case in QUARTER_CASES} == {1e-4}


def test_contradicting_base_motion_is_refused():
    with pytest.raises(ParameterError, match="2 frequencies have 1 phases: give one phase for each"):
        BaseMotion(frequencies=(1.0, 2.0), phases=(0.0,))
    with pytest.raises(ParameterError, match="pulse_frequency=0 must be above 0"):
        BaseMotion(pulse_frequency=0.0)
    with pytest.raises(ParameterError, match="random=-1 must be at least 0"):
        BaseMotion(random=-1.0)
