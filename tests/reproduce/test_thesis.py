"""Settings of the thesis, modes matched with the true ones, cells of the pages, and runs over seeds."""

import math

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.identification import BlockRowLadder, IdentificationSettings, as_in_thesis
from sprung.reproduce import CHAPTERS, reproduce
from sprung.reproduce.chapter import Chapter, Effort, over_seeds
from sprung.reproduce.thesis import (
    deviations,
    in_runs,
    matched,
    numbers,
    spread,
    theoretical,
    theory_table,
    worst_error,
)
from sprung.results.page.page import Section
from sprung.vehicles import chain


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


def test_a_chapter_runs_its_experiment_for_every_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    prose = {
        "thresholds": "Strict.",
        "chapter_9": {
            "title": "T",
            "records": {"rate": 50.0},
            "settings": "{thresholds} {rate:g} Hz.\nOnce.",
            "verdict": "{x}: {y}",
        },
    }
    monkeypatch.setattr("sprung.reproduce.chapter.data", {"chapters": prose}.__getitem__)
    section = Section("S", ())
    chapter = Chapter(
        "chapter_9", lambda: "example", math.isqrt, lambda example, results: ({"x": example, "y": results}, (section,))
    )
    steps = []
    report = chapter.report(Effort(n_seeds=4), lambda doing, share: steps.append((doing, share)))
    assert (report.title, report.verdict) == ("T", "example: [1, 1, 1, 2]")
    assert report.settings == ("Strict. 50 Hz.", "Once.", "Command: sprung reproduce 9 --out DIR")
    assert report.sections == (section,)
    assert steps[0] == ("one set of records, as the thesis shows it", 0.0)
    assert steps[-1] == ("4 sets of records", 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("n_processes", [1, 2])
def test_runs_come_in_the_order_of_their_seeds(n_processes) -> None:
    shares: list[float] = []
    found = over_seeds(math.isqrt, [0, 1, 4, 9, 16], n_processes=n_processes, on_progress=shares.append)
    assert found == [0, 1, 2, 3, 4]
    assert shares == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])


@pytest.fixture
def truth():
    return theoretical(chain())


def test_the_truth_matches_itself(truth) -> None:
    match = matched(truth, truth)
    assert match.natural_frequency == pytest.approx(truth.natural_frequency)
    assert match.damping_ratio == pytest.approx([0.01124, 0.03149, 0.04551], abs=1e-5)
    assert match.mac == pytest.approx(1)
    assert match.n_others == 0


def test_missing_and_other_modes(truth) -> None:
    match = matched(truth.take(np.array([2])), truth)
    assert np.isnan(match.natural_frequency[:2]).all()
    assert match.natural_frequency[2] == pytest.approx(28.3905, abs=1e-4)
    apart = matched(truth, truth.take(np.array([0])))
    assert (apart.mac.size, apart.n_others) == (1, 2)


def test_a_mode_far_off_or_of_another_shape_does_not_match(truth) -> None:
    import dataclasses

    far = dataclasses.replace(truth, poles=truth.poles * 1.2)
    assert matched(far, truth).n_others == 3
    turned = dataclasses.replace(truth, mode_shapes=truth.mode_shapes[::-1])
    assert np.isnan(matched(turned, truth).natural_frequency[[0, 2]]).all()


def test_labels_choose_modes() -> None:
    from sprung.vehicles import read_vehicle, structure

    modes = theoretical(structure(read_vehicle("zafira")), labels=("bounce", "roll"))
    assert modes.labels == ("bounce", "roll")
