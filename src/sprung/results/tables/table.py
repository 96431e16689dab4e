"""A table of text, for the command line, reports and pages."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime

from sprung.errors import ParameterError

#: Units of ages: name, length, and shortest age in it [s].
_UNITS = (("days", 86400.0, 172800.0), ("h", 3600.0, 7200.0), ("min", 60.0, 60.0))


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


def in_words(name: str) -> str:
    """Return a name such as "front_left.spring" in words."""
    return name.replace("_", " ").replace(".", " ")


def with_deviation(value: float, deviation: float) -> str:
    """Return a value and its standard deviation, with two significant digits of the deviation.

    References
    ----------
    JCGM 100:2008, Evaluation of measurement data - Guide to the expression of uncertainty in measurement, section 7.2.6
    (at most two significant digits of an uncertainty).

    Examples
    --------
    >>> with_deviation(7.01234, 0.0123), with_deviation(44279.6, 723.4)
    ('7.012 ± 0.012', '44280 ± 720')
    """
    if not (math.isfinite(deviation) and deviation > 0):
        return f"{value:.4g}"
    decimals = min(1 - math.floor(math.log10(deviation)), 6)
    return " ± ".join(f"{round(number, decimals):.{max(decimals, 0)}f}" for number in (value, deviation))


def time_in_words(time: int) -> str:
    """Return a time (UTC ns) to the minute, such as "2026-11-21 08:30".

    Examples
    --------
    >>> time_in_words(1_790_000_000_000_000_000)
    '2026-09-21 14:13'
    """
    return f"{datetime.fromtimestamp(time / 1e9, tz=UTC):%Y-%m-%d %H:%M}"


def age_in_words(time: int, *, now: int) -> str:
    """Return how long ago a time is (both UTC ns), in one unit.

    Examples
    --------
    >>> [age_in_words(-seconds * 10**9, now=0) for seconds in (5, 90, 7200, 86400 * 3, -300)]
    ['just now', '2 min ago', '2 h ago', '3 days ago', 'in 5 min']
    """
    seconds = abs(now - time) / 1e9
    for name, length, least in _UNITS:
        if seconds >= least:
            words = f"{seconds / length:.0f} {name}"
            return f"{words} ago" if now > time else f"in {words}"
    return "just now"


def duration_in_words(seconds: float) -> str:
    """Return a duration in its natural unit.

    Examples
    --------
    >>> [duration_in_words(seconds) for seconds in (90.0, 600.0, 7200.0)]
    ['90 s', '10 min', '2 h']
    """
    if seconds < 120:
        return f"{seconds:.4g} s"
    return f"{seconds / 60:.4g} min" if seconds < 7200 else f"{seconds / 3600:.4g} h"


def span_in_words(begin: int, end: int) -> str:
    """Return a span of time (UTC ns), such as "2026-11-21 08:30 to 08:40 UTC".

    Examples
    --------
    >>> begin = 1_790_000_000_000_000_000
    >>> span_in_words(begin, begin + 600_000_000_000)
    '2026-09-21 14:13 to 14:23 UTC'
    >>> span_in_words(begin, begin + 86_400_000_000_000)
    '2026-09-21 14:13 to 2026-09-22 14:13 UTC'
    """
    first, last = time_in_words(begin), time_in_words(end)
    return f"{first} to {last.removeprefix(first[:11])} UTC"
