"""Spectral matrices of segments of similar speed, and the window that they are seen through."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.likelihood import class_spectra, rigid_layout, segment_spectra
from sprung.likelihood.spectra import between_updates, onto_grid, segment_speeds, speed_classes, through_window
from sprung.recording import Channel, Gap, Recording
from sprung.vehicles import structure

RATE, BAND = 50.0, (0.5, 20.0)


@pytest.fixture
def layout(car):
    return rigid_layout(structure(car))


def recorded(layout, samples, speed):
    channels = (*(Channel(name, "acceleration") for name in layout.names), Channel("speed", "speed"))
    return Recording(np.vstack([samples, np.broadcast_to(speed, samples.shape[1])]), RATE, channels)


def white(layout, *, seconds=600.0, seed=1):
    return np.random.default_rng(seed).standard_normal((len(layout.names), int(seconds * RATE)))


def test_window_and_its_adjoint() -> None:
    generator = np.random.default_rng(1)
    x = generator.standard_normal((2, 12, 3, 3)).astype(complex)
    y = generator.standard_normal((2, 10, 3, 3)).astype(complex)
    assert np.vdot(y, through_window(x)) == pytest.approx(np.vdot(onto_grid(y), x))
    assert through_window(np.ones((1, 5, 1, 1), dtype=complex)) == pytest.approx(1)


def test_white_noise_has_its_one_sided_density_in_the_coordinates(layout) -> None:
    """Variance 1 at 50 Hz is 1 / 25 per Hz; 233 segments and 100 lines leave a chance of 1 %."""
    run = recorded(layout, white(layout), 12.0)
    segments = segment_spectra([run], layout, speed="speed", band=BAND)
    assert segments.values.shape[0] == 1 + (30_000 - 256) // 128  # half-overlapping segments of 256 samples
    assert segments.frequencies[[0, 1]] == pytest.approx([3 / 5.12, 4 / 5.12])
    spectra = class_spectra(segments)
    expected = layout.reduction @ layout.reduction.T / 25.0
    assert spectra.matrices.mean(axis=(0, 1)) == pytest.approx(expected, abs=0.03 * np.abs(expected).max())
    assert spectra.n_segments == segments.values.shape[0]


def test_slow_and_unsteady_segments_are_left_out(layout) -> None:
    """The first half stands, the second drives at 12 m/s."""
    speed = np.where(np.arange(30_000) < 15_000, 1.0, 12.0)
    segments = segment_spectra([recorded(layout, white(layout), speed)], layout, speed="speed", band=BAND)
    assert segments.speeds == pytest.approx(np.full(segments.speeds.size, 12.0), abs=0.01)
    total = segment_spectra([recorded(layout, white(layout), 12.0)], layout, speed="speed", band=BAND).speeds.size
    assert segments.n_rejected == total - segments.speeds.size
    with pytest.raises(DataError, match="is faster than 3 m/s at a speed within 12 %"):
        segment_spectra([recorded(layout, white(layout), 1.0)], layout, speed="speed", band=BAND)


def test_no_segment_spans_a_gap(layout) -> None:
    """Two stretches of 4 s each are both shorter than a segment."""
    run = replace(recorded(layout, white(layout, seconds=8.0), 12.0), gaps=(Gap(200, 1.0),))
    with pytest.raises(DataError, match=r"no stretch without a gap is as long as a segment of 5\.12 s"):
        segment_spectra([run], layout, speed="speed", band=BAND)


def test_speeds_within_a_class_differ_by_its_width_at_most() -> None:
    speeds = np.array([10.0, 20.0, 10.1, 5.0, np.nan])
    numbers = speed_classes(speeds[:4])
    assert numbers.tolist() == [1, 2, 1, 0]
    assert speed_classes(np.full(3, np.nan)).tolist() == [0, 0, 0]
    every = np.geomspace(3, 45, 500)
    numbers = speed_classes(every, width=0.05)
    assert max(np.ptp(np.log(every[numbers == k])) for k in range(numbers.max() + 1)) <= np.log(1.05)


def test_a_class_has_the_mean_of_its_segments_and_their_scatter(layout) -> None:
    """Two segments of 10.0 and 10.2 m/s without spreads of their own: mean 10.1, scatter 0.1 / 10.1."""
    run = recorded(layout, white(layout, seconds=7.68), 10.0)
    segments = segment_spectra([run], layout, speed="speed", band=BAND)
    pair = replace(segments, speeds=np.array([10.0, 10.2]), spreads=np.zeros(2))
    spectra = class_spectra(pair)
    assert spectra.speeds == pytest.approx([10.1])
    assert spectra.spreads == pytest.approx([0.1 / 10.1])
    first, second = (np.einsum("fi,fj->fij", values, values.conj()) for values in pair.values)
    np.testing.assert_allclose(spectra.matrices[0], (first + second) / 2, rtol=1e-12)


def held(values, period):
    """Values of which every `period`-th is held."""
    return values[np.arange(values.size) // period * period]


def test_a_slowly_updated_speed_is_interpolated() -> None:
    """Updates once a second at 50 Hz: the straight lines between them come back, a steady stretch included."""
    seconds = np.array([10, 11, 13, 14, 14, 14, 14, 12, 11, 9, 8, 8, 9, 12, 13, 15, 16], dtype=float)
    lines = np.interp(np.arange(800) / 50, np.arange(17), seconds)
    assert between_updates(held(lines, 50), 50.0)[: 14 * 50] == pytest.approx(lines[: 14 * 50])


def test_a_speed_in_whole_steps_is_left_as_it_is() -> None:
    time = np.arange(3000) / 50
    rounded = np.round(12 + 4 * np.sin(0.4 * time) + 0.1 * time)
    assert between_updates(rounded, 50.0) is rounded
    smooth = 12 + 4 * np.sin(0.4 * time)
    assert between_updates(smooth, 50.0) is smooth


def test_a_late_speed_is_read_ahead() -> None:
    """10 m/s and 0.5 m/s more every second: segments of 4 s have the speed of their middle."""
    time = np.arange(1000) / 50

    def recorded_speed(late):
        return [Recording((10.0 + 0.5 * (time - late))[None], 50.0, (Channel("speed", "speed"),))]

    expected = 10.0 + 0.5 * np.arange(2.0, 18.0, 2.0)
    for late in (0.0, 1.0):
        speeds, spreads = segment_speeds(recorded_speed(late), "speed", 4.0, delay=late)
        assert speeds[:-1] == pytest.approx(expected[: speeds.size - 1])
        assert np.all(spreads > 0)
