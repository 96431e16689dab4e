import math

import pytest

from sprung.reproduce.chapter import Chapter, Effort, over_seeds
from sprung.results.page.page import Section


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
