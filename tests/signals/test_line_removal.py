import numpy as np
import pytest

from sprung.recording import Channel, Gap, Recording
from sprung.signals.harmonics import Harmonic, subtract_lines

RATE, T = 125.0, np.arange(7500) / 125.0
LINE = Harmonic(17.0, "constant", (16.99, 17.01), 0.025, 20.0, ("a",))


def recorded(samples, **fields):
    samples = np.atleast_2d(samples)
    return Recording(samples, RATE, tuple(Channel(name) for name in "abc"[: len(samples)]), **fields)


def residue(line, noise):
    """Return the RMS of what is left of a line, without the noise, over that of the line."""
    left = subtract_lines(recorded(noise + line), [LINE]).samples - noise
    return left.std() / line.std()


@pytest.mark.parametrize("frequency", [17.0, 17.0037, 16.9961])
def test_a_sine_is_subtracted_whatever_its_exact_frequency_and_phase(frequency) -> None:
    line = np.array([[1.0], [-3.0], [0.1]]) * np.sin(2 * np.pi * frequency * T + np.array([[0.3], [1.0], [2.0]]))
    assert residue(line, np.zeros((3, T.size))) < 0.01
    assert residue(line, 0.3 * np.random.default_rng(1).standard_normal((3, T.size))) < 0.02


@pytest.mark.parametrize(
    ("amplitude", "largest"),
    [
        (np.where((T > 20) & (T < 45), 1.0, 0.0), 0.25),
        (1 + 0.5 * np.sin(2 * np.pi * 0.03 * T), 0.15),
        (np.exp(2j * np.pi * 0.0005 * T**2), 0.15),
    ],
    ids=["comes and goes", "changes level", "drifts"],
)
def test_a_line_that_changes_is_followed(amplitude, largest) -> None:
    noise = 0.3 * np.random.default_rng(2).standard_normal((1, T.size))
    assert residue(np.real(amplitude * np.exp(2j * np.pi * 17.0 * T))[None], noise) < largest


def test_hardly_anything_goes_where_there_is_no_line() -> None:
    """A sine has two free values in each channel: of 7500 samples of white noise 2/7500 of the energy."""
    noise = np.random.default_rng(3).standard_normal((3, T.size))
    removed = subtract_lines(recorded(noise), [LINE]).samples - noise
    assert 0 < removed.var() < 5 * 2 / 7500


def test_each_stretch_has_its_own_phase() -> None:
    phase = np.where(T < 24, 0.0, 2.0)
    record = recorded(np.sin(2 * np.pi * 17.0 * T + phase), gaps=(Gap(3000, 7.7),))
    assert subtract_lines(record, [LINE]).samples.std() < 0.02


def test_lines_that_drift_or_follow_the_speed_are_left_in() -> None:
    record = recorded(np.sin(2 * np.pi * 17.0 * T))
    for kind in ("drifting", "speed"):
        left_in = Harmonic(17.0, kind, (16.5, 17.5), 1.0, 20.0, ("a",))
        assert subtract_lines(record, [left_in]) is record
    assert subtract_lines(record, [Harmonic(80.0, "constant", (79.0, 81.0), 0.1, 20.0, ("a",))]) is record
