"""What commands print and write: tables, sentences, JSON, reports and figures, and the progress bar.

Names from files are never interpreted as markup or control sequences.
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure
    from rich.console import Console
    from rich.table import Table as Grid

    from sprung.formats import ReadSettings
    from sprung.results.documents import Document
    from sprung.results.page import Inputs, Report
    from sprung.results.tables import Table

#: Columns where standard output is not a terminal and COLUMNS is not set.
_WIDTH_OF_A_FILE = 120


def write_json(document: "Document | Mapping[str, Any]", path: str) -> None:
    """Write a document to a file, or to standard output where `path` is "-"."""
    from sprung.results.documents import document_text, write_document

    if path == "-":
        sys.stdout.write(document_text(document))
        sys.stdout.flush()
    else:
        write_document(document, path)


def write_result(document: "Document | Mapping[str, Any]", json: str | None) -> bool:
    """Write a result to the path of `--json`, if given; return whether standard output is free for its tables."""
    if json is not None:
        write_json(document, json)
    return json != "-"


def write_pieces(pieces: Iterable[bytes], path: str) -> None:
    """Write the pieces of a text file in UTF-8, or of any file, to a file, or to standard output for "-"."""
    if path == "-":
        for piece in pieces:
            sys.stdout.write(piece.decode())
        sys.stdout.flush()
        return
    with open(path, "wb") as file:
        file.writelines(pieces)


def written(paths: "Iterable[Path | str]", json: str | None = None) -> list[str]:
    """Return a sentence for each file that was written, that of `--json` last."""
    return [f"wrote {path}" for path in (*paths, *([] if json is None else [json]))]


def show(*parts: "Table | Sequence[str]", heading: str = "") -> None:
    """Print tables and lists of sentences, with an empty line between them; an empty list is left out."""
    from sprung.results.tables import Table

    screen = console()
    if heading:
        screen.print(printable(heading), style="bold", soft_wrap=True)
    shown = [part for part in parts if isinstance(part, Table) or part]
    for number, part in enumerate(shown):
        if number:
            screen.print()
        screen.print(grid_of(part) if isinstance(part, Table) else _list(part))
        if isinstance(part, Table) and part.caption:
            screen.print(part.caption, style="dim")


def console() -> "Console":
    """Return the console that prints on standard output."""
    from rich.console import Console

    is_measured = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(markup=False, emoji=False, highlight=False, width=None if is_measured else _WIDTH_OF_A_FILE)


def grid_of(table: "Table") -> "Grid":
    """Return a table as printed: a column other than the first is left out where all its cells are empty."""
    from rich import box
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid(
        title=Text(table.title) if table.title else None,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    cells = [[printable_lines(cell) for cell in row] for row in table.rows]
    for k in table.shown:
        has_words = table.has_words(k)
        grid.add_column(
            table.columns[k], justify="left" if has_words else "right", overflow="fold", no_wrap=not has_words
        )
    for row in cells:
        grid.add_row(*(Text(row[k]) for k in table.shown))
    return grid


def _list(sentences: Iterable[str]) -> "Grid":
    """Return sentences as a list with one bullet each."""
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid.grid(padding=(0, 1))
    for sentence in sentences:
        grid.add_row("-", Text(printable(sentence), overflow="fold"))
    return grid


def printable(text: str) -> str:
    """Return `text` in one line, without control characters."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def printable_lines(text: str) -> str:
    """Return `text` without control characters in its lines."""
    return "\n".join(printable(line) for line in text.split("\n"))


def write_page(
    page: "Path | None",
    report: "Callable[[Inputs], Report]",
    files: "Sequence[Path]",
    *,
    reading: "ReadSettings",
    others: Mapping[str, object],
    has_recordings: bool = True,
) -> "list[Path]":
    """Write a report where one is wanted, and return its path.

    Parameters
    ----------
    page
        File to write; None: no report.
    report
        Function from the facts about the files to the report.
    files
        Recordings, which are read once more for those facts.
    reading
        Settings with which the command reads the files.
    others
        Further files by purpose; None for those not given.
    has_recordings
        Whether the files are recordings; their channels are not listed otherwise.
    """
    if page is None:
        return []
    from sprung.results.page import Inputs, inspected, render

    given = {purpose: str(name) for purpose, name in others.items() if name is not None}
    inputs = Inputs(tuple(files), {}, given)
    if has_recordings:
        inputs = inspected(files, settings=reading, others=given)
    page.write_text(render(report(inputs)), encoding="utf-8")
    return [page]


def write_figures(
    folder: "Path | None", draw: "Callable[[Any], Mapping[str, Figure]]", file_format: str
) -> "list[Path]":
    """Write figures by name where a folder for them is given; `draw` receives `sprung.results.figures`."""
    if folder is None:
        return []
    from sprung.results import figures

    return figures.saving.save(draw(figures), folder, file_format=file_format)


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Yield a callback that receives the current step and the share that is done (0 to 1; 0 if unknown)."""
    if not sys.stderr.isatty():
        yield lambda step, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)
        yield lambda step, share: bar.update(
            task, description=printable(step), completed=share, total=1.0 if share else None
        )
