"""Plain text and tables on standard output; names from files are never interpreted as markup or control sequences."""

import os
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from sprung import tables

#: Columns where standard output is not a terminal and COLUMNS is not set.
_WIDTH_OF_A_FILE = 120


def printable(text: str) -> str:
    """Return `text` in one line, without control characters."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def printable_lines(text: str) -> str:
    """Return `text` without control characters in its lines."""
    return "\n".join(printable(line) for line in text.split("\n"))


def console() -> "Console":
    """Return the console that prints on standard output."""
    from rich.console import Console

    is_measured = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(markup=False, emoji=False, highlight=False, width=None if is_measured else _WIDTH_OF_A_FILE)


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, n_words: int = 1) -> "Table":
    """Return a table.

    Parameters
    ----------
    title
        Title; "" for none.
    columns
        Headings. The first `n_words` columns and the last one hold words, the others numbers.
    rows
        Cells. A column other than the first is omitted where all its cells are empty.
    n_words
        Number of leading columns that hold words.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(
        title=Text(title) if title else None,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    cells = [[printable_lines(cell) for cell in row] for row in rows]
    kept = [k for k in range(len(columns)) if k == 0 or any(row[k] for row in cells)]
    for k in kept:
        has_words = k < n_words or k == len(columns) - 1
        grid.add_column(columns[k], justify="left" if has_words else "right", overflow="fold", no_wrap=not has_words)
    for row in cells:
        grid.add_row(*(Text(row[k]) for k in kept))
    return grid


def rich_table(content: "tables.Table") -> "Table":
    """Return the table of a result as printed."""
    return table(content.title, content.columns, content.rows, n_words=content.n_words)


def notes(sentences: Iterable[str]) -> "Table":
    """Return sentences as a list with one bullet each."""
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 1))
    for sentence in sentences:
        grid.add_row("-", Text(printable(sentence), overflow="fold"))
    return grid
