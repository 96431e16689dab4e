"""A table of text, for the command line, reports and pages."""

from dataclasses import dataclass

from sprung.errors import ParameterError


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text.

    Parameters
    ----------
    title
        Title; empty for none.
    columns
        Headings. The first `n_words` columns hold words, and the last one where `ends_in_words`; the others numbers.
    rows
        Cells of each row.
    n_words
        Number of leading columns that hold words.
    ends_in_words
        Whether the last column holds words.
    caption
        Meaning of the columns, in a line under the table; empty for none.

    Raises
    ------
    ParameterError
        If the number of cells in a row differs from the number of columns.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    n_words: int = 1
    ends_in_words: bool = True
    caption: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ParameterError(
                    f"a row of {self.title!r} has {len(row)} cells, but must have {len(self.columns)}: {row}"
                )

    @property
    def shown(self) -> tuple[int, ...]:
        """Columns to show: a column other than the first is left out where all its cells are empty."""
        return tuple(k for k in range(len(self.columns)) if k == 0 or any(row[k].strip() for row in self.rows))

    def has_words(self, column: int) -> bool:
        """Whether a column holds words, not numbers."""
        return column < self.n_words or (self.ends_in_words and column == len(self.columns) - 1)
