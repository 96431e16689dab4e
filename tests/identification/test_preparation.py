"""What becomes of a recording before it is correlated."""

import numpy as np
import pytest

from sprung.identification import IdentificationSettings
from sprung.identification.planning import plan_preparation, prepare, search_harmonics
from sprung.recording import Channel, Recording
from sprung.signals.cepstrum import ShortPass
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

RATE = 100.0


def recorded(samples, names="abc", *, quantities=(), **fields):
    samples = np.atleast_2d(samples)
    kinds = [*quantities, *["acceleration"] * (len(samples) - len(quantities))]
    channels = tuple(Channel(name, kind) for name, kind in zip(names, kinds, strict=False))
    return Recording(samples, RATE, channels, **fields)


def noise(n_channels=2, n_samples=1000, seed=0):
    return np.random.default_rng(seed).normal(size=(n_channels, n_samples))


def run_of_the_chain(**options):
    structure = chain()
    options = {"duration": 60.0, "sampling_rate": 500.0, "seed": 1, "snr": 10.0, **options}
    return simulate(structure, usual_excitation(structure), **options)


@pytest.mark.parametrize("band", [None, (3.0, 40.0)])
def test_motion_is_decimated_without_trend_and_of_unit_rms(band) -> None:
    recording = run_of_the_chain()
    recording = recording.changed("offset", samples=recording.samples * 1e3 + 7.0)
    plan = plan_preparation(recording, settings=IdentificationSettings(band=band))
    prepared = prepare(recording, plan)
    assert prepared.motion.sampling_rate == pytest.approx(plan.decimate_to)
    assert prepared.motion.sampling_rate == pytest.approx(125.0 if band is None else 250.0)
    assert prepared.motion.names == recording.names
    rms = prepared.motion.samples.std(axis=1)
    expected = recording.samples.std(axis=1) * np.array(list(plan.factors.values()))
    np.testing.assert_allclose(expected, 1, rtol=1e-5)  # factors are those without the trend
    assert np.all((rms > 0.5) & (rms <= 1.0))
    assert np.abs(prepared.motion.samples.mean(axis=1)).max() < 0.01
    assert prepared.edited_spectra is None
    assert prepared.spectra.names == recording.names


def test_motion_below_the_wanted_band_is_filtered_off() -> None:
    """A swaying of 0.2 Hz, a hundred times the motion, is 15 times below half the lower edge."""
    recording = run_of_the_chain()
    sway = 100 * recording.samples.std() * np.sin(2 * np.pi * 0.2 * np.arange(recording.n_samples) / 500.0)
    swaying = recording.changed("swaying", samples=recording.samples + sway)
    plan = plan_preparation(swaying, settings=IdentificationSettings(band=(6.0, 40.0)))
    found = prepare(swaying, plan).motion.samples
    alone = prepare(recording, plan).motion.samples
    middle = slice(500, -500)
    assert np.abs(found - alone)[:, middle].max() < 0.02 * np.abs(alone).max()


@pytest.mark.parametrize("frequency", [1.5, 3.0, 6.0])
def test_the_high_pass_halves_at_half_the_lower_edge(frequency) -> None:
    """Fourth order, run both ways: 1 / (1 + (3 Hz / f)^8)."""
    tone = np.sin(2 * np.pi * frequency * np.arange(30_000) / 500.0)
    recording = Recording(np.vstack([tone, 2 * tone]), 500.0, (Channel("a"), Channel("b")))
    settings = IdentificationSettings(band=(6.0, 40.0), decimate_to=500.0)
    found = prepare(recording, plan_preparation(recording, settings=settings)).motion.samples[:, 5_000:-5_000]
    assert found.std(axis=1) == pytest.approx(1 / (1 + (3.0 / frequency) ** 8), rel=1e-3)


def test_editing_keeps_the_spectra_before_and_after() -> None:
    recording = run_of_the_chain()
    plan = plan_preparation(recording, settings=IdentificationSettings())
    prepared = prepare(recording, plan, lifter=ShortPass(0.25))
    assert prepared.edited_spectra is not None
    assert prepared.edited_spectra.frequencies.shape == prepared.spectra.frequencies.shape
    assert not np.allclose(prepared.edited_spectra.matrix, prepared.spectra.matrix)


def test_harmonics_are_searched_above_the_band_of_the_identification() -> None:
    """A line of 60 Hz, in a record that is decimated to 20 Hz for its modes."""
    recording = run_of_the_chain()
    line = recording.samples.std() * np.sin(2 * np.pi * 60.0 * np.arange(recording.n_samples) / 500.0)
    humming = recording.changed("hum", samples=recording.samples + line)
    plan = plan_preparation(humming, settings=IdentificationSettings(decimate_to=20.0))
    assert prepare(humming, plan).motion.sampling_rate == pytest.approx(20.0)
    (found,) = search_harmonics(humming, plan, speed=None)
    assert found.frequency == pytest.approx(60.0, abs=0.02)
