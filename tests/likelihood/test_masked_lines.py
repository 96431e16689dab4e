"""Lines of wheels, engine and mains in spectra that the model explains otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood.masked_lines import SpectralLine, residual_lines, without_lines


@pytest.fixture
def explained(car, road_model, with_data):
    """A model and the spectra that it gives itself, of 6 classes of 100 segments."""
    model = road_model(car)
    return with_data(model, model.start, counts=100.0)


def with_line(model, gain):
    """The model with data that a gain multiplies, shape (classes, frequencies)."""
    matrices = model.spectra.matrices * gain[..., None, None]
    return replace(model, spectra=replace(model.spectra, matrices=matrices))


def test_spectra_as_the_model_has_them_hold_no_line(explained) -> None:
    assert residual_lines(explained, explained.start) == ()


def test_a_constant_frequency_is_found_where_it_is(car, road_model, with_data, classes) -> None:
    """A hum at 12.5 Hz that spreads over the main lobe of the window, at one speed."""
    model = road_model(car, spectra=classes(3, n_classes=1))
    explained = with_data(model, model.start, counts=600.0)
    gain = np.where(np.abs(explained.spectra.frequencies - 12.5) <= 0.2, 5.0, 1.0)[None]
    lines = residual_lines(with_line(explained, gain), explained.start)
    assert lines
    assert not any(line.follows_speed for line in lines)
    assert [line.place for line in lines] == pytest.approx([12.5] * len(lines), abs=0.2)
    assert residual_lines(with_line(explained, gain), explained.start, lowest=13.0) == ()


def test_a_line_of_the_wheels_follows_the_speed(explained) -> None:
    """Half a cycle per metre: 2.5 Hz at 5 m/s, 10 Hz at 20 m/s."""
    spectra = explained.spectra
    place = 0.5 * spectra.speeds[:, None]
    gain = np.where(np.abs(spectra.frequencies - place) <= 0.2, 8.0, 1.0)
    lines = residual_lines(with_line(explained, gain), explained.start)
    assert lines[0].follows_speed
    assert lines[0].place == pytest.approx(0.5, rel=0.05)


def test_frequencies_around_a_line_are_left_out(explained) -> None:
    """Two spectral lines on either side; for the wheels twice the spread of the speed more."""
    spectra = explained.spectra
    frequencies, step = spectra.frequencies, 1 / spectra.segment_length
    is_free = without_lines(spectra, (SpectralLine(frequencies[40], follows_speed=False),))
    assert np.flatnonzero(~is_free[0]).tolist() == [38, 39, 40, 41, 42]
    assert np.array_equal(is_free, np.broadcast_to(is_free[0], is_free.shape))
    of_wheels = without_lines(spectra, (SpectralLine(0.9, follows_speed=True),))
    for speed, spread, row in zip(spectra.speeds, spectra.spreads, of_wheels, strict=True):
        left_out = frequencies[~row]
        distance = np.abs(left_out - 0.9 * speed)
        assert distance.max() <= 2 * step + 2 * spread * 0.9 * speed
        assert distance.min() < step
    assert without_lines(spectra, ()).all()
