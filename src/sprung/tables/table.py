"""A table of text, for the command line, reports and pages."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text.

    Parameters
    ----------
    title
        Title; empty for none.
    columns
        Headings. The first `n_words` columns and the last one hold words, the others numbers.
    rows
        Cells of each row.
    n_words
        Number of leading columns that hold words.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    n_words: int = 1


def in_words(name: str) -> str:
    """Return a name such as "front_left.spring" in words."""
    return name.replace("_", " ").replace(".", " ")
