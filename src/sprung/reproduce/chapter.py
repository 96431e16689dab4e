"""Skeleton of a chapter: one example, the same experiment with many seeds, and the contents of the page."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

from sprung.reproduce.runs import Effort, Progress, over_seeds
from sprung.results.page.page import Report, Section

Example = TypeVar("Example")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False, slots=True)
class Chapter(Generic[Example, Result]):
    """A chapter of the thesis, as functions that compute and describe it.

    Parameters
    ----------
    title
        Heading of its page.
    example
        Returns one set of records as the thesis shows it, with what is identified in it.
    experiment
        Returns the result of one set of records for a seed; a function of a module, sent to other processes.
    contents
        Returns the verdict and the sections, from the example and the results of all seeds.
    settings
        Sentences that state lengths, rates, noise and settings.
    """

    title: str
    example: Callable[[], Example]
    experiment: Callable[[int], Result]
    contents: Callable[[Example, list[Result]], tuple[str, tuple[Section, ...]]]
    settings: tuple[str, ...]

    def report(self, effort: Effort, on_progress: Progress) -> Report:
        """Compute the chapter and return its report; the experiments have the seeds 1 and up."""
        on_progress("one set of records, as the thesis shows it", 0.0)
        example = self.example()
        results = over_seeds(
            self.experiment,
            range(1, effort.n_seeds + 1),
            n_processes=effort.n_processes,
            on_progress=partial(on_progress, f"{effort.n_seeds} sets of records"),
        )
        verdict, sections = self.contents(example, results)
        return Report(self.title, verdict, sections, self.settings)
