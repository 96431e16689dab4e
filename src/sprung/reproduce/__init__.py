"""Tables and figures of the thesis, recomputed: a report for each chapter, published numbers next to ours.

References
----------
F. Liu, Online Identification of Vehicle Dynamic Systems for Condition Monitoring, University of Huddersfield (2020).
"""

from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sprung._checks import check_one_of
from sprung.reproduce import chapter_4, chapter_5, chapter_6, chapter_7, chapter_8, comparison
from sprung.reproduce.chapter import Chapter, Effort, Progress, default_processes
from sprung.results.page.page import render

__all__ = ["CHAPTERS", "Effort", "reproduce"]

#: Chapters by their names.
CHAPTERS: MappingProxyType[str, Chapter[Any, Any]] = MappingProxyType(
    {
        "4": chapter_4.CHAPTER,
        "5": chapter_5.CHAPTER,
        "6": chapter_6.CHAPTER,
        "7": chapter_7.CHAPTER,
        "8": chapter_8.CHAPTER,
        "comparison": comparison.CHAPTER,
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
    """Write an HTML page for each chapter.

    Parameters
    ----------
    chapters
        Names of chapters, keys of `CHAPTERS`; none: all.
    directory
        Folder for the pages, created where it does not exist.
    n_seeds
        Number of runs where the thesis shows one, at least 2.
    n_processes
        Number of processes; None: one for each processor.
    on_progress
        Function called with the current step and the progress from 0 to 1.

    Returns
    -------
    list of pathlib.Path
        Paths of the pages, self-contained HTML.

    Raises
    ------
    ParameterError
        If there is no chapter of a name.

    Examples
    --------
    The page of a chapter, with ten runs where the thesis shows one, takes minutes:

    >>> from sprung.reproduce import CHAPTERS
    >>> list(CHAPTERS)
    ['4', '5', '6', '7', '8', 'comparison']
    >>> reproduce(["4"], directory="pages", n_seeds=10)  # doctest: +SKIP
    [PosixPath('pages/chapter_4.html')]
    """
    wanted = tuple(chapters) or tuple(CHAPTERS)
    for chapter in wanted:
        check_one_of("chapter", chapter, CHAPTERS)
    effort = Effort(n_seeds, default_processes() if n_processes is None else n_processes)
    report = on_progress or (lambda doing, share: None)
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, chapter in enumerate(wanted):

        def on_chapter(doing: str, share: float, number: int = number, chapter: str = chapter) -> None:
            report(f"{_short(chapter)}: {doing}", (number + share) / len(wanted))

        page = CHAPTERS[chapter].report(effort, on_chapter)
        path = folder / f"{_file(chapter)}.html"
        others = [(f"{_file(other)}.html", _short(other)) for other in wanted if other != chapter]
        path.write_text(render(page, others=others), encoding="utf-8")
        paths.append(path)
    return paths


def _file(chapter: str) -> str:
    """Return the name of a chapter's page."""
    return f"chapter_{chapter}" if chapter.isdigit() else chapter


def _short(chapter: str) -> str:
    """Return the name of a chapter in running text."""
    return f"Chapter {chapter}" if chapter.isdigit() else chapter.capitalize()
