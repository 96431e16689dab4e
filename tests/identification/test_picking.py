"""Modes picked by hand."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.runs import TRUTH, run

from sprung.errors import ParameterError
from sprung.identification import METHODS, IdentificationSettings, coss_ssi, cov_ssi, pick_modes
from sprung.identification.stabilisation import StabilityCriteria
from sprung.modal import PoleStatus
from sprung.results.documents import identification_document
from sprung.signals.spectrum import Exponential


@pytest.mark.parametrize("method", METHODS)
def test_picked_modes_are_those_selected_there(method) -> None:
    result = METHODS[method](run())
    picked = pick_modes(result, [28.2, 7.05])
    expected = result.modes.take(np.array([0, 2]))
    is_same = method != "fdd"  # where the bell has other neighbours
    np.testing.assert_allclose(picked.modes.poles, expected.poles, rtol=1e-12 if is_same else 0.01)
    np.testing.assert_allclose(picked.modes.mode_shapes, expected.mode_shapes, atol=1e-9 if is_same else 0.1)
    assert [note for note in picked.notes if "by hand" in note] == [
        f"{frequency:.4g} Hz picked by hand (selected automatically too)"
        for frequency in picked.modes.natural_frequency
    ]
    assert picked.members.shape == (2, len(result.subsets))
    document = identification_document(picked)
    assert [mode.source for mode in document.modes] == [method if method in ("plscf", "fdd") else "ssi"] * 2
    if method == "fdd":
        assert document.refinement is None
    else:
        assert result.refinement is not None
        assert picked.refinement is not None
        np.testing.assert_array_equal(picked.refinement.distances, result.refinement.distances[[0, 2]])
        assert {k for band in picked.refinement.bands for k in band.modes} <= {0, 1}


def test_modes_that_the_selection_refused_can_be_picked() -> None:
    settings = IdentificationSettings(criteria=StabilityCriteria(contribution=1e9))
    result = cov_ssi(run(), settings=settings)
    assert len(result.modes) == 0
    picked = pick_modes(result, TRUTH.natural_frequency.tolist())
    np.testing.assert_allclose(picked.modes.natural_frequency, TRUTH.natural_frequency, rtol=0.01)
    assert any(
        note.endswith(
            "picked by hand (not selected: its contribution to the correlations between channels is no larger than"
            " chance)"
        )
        for note in picked.notes
    )
    assert not any(note.startswith("no mode found") for note in picked.notes)
    assert picked.refinement is not None
    assert picked.refinement.reasons == ("it was picked by hand",) * 3


def test_what_is_not_picked_is_marked_in_the_diagram() -> None:
    picked = pick_modes(cov_ssi(run()), [7.0])
    diagram = picked.subsets[0].diagrams[0]
    places = diagram.poles.natural_frequency
    assert np.median(places[diagram.status == PoleStatus.SELECTED]) == pytest.approx(7.0, rel=0.01)
    others = places[diagram.status == PoleStatus.NOT_PICKED]
    assert set(np.unique(others.round(-1))) == {20.0, 30.0}


def test_the_damping_of_a_lifter_and_the_scales_of_channels_are_taken_off() -> None:
    record = run()
    record = record.changed("scaled", samples=record.samples * np.array([[1e3], [1.0], [1e-3]]))
    result = cov_ssi(record, settings=IdentificationSettings(lifter=Exponential(1.0)))
    picked = pick_modes(result, result.modes.natural_frequency.tolist())
    np.testing.assert_allclose(picked.modes.poles, result.modes.poles, rtol=1e-12)
    np.testing.assert_allclose(picked.modes.mode_shapes, result.modes.mode_shapes, atol=1e-12)


def test_a_mode_of_some_subsets_is_picked_from_those() -> None:
    result = coss_ssi([run(seed) for seed in range(3)])
    diagrams = [subset.diagrams[0] for subset in result.subsets]
    nowhere = replace(diagrams[0], alignments=np.full(len(diagrams[0].status), -1))
    subsets = (replace(result.subsets[0], diagrams=(nowhere,)), *result.subsets[1:])
    picked = pick_modes(replace(result, subsets=subsets), [7.0])
    assert picked.members.tolist() == [[-1, *[0] * (len(subsets) - 1)]]
    assert picked.modes.natural_frequency == pytest.approx([7.01], rel=0.01)


@pytest.mark.parametrize(
    ("frequencies", "sentence"),
    [
        ([], "no frequency is given to pick a mode at: give at least one"),
        ([0.0], "a picked frequency=0 must be above 0"),
        ([7.0, 14.0], "no stable poles near 14 Hz: the nearest are at 7"),
    ],
)
def test_what_cannot_be_picked_gets_one_sentence(frequencies, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        pick_modes(cov_ssi(run()), frequencies)
    assert str(refusal.value).startswith(sentence)
    assert "\n" not in str(refusal.value)


def test_modes_of_disjoint_references_are_refused() -> None:
    result = cov_ssi(run(), settings=IdentificationSettings(has_disjoint_references=True))
    with pytest.raises(ParameterError, match="cannot be picked: identify them without"):
        pick_modes(result, [7.0])
