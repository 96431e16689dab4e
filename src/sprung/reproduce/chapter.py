"""Skeleton of a chapter: one example, the same experiment with many seeds, and the contents of the page."""

import math
import multiprocessing
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from typing import Any, Generic, TypeVar

from sprung._checks import check_number
from sprung.results.page.page import Report, Section

Result = TypeVar("Result")
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Effort:
    """Computing effort for a report.

    Parameters
    ----------
    n_seeds
        Number of runs where the thesis shows one, at least 2.
    n_processes
        Number of processes, at least 1.

    Raises
    ------
    ParameterError
        If the number of seeds is below 2, or that of processes below 1.
    """

    n_seeds: int = 50
    n_processes: int = 1

    def __post_init__(self) -> None:
        check_number("n_seeds", self.n_seeds, at_least=2)
        check_number("n_processes", self.n_processes, at_least=1)


def over_seeds(
    experiment: Callable[[int], Result],
    seeds: Sequence[int],
    *,
    n_processes: int = 1,
    on_progress: Callable[[float], None] | None = None,
) -> list[Result]:
    """Return the result of an experiment for each seed, in the order of the seeds.

    Parameters
    ----------
    experiment
        Function of a seed, defined in a module or a `functools.partial` of such a function: it is sent to other
        processes.
    seeds
        Seeds of the runs.
    n_processes
        Number of processes, at least 1; with 1 everything runs in this process. The results are the same.
    on_progress
        Function called with the share of the runs that are done.
    """
    check_number("n_processes", n_processes, at_least=1)
    report = on_progress or (lambda share: None)
    results: dict[int, Result] = {}
    if n_processes == 1:
        for number, seed in enumerate(seeds):
            results[number] = experiment(seed)
            report(len(results) / len(seeds))
    else:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(n_processes, mp_context=context, initializer=_one_thread) as pool:
            numbers = {pool.submit(experiment, seed): number for number, seed in enumerate(seeds)}
            for future in as_completed(numbers):
                results[numbers[future]] = future.result()
                report(len(results) / len(seeds))
    return [results[number] for number in range(len(seeds))]


def default_processes() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _one_thread() -> None:
    """Keep numerical libraries that are loaded later to one thread: the processes share the machine."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"


@cache
def data(name: str) -> Mapping[str, Any]:
    """Return the tables of one of the files beside this module: `published` numbers, or records and prose of `chapters`."""
    return tomllib.loads(files("sprung.reproduce").joinpath(f"{name}.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True, slots=True)
class SetUp:
    """Records of a chapter: sampling rate [Hz], duration [s], number, block rows, length of segments and lifter [s]."""

    rate: float
    duration: float
    n_records: int
    rows: tuple[int, int]
    segment: float = math.nan
    quefrency: float = math.nan


def set_up(chapter: str, records: str = "records") -> SetUp:
    """Return the records of a chapter."""
    fields = data("chapters")[chapter][records]
    return SetUp(**{**fields, "rows": tuple(fields["rows"])})


Example = TypeVar("Example")


@dataclass(frozen=True, eq=False, slots=True)
class Chapter(Generic[Example, Result]):
    """A chapter of the thesis, as functions that compute and describe it; its prose is in `chapters.toml`.

    Parameters
    ----------
    name
        Name of its table there, and of its file.
    example
        Returns one set of records as the thesis shows it, with what is identified in it.
    experiment
        Returns the result of one set of records for a seed; a function of a module, sent to other processes.
    contents
        Returns the values in the verdict and the sections, from the example and the results of all seeds.
    """

    name: str
    example: Callable[[], Example]
    experiment: Callable[[int], Result]
    contents: Callable[[Example, list[Result]], tuple[Mapping[str, object], tuple[Section, ...]]]

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
        values, sections = self.contents(example, results)
        prose = data("chapters")
        own = prose[self.name]
        given = {"thresholds": prose["thresholds"], **own.get("records", {})}
        settings = [sentence.format(**given) for sentence in own["settings"].splitlines()]
        command = f"Command: sprung reproduce {self.name.removeprefix('chapter_')} --out DIR"
        return Report(own["title"], own["verdict"].format(**values), sections, (*settings, command))
