"""Choices from the data against what is known of the data, and the preparation that they ask for."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from tests.identification.runs import TRUTH, run

from sprung.errors import DataError, ParameterError
from sprung.identification import BlockRowLadder, IdentificationSettings
from sprung.identification.planning import (
    disjoint_splits,
    make_plan,
    plan_preparation,
    prepare,
    rate_for_body,
    search_harmonics,
)
from sprung.identification.settings import ACS, COSS, COV
from sprung.recording import Channel, Recording
from sprung.signals.harmonics import Harmonic
from sprung.vehicles import read_vehicle, structure

FREQUENCIES = TRUTH.natural_frequency


def planned(recording, *, method=COV, total=None, **settings):
    wishes = IdentificationSettings(**settings)
    preparation = plan_preparation(recording, settings=wishes)
    return make_plan(
        preparation,
        prepare(recording, preparation),
        search_harmonics(recording, preparation, speed=None),
        settings=wishes,
        method=method,
        total_duration=total or recording.duration,
    )


def test_the_band_holds_all_modes_and_the_rate_carries_it() -> None:
    plan = planned(run())
    assert plan.preparation.band[0] < FREQUENCIES[0]
    assert FREQUENCIES[-1] < plan.preparation.band[1] < 60.0
    assert plan.preparation.decimate_to >= 3 * plan.preparation.band[1]
    assert 500.0 / plan.preparation.decimate_to == pytest.approx(round(500.0 / plan.preparation.decimate_to))
    assert plan.mode_band[0] < FREQUENCIES[0]
    assert plan.mode_band[1] > FREQUENCIES[-1]
    assert plan.preparation.notes[0].endswith("Hz (where the channels are coherent), sampled at 125 Hz")


def test_the_band_is_where_channels_move_together_not_where_they_are_loud() -> None:
    """Noise of each sensor alone at 100 to 200 Hz, as strong as the motion, does not widen the band."""
    generator = np.random.default_rng(0)
    frequencies = np.fft.rfftfreq(run().n_samples, 1 / 500.0)
    spectrum = np.fft.rfft(generator.normal(size=run().samples.shape)) * ((frequencies > 100) & (frequencies < 200))
    own = np.fft.irfft(spectrum, run().n_samples)
    own *= run().samples.std(axis=1, keepdims=True) / own.std(axis=1, keepdims=True)
    loud = run().changed("noisy", samples=run().samples + own)
    assert planned(loud).preparation.band[1] < 60.0


def resonances(frequencies, scales, generator, *, rate=200.0, n_samples=12_000):
    """Return accelerations of three channels in modes of given RMS and 2 % of damping, with sensor noise."""
    samples = np.zeros((3, n_samples))
    shapes = np.linalg.qr(np.vander([1.0, 2.0, 3.5], 3))[0]
    for frequency, scale, shape in zip(frequencies, scales, shapes, strict=True):
        root = np.exp(2 * np.pi * frequency / rate * (-0.02 + 1j))
        mode = signal.lfilter(
            [1.0, -2.0, 1.0], np.poly([root, root.conj()]).real, generator.standard_normal(n_samples + 3000)
        )
        samples += scale * np.outer(shape, mode[3000:] / mode[3000:].std())
    return samples + 0.1 * samples.std() * generator.standard_normal(samples.shape)


def band_of(samples, rate=200.0, **lines):
    recording = Recording(samples, rate, tuple(Channel(f"a{k}") for k in range(len(samples))))
    return plan_preparation(recording, settings=IdentificationSettings(), **lines).band


def test_a_weak_first_mode_below_a_channel_with_strong_motion_of_its_own_is_in_the_band() -> None:
    """At 20 dB below the others the first mode has less than 1 % of the coherent power."""
    for seed in range(4):
        generator = np.random.default_rng([14, seed])
        samples = resonances([5.2, 14.6, 21.0], [0.1, 1.0, 1.0], generator)
        own = signal.lfilter(*signal.butter(2, [18, 30], "band", fs=200.0), generator.standard_normal(12_000))
        samples[2] += 30 * samples.std() * own
        assert 3.0 < band_of(samples)[0] < 5.2


def test_chance_is_no_peak_below_the_band() -> None:
    for seed in range(10):
        generator = np.random.default_rng([15, seed])
        samples = resonances([14.6, 21.0, 25.0], [1.0, 1.0, 1.0], generator)
        assert 10.0 < band_of(samples + generator.standard_normal(samples.shape))[0] < 14.6


def test_lines_above_those_that_were_searched_do_not_widen_the_band() -> None:
    """Without the lines below 40 Hz, those above would hold most of the power."""
    generator = np.random.default_rng(17)
    samples = resonances([5.2, 14.6, 21.0], [1.0, 1.0, 1.0], generator)
    frequencies = np.arange(7.0, 95.0, 7.0)
    waves = 3 * samples.std() * np.sin(2 * np.pi * np.outer(frequencies, np.arange(12_000) / 200.0)).sum(axis=0)
    lines = [Harmonic(f, "constant", (f - 0.02, f + 0.02), 0.04, 20.0, ("a0",)) for f in frequencies if f < 40]
    assert band_of(samples + waves, harmonics=lines)[1] > 60.0
    assert band_of(samples + waves, harmonics=lines, searched=40.0)[1] < 40.0


@pytest.mark.parametrize("rate", [100.0, 101.0])
def test_hum_at_half_the_rate_does_not_take_the_band(rate) -> None:
    """Where no line can be found, and no mode is sought: a hum of three times the motion drew the band up to 50 Hz."""
    samples = resonances([2.0, 5.6, 8.1], [1.0, 1.0, 1.0], np.random.default_rng(2), rate=rate, n_samples=2000)
    hum = 3 * samples.std() * np.sqrt(2) * np.sin(2 * np.pi * 50.003 * np.arange(2000) / rate + 1.0)
    assert band_of(samples + hum, rate)[1] < 15.0


def test_the_band_of_a_vehicle_is_around_its_modes() -> None:
    car = read_vehicle("zafira")
    recording = Recording(np.random.default_rng(0).normal(size=(1, 5000)), 200.0, (Channel("a", "acceleration"),))
    plan = plan_preparation(recording, settings=IdentificationSettings(), vehicle=car)
    modes = structure(car).modes().natural_frequency
    assert plan.band == pytest.approx((0.3 * modes.min(), 1.5 * modes.max()))
    assert "around the modes of the vehicle file" in plan.notes[0]


def test_given_settings_are_kept() -> None:
    given = {"band": (5.0, 35.0), "decimate_to": 250.0, "segment": 7.0, "block_rows": 33, "max_order": 22}
    plan = planned(run(), **given)
    assert plan.preparation.band == given["band"]
    assert plan.preparation.high_pass == 2.5
    assert plan.preparation.decimate_to == 250.0
    assert plan.segment == 7.0
    assert (plan.ladder.block_rows, plan.ladder.max_order) == (33, 22)
    assert plan.mode_band == (5.0, 35.0)
    assert plan.ladder.n_lags == 66
    assert planned(run(), ladder=BlockRowLadder(12, 45)).ladder.n_lags == 135
    assert "(given)" in plan.preparation.notes[0]


def test_segments_are_many_and_long_against_the_lags() -> None:
    cov, acs, coss = (planned(run(), method=method, total=1200.0) for method in (COV, ACS, COSS))
    assert cov.segment == pytest.approx(1200.0 / 48)
    assert acs.segment == pytest.approx(60.0)
    assert coss.segment == pytest.approx(1200.0 / 36)
    for plan in (cov, acs, coss):
        assert plan.segment >= 3 * plan.ladder.n_lags / plan.preparation.decimate_to
    short = planned(run(), method=COSS)
    assert short.segment == pytest.approx(3 * short.ladder.n_lags / short.preparation.decimate_to)
    assert short.segment > 60.0 / 36


def test_lags_of_many_channels_are_no_longer_than_a_short_record_bears() -> None:
    """Eight channels leave 50 block rows: three times their lags would be a sixth of 20 s, and leave four blocks."""
    generator, rate = np.random.default_rng(3), 85.0
    shapes = np.linalg.qr(generator.normal(size=(8, 8)))[0]
    samples = 0.05 * generator.normal(size=(8, 1700))
    for frequency, shape in zip([1.0, 3.0, 4.8, 6.5, 8.0, 9.2, 10.1, 10.7], shapes, strict=True):
        root = np.exp(2 * np.pi * frequency / rate * (-0.03 + 1j))
        mode = signal.lfilter([1.0], np.poly([root, root.conj()]).real, generator.normal(size=4700))[3000:]
        samples += np.outer(shape, mode / mode.std())
    record = Recording(samples, rate, tuple(Channel(f"a{k}") for k in range(8)))
    assert planned(record, decimate_to=rate).ladder.span / rate <= 20.0 / 11


def test_orders_are_even_and_fit_the_matrix() -> None:
    for given_settings, n_channels in (
        ({}, 3),
        ({"block_rows": 4}, 3),
        ({"references": ("acc_1",)}, 1),
        ({"has_disjoint_references": True}, 1),
    ):
        found = planned(run(), **given_settings).ladder
        assert found.max_order % 2 == 0
        assert found.max_order <= (found.block_rows - 1) * n_channels


@pytest.mark.parametrize(
    ("n_samples", "settings", "error", "sentence"),
    [
        (99, {}, DataError, "the longest stretch without a gap has 99 samples at 500 Hz, but .* needs 100 or more"),
        (30_000, {"decimate_to": 1.6}, DataError, "the longest stretch without a gap has 96 samples at 1.6"),
        (30_000, {"block_rows": 4000, "decimate_to": 125.0}, DataError, "block_rows=4000 .* block_rows <= 3750"),
        (
            30_000,
            {"ladder": BlockRowLadder(12, 3000), "decimate_to": 125.0},
            DataError,
            "block_rows=3000 needs 9000 lags, .* 7500 samples at 125 Hz: record longer or use block_rows <= 2500",
        ),
        (30_000, {"decimate_to": 600.0}, ParameterError, "decimate_to=600 must be at most 500: decimation only lowers"),
        (30_000, {"band": (300.0, 400.0)}, ParameterError, "the band's lower edge=300 must be at most 250"),
    ],
)
def test_what_a_record_cannot_carry_is_refused(n_samples, settings, error, sentence) -> None:
    short = run().changed("cut", samples=run().samples[:, :n_samples])
    with pytest.raises(error, match=f"^{sentence}"):
        planned(short, **settings)


@settings(deadline=None)
@given(st.integers(2, 40))
def test_every_two_channels_are_apart_in_some_split_both_ways(n) -> None:
    splits = disjoint_splits(range(n))
    together = set()
    for outputs, references in splits:
        assert outputs
        assert references
        assert sorted(outputs + references) == list(range(n))
        together |= set(itertools.product(outputs, references))
    assert together == set(itertools.permutations(range(n), 2))
    assert len(splits) == 2 * int(np.ceil(np.log2(n)))


def test_the_body_alone_needs_a_lower_rate() -> None:
    """The lowest submultiple of at least 11 x 1.6 times the highest mode of the body; the wheels move at 12 Hz."""
    car = read_vehicle("zafira")
    modes = structure(car).modes()
    is_body = np.isin(np.array(modes.labels), ["bounce", "pitch", "roll"])
    least = 11 * 1.6 * modes.natural_frequency[is_body].max()
    rate = rate_for_body(car, 200.0)
    assert rate == pytest.approx(40.0)
    assert 200 / 6 < least < rate
    assert rate_for_body(car, 20.0) == 20.0


RATE = 100.0


def recorded(samples, names="abc", *, quantities=(), **fields):
    samples = np.atleast_2d(samples)
    kinds = [*quantities, *["acceleration"] * (len(samples) - len(quantities))]
    channels = tuple(Channel(name, kind) for name, kind in zip(names, kinds, strict=False))
    return Recording(samples, RATE, channels, **fields)


def noise(n_channels=2, n_samples=1000, seed=0):
    return np.random.default_rng(seed).normal(size=(n_channels, n_samples))


@pytest.mark.parametrize("band", [None, (3.0, 40.0)])
def test_motion_is_decimated_without_trend_and_of_unit_rms(band) -> None:
    recording = run()
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


@pytest.mark.parametrize("frequency", [1.5, 3.0, 6.0])
def test_the_high_pass_halves_at_half_the_lower_edge(frequency) -> None:
    """Fourth order, run both ways: 1 / (1 + (3 Hz / f)^8)."""
    tone = np.sin(2 * np.pi * frequency * np.arange(30_000) / 500.0)
    recording = Recording(np.vstack([tone, 2 * tone]), 500.0, (Channel("a"), Channel("b")))
    settings = IdentificationSettings(band=(6.0, 40.0), decimate_to=500.0)
    found = prepare(recording, plan_preparation(recording, settings=settings)).motion.samples[:, 5_000:-5_000]
    assert found.std(axis=1) == pytest.approx(1 / (1 + (3.0 / frequency) ** 8), rel=1e-3)


def test_harmonics_are_searched_above_the_band_of_the_identification() -> None:
    """A line of 60 Hz, in a record that is decimated to 20 Hz for its modes."""
    recording = run()
    line = recording.samples.std() * np.sin(2 * np.pi * 60.0 * np.arange(recording.n_samples) / 500.0)
    humming = recording.changed("hum", samples=recording.samples + line)
    plan = plan_preparation(humming, settings=IdentificationSettings(decimate_to=20.0))
    assert prepare(humming, plan).motion.sampling_rate == pytest.approx(20.0)
    (found,) = search_harmonics(humming, plan, speed=None)
    assert found.frequency == pytest.approx(60.0, abs=0.02)
