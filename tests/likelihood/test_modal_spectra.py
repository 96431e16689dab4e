"""Spectra over narrow bins: their power, their sums over stretches, and what is lost to the taper."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood.modal_spectra import OVERCOUNT, LineSpectra, block_sums, line_edges, line_sums
from sprung.recording import Channel, Gap, Recording


def recorded(samples, rate=100.0, gaps=()):
    return Recording(samples, rate, tuple(Channel(f"s{k}") for k in range(len(samples))), gaps=gaps)


def noise(n_samples, n_channels=2, seed=0):
    return np.random.default_rng(seed).normal(size=(n_channels, n_samples))


def test_white_noise_has_its_density_and_its_counts() -> None:
    # One-sided density of unit variance: 2 / sampling rate.
    spectra = line_sums(recorded(noise(60_000)), line_edges(1.0, 40.0, duration=600.0)).spectra()
    mean = np.average(spectra.matrices, axis=0, weights=spectra.counts)
    assert mean == pytest.approx(0.02 * np.eye(2), abs=4 * 0.02 / np.sqrt(spectra.counts.sum()))
    assert spectra.counts.sum() * OVERCOUNT == pytest.approx(39.0 * 600.0, rel=1e-3)


def test_counts_are_those_that_the_scatter_of_means_shows() -> None:
    edges = np.array([5.0, 45.0])
    means = [line_sums(recorded(noise(2000, 1, seed)), edges).spectra() for seed in range(400)]
    relative = np.var([spectra.matrices[0, 0, 0].real for spectra in means]) / 0.02**2
    assert relative == pytest.approx(1 / means[0].counts[0], rel=0.2)


def test_sums_over_stretches_are_those_of_their_records() -> None:
    samples, edges = noise(3000), line_edges(1.0, 40.0, duration=10.0)
    whole = line_sums(recorded(samples, gaps=(Gap(1000, 5.0),)), edges)
    parts = line_sums(recorded(samples[:, :1000]), edges) + line_sums(recorded(samples[:, 1000:]), edges)
    assert whole.moments == pytest.approx(parts.moments)
    assert whole.matrices == pytest.approx(parts.matrices)
    assert whole.longest == parts.longest == 20.0


def test_blocks_have_the_lines_of_their_samples() -> None:
    samples, edges = noise(3000), line_edges(1.0, 40.0, duration=10.0)
    blocks = block_sums(recorded(samples), edges, duration=9.0)
    assert [block.longest for block in blocks] == [10.0] * 3
    assert blocks[1].matrices == pytest.approx(line_sums(recorded(samples[:, 1000:2000]), edges).matrices)


def test_joined_bins_are_weighted_means() -> None:
    spectra = LineSpectra(
        np.array([1.0, 2.0, 4.0]), np.zeros(3), np.array([1.0, 3.0, 2.0]), np.ones((3, 1, 1), dtype=complex)
    )
    joined = spectra.joined(np.array([0, 0, 1]))
    assert joined.frequencies == pytest.approx([1.75, 4.0])
    assert joined.counts == pytest.approx([4.0, 2.0])
    assert joined.spreads == pytest.approx([np.sqrt(3) / 4, 0.0])


def test_scaled_and_tilted_channels() -> None:
    sums = line_sums(recorded(noise(1000)), line_edges(1.0, 40.0, duration=10.0))
    factors = np.array([2.0, 0.5])
    assert sums.scaled(factors).spectra().matrices == pytest.approx(
        sums.spectra().matrices * np.outer(factors, factors)
    )
    spectra = sums.spectra()
    tilted = spectra.tilted(np.array([1.0, 0.0]), middle=10.0)
    assert tilted.matrices[:, 0, 1] == pytest.approx(spectra.matrices[:, 0, 1] * spectra.frequencies / 10.0)


def test_edges_and_parts_must_be_consistent() -> None:
    with pytest.raises(ParameterError, match="low=0 must be above 0"):
        line_edges(0.0, 1.0, duration=1.0)
    with pytest.raises(ParameterError, match="must be equally many"):
        LineSpectra(np.ones(2), np.ones(2), np.ones(3), np.ones((2, 1, 1), dtype=complex))
