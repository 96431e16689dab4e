"""Settings that cannot be used, and those of the thesis."""

from dataclasses import replace

import pytest

from sprung.errors import ParameterError
from sprung.identification import BlockRowLadder, IdentificationSettings, as_in_thesis
from sprung.identification.stabilisation import THESIS_CRITERIA


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
def test_settings_that_cannot_be_used_are_refused(settings, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        IdentificationSettings(**settings)
    assert str(refusal.value) == sentence


def test_settings_of_the_thesis_keep_what_they_are_given() -> None:
    settings = as_in_thesis(IdentificationSettings(segment=20.0, references=("a",)))
    assert settings.ladder == BlockRowLadder(12, 45)
    assert (settings.segment, settings.references) == (20.0, ("a",))
    assert settings.criteria == THESIS_CRITERIA
    loose = as_in_thesis(rows=(4, 8), stable_rate=0.3)
    assert loose.ladder == BlockRowLadder(4, 8)
    assert replace(loose.criteria, stable_rate=THESIS_CRITERIA.stable_rate) == THESIS_CRITERIA
    with pytest.raises(ParameterError, match="excludes a ladder"):
        as_in_thesis(IdentificationSettings(block_rows=20))
