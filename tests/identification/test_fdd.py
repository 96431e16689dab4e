"""Frequency domain decomposition: exact spectra, chance, and bells through a window."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from sprung.errors import ParameterError
from sprung.identification import enhanced_fdd
from sprung.identification.fdd import bells_at, find_bells, modes_of_bells
from sprung.modal import mac
from sprung.recording import Channel, Recording
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain, exact_correlations

CHAIN = chain()
TRUTH = CHAIN.modes()


def through_window(correlations, rate, n_segments=10_000):
    """Expected spectral matrix of Hann-windowed segments as long as the correlations (channels, channels, lags)."""
    n = correlations.shape[-1]
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    overlap = np.correlate(window, window, "full")[n - 1 :] / np.sum(window**2)
    half = np.fft.fft(correlations * overlap)[..., : n // 2 + 1]
    matrix = 2 / rate * (half + half.conj().transpose(1, 0, 2) - correlations[:, :, :1])
    names = tuple(f"c{k}" for k in range(len(correlations)))
    return SpectralMatrix(np.arange(n // 2 + 1) * rate / n, matrix, names, n / rate, n_segments)


def oscillator(frequency, damping, *, n_derivatives, rate=200.0, duration=8.0, floor=1e-3):
    """Expected spectra of one oscillator at two channels, from the closed form on a hundred times finer lines."""
    fine = np.arange(int(duration * rate) * 50 + 1) / (100 * duration)
    ratio = fine / frequency
    density = (
        4 * damping**2 * ratio ** (2 * n_derivatives) / ((1 - ratio**2) ** 2 + (2 * damping * ratio) ** 2) + floor / 2
    )
    correlations = np.fft.irfft(density)[: int(duration * rate)]
    shape = np.array([1.0, -0.5])
    return through_window(np.multiply.outer(np.outer(shape, shape), correlations), rate)


@pytest.mark.parametrize("n_derivatives", [0, 1, 2])
@pytest.mark.parametrize(("frequency", "damping"), [(7.0, 0.002), (7.0, 0.01), (12.3, 0.05), (20.0, 0.2)])
def test_the_expected_spectrum_of_an_oscillator_gives_its_values(frequency, damping, n_derivatives) -> None:
    """Also where the bell is a fifth as wide as the resolution (0.2 %: 0.03 Hz at 0.19 Hz).

    The model's correlation is sampled, so that the wide tails of a mode damped by 20 % fold back: to 1 and 8 %.
    """
    quantity = ("displacement", "velocity", "acceleration")[n_derivatives]
    spectra = oscillator(frequency, damping, n_derivatives=n_derivatives)
    bells = bells_at(spectra, [frequency])
    modes = modes_of_bells(bells, spectra, channels=[Channel("a", quantity), Channel("b", quantity)])
    assert modes.natural_frequency == pytest.approx([frequency], rel=0.01 if damping > 0.1 else 5e-4)
    assert modes.damping_ratio == pytest.approx([damping], rel=0.08 if damping > 0.1 else 0.02)
    assert modes.mode_shapes[0] == pytest.approx([1, -0.5], abs=1e-6)
    assert np.isnan(modes.stable_rate).all()


def test_exact_spectra_of_the_chain_give_its_modes() -> None:
    """The foot of a bell belongs to other modes in part: damping is up to 4 % low, frequencies exact to 1e-4."""
    correlations = exact_correlations(CHAIN.discretised(1000.0), n_lags=8000)
    spectra = through_window(correlations, 1000.0)
    bells = find_bells(spectra, band=(1.0, 50.0))
    modes = modes_of_bells(bells, spectra, channels=[Channel(name, "acceleration") for name in spectra.names])
    np.testing.assert_allclose(modes.natural_frequency, TRUTH.natural_frequency, rtol=2e-4)
    np.testing.assert_allclose(modes.damping_ratio, TRUTH.damping_ratio, rtol=0.05)
    assert np.diag(mac(modes.mode_shapes, TRUTH.mode_shapes)).min() > 0.999


def test_the_quantity_of_unknown_channels_is_the_most_likely_one() -> None:
    spectra = oscillator(20.0, 0.2, n_derivatives=0)
    modes = modes_of_bells(bells_at(spectra, [19.0]), spectra, channels=[Channel("a"), Channel("b")])
    assert modes.natural_frequency == pytest.approx([20.0], rel=1e-3)
    assert modes.damping_ratio == pytest.approx([0.2], rel=0.02)


@pytest.mark.slow
def test_white_noise_has_a_peak_above_chance_in_one_spectrum_of_a_thousand() -> None:
    """At most 2 in 200 by the binomial law, at 1e-3 for each of two averages."""
    generator = np.random.default_rng(5)
    channels = tuple(Channel(f"a{k}") for k in range(3))
    peaks = [
        len(
            find_bells(
                spectral_matrix(Recording(generator.normal(size=(3, 4000)), 100.0, channels), segment_length=5.0),
                band=(0.0, 50.0),
            ).peaks
        )
        for _ in range(200)
    ]
    assert np.count_nonzero(peaks) <= 3


@pytest.mark.parametrize("snr", [10.0, 0.5])
def test_one_record_of_the_chain_gives_exactly_its_three_modes(snr) -> None:
    run = simulate(CHAIN, usual_excitation(CHAIN), duration=60.0, sampling_rate=500.0, snr=snr, seed=1)
    result = enhanced_fdd(run)
    assert result.method == "fdd"
    assert len(result.modes) == 3
    deviation = np.abs(result.modes.natural_frequency - TRUTH.natural_frequency) / result.modes.natural_frequency_std
    assert deviation.max() < 3
    deviation = np.abs(result.modes.damping_ratio - TRUTH.damping_ratio) / result.modes.damping_ratio_std
    assert deviation.max() < 3
    assert result.subsets[0].diagrams == ()
    assert result.spectra.n_segments in (14, 15)


def test_a_frequency_without_a_maximum_is_refused() -> None:
    spectra = oscillator(7.0, 0.01, n_derivatives=2)
    with pytest.raises(ParameterError) as refusal:
        bells_at(spectra, [30.0])
    assert str(refusal.value) == (
        "no clear maximum of the first singular value near 30 Hz: the nearest are at 7 Hz, pick one of those"
    )


def test_a_mode_beside_a_stronger_one_peaks_in_the_second_singular_value() -> None:
    """Two modes of other shapes, one of a hundredth of the power on the slope of the other."""
    strong = oscillator(7.0, 0.01, n_derivatives=2)
    weak = oscillator(7.6, 0.01, n_derivatives=2)
    shape = np.array([0.5, 1.0])
    density = weak.matrix[0, 0] * np.outer(shape, shape)[:, :, None]
    spectra = replace(strong, matrix=strong.matrix + 0.01 * density, n_segments=20)
    bells = find_bells(spectra, band=(1.0, 50.0))
    modes = modes_of_bells(bells, spectra, channels=[Channel(name, "acceleration") for name in spectra.names])
    assert modes.natural_frequency == pytest.approx([7.0, 7.6], rel=1e-3)
    assert modes.damping_ratio == pytest.approx([0.01, 0.01], rel=0.01)
    np.testing.assert_allclose(modes.mode_shapes, [[1, -0.5], [0.5, 1]], atol=0.01)


def test_a_peak_at_the_end_of_the_band_is_as_high_as_it_is_beyond() -> None:
    spectra = replace(oscillator(20.0, 0.01, n_derivatives=2), n_segments=20)
    assert spectra.frequencies[find_bells(spectra, band=(1.0, 20.1)).peaks] == pytest.approx([20.0])


@pytest.mark.slow
def test_peaks_of_light_damping_are_as_certain_as_two_minutes_allow() -> None:
    """Damping of 0.2 % leaves frequencies 0.3 to 0.9 half-bandwidths uncertain: 12 of 30 such peaks were left out."""
    frequencies, rate, n_samples, shown = np.array([3.5, 5.9, 8.4]), 50.0, 6_000, 0
    roots = np.exp(2 * np.pi * frequencies / rate * (1j - 0.002))
    for seed in range(10):
        generator = np.random.default_rng([2, seed])
        forces = generator.standard_normal((3, n_samples + 20_000))
        modal = [signal.lfilter([1], np.poly([p, p.conj()]).real, row) for p, row in zip(roots, forces, strict=True)]
        motion = np.array(modal)[:, 20_000:]
        samples = generator.standard_normal((5, 3)) @ (motion / motion.std(axis=1, keepdims=True))
        samples += 0.1 * generator.standard_normal(samples.shape)
        channels = tuple(Channel(f"a{k}", "acceleration") for k in range(5))
        found = enhanced_fdd(Recording(samples, rate, channels)).modes.natural_frequency
        distance = np.abs(found[:, None] / frequencies - 1)
        assert (distance.min(axis=1) < 0.01).all()
        shown += int((distance.min(axis=0) < 0.01).sum())
    assert shown >= 29


def test_a_pair_two_lines_apart_of_different_shapes_is_found() -> None:
    """As of a steel frame that bends in two directions: the weaker peak is in the second singular value alone."""
    rate, n, shapes, n_pairs = 40.0, 4800, np.array([(1.0, 0.2, -0.5), (-0.1, 1.0, 0.4)]), 0
    for seed in range(6):
        generator, samples = np.random.default_rng(seed), np.zeros((3, n))
        for frequency, scale, shape in zip((5.0, 5.15), (1.0, 0.8), shapes, strict=True):
            root = np.exp(2 * np.pi * frequency / rate * (-0.004 + 1j))
            mode = signal.lfilter([1.0], np.poly([root, root.conj()]).real, generator.standard_normal(n + 4000))[4000:]
            samples += scale * np.outer(shape, mode / mode.std())
        samples += 0.05 * generator.standard_normal(samples.shape)
        modes = enhanced_fdd(Recording(samples, rate, tuple(Channel(f"a{k}", "acceleration") for k in range(3)))).modes
        assert modes.natural_frequency == pytest.approx([5.0, 5.15][: len(modes)], rel=0.006)
        assert np.all(mac(modes.mode_shapes, shapes[: len(modes)].astype(complex)).diagonal() > 0.9)
        n_pairs += len(modes) == 2
    assert n_pairs >= 5
