"""Methods of identification: records of every make, what results say, and one sentence for what cannot be used."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.identification.runs import TRUTH, assert_same, recorded, run

from sprung.errors import DataError, ParameterError
from sprung.identification import (
    METHODS,
    SUBSPACE_METHODS,
    IdentificationSettings,
    OrderLadder,
    acs_ssi,
    as_in_thesis,
    coss_ssi,
    cov_ssi,
    summarise,
)
from sprung.identification.stabilisation import StabilityCriteria
from sprung.modal import PoleStatus, mac
from sprung.recording import Channel, Gap, Recording
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain


@pytest.mark.parametrize("names", [["acc_1"], ["acc_3"], ["acc_1", "acc_3"], ["acc_2", "acc_3"]])
def test_one_or_two_channels_are_enough(names) -> None:
    found = cov_ssi(run().select(names))
    np.testing.assert_allclose(found.modes.natural_frequency, TRUTH.natural_frequency, rtol=0.01)
    assert found.modes.channels == tuple(names)
    columns = [TRUTH.channels.index(name) for name in names]
    assert np.diag(mac(found.modes.mode_shapes, TRUTH.mode_shapes[:, columns])).min() > 0.98


@pytest.mark.parametrize("references", [("acc_1",), ("acc_2", "acc_3")])
def test_references_can_be_chosen(references) -> None:
    found = cov_ssi([run(1), run(2), run(3)], settings=IdentificationSettings(references=references))
    np.testing.assert_allclose(found.modes.natural_frequency, TRUTH.natural_frequency, rtol=0.01)
    assert np.diag(mac(found.modes.mode_shapes, TRUTH.mode_shapes)).min() > 0.98
    assert found.subsets[0].diagrams[0].poles.channels == TRUTH.channels


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_generator_is_read_once_one_record_at_a_time(method) -> None:
    records = [run(seed) for seed in range(4)]
    settings = IdentificationSettings(segment=6.0)
    alive = []

    def one_by_one():
        for k, record in enumerate(records):
            alive.append(k)
            yield record

    found = METHODS[method](one_by_one(), settings=settings)
    assert alive == [0, 1, 2, 3]
    assert_same(found, METHODS[method](records, settings=settings), deviations=1e-9)


def test_a_record_with_gaps_is_used_up_to_its_gaps() -> None:
    record = replace(run(), gaps=(Gap(1_000, 1.0), Gap(1_010, 1.0), Gap(20_000, 3.0)))
    found = cov_ssi(record)
    np.testing.assert_allclose(found.modes.natural_frequency, TRUTH.natural_frequency, rtol=0.01)


def test_records_of_a_higher_rate_are_brought_down() -> None:
    records = [run(), run(2, sampling_rate=1000.0)]
    found = cov_ssi(records)
    np.testing.assert_allclose(found.modes.natural_frequency, TRUTH.natural_frequency, rtol=0.01)


@pytest.mark.parametrize("first", [0, 1])
def test_poor_records_among_good_ones_are_left_out_and_noted(first) -> None:
    good = run()
    poor = good.changed("cut", samples=good.samples[:, :1])
    dead = good.changed("cable off", samples=np.where([[True], [False], [True]], good.samples, 0.0))
    found = cov_ssi([good, poor, run(2), dead][first:])
    left_out = [note for note in found.notes if "left out" in note]
    assert left_out == [
        f"record {2 - first} left out: the recording has 1 sample(s): record at least a minute",
        f"record {4 - first} left out: channel 'acc_2' is constant at 0: leave it out with --channels acc_1,acc_3",
    ]
    assert_same(found, cov_ssi([good, run(2)][first:]), deviations=0.5)


@pytest.mark.slow
def test_one_subset_is_the_average_of_all_segments() -> None:
    """F. Liu (2020), section 4.2: J = 1 is ACS-Cov-SSI; sorted by the expected level it is Cov-SSI."""
    records = [run(seed) for seed in range(3)]
    settings = IdentificationSettings(n_subsets=1, segment=10.0)
    assert_same(coss_ssi(records, settings=settings), cov_ssi(records, settings=settings), deviations=1e-6)
    thesis = replace(settings, has_own_levels=True)
    assert_same(coss_ssi(records, settings=thesis), acs_ssi(records, settings=thesis), deviations=1e-9)


def test_the_ladder_of_the_thesis_averages_with_bias() -> None:
    """The average of one segment of N samples is (N - m) / N times the one without bias at lag m."""
    settings = as_in_thesis(IdentificationSettings(segment=60.0), rows=(12, 14))
    summary = summarise("acs", run(), settings=settings)
    biased, unbiased = summary.subsets[0][1].values, summary.average.values
    n_samples = 60.0 * summary.average.sampling_rate
    expected = unbiased * (1 - np.arange(summary.plan.ladder.n_lags) / n_samples)
    np.testing.assert_allclose(biased, expected, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_progress_rises_from_nothing_to_everything(method) -> None:
    calls = []
    METHODS[method]([run(1), run(2), run(3)], on_progress=lambda doing, share: calls.append((doing, share)))
    shares = [share for _, share in calls]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert [doing for doing, _ in calls[:3]] == [f"correlating record {k}" for k in (1, 2, 3)]
    assert calls[-1] == ("done", 1.0)
    assert len(set(shares)) == len(shares) >= 5


def test_noise_alone_has_no_modes() -> None:
    noise = np.random.default_rng(0).normal(size=(3, 30_000))
    for method in METHODS.values():
        found = method(recorded(noise))
        assert len(found.modes) == 0
        assert found.members.shape == (0, len(found.subsets))
        assert found.modes.mode_shapes.shape == (0, 3)


def broken(row, value):
    samples = run().samples.copy()
    samples[row] = value
    return recorded(samples)


SHORT = np.random.default_rng(0).normal(size=(2, 99))
BAD = [
    (lambda: broken(2, 3.0), {}, DataError, "channel 'acc_3' is constant at 3: leave it out with --channels"),
    (lambda: broken(0, np.nan), {}, DataError, "channel 'acc_1' has no values: leave it out with --channels"),
    (lambda: recorded(np.ones((2, 1))), {}, DataError, "the recording has 1 sample(s): record at least a minute"),
    (lambda: recorded(np.zeros((2, 0))), {}, DataError, "the recording has 0 sample(s)"),
    (lambda: recorded(np.zeros((0, 9))), {}, DataError, "the recording has no channel of motion: give accelerations"),
    (list, {}, DataError, "there is no recording to identify modes from: give at least one"),
    (lambda: iter([]), {}, DataError, "there is no recording to identify modes from"),
    (lambda: recorded(SHORT), {}, DataError, "the longest stretch without a gap has 99 samples at 500 Hz"),
    (run, {"block_rows": 5000, "decimate_to": 125.0}, DataError, "block_rows=5000 needs 10000 lags, but the longest"),
    (run, {"block_rows": 40, "max_order": 400}, ParameterError, "max_order=400 is more than block_rows=40 can carry"),
    (
        lambda: [run(), run(2, sampling_rate=100.0)],
        {"decimate_to": 125.0},
        ParameterError,
        "sampling rates 125 Hz and 100 Hz differ: bring the records to one rate first (--decimate-to)",
    ),
    (run, {"references": ("acc_9",)}, ParameterError, "there is no channel 'acc_9': the recording has acc_1, acc_2"),
    (
        lambda: [run().select(["acc_1", "acc_2"]), run(2).select(["acc_3"])],
        {},
        ParameterError,
        "set-up 2 (acc_3) shares no channel with the others",
    ),
    (
        lambda: run().select(["acc_1"]),
        {"has_disjoint_references": True},
        ParameterError,
        "disjoint outputs and references need at least two channels",
    ),
]


@pytest.mark.parametrize(("record", "settings", "error", "sentence"), BAD)
def test_bad_input_gets_one_clear_sentence(record, settings, error, sentence) -> None:
    for method in (cov_ssi, coss_ssi):
        with pytest.raises(error, match=f"^{re.escape(sentence)}"):
            method(record(), settings=IdentificationSettings(**settings))


@pytest.mark.parametrize(
    ("method", "settings", "sentence"),
    [
        ("plscf", as_in_thesis(), "pLSCF cannot use a ladder over block rows: leave it (--thesis) out"),
        ("fdd", as_in_thesis(), "FDD uses neither a ladder (--thesis) nor references: leave them out"),
        ("fdd", IdentificationSettings(has_disjoint_references=True), "FDD uses neither a ladder (--thesis) nor ref"),
        ("plscf", IdentificationSettings(block_rows=20, max_order=40), "max_order=40 is more than the half spectra of"),
    ],
)
def test_second_opinions_refuse_what_does_not_apply(method, settings, sentence) -> None:
    with pytest.raises(ParameterError, match=f"^{re.escape(sentence)}"):
        METHODS[method](run(), settings=settings)
    with pytest.raises(ParameterError, match="method"):
        summarise("fdd", run())


@pytest.mark.slow
def test_records_of_one_logger_by_slightly_different_clocks_are_one_condition() -> None:
    masses = chain()
    runs = [simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=500.0, seed=k) for k in range(2)]
    late = replace(runs[1], sampling_rate=500.0 * 1.0002)
    for settings in (IdentificationSettings(), IdentificationSettings(decimate_to=100.0)):
        modes = METHODS["cov"]([runs[0], late], settings=settings).modes
        assert modes.natural_frequency == pytest.approx([7.01, 19.65, 28.39], rel=0.01)


def test_free_motion_is_recognised_and_fitted_as_such() -> None:
    """A decay from the first sample on, and one after a push: exact poles within chance; random motion stays random."""
    poles = 2 * np.pi * np.array([3.0, 7.5]) * (1j * np.sqrt(1 - 0.02**2) - 0.02)
    shapes = np.array([[1.0, 0.6], [-0.5, 1.0]])
    time = np.arange(1500) / 50
    decay = (shapes.T @ np.exp(poles[:, None] * time)).real
    channels = (Channel("a", "displacement"), Channel("b", "displacement"))
    noise = 1e-3 * np.random.default_rng(2).standard_normal(decay.shape)
    whole = cov_ssi(Recording(decay + noise, 50.0, channels))
    assert set(whole.sources) == {"free_response"}
    np.testing.assert_allclose(whole.modes.natural_frequency, [3.0, 7.5], rtol=1e-3)
    np.testing.assert_allclose(whole.modes.damping_ratio, 0.02, rtol=0.02)
    assert any("free motion" in note for note in whole.notes)
    as_random = cov_ssi(Recording(decay + noise, 50.0, channels), settings=IdentificationSettings(kind="random"))
    assert "free_response" not in as_random.sources
    masses = chain()
    run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    assert set(cov_ssi(run).sources) == {"ssi"}


@pytest.mark.parametrize("has_disjoint_references", [False, True])
@pytest.mark.parametrize("method", [*SUBSPACE_METHODS, "plscf"])
def test_every_mode_leads_back_to_its_subsets_and_their_poles(method, has_disjoint_references) -> None:
    settings = IdentificationSettings(has_disjoint_references=has_disjoint_references)
    found = METHODS[method]([run(seed) for seed in range(4)], settings=settings)
    assert found.members.shape == (len(found.modes), len(found.subsets))
    assert len(found.modes) == 3
    assert np.all(np.diff(found.modes.natural_frequency) > 0)
    np.testing.assert_allclose(np.abs(found.modes.mode_shapes).max(axis=1), 1)
    for mode, row in enumerate(found.members):
        for subset, member in zip(found.subsets, row, strict=True):
            if member < 0:
                continue
            own = subset.modes.natural_frequency[member]
            assert own == pytest.approx(found.modes.natural_frequency[mode], rel=0.03)
            for diagram, alignment in zip(subset.diagrams, subset.alignments[member], strict=True):
                if alignment < 0:
                    continue
                behind = diagram.alignments == alignment
                assert set(diagram.status[behind]) == {PoleStatus.SELECTED}
                assert np.median(diagram.poles.natural_frequency[behind]) == pytest.approx(own, rel=0.03)


@pytest.mark.parametrize("method", METHODS)
def test_modes_that_contribute_too_little_are_dropped_with_all_that_belongs_to_them(method) -> None:
    few = IdentificationSettings(criteria=StabilityCriteria(contribution=1e9))
    found = METHODS[method](run(), settings=few)
    assert len(found.modes) == 0
    assert found.members.shape == (0, len(found.subsets))
    for subset in found.subsets if method != "fdd" else ():
        statuses = subset.diagrams[0].status
        assert PoleStatus.INSIGNIFICANT in statuses
        behind = np.isin(subset.diagrams[0].alignments, subset.alignments[:, 0])
        assert set(statuses[behind]) <= {PoleStatus.INSIGNIFICANT, PoleStatus.SELECTED}


@pytest.mark.slow
def test_subsets_hold_all_segments_and_rise_in_level() -> None:
    found = coss_ssi([run(seed) for seed in range(6)])
    levels = [subset.level for subset in found.subsets if subset.level is not None]
    assert len(levels) == len(found.subsets)
    assert all(low < high for low, high in levels)
    assert [high for _, high in levels[:-1]] == [low for low, _ in levels[1:]]
    expected = cov_ssi([run(seed) for seed in range(6)]).subsets[0].n_segments
    assert sum(subset.n_segments for subset in found.subsets) == pytest.approx(expected, abs=1)
    assert cov_ssi(run()).subsets[0].level is None


def test_choices_are_noted_and_filled_in() -> None:
    found = cov_ssi(run())
    assert found.notes[0].startswith("modes sought from ")
    assert found.notes[0].endswith("Hz (where the channels are coherent), sampled at 125 Hz")
    effective, plan = found.effective_settings, found.plan
    assert (effective.decimate_to, effective.segment) == (plan.preparation.decimate_to, plan.segment)
    assert isinstance(plan.ladder, OrderLadder)
    assert (effective.block_rows, effective.max_order) == (plan.ladder.block_rows, plan.ladder.max_order)
    assert found.settings == IdentificationSettings()


def test_a_drive_without_a_mode_of_its_body_says_what_to_give() -> None:
    """Modes of the structure at 8 and 20 Hz alone."""
    motion = run(duration=60.0)
    channels = (*motion.channels, Channel("speed", "speed"))
    drive = replace(motion, samples=np.vstack([motion.samples, np.full(motion.n_samples, 12.0)]), channels=channels)
    found = cov_ssi(drive)
    assert found.modes.natural_frequency.min() > 4.0
    assert any("pass --vehicle" in note for note in found.notes)
    assert not any("pass --vehicle" in note for note in cov_ssi(motion).notes)


def test_one_note_lists_the_channels_that_are_no_motion() -> None:
    motion = run(duration=60.0)
    channels = (*motion.channels, Channel("heading", "angle"), Channel("mode"))
    added = np.vstack([np.linspace(0.0, 3.0, motion.n_samples), np.full(motion.n_samples, 4.0)])
    found = cov_ssi(replace(motion, samples=np.vstack([motion.samples, added]), channels=channels))
    assert found.notes.count("channels that are no motion take no part: heading, mode") == 1
    assert_same(found, cov_ssi(motion), deviations=0.0)


@pytest.mark.parametrize("method", [cov_ssi, acs_ssi, coss_ssi])
def test_no_mode_lies_outside_the_frequencies_that_the_note_states(method) -> None:
    found = method(run(duration=120.0))
    stated = re.match(r"modes sought from (\S+) to (\S+) Hz, settings for \S+ to \S+ Hz \(where", found.notes[0])
    assert stated is not None
    assert "band" not in found.notes[0]  # what the lags are chosen for limits no modes
    low, high = map(float, stated.groups())
    assert np.all((low < found.modes.natural_frequency) & (found.modes.natural_frequency < high))
