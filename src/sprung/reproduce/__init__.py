"""The thesis' tables and figures, computed again: one report for each chapter, the published number beside ours.

References
----------
F. Liu, Online Identification of Vehicle Dynamic Systems for Condition Monitoring, University of Huddersfield (2020).
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

from sprung._checks import check_one_of
from sprung.reproduce.report import Report, render
from sprung.reproduce.runs import Effort, Progress, usual_processes

__all__ = ["CHAPTERS", "Effort", "reproduce"]

#: Titles of the pages by the name of the chapter.
CHAPTERS = MappingProxyType(
    {
        "4": "Chapter 4: CoSS-SSI on a chain of three masses",
        "5": "Chapter 5: harmonics and cepstrum editing on a quarter vehicle",
        "6": "Chapter 6: plate on springs, and a car on the road",
        "7": "Chapter 7: bogie at a scale of 1 to 5 on a roller rig",
        "8": "Chapter 8: Y25 bogie on a full-size roller rig",
        "comparison": "Cov-SSI, ACS-Cov-SSI and CoSS-SSI compared",
    }
)


def reproduce(
    chapters: Sequence[str] = (),
    *,
    directory: str | Path,
    n_seeds: int = 50,
    n_processes: int | None = None,
    on_progress: Progress | None = None,
) -> list[Path]:
    """Write a report for each chapter.

    Parameters
    ----------
    chapters
        Keys of `CHAPTERS`; none: all.
    directory
        Where to; made if it is not there.
    n_seeds
        Runs where the thesis shows one, at least 2.
    n_processes
        Processes to use; None: one for each processor.
    on_progress
        Called with what is being done and how far it is (0 to 1).

    Returns
    -------
    list of pathlib.Path
        The pages, self-contained HTML.
    """
    wanted = tuple(chapters) or tuple(CHAPTERS)
    for chapter in wanted:
        check_one_of("chapter", chapter, CHAPTERS)
    effort = Effort(n_seeds, usual_processes() if n_processes is None else n_processes)
    report = on_progress or (lambda doing, share: None)
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, chapter in enumerate(wanted):

        def on_chapter(doing: str, share: float, number: int = number, chapter: str = chapter) -> None:
            report(f"{_short(chapter)}: {doing}", (number + share) / len(wanted))

        made = _chapter(chapter)(effort, on_chapter)
        path = folder / f"{_file(chapter)}.html"
        others = [(f"{_file(other)}.html", _short(other)) for other in wanted if other != chapter]
        path.write_text(render(made, others=others), encoding="utf-8")
        paths.append(path)
    return paths


def _chapter(chapter: str) -> Callable[[Effort, Progress], Report]:
    """Return the function that makes a chapter's report; its module is imported only now."""
    function: Callable[[Effort, Progress], Report] = import_module(f"sprung.reproduce.{_file(chapter)}").report
    return function


def _file(chapter: str) -> str:
    """Name of a chapter's module and page."""
    return f"chapter_{chapter}" if chapter.isdigit() else chapter


def _short(chapter: str) -> str:
    """Name of a chapter in running text."""
    return f"Chapter {chapter}" if chapter.isdigit() else chapter.capitalize()
