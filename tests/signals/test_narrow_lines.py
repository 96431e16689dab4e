"""Narrow lines: their chances in random vibration, their multiples, and their subtraction."""

import itertools

import numpy as np
import pytest
from scipy import stats

from sprung.recording import Channel, Gap, Recording
from sprung.signals.harmonics import Harmonic, subtract_lines
from sprung.signals.narrow_lines import (
    Line,
    chance_of_regularity,
    chance_of_steadiness,
    largest_family,
    multiples,
    search_segments,
    searched,
)


def line(frequency, tolerance=0.01):
    return Line(frequency, tolerance, 3 * tolerance, 20.0, frozenset([0]))


@pytest.mark.slow
@pytest.mark.parametrize("n_segments", [5, 6, 7, 11])
def test_chance_of_regularity_is_uniform_for_random_signals(n_segments) -> None:
    """Against the definition: the share of random signals that look at least as regular."""
    powers = np.random.default_rng(5).exponential(size=(20_000, n_segments))
    chances = np.array([chance_of_regularity(row) for row in powers])
    for level in (1e-3, 1e-2):
        expected = 20_000 * level
        assert abs(np.count_nonzero(chances <= level) - expected) < 4 * np.sqrt(expected)


def test_multiples_follow_a_fundamental_upwards() -> None:
    lines = [line(3.652), line(7.3), line(10.95), line(17.0), line(3.65 * 40), line(3.65 * 100)]
    family = multiples(lines[0].frequency, lines[0].tolerance, lines)
    assert family.members == ((0, 1), (1, 2), (2, 3), (4, 40), (5, 100))
    assert family.fundamental == pytest.approx(3.65)


def test_a_family_without_its_fundamental_is_found_if_most_multiples_are_there() -> None:
    family = largest_family([line(20.0), line(30.0), line(40.0), line(50.0), line(61.3)])
    assert family is not None
    assert family.fundamental == pytest.approx(10.0)
    assert [order for _, order in family.members] == [2, 3, 4, 5]
    assert largest_family([line(20.0), line(31.0)]) is None


def test_one_peak_between_many_multiples_does_not_halve_the_fundamental() -> None:
    """With the peak more than half of the multiples of 5 Hz exist, but one in forty of the odd ones."""
    family = largest_family([line(10.0 * n) for n in range(1, 41)] + [line(405.0)])
    assert family is not None
    assert family.fundamental == pytest.approx(10.0)
    assert len(family.members) == 40


def test_noise_has_no_narrow_lines_at_the_rate_stated() -> None:
    found = 0
    for seed, is_geometric in itertools.product(range(100), (False, True)):
        samples = np.random.default_rng(seed).standard_normal((2, 6000))
        recording = Recording(samples, 100.0, (Channel("a"), Channel("b")))
        found += len(
            search_segments(
                searched(recording),
                segment_length=4.0,
                prominence=0.1,
                false_alarm_rate=0.05,
                is_geometric=is_geometric,
            )[0]
        )
    assert found <= stats.poisson.isf(1e-3, 2 * 100 * 0.05)


@pytest.mark.parametrize("decay", [0.5, 2.0])
def test_a_mode_is_as_steady_as_a_line_no_more_often_than_stated(decay) -> None:
    """An envelope exp(-decay |t|) through Hann windows at any phase; the probability is an upper bound."""
    rng = np.random.default_rng(1)
    n_segments, length, n_draws = 9, 32, 1000
    times = np.arange(length * (n_segments + 1) // 2) / length
    root = np.linalg.cholesky(np.exp(-decay * np.abs(np.subtract.outer(times, times))))
    noise = rng.standard_normal((2, times.size, n_draws))
    envelope = root @ (noise[0] + 1j * noise[1])
    window = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    starts = np.arange(n_segments) * (length // 2)
    places = np.asarray(starts / length, dtype=np.float64)
    spectra = np.array([window @ envelope[start : start + length] for start in starts])
    chances = np.array([chance_of_steadiness(row, places, decay) for row in spectra.T])
    assert np.mean(chances <= 0.1) <= 0.1
    assert np.mean(chances <= 0.01) <= 0.02


def test_the_chance_of_steadiness_of_independent_segments_is_a_power() -> None:
    """r^(n - 1) for the share 1 - r of the energy in one phase, times the frequencies that are distinguished."""
    noise = np.array([1.0, -1, 1, -1, 1, -1])
    spectra = 1 + 0.1 * noise * np.array([1, 1, -1, -1, 0, 0]) + 0j
    share = abs(spectra.sum()) ** 2 / (6 * np.sum(abs(spectra) ** 2))
    places = np.linspace(0, 50, 6)
    chance = chance_of_steadiness(spectra, places, 500.0)
    assert chance == pytest.approx(2 * 51 * (1 - share) ** 5, rel=0.02)
    assert chance_of_steadiness(spectra[:4], places[:4], 500.0) == 1.0


@pytest.mark.parametrize("is_geometric", [False, True])
def test_a_band_holds_the_lines_of_the_whole_search(is_geometric) -> None:
    """Noise with tones, 4 dB and more above it: the same lines to the last digit."""
    t = np.arange(12_000) / 100
    noise = np.random.default_rng(3).standard_normal((2, t.size))
    tones = sum(0.3 * np.sin(2 * np.pi * f * t) for f in (3.3, 11.7, 12.4, 30.1))
    recording = Recording(noise + tones, 100.0, (Channel("a"), Channel("b")))
    options = {"segment_length": 8.0, "prominence": 4.0, "false_alarm_rate": 0.5, "is_geometric": is_geometric}
    whole, _ = search_segments(searched(recording), **options)
    for band in ((11.0, 13.0), (0.0, 5.0), (29.0, 49.9)):
        inside = [line for line in whole if band[0] <= line.frequency <= band[1]]
        found, _ = search_segments(searched(recording), band=band, **options)
        assert [line for line in found if band[0] <= line.frequency <= band[1]] == inside
        assert inside


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


def test_hardly_anything_goes_where_there_is_no_line() -> None:
    """A sine has two free values in each channel: of 7500 samples of white noise 2/7500 of the energy."""
    noise = np.random.default_rng(3).standard_normal((3, T.size))
    removed = subtract_lines(recorded(noise), [LINE]).samples - noise
    assert 0 < removed.var() < 5 * 2 / 7500
