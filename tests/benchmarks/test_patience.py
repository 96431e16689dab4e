"""Simulated fleets of the promise: their evidence is that of the package."""

from dataclasses import replace

import numpy as np
import pytest

import sprung
from sprung.diagnosis.baseline import CONDITIONS
from sprung.diagnosis.changes import PATIENCE_DAYS
from sprung.diagnosis.scatter import LASTING, pooled

patience = pytest.importorskip("benchmarks.patience", reason="the benchmarks are not in this tree")
vectors = pytest.importorskip("benchmarks.patience_vectors")

MIDDLE = {"payload": 100.0, "roughness": 1e-5, "speed": 20.0, "temperature": 290.0}


def windows_of(units, values):
    """Return windows with these conditions, in units away from a middle, and ln values."""
    found = []
    for k, (unit, row) in enumerate(zip(units, values, strict=True)):
        met = {name: MIDDLE[name] + x * CONDITIONS[name] for name, x in zip(vectors.CONDITIONS, unit, strict=True)}
        met["roughness"] = MIDDLE["roughness"] * np.exp(unit[1] * CONDITIONS["roughness"])
        covariance = vectors.REPORTED**2 * np.eye(len(row))
        found.append(sprung.Observation(600.0 * k, vectors.PARTS, row, covariance, met, {}, ()))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("n_learning", [6, 12])
@pytest.mark.parametrize("world", ["as the model says", "all three, correlation of 0.6"])
def test_evidence_of_vectors_is_that_of_windows(world, n_learning) -> None:
    """By `learn` and `detect`, at two looks, of three vehicles."""
    units, values = patience.drawn(patience.WORLDS[world], n_learning, -0.05, np.random.default_rng(1))
    units, values = units[:3], values[:3]
    for which, learnt in vectors.baselines(units[:, :n_learning], values[:, :n_learning]):
        if not len(which):
            continue
        found = vectors.evidence(learnt, units[which, n_learning:], values[which, n_learning:], (6, 24))
        for vehicle, row in zip(which, found, strict=True):
            every = windows_of(units[vehicle], values[vehicle])
            baseline = sprung.learn(every[:n_learning])
            for look, value in zip((6, 24), row, strict=True):
                detection = sprung.diagnosis.detect(baseline, every[n_learning : n_learning + look])
                assert detection is not None
                assert value == pytest.approx(detection.e_value + np.log(48 * PATIENCE_DAYS), abs=1e-6)


@pytest.mark.parametrize("n_learning", [6, 12])
@pytest.mark.parametrize(
    ("world", "unequal", "correlation"),
    [
        ("as the model says", 0, 0.0),
        ("serial correlation of 0.3", 0, 0.3),
        ("unequal scatter of parts", 1, 0.0),
        ("all three, correlation of 0.6", 1, 0.6),
    ],
)
def test_baselines_of_a_fleet_state_its_scatter_and_correlation(world, unequal, correlation, n_learning) -> None:
    """Deviations from a regression, regressed again, made parts scatter alike and windows less correlated."""
    units, values = patience.drawn(patience.WORLDS[world], n_learning, 0.0, np.random.default_rng(5))
    learnt = vectors.baselines(units[:, :n_learning], values[:, :n_learning])
    weights = pooled([own for which, baseline in learnt for own in baseline.weights if len(which)])
    row, column = np.unravel_index(np.argmax(weights), weights.shape)
    assert row == unequal
    assert LASTING.correlations[column] == pytest.approx(correlation, abs=0.11)


@pytest.mark.slow
def test_the_mean_of_the_e_detector_is_below_the_number_of_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 300 healthy vehicles by themselves, with baselines of six windows: 0.05 to 0.2 times that number.

    It is 1.3 to 2.2 times where what the baseline excludes counts for more, 11 to 74 by a ninth of the probabilities.
    """
    monkeypatch.setattr(patience, "ABOVE_ALONE", -np.inf)
    world = patience.WORLDS["all three, correlation of 0.6"]
    found = patience.simulated(world, 6, 0.0, 300, [3, 6], alone=True)
    assert np.all(np.mean(np.exp(found), axis=0) < patience.LOOKS)


def test_a_part_that_alone_scatters_more_is_no_evidence_of_a_change() -> None:
    """Of 1,500 vehicles with unequal scatter, lasting deviations and new conditions: one whose rear left damper had an
    evidence of 11.6 where the likelihood of no change took its deviations as those of three unlike coordinates."""
    generator = np.random.default_rng([11, 12])
    every = [patience.drawn(patience.WORLDS["all three, correlation of 0.6"], 12, 0.0, generator) for _ in range(12)]
    windows = windows_of(*(each[71] for each in every[-1]))
    detection = sprung.diagnosis.detect(sprung.learn(windows[:12]), windows[12:36])
    assert detection is not None
    assert detection.e_value + np.log(48 * PATIENCE_DAYS) < np.log(48 / patience.RATE)


@pytest.mark.parametrize("alone", [False, True])
def test_evidence_that_is_not_computed_is_below_that_of_any_list(alone) -> None:
    """Of 100 vehicles, half of them with a fault: what is computed is the same, and what is not is below 6.9."""
    units, values = patience.drawn(patience.WORLDS["all three, correlation of 0.6"], 12, 0.0, np.random.default_rng(4))
    values[:50, 15:, 0] -= 0.25
    above = patience.ABOVE_ALONE if alone else patience.ABOVE
    every = [one for one in vectors.baselines(units[:, :12], values[:, :12]) if len(one[0])]
    together = pooled([own for _, baseline in every for own in baseline.weights])
    for which, learnt in every:
        weights = learnt.weights if alone else np.broadcast_to(together, learnt.weights.shape)
        baseline = replace(learnt, weights=weights)
        rough, full = (
            vectors.evidence(baseline, units[which, 12:], values[which, 12:], (24,), limit)
            for limit in (above, -np.inf)
        )
        is_computed = rough >= above
        assert rough[is_computed & (full >= above)] == pytest.approx(full[is_computed & (full >= above)])
        assert np.all(full[~is_computed] < np.log(48 / patience.RATE))
        assert 0 < np.sum(full > np.log(48 / patience.RATE)) < len(which)
