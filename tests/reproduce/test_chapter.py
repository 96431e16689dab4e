import math

from sprung.reproduce.chapter import Chapter, Effort
from sprung.results.page.page import Section


def test_a_chapter_runs_its_experiment_for_every_seed() -> None:
    chapter = Chapter(
        title="T",
        example=lambda: "example",
        experiment=math.isqrt,
        contents=lambda example, results: (f"{example}: {results}", (Section("S", ()),)),
        settings=("once",),
    )
    steps = []
    report = chapter.report(Effort(n_seeds=4), lambda doing, share: steps.append((doing, share)))
    assert (report.title, report.verdict, report.settings) == ("T", "example: [1, 1, 1, 2]", ("once",))
    assert steps[0] == ("one set of records, as the thesis shows it", 0.0)
    assert steps[-1] == ("4 sets of records", 1.0)
