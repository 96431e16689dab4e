"""Misfit of the spectra, tempering of the likelihood, weights of segments."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import SegmentSpectra
from sprung.likelihood.uncertainty import power_misfit, segment_weights, tempering


@pytest.fixture
def explained(car, road_model, with_data):
    """A model of 6 classes of 9 segments with the spectra that it gives itself."""
    model = road_model(car)
    return with_data(model, model.start)


def test_exact_spectra_have_no_misfit_and_less_than_chance(explained) -> None:
    """Chance: 1.06 / 54 segments."""
    misfit, excess = power_misfit(explained, explained.start)
    assert misfit == pytest.approx(np.zeros((3, 96)), abs=1e-12)
    assert excess == pytest.approx(-1.06 / 54)
    assert tempering(explained, explained.start) == 1.0


def test_a_constant_misfit_tempers_by_its_size_and_reach(explained) -> None:
    """Power 20 % too large everywhere: d = 0.2, correlated over all F lines with (F - lag) / F up to lag F / 2."""
    louder = replace(explained, spectra=replace(explained.spectra, matrices=1.2 * explained.spectra.matrices))
    misfit, excess = power_misfit(louder, louder.start)
    assert misfit == pytest.approx(np.full((3, 96), 0.2))
    assert excess == pytest.approx(0.04 - 1.06 / 54)
    reach = 1 + 2 * sum((96 - lag) / 96 for lag in range(1, 48))
    assert tempering(louder, louder.start) == pytest.approx(1 / (1 + 54 / (19 / 9) * excess * reach))


def test_a_segment_on_a_pothole_counts_less(explained) -> None:
    """Forty segments of the model's own power and one of a hundred times the median: weight 3 / 100."""
    factor = np.linalg.cholesky(explained.matrix(explained.start))[2]
    draws = np.random.default_rng(1).standard_normal((2, 41, 96, 3)) / np.sqrt(2)
    values = np.einsum("fij,sfj->sfi", factor, draws[0] + 1j * draws[1])
    speeds = np.full(41, explained.spectra.speeds[2])
    one_class = replace(
        explained.spectra,
        counts=np.array([41.0]),
        speeds=speeds[:1],
        spreads=explained.spectra.spreads[:1],
        matrices=explained.spectra.matrices[2:3],
        weights=np.full((1, 96), 41.0),
    )
    model = replace(explained, spectra=one_class, blocks=_with_one_class(explained, one_class))
    segments = SegmentSpectra(one_class.frequencies, values, speeds, np.zeros(41), 5.12, 0)
    plain = segment_weights(model, model.start, segments)
    assert plain == pytest.approx(np.ones(41))
    values[7] *= 10.0
    weights = segment_weights(model, model.start, replace(segments, values=values))
    assert weights[7] == pytest.approx(0.012, rel=0.2)
    assert np.delete(weights, 7) == pytest.approx(np.ones(40))


def _with_one_class(model, spectra):
    """The blocks of a model, those of the road for other classes."""
    changes = {"inputs": {"spectra": spectra}, "class_roughness": {"n_classes": 1}}
    return tuple(replace(block, **changes.get(block.group, {})) for block in model.blocks)
