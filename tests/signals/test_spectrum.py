import numpy as np
import pytest
from scipy import signal

from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Gap, Recording
from sprung.signals.spectrum import singular_values, spectral_matrix


def noise(n_channels=3, n_samples=5000, seed=1, **fields):
    samples = np.random.default_rng(seed).standard_normal((n_channels, n_samples))
    samples[1] += np.roll(samples[0], 3)
    channels = tuple(Channel(f"c{i}") for i in range(n_channels))
    return Recording(samples, 100.0, channels, **fields)


@pytest.mark.parametrize("n_per_segment", [256, 255])
def test_densities_are_those_of_scipy(n_per_segment) -> None:
    recording = noise()
    spectra = spectral_matrix(recording, segment_length=n_per_segment / 100)
    settings = {"fs": 100.0, "nperseg": n_per_segment, "noverlap": n_per_segment - round(n_per_segment / 2)}
    for p in range(3):
        for q in range(3):
            frequencies, expected = signal.csd(recording.samples[q], recording.samples[p], **settings)
            np.testing.assert_allclose(spectra.matrix[p, q], expected, atol=1e-12)
    np.testing.assert_allclose(spectra.frequencies, frequencies)


def test_phase_says_which_channel_comes_later() -> None:
    spectra = spectral_matrix(noise(n_samples=200_000), segment_length=2.56)
    k = 20
    delayed = np.angle(spectra.matrix[1, 0, k])
    assert delayed == pytest.approx(-2 * np.pi * spectra.frequencies[k] * 0.03, abs=0.1)


def test_no_segment_spans_a_gap_and_records_add_up() -> None:
    recording = noise(n_samples=3000, gaps=(Gap(700, 1.0), Gap(1999, 2.0)))
    parts = [Recording(recording.samples[:, stretch], 100.0, recording.channels) for stretch in recording.stretches()]
    whole = spectral_matrix(recording, segment_length=1.5)
    first, second, third = (spectral_matrix(part, segment_length=1.5) for part in parts)
    total = third + (first + second)
    assert total.n_segments == whole.n_segments
    np.testing.assert_allclose(total.matrix, whole.matrix, atol=1e-14)


def test_singular_values_count_the_sources() -> None:
    source = np.random.default_rng(3).standard_normal((1, 20_000))
    recording = Recording(np.array([[1.0], [-2.0], [0.5]]) @ source, 100.0, tuple(Channel(c) for c in "abc"))
    spectra = spectral_matrix(recording, segment_length=1.0)
    values = singular_values(spectra)
    assert values.shape == (3, 51)
    np.testing.assert_allclose(values[0], spectra.densities.sum(axis=0))
    assert values[1:].max() < 1e-12 * values[0].max()


def test_what_cannot_be_averaged_is_refused() -> None:
    recording = noise(n_samples=500)
    with pytest.raises(DataError, match="use at most 5 s"):
        spectral_matrix(recording, segment_length=6.0)
    with pytest.raises(ParameterError, match=r"at least 4 samples: use 0\.04 s or more"):
        spectral_matrix(recording, segment_length=0.01)
    with pytest.raises(ParameterError, match="must agree"):
        spectral_matrix(recording, segment_length=1.0) + spectral_matrix(recording, segment_length=2.0)
