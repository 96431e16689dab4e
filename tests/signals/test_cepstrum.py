import numpy as np
import pytest
from scipy import signal

from sprung.errors import DataError, ParameterError
from sprung.excitation import QUARTER_CASES
from sprung.recording import Channel, Gap, Recording
from sprung.signals.harmonics import find_harmonics
from sprung.signals.spectrum import (
    Comb,
    Exponential,
    ShortPass,
    edit,
    spectral_matrix,
    subtract_lifter_damping,
)
from sprung.simulation import simulate
from sprung.vehicles import read_description, structure

RATE = 100.0


def recorded(samples, **fields):
    samples = np.atleast_2d(samples)
    return Recording(samples, RATE, tuple(Channel(f"c{i}") for i in range(len(samples))), **fields)


def noise(n_samples=6000, n_channels=1, seed=1):
    return np.random.default_rng(seed).standard_normal((n_channels, n_samples))


def resonator(frequency, damping_ratio):
    """Denominator of an all-pole filter with one mode, and its continuous pole."""
    pole = 2 * np.pi * frequency * (-damping_ratio + 1j * np.sqrt(1 - damping_ratio**2))
    return np.real(np.poly(np.exp(np.array([pole, pole.conjugate()]) / RATE))), pole


def impulse_response(denominator, n_samples=6000):
    return signal.lfilter([1.0], denominator, np.eye(1, n_samples)[0])


def cepstrum(samples):
    """Real cepstrum IFFT(ln |FFT(x)|) of the centred samples, by complex transforms."""
    spectrum = np.abs(np.fft.fft(samples - samples.mean()))
    spectrum[0] = spectrum[1]
    return np.fft.ifft(np.log(spectrum)).real


def test_an_echo_has_the_rahmonics_of_its_delay_and_a_short_pass_takes_it_out() -> None:
    """ln(1 + a exp(-i w T)) = sum of (-1)^(n+1) a^n / n exp(-i n w T): none below the delay, so |X| becomes 1."""
    x = np.zeros(4000)
    x[0], x[130] = 1.0, 0.6
    for n in (1, 2, 3):
        assert cepstrum(x)[130 * n] == pytest.approx((-1) ** (n + 1) * 0.6**n / (2 * n), abs=1e-3)
    edited = edit(recorded(x), ShortPass(1.2)).samples[0]
    np.testing.assert_allclose(np.abs(np.fft.rfft(edited))[5:], 1.0, atol=0.02)


def test_an_exponential_lifter_moves_a_pole_by_one_over_its_time_constant() -> None:
    denominator, pole = resonator(8.0, 0.02)
    moved, _ = resonator(8.0, 0.02)
    tau = 0.4
    moved = denominator * np.exp(-np.arange(3) / (tau * RATE))
    edited = edit(recorded(impulse_response(denominator)), Exponential(tau)).samples[0]
    _, expected = signal.freqz([1.0], moved, worN=np.arange(5, 2995) / 6000 * RATE, fs=RATE)
    np.testing.assert_allclose(np.abs(np.fft.rfft(edited)[5:2995]), np.abs(expected), rtol=5e-3)
    poles = RATE * np.log(np.roots(moved))
    assert poles[0].real == pytest.approx(pole.real - 1 / tau)
    assert subtract_lifter_damping(poles, tau)[0] == pytest.approx(pole)


def test_the_first_order_formula_of_the_damping_is_that_of_the_poles() -> None:
    omega, xi, tau = 2 * np.pi * 8.0, 0.02, 5.0
    pole = omega * (-xi + 1j * np.sqrt(1 - xi**2))
    true = subtract_lifter_damping(pole, tau)
    assert -true.real / abs(true) == pytest.approx(xi - 1 / (tau * omega), rel=1e-3)


@pytest.mark.parametrize("n_samples", [6000, 6007])
def test_weights_of_one_give_the_recording_without_its_mean(n_samples) -> None:
    x = noise(n_samples, 2) + np.array([[3.0], [-1.0]])
    edited = edit(recorded(x), ShortPass(1e6))
    np.testing.assert_allclose(edited.samples, x - x.mean(axis=1, keepdims=True), atol=1e-10)


def test_a_short_pass_keeps_the_symmetric_half_too() -> None:
    edited = edit(recorded(noise()), ShortPass(0.25)).samples[0]
    after, before = cepstrum(edited), cepstrum(noise()[0])
    np.testing.assert_allclose(after[:25], before[:25], atol=2e-3)
    np.testing.assert_allclose(after[-24:], before[-24:], atol=2e-3)
    assert np.abs(after[25:-24]).max() < 2e-3


def test_a_short_pass_replaces_noise_by_its_geometric_mean() -> None:
    edited = edit(recorded(noise(200_000)), ShortPass(0.1))
    assert edited.samples.std() == pytest.approx(np.exp(-np.euler_gamma / 2), rel=0.01)


def test_stretches_are_edited_by_themselves() -> None:
    x = noise(3000)
    edited = edit(recorded(x, gaps=(Gap(1234, 1.0),)), Exponential(0.3))
    alone = edit(recorded(x[:, 1234:]), Exponential(0.3))
    np.testing.assert_array_equal(edited.samples[:, 1234:], alone.samples)
    assert edited.history == ("cepstrum edited with Exponential(time_constant=0.3)",)


def test_silence_stays_silent_and_gaps_in_a_spectrum_do_no_harm() -> None:
    x = np.vstack([np.zeros(1000), np.full(1000, 2.0), np.sin(2 * np.pi * 0.1 * np.arange(1000))])
    edited = edit(recorded(x), ShortPass(0.25)).samples
    np.testing.assert_array_equal(edited[:2], x[:2])
    assert np.isfinite(edited).all()


def test_editing_does_not_depend_on_scale() -> None:
    x = noise()
    small = edit(recorded(1e-6 * x), ShortPass(0.25)).samples
    np.testing.assert_allclose(small, 1e-6 * edit(recorded(x), ShortPass(0.25)).samples, rtol=1e-9, atol=1e-15)


def test_what_cannot_be_edited_is_refused() -> None:
    with pytest.raises(ParameterError, match="time_constant=0 must be above 0"):
        Exponential(0.0)
    with pytest.raises(ParameterError, match="a notch cannot exceed a period"):
        Comb(1.0, width=2.0)
    with pytest.raises(DataError, match="channel 'c0' has 1 missing values"):
        edit(recorded([0.0, np.nan]), ShortPass(0.25))

    class Wrong:
        def weights(self, quefrency):
            return quefrency[:3]

    with pytest.raises(ParameterError, match="one finite number for each of the 3001 quefrencies"):
        edit(recorded(noise()), Wrong())


def test_a_comb_removes_a_pulse_train_and_keeps_the_noise() -> None:
    t = np.arange(6000)
    pulses = np.where(t % 40 == 0, 8.0, 0.0)
    edited = edit(recorded(noise() + pulses), Comb(0.4)).samples[0]
    spectra = spectral_matrix(recorded([noise()[0] + pulses, edited, noise()[0]]), segment_length=20.0)
    lines = spectra.densities[:, 50:1000:50].mean(axis=1)
    assert lines[0] > 30 * lines[2]
    assert lines[1] < 2 * lines[2]
    assert np.corrcoef(edited, noise()[0])[0, 1] > 0.93


def quarter(case, seed=0):
    vehicle = structure(read_description("quarter"))
    return simulate(vehicle, QUARTER_CASES[case - 1], duration=60.0, sampling_rate=1000.0, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("case", [2, 3, 4])
def test_editing_gives_the_quarter_vehicle_its_undisturbed_spectrum_back(case) -> None:
    clean, edited = quarter(1), edit(quarter(case), ShortPass(0.25))
    assert find_harmonics(edited) == ()
    before, after, disturbed = (
        spectral_matrix(recording, segment_length=2.0).densities for recording in (clean, edited, quarter(case))
    )
    change, disturbance = 10 * np.log10(after / before), 10 * np.log10(disturbed / before)
    levels = change.mean(axis=1, keepdims=True)
    band = slice(4, 200)
    assert np.abs(change - levels)[:, band].max() < 6.0
    assert (change - levels)[:, band].std() < 1.5
    assert disturbance[:, band].max() > 15.0
