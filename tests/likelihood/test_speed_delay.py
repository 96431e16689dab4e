"""Delay of the speed channel: from segments drawn from a model, and of a simulated drive."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import SegmentSpectra, fit_corners
from sprung.likelihood.speed_delay import DELAYS, speed_delay
from sprung.simulation import RoadDrive, simulate_drive

SEGMENT = 5.12


@pytest.fixture
def model_at(car, road_model, classes):
    """Return a function from speeds to the model of a car with one class for each."""

    def model(speeds):
        spectra = replace(classes(3, n_classes=speeds.size), speeds=speeds, spreads=np.full(speeds.size, 0.01))
        return road_model(car, spectra=spectra)

    return model


def drawn(model_at, true_delay, acceleration=0.4, n_segments=30):
    """Segments of a car that speeds up and slows down, with the speeds of a channel for each delay."""
    speeds = 12.0 + 4.0 * np.sin(acceleration * np.arange(n_segments))
    rates = 4.0 * acceleration * np.cos(acceleration * np.arange(n_segments)) / (SEGMENT / 2)
    model = model_at(speeds)
    draws = np.random.default_rng(3).standard_normal((2, n_segments, 96, 3)) / np.sqrt(2)
    values = np.einsum("sfij,sfj->sfi", np.linalg.cholesky(model.matrix(model.start)), draws[0] + 1j * draws[1])
    unknown = np.full(n_segments, np.nan)
    segments = SegmentSpectra(model.spectra.frequencies, values, unknown, np.zeros(n_segments), SEGMENT, 0)
    moving = speeds + (DELAYS[:, None] - true_delay) * rates
    return segments, moving, np.full(moving.shape, 0.01)


@pytest.mark.parametrize("true_delay", [-0.3, 1.0, 2.2])
def test_the_delay_of_drawn_segments_comes_back(model_at, true_delay) -> None:
    segments, speeds, spreads = drawn(model_at, true_delay)
    delay = speed_delay(segments, speeds, spreads, model_at)
    assert delay.value == pytest.approx(true_delay, abs=max(0.05, 4 * delay.std))
    assert delay.std < 0.1


def test_a_speed_in_time_has_no_delay(model_at) -> None:
    segments, speeds, spreads = drawn(model_at, 0.0)
    assert speed_delay(segments, speeds, spreads, model_at).value == 0.0


@pytest.mark.parametrize("true_delay", [-1.2, 4.5])
def test_a_likelihood_that_rises_to_the_end_of_the_delays_says_nothing(model_at, true_delay) -> None:
    """No delay in the range fits: the model is wrong, or the speed is."""
    segments, speeds, spreads = drawn(model_at, true_delay)
    delay = speed_delay(segments, speeds, spreads, model_at)
    assert (delay.value, delay.std) == (0.0, 1.0)


def test_a_steady_speed_says_nothing(model_at) -> None:
    segments, speeds, spreads = drawn(model_at, 1.0, acceleration=0.0)
    delay = speed_delay(segments, speeds, spreads, model_at)
    assert (delay.value, delay.std) == (0.0, 1.0)


@pytest.mark.slow
def test_a_late_and_held_speed_is_corrected(car) -> None:
    """A speed as from GPS, one second late and updated every second: as good as the speed itself."""
    drive = simulate_drive(car, RoadDrive(duration=400.0, snr=50.0), seed=5).recording
    time, row = np.arange(drive.n_samples) / drive.sampling_rate, drive.index("speed")
    samples = drive.samples.copy()
    samples[row] = np.interp(np.floor(time) - 1.0, time, samples[row])
    plain, late = fit_corners(drive, car), fit_corners(replace(drive, samples=samples), car)
    assert plain.speed["speed_delay"]["value"] == 0.0
    assert late.speed["speed_delay"]["value"] == pytest.approx(1.0, abs=0.1)
    assert late.model_error < plain.model_error + 0.02
    assert np.abs((late.log_ratios - plain.log_ratios) / plain.log_ratios_std).max() < 1.0
    assert any("1.0 s late" in note for note in late.notes)
