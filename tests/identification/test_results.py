"""What a result says about how it came about."""

import numpy as np
import pytest

from sprung.identification import (
    METHODS,
    SUBSPACE_METHODS,
    BlockRowLadder,
    IdentificationSettings,
    OrderLadder,
    as_in_thesis,
    coss_ssi,
    cov_ssi,
)
from sprung.identification.stabilisation import StabilityCriteria
from sprung.modal import PoleStatus
from sprung.recording import Channel, Recording
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

CHAIN = chain()
TRUTH = CHAIN.modes()


def run(seed=1, *, snr=10.0, band=None, duration=60.0, sampling_rate=500.0, vehicle=CHAIN):
    excitation = usual_excitation(vehicle)
    return simulate(
        vehicle, excitation, duration=duration, sampling_rate=sampling_rate, seed=seed, snr=snr, noise_band=band
    )


def recorded(samples, sampling_rate=500.0):
    samples = np.atleast_2d(samples)
    channels = tuple(Channel(f"acc_{k}", "acceleration") for k in range(1, len(samples) + 1))
    return Recording(samples, sampling_rate, channels)


def assert_same(one, other, *, deviations):
    """The same modes, each within a share of its standard deviation."""
    assert len(one.modes) == len(other.modes)
    for name in ("natural_frequency", "damping_ratio"):
        difference = np.abs(getattr(one.modes, name) - getattr(other.modes, name))
        assert np.all(difference <= deviations * getattr(one.modes, f"{name}_std") + 1e-9)


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


def test_subsets_hold_all_segments_and_rise_in_level() -> None:
    found = coss_ssi([run(seed) for seed in range(6)])
    levels = [subset.level for subset in found.subsets if subset.level is not None]
    assert len(levels) == len(found.subsets)
    assert all(low < high for low, high in levels)
    assert [high for _, high in levels[:-1]] == [low for low, _ in levels[1:]]
    expected = cov_ssi([run(seed) for seed in range(6)]).subsets[0].n_segments
    assert sum(subset.n_segments for subset in found.subsets) == pytest.approx(expected, abs=1)
    assert cov_ssi(run()).subsets[0].level is None


def test_merged_subsets_are_noted() -> None:
    found = coss_ssi(run(), settings=IdentificationSettings(n_subsets=10, has_own_levels=True))
    assert len(found.subsets) < 10
    assert sum("merged with" in note for note in found.notes) == 10 - len(found.subsets)


def test_choices_are_noted_and_filled_in() -> None:
    found = cov_ssi(run())
    assert found.notes[0].startswith("band ")
    assert found.notes[0].endswith("Hz (where the channels are coherent), sampled at 125 Hz")
    effective, plan = found.effective_settings, found.plan
    assert (effective.decimate_to, effective.segment) == (plan.preparation.decimate_to, plan.segment)
    assert isinstance(plan.ladder, OrderLadder)
    assert (effective.block_rows, effective.max_order) == (plan.ladder.block_rows, plan.ladder.max_order)
    assert found.settings == IdentificationSettings()


def test_the_ladder_of_the_thesis_stays_in_the_settings() -> None:
    found = cov_ssi(run(), settings=as_in_thesis(rows=(12, 14)))
    assert found.effective_settings.ladder == found.plan.ladder == BlockRowLadder(12, 14)
    assert found.effective_settings.block_rows is None
    assert found.subsets[0].diagrams[0].poles.ladder == (12, 13, 14)
