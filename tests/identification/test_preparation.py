"""What becomes of a recording before it is correlated, and the settings that cannot be used."""

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.identification import BlockRowLadder, IdentificationSettings
from sprung.identification.planning import plan_preparation
from sprung.identification.preparation import prepare, search_harmonics
from sprung.recording import Channel, Recording
from sprung.signals.cepstrum import ShortPass
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain, parse_vehicle, read_description
from sprung.vehicles.usable import speed_channel, usable

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


# Usable parts


def test_outputs_are_the_channels_of_motion():
    recording = recorded(noise(3), ("a", "oil", "b"), quantities=("acceleration", "temperature"))
    assert usable(recording).names == ("a", "b")


def test_outputs_are_the_vehicle_s_sensors_in_its_order_and_in_si():
    """A chain file with two of its sensors in g; the third channel of the recording is none."""
    fields = read_description("chain3").model_dump(exclude_defaults=True)
    sensors = [
        {"channel": name, "quantity": "acceleration", "unit": "g", "on": f"mass_{k}"}
        for k, name in ((3, "c"), (1, "a"))
    ]
    vehicle = parse_vehicle({**fields, "sensor": sensors})
    recording = recorded(noise(3), quantities=["unknown"] * 3)
    found = usable(recording, vehicle=vehicle)
    assert found.names == ("c", "a")
    np.testing.assert_allclose(found.samples, 9.80665 * recording.samples[[2, 0]])


def test_missing_values_become_gaps():
    samples = noise()
    samples[1, 400:450] = np.nan
    found = usable(recorded(samples))
    assert found.n_samples == 950
    (gap,) = found.gaps
    assert (gap.index, gap.duration) == (400, pytest.approx(0.5))


def test_only_what_was_recorded_while_moving_counts():
    """Above 3 m/s: the first and the last three seconds of ten."""
    speed = np.where(np.abs(np.arange(1000) - 499.5) < 200, 1.0, 10.0)
    recording = recorded(np.vstack([speed, noise()]), ("speed", "a", "b"), quantities=("speed",))
    found = usable(recording)
    assert found.names == ("a", "b", "speed")
    assert found.n_samples == 600
    assert [gap.index for gap in found.gaps] == [300]
    assert speed_channel(recording) == "speed"
    assert speed_channel(recording.select(["a"])) is None


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [
        (
            [np.ones(50), np.arange(50.0)],
            "channel 'a' is constant at 1: leave it out with --channels b",
        ),
        (
            [np.arange(50.0), np.zeros(50)],
            "channel 'b' is constant at 0: leave it out with --channels a",
        ),
        (
            [np.full(50, np.nan), np.arange(50.0)],
            "channel 'a' has no values: leave it out with --channels b",
        ),
        (
            [np.ones(50), np.full(50, np.nan)],
            "channel 'a' is constant at 1: check the sensors and their wiring",
        ),
        ([[1.0], [2.0]], "the recording has 1 sample(s): record at least a minute"),
        (np.zeros((2, 0)), "the recording has 0 sample(s): record at least a minute"),
        (
            np.zeros((0, 50)),
            "the recording has no channel of motion: give accelerations or angular velocities",
        ),
    ],
)
def test_dead_channels_and_empty_recordings_are_refused(samples, sentence):
    with pytest.raises(DataError) as refusal:
        usable(recorded(np.asarray(samples)))
    assert str(refusal.value) == sentence


def test_a_large_offset_is_no_dead_channel():
    """An accelerometer standing upright: 9.81 m/s^2 and little motion."""
    samples = 9.81 + 1e-4 * noise()
    assert usable(recorded(samples)).n_samples == 1000


# Preparation


@pytest.mark.parametrize("band", [None, (3.0, 40.0)])
def test_motion_is_decimated_without_trend_and_of_unit_rms(band):
    recording = run_of_the_chain()
    recording = recording.changed("offset", samples=recording.samples * 1e3 + 7.0)
    plan = plan_preparation(recording, settings=IdentificationSettings(band=band))
    prepared = prepare(recording, plan)
    assert prepared.motion.sampling_rate == pytest.approx(plan.decimate_to)
    assert prepared.motion.sampling_rate == pytest.approx(125.0 if band is None else 250.0)
    assert prepared.motion.names == recording.names
    rms = prepared.motion.samples.std(axis=1)
    expected = recording.samples.std(axis=1) * np.array(list(plan.factors.values()))
    np.testing.assert_allclose(expected, 1, rtol=1e-9)
    assert np.all((rms > 0.5) & (rms <= 1.0))
    assert np.abs(prepared.motion.samples.mean(axis=1)).max() < 0.01
    assert prepared.edited_spectra is None
    assert prepared.spectra.names == recording.names


def test_motion_below_the_wanted_band_is_filtered_off():
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
def test_the_high_pass_halves_at_half_the_lower_edge(frequency):
    """Fourth order, run both ways: 1 / (1 + (3 Hz / f)^8)."""
    tone = np.sin(2 * np.pi * frequency * np.arange(30_000) / 500.0)
    recording = Recording(np.vstack([tone, 2 * tone]), 500.0, (Channel("a"), Channel("b")))
    settings = IdentificationSettings(band=(6.0, 40.0), decimate_to=500.0)
    found = prepare(recording, plan_preparation(recording, settings=settings)).motion.samples[:, 5_000:-5_000]
    assert found.std(axis=1) == pytest.approx(1 / (1 + (3.0 / frequency) ** 8), rel=1e-3)


def test_editing_keeps_the_spectra_before_and_after():
    recording = run_of_the_chain()
    plan = plan_preparation(recording, settings=IdentificationSettings())
    prepared = prepare(recording, plan, lifter=ShortPass(0.25))
    assert prepared.edited_spectra is not None
    assert prepared.edited_spectra.frequencies.shape == prepared.spectra.frequencies.shape
    assert not np.allclose(prepared.edited_spectra.matrix, prepared.spectra.matrix)


def test_harmonics_are_searched_above_the_band_of_the_identification():
    """A line of 60 Hz, in a record that is decimated to 20 Hz for its modes."""
    recording = run_of_the_chain()
    line = recording.samples.std() * np.sin(2 * np.pi * 60.0 * np.arange(recording.n_samples) / 500.0)
    humming = recording.changed("hum", samples=recording.samples + line)
    plan = plan_preparation(humming, settings=IdentificationSettings(decimate_to=20.0))
    assert prepare(humming, plan).motion.sampling_rate == pytest.approx(20.0)
    (found,) = search_harmonics(humming, plan, speed=None)
    assert found.frequency == pytest.approx(60.0, abs=0.02)


# Settings


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"band": (5.0, 2.0)}, "band 5 to 2 Hz must rise from 0 or more"),
        ({"band": (-1.0, 2.0)}, "band -1 to 2 Hz must rise from 0 or more"),
        ({"decimate_to": 0.0}, "decimate_to=0 must be above 0"),
        ({"segment": -1.0}, "segment=-1 must be above 0"),
        ({"n_subsets": 0}, "n_subsets=0 must be at least 1 and at most 50"),
        ({"block_rows": 0}, "block_rows=0 must be at least 2"),
        ({"max_order": 1}, "max_order=1 must be at least 2"),
        (
            {"ladder": BlockRowLadder(12, 45), "block_rows": 40},
            "block_rows=40 excludes a ladder over block rows, which sets them: leave one of them out",
        ),
        (
            {"ladder": BlockRowLadder(12, 45), "max_order": 40},
            "max_order=40 excludes a ladder over block rows, which sets them: leave one of them out",
        ),
        ({"references": ()}, "references is empty: name at least one channel, or leave it out to use all channels"),
        (
            {"references": ("a",), "has_disjoint_references": True},
            "references excludes has_disjoint_references, which chooses the references: leave one of them out",
        ),
    ],
)
def test_settings_that_cannot_be_used_are_refused(settings, sentence):
    with pytest.raises(ParameterError) as refusal:
        IdentificationSettings(**settings)
    assert str(refusal.value) == sentence
