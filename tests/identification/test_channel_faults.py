"""Clipped channels and channels that are dead for a part of a record."""

import numpy as np
import pytest
from tests.identification.runs import TRUTH, run

from sprung.errors import DataError
from sprung.identification import cov_ssi
from sprung.identification.records import note_on_faults, without_dead_parts

NAMES = ("acc_1", "acc_2", "acc_3")


def changed(change, recording=None):
    """Return a run with `change` applied to a copy of its samples."""
    recording = recording or run()
    samples = recording.samples.copy()
    change(samples)
    return recording.changed("changed", samples=samples)


def clip(samples):
    limit = 1.5 * samples[1].std()
    samples[1] = np.clip(samples[1], -limit, limit)


def stop(samples):
    samples[2, 20_000:] = samples[2, 20_000]


def lose(samples):
    samples[0, :3_000] = np.nan


def break_off(samples):
    samples[2, 6_000:] = 0.0


def noted(recordings):
    found = cov_ssi(recordings)
    return found, [note for note in found.notes if note.startswith("faults of channels")]


def test_a_healthy_record_is_not_touched() -> None:
    healthy = run()
    recording, faults = without_dead_parts(healthy, NAMES)
    assert recording is healthy
    assert faults == ()
    assert note_on_faults([faults]) == ()
    assert noted(healthy)[1] == []


def test_a_clipped_channel_is_noted_and_kept() -> None:
    """1.5 standard deviations of a normal distribution are exceeded in 13.4 % of the samples, half in long plateaus."""
    clipped = changed(clip)
    recording, (fault,) = without_dead_parts(clipped, NAMES)
    assert recording is clipped
    assert (fault.channel, fault.dead, fault.missing, fault.is_left_out) == ("acc_2", 0.0, 0.0, False)
    assert 0.03 < fault.clipped < 0.134
    found, notes = noted(clipped)
    assert notes == [
        f"faults of channels: acc_2 (clipped in {100 * fault.clipped:.2g} % of its samples, which distorts the motion):"
        " check ranges, sensors and wiring"
    ]
    np.testing.assert_allclose(found.modes.natural_frequency, TRUTH.natural_frequency, rtol=0.02)


def test_the_dead_part_of_a_channel_is_left_out() -> None:
    found, notes = noted(changed(stop))
    assert notes == [
        "faults of channels: acc_3 (dead in 33 %, this part of the record left out): check ranges, sensors and wiring"
    ]
    alone = cov_ssi(run().changed("cut", samples=run().samples[:, :20_000])).modes
    np.testing.assert_allclose(found.modes.natural_frequency, alone.natural_frequency, rtol=1e-3)


def test_a_channel_that_is_mostly_dead_is_left_out() -> None:
    found, notes = noted(changed(break_off))
    assert notes == ["faults of channels: acc_3 (dead in 80 %, channel left out): check ranges, sensors and wiring"]
    assert [channel.name for channel in found.channels] == ["acc_1", "acc_2"]
    np.testing.assert_allclose(found.modes.natural_frequency, TRUTH.natural_frequency, rtol=0.02)


def test_all_faults_are_one_sentence() -> None:
    broken = changed(lose, changed(stop, changed(clip)))
    _, (note,) = noted(broken)
    assert note.startswith(
        "faults of channels: acc_1 (missing in 10 %, this part of the record left out), acc_2 (clipped"
    )
    assert "acc_3 (dead in 33 %, this part of the record left out)" in note


def test_a_later_record_without_a_channel_of_the_plan_is_left_out() -> None:
    found, _ = noted([run(), changed(break_off, run(2))])
    assert "record 2 left out: channel 'acc_3' is dead in 80 % of it, but not in the first record" in found.notes
    assert len(found.channels) == 3


def test_a_channel_that_is_dead_throughout_is_refused_as_before() -> None:
    def cut(samples):
        samples[0] = 2.0

    with pytest.raises(DataError, match="channel 'acc_1' is constant at 2"):
        cov_ssi(changed(cut))


def test_short_runs_of_a_coarse_resolution_are_not_dead() -> None:
    def repeat(samples):
        samples[0, 1_000:1_600] = samples[0, 1_000]

    recording, faults = without_dead_parts(changed(repeat), NAMES)
    assert faults == ()
    assert np.isfinite(recording.samples).all()
