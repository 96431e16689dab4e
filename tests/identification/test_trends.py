"""Trends with the level: exact for any excitation of one system, called for a nonlinear one only."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.identification import IdentificationSettings, LevelTrends, coss_ssi, cov_ssi
from sprung.identification.levels import trends_in_words
from sprung.identification.subspace import eigenvalue_weights, realise
from sprung.modal import Modes
from sprung.recording import Channel, Recording

QUIET = IdentificationSettings(harmonics=())


@pytest.mark.parametrize(("name", "rate"), [("chain3", 125.0), ("quarter", 250.0)])
def test_the_modal_filter_gives_the_pole_however_the_system_is_excited(known, name, rate) -> None:
    """Correlations C A^(m - 1) G' with another G' than that of the filter: the same eigenvalue."""
    correlations, poles, _ = known(name, rate)
    realisation = realise(correlations, block_rows=20, max_order=2 * len(poles))
    n_references = len(correlations.references)
    mixed = np.einsum(
        "crm,rs->csm", correlations.values, np.random.default_rng(0).normal(size=(n_references, n_references))
    )
    for pole in poles:
        eigenvalue = np.exp(pole / rate)
        numerator, denominator = eigenvalue_weights(realisation, 2 * len(poles), eigenvalue)
        n_lags = numerator.shape[-1]
        quotient = np.sum(numerator * mixed[..., 1 : n_lags + 1]) / np.sum(denominator * mixed[..., 1 : n_lags + 1])
        assert abs(quotient - eigenvalue) < 1e-8
        own = correlations.values[..., 1 : n_lags + 1]
        assert np.sum(denominator * own) == pytest.approx(1.0, abs=1e-8)


def oscillator(seed, *, hardening=0.0, friction=0.0, duration=200.0, rate=100.0):
    """Acceleration of two sensors on an oscillator of 5 Hz and 3 %, driven at slowly varying levels, 2:1."""
    generator = np.random.default_rng(seed)
    n_samples, steps = round(duration * rate), 4
    step = 1 / (rate * steps)
    level = 2.0 ** np.interp(np.arange(n_samples), np.arange(0, n_samples + 1500, 1500), _levels(generator, n_samples))
    force = 100.0 * level * generator.normal(size=n_samples)
    frequency = 2 * np.pi * 5.0
    position = velocity = 0.0
    motion = np.empty(n_samples)
    for k, push in enumerate(force.tolist()):
        for _ in range(steps):
            spring = frequency**2 * position * (1 + hardening * position**2)
            velocity += step * (push - spring - 0.06 * frequency * velocity - friction * np.sign(velocity))
            position += step * velocity
        motion[k] = push - frequency**2 * position * (1 + hardening * position**2) - 0.06 * frequency * velocity
    motion -= force
    samples = np.array([[1.0], [0.7]]) * motion
    samples += 0.1 * np.std(motion) * generator.normal(size=samples.shape)
    return Recording(samples, rate, (Channel("a"), Channel("b")))


def _levels(generator, n_samples):
    return generator.uniform(-0.5, 0.5, size=len(np.arange(0, n_samples + 1500, 1500)))


def test_a_linear_record_of_varying_level_has_no_trend() -> None:
    found = coss_ssi(oscillator(1), settings=QUIET)
    assert len(found.modes) == 1
    assert found.level_trends is not None
    assert not found.level_trends.is_detected.any()
    assert found.level_trends.level_ratio[0] > 1.2
    sentence = "no dependence on the level detected (highest subset over lowest: 1."
    assert any(note.startswith(sentence) for note in found.notes)
    average = cov_ssi(oscillator(1), settings=QUIET).modes
    difference = abs(found.modes.damping_ratio[0] - average.damping_ratio[0])
    assert difference < average.damping_ratio_std[0]


def test_a_hardening_spring_raises_the_frequency() -> None:
    found = coss_ssi(oscillator(2, hardening=4.0), settings=QUIET)
    trends = found.level_trends
    assert trends is not None
    nearest = int(np.argmax(trends.natural_frequency / trends.natural_frequency_std))
    assert trends.is_detected[nearest]
    assert trends.natural_frequency[nearest] > 0
    assert any("rises by" in note and "for twice the level: a nonlinearity" in note for note in found.notes)


def test_without_levels_there_is_no_trend() -> None:
    record = oscillator(3, duration=60.0)
    assert cov_ssi(record, settings=QUIET).level_trends is None
    assert coss_ssi(record, settings=replace(QUIET, has_own_levels=True)).level_trends is None
    assert coss_ssi(record, settings=replace(QUIET, n_subsets=1)).level_trends is None


def modes_at(*frequencies):
    n = len(frequencies)
    return Modes(
        poles=2 * np.pi * np.array(frequencies) * (-0.02 + 1j * np.sqrt(1 - 0.02**2)),
        mode_shapes=np.ones((n, 2), dtype=complex),
        channels=("a", "b"),
        natural_frequency_std=np.full(n, 0.01),
        damping_ratio_std=np.full(n, 0.001),
        stable_rate=np.ones(n),
        labels=(None,) * n,
    )


def test_trends_in_words() -> None:
    trends = LevelTrends(
        natural_frequency=np.array([-0.031, 0.001]),
        natural_frequency_std=np.array([0.004, 0.002]),
        damping_ratio=np.array([0.0, -0.012]),
        damping_ratio_std=np.array([0.001, 0.002]),
        p_value=np.array([1e-6, 1e-5]),
        level_ratio=np.array([2.0, 1.5]),
    )
    assert trends_in_words(modes_at(13.2, 20.0), trends) == [
        "the frequency of the mode at 13.2 Hz falls by 3.1 % ± 0.4 % for twice the level: a nonlinearity",
        "the damping ratio of the mode at 20 Hz falls by 1.2 ± 0.2 percentage points for twice the level:"
        " a nonlinearity",
    ]
    chance = replace(trends, p_value=np.array([0.02, 0.5]))
    assert trends_in_words(modes_at(13.2, 20.0), chance) == [
        "no dependence on the level detected (highest subset over lowest: 1.75)"
    ]
    unknown = replace(trends, p_value=np.full(2, np.nan))
    assert trends_in_words(modes_at(13.2, 20.0), unknown) == []
