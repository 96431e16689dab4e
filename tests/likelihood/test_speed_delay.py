"""Speed by the delay between the axles: where it was not recorded, and where its channel is late."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.likelihood import SegmentSpectra, fit_corners
from sprung.likelihood.speed_delay import (
    DELAYS,
    _smoothed,
    log_likelihoods,
    speed_delay,
    speed_grid,
    with_estimated_speeds,
)
from sprung.simulation import RoadDrive, simulate_drive

SEGMENT = 5.12


@pytest.fixture
def model_at(car, road_model, classes):
    """Return a function from speeds to the model of a car with one class for each."""

    def model(speeds):
        spectra = replace(classes(3, n_classes=speeds.size), speeds=speeds, spreads=np.full(speeds.size, 0.01))
        return road_model(car, spectra=spectra)

    return model


def segments_of(model, values):
    n = len(values)
    return SegmentSpectra(model.spectra.frequencies, values, np.full(n, np.nan), np.zeros(n), SEGMENT, 3)


def drawn_at_start(model, seed):
    """One segment of each class of a model."""
    n, shape = model.spectra.speeds.size, (96, 3)
    draws = np.random.default_rng(seed).standard_normal((2, n, *shape)) / np.sqrt(2)
    return np.einsum("sfij,sfj->sfi", np.linalg.cholesky(model.matrix(model.start)), draws[0] + 1j * draws[1])


def drawn(model_at, true_delay, acceleration=0.4, n_segments=30):
    """Segments of a car that speeds up and slows down, with the speeds of a channel for each delay."""
    speeds = 12.0 + 4.0 * np.sin(acceleration * np.arange(n_segments))
    rates = 4.0 * acceleration * np.cos(acceleration * np.arange(n_segments)) / (SEGMENT / 2)
    model = model_at(speeds)
    segments = segments_of(model, drawn_at_start(model, 3))
    moving = speeds + (DELAYS[:, None] - true_delay) * rates
    return segments, moving, np.full(moving.shape, 0.01)


@pytest.mark.parametrize("true_delay", [-0.3, 0.0, 1.0, 2.2])
def test_the_delay_of_drawn_segments_comes_back(model_at, true_delay) -> None:
    segments, speeds, spreads = drawn(model_at, true_delay)
    delay = speed_delay(segments, speeds, spreads, model_at)
    assert delay.value == pytest.approx(true_delay, abs=max(0.05, 4 * delay.std) if true_delay else 0.0)
    assert delay.std < 0.1


def test_no_frequency_counts_beyond_fifty_times_the_median() -> None:
    """Segments of plain noise, with a line, and with nothing but a few lines."""
    values = np.random.default_rng(1).standard_normal((3, 40, 2)).astype(np.complex128)
    values[1:, 7] *= 100
    values[2, 8:] *= 1e-3
    power = np.mean(np.abs(values) ** 2, axis=2)
    level = np.minimum(power, 50 * np.median(power, axis=1, keepdims=True)).mean(axis=1)
    assert np.sum(level < 0.9 * power.mean(axis=1)) == 2
    unit = np.broadcast_to(np.eye(2, dtype=np.complex128), (1, 40, 2, 2))
    assert log_likelihoods(values, unit)[:, 0] == pytest.approx(-80 * np.log(level), rel=1e-12)


@pytest.mark.parametrize("true_delay", [0.0, 1.0])
def test_lines_of_an_uneven_wheel_do_not_move_the_delay(model_at, true_delay) -> None:
    """Two periods of turns of 1.9 m in phase in bounce, pitch and roll, ten times the RMS of each, in three bins."""
    segments, speeds, spreads = drawn(model_at, true_delay)
    turns = 1.9 / np.array([np.interp(true_delay, DELAYS, own) for own in speeds.T])[:, None] * segments.frequencies
    is_line = (np.abs(turns - np.rint(turns)) < 1.5 / SEGMENT * turns / segments.frequencies) & (turns < 2.5)
    lines = 10 * np.sqrt(np.mean(np.abs(segments.values) ** 2, axis=(0, 1))) * is_line[..., None]
    uneven = replace(segments, values=segments.values + lines)
    delay = speed_delay(uneven, speeds, spreads, model_at)
    assert delay.value == pytest.approx(true_delay, abs=0.1 if true_delay else 0.0)
    assert delay.std < 0.1


@pytest.mark.parametrize(("true_delay", "acceleration"), [(-1.2, 0.4), (4.5, 0.4), (1.0, 0.0)])
def test_delays_beyond_the_range_and_a_steady_speed_say_nothing(model_at, true_delay, acceleration) -> None:
    segments, speeds, spreads = drawn(model_at, true_delay, acceleration)
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


def test_the_grid_rises_by_two_per_cent_between_its_ends() -> None:
    grid = speed_grid()
    assert grid[0] == 3.0
    assert 45.0 / 1.02 < grid[-1] <= 45.0
    assert grid[1:] / grid[:-1] == pytest.approx(np.full(grid.size - 1, 1.02))


@pytest.mark.parametrize("scale", [1.0, 400.0])
def test_smoothed_speeds_are_the_sum_over_all_ways_through_the_grid(scale) -> None:
    """Also where single segments exclude the speeds of their neighbours by hundreds of nepers."""
    evidence, places = scale * np.random.default_rng(4).standard_normal((4, 5)), np.log(1.02) * np.arange(5)
    moves = np.exp(-0.5 * (np.subtract.outer(places, places) / 0.08) ** 2)
    moves = np.log(moves / moves.sum(axis=1, keepdims=True))
    ways = np.array(list(product(range(5), repeat=4)))
    logs = evidence[np.arange(4), ways].sum(axis=1) + moves[ways[:, :-1], ways[:, 1:]].sum(axis=1)
    weights = np.exp(logs - logs.max())
    expected = [[weights[ways[:, segment] == place].sum() for place in range(5)] for segment in range(4)]
    assert _smoothed(evidence, places) == pytest.approx(np.array(expected) / weights.sum(), abs=1e-12)


def test_speeds_of_segments_drawn_from_the_model_come_back(model_at) -> None:
    """An acceleration from 6 to 22 m/s in 40 segments of any roughness."""
    speeds = np.geomspace(6.0, 22.0, 40)
    model = model_at(speeds)
    levels = np.exp(np.random.default_rng(2).standard_normal(40))[:, None, None]
    values = levels * drawn_at_start(model, 1)
    segments = with_estimated_speeds(segments_of(model, values), model_at)
    assert segments.speeds.size >= 36
    assert segments.n_rejected == 3 + 40 - segments.speeds.size
    places = [int(np.argmin(np.abs(values - kept).sum(axis=(1, 2)))) for kept in segments.values]
    errors = np.log(segments.speeds / speeds[places])
    assert np.abs(errors).max() < 0.06
    assert np.abs(errors.mean()) < 0.01
    assert np.abs(errors / segments.spreads).mean() < 1.5


def test_speeds_beyond_the_grid_are_not_estimated(model_at) -> None:
    """At 80 m/s the posterior lies at the end of the grid, 45 m/s."""
    model = model_at(np.full(20, 80.0))
    segments = segments_of(model, drawn_at_start(model, 1))
    with pytest.raises(DataError, match=r"gives the speed of only \d+ of 20 segments: add the speed"):
        with_estimated_speeds(segments, model_at)


@pytest.mark.parametrize("slope", [0.0, 2.0, 4.0])
def test_noise_has_no_speed(model_at, slope) -> None:
    """Channels that are independent of each other, of any colour: no delay between the axles."""
    model = model_at(speed_grid())
    draws = np.random.default_rng(1).standard_normal((2, 20, 96, 3)) / np.sqrt(2)
    colour = (model.spectra.frequencies / 5.0) ** (-slope / 2)
    segments = segments_of(model, colour[:, None] * (draws[0] + 1j * draws[1]))
    with pytest.raises(DataError, match=r"gives the speed of only [01] of 20 segments"):
        with_estimated_speeds(segments, model_at)
