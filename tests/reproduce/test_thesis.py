"""Settings of the thesis: one preset for the pages and for everybody else."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.identification import BlockRowLadder, IdentificationSettings, as_in_thesis
from sprung.reproduce import CHAPTERS, reproduce
from sprung.reproduce.thesis import deviations, in_runs, numbers, spread, theory_table, worst_error


def test_the_preset_is_that_of_section_4_3() -> None:
    """Ladder over 12 to 45 block rows, 1/N, changes up to 0.1, 0.2 and 0.5, delta 0.5."""
    settings = as_in_thesis()
    assert settings.ladder == BlockRowLadder(12, 45)
    assert settings.ladder.is_biased
    criteria = settings.criteria
    assert (criteria.frequency, criteria.damping, criteria.shape, criteria.stable_rate) == (0.1, 0.2, 0.5, 0.5)


def test_block_rows_and_orders_are_those_of_the_ladder() -> None:
    with pytest.raises(ParameterError, match=r"^max_order=40 excludes a ladder over block rows"):
        as_in_thesis(IdentificationSettings(max_order=40))


def test_words_for_numbers() -> None:
    assert deviations([101.0, np.nan, 1.0], [100.0, 100.0, 0.0]) == ["+1.00 %", "–", "–"]
    assert spread([np.nan]) == "–"
    assert in_runs(np.array([[2.0, np.nan], [2.0, np.nan]])) == ["2 of 2: 2.00 (2.00 to 2.00)", "0 of 2: –"]
    assert numbers([float("nan"), 2.0]) == ["–", "2.00"]
    assert worst_error([[1.1, np.nan], [1.1, np.nan]], [1.0, 2.0]) == pytest.approx(0.1)


def test_unknown_chapter_is_refused(tmp_path) -> None:
    with pytest.raises(ParameterError, match="chapter '9' is not one of 4, 5"):
        reproduce(["9"], directory=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert list(CHAPTERS) == ["4", "5", "6", "7", "8", "comparison"]


def test_tables_by_columns() -> None:
    table = theory_table("T", ("bounce",), ([2.0], [2.02]), ([10.0], [np.nan]), digits=(1, 2, 0, 1), remark="R.")
    assert table.columns == (
        "",
        "f published [Hz]",
        "f ours [Hz]",
        "deviation",
        "ξ published [%]",
        "ξ ours [%]",
        "deviation",
    )
    assert table.rows == (("bounce", "2.0", "2.02", "+1.00 %", "10", "–", "–"),)
    assert table.caption == "R."
