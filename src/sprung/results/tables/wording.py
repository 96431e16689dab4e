"""How numbers, names, times and tables are written wherever people read them; periods of time that they choose."""

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime

from sprung.errors import ParameterError

#: A date without a time, and a day [ns].
_DAY_ALONE, _DAY = re.compile(r"\d{4}-?\d{2}-?\d{2}"), 86400 * 10**9
#: Latest time that columns hold [UTC ns].
_LATEST = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Period:
    """A period, including its ends.

    Parameters
    ----------
    since, until
        Start and end, UTC ns; None: unbounded.

    Raises
    ------
    ParameterError
        If it ends before it begins.
    """

    since: int | None = None
    until: int | None = None

    def __post_init__(self) -> None:
        if self.since is not None and self.until is not None and self.until < self.since:
            begin, end = format_time(self.since), format_time(self.until)
            raise ParameterError(f"the period ends at {end}, before it begins at {begin}: swap since and until")

    def overlaps(self, begin: int, end: int | None) -> bool:
        """Return whether an interval of time (UTC ns; None: no end) overlaps the period."""
        is_early = self.since is not None and end is not None and end < self.since
        return not is_early and (self.until is None or begin <= self.until)


def parse_period(since: str | None, until: str | None) -> Period:
    """Return the period between two times as people write them; a date as its end includes that whole day.

    Raises
    ------
    ParameterError
        If a text is not a time, or the period ends before it begins.

    Examples
    --------
    >>> parse_period("1970-01-02", "1970-01-02")
    Period(since=86400000000000, until=172799999999999)
    """
    end = parse_time("until", until)
    if end is not None and until is not None and _DAY_ALONE.fullmatch(until.strip()):
        end += _DAY - 1
    return Period(parse_time("since", since), end)


def parse_time(name: str, text: str | None) -> int | None:
    """Return a time as people write it, UTC ns; None for no text.

    Parameters
    ----------
    name
        Name of the time, for messages, such as "since".
    text
        Date or date and time of ISO 8601, UTC without an offset of its own, such as "2026-11-21" or
        "2026-11-21T08:30+01:00"; or UTC ns.

    Raises
    ------
    ParameterError
        If it is neither.

    Examples
    --------
    >>> parse_time("since", "1970-01-02"), parse_time("since", "1970-01-01 01:00:01+01:00"), parse_time("since", "7")
    (86400000000000, 1000000000, 7)
    """
    if text is None or not text.strip():
        return None
    words = text.strip()
    try:
        if words.isascii() and words.isdigit() and len(words) != len("20261121"):
            time = int(words)
        else:
            moment = datetime.fromisoformat(words)
            moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment
            time = round(moment.timestamp() * 1e6) * 1000
        if 0 <= time <= _LATEST:
            return time
    except (ValueError, OverflowError):
        pass
    raise ParameterError(f"{name}={words!r} must be a date or time since 1970: write 2026-11-21 or 2026-11-21T08:30")


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


#: Units of ages: name, length, and shortest age in it [s].
_UNITS = (("days", 86400.0, 172800.0), ("h", 3600.0, 7200.0), ("min", 60.0, 60.0))


def format_name(name: str) -> str:
    """Return a name such as "front_left.spring" in words."""
    return name.replace("_", " ").replace(".", " ")


def format_estimate(value: float, deviation: float) -> str:
    """Return a value and its standard deviation, with two significant digits of the deviation.

    References
    ----------
    JCGM 100:2008, Evaluation of measurement data - Guide to the expression of uncertainty in measurement, section 7.2.6
    (at most two significant digits of an uncertainty).

    Examples
    --------
    >>> format_estimate(7.01234, 0.0123), format_estimate(44279.6, 723.4)
    ('7.012 ± 0.012', '44280 ± 720')
    """
    if not (math.isfinite(deviation) and deviation > 0):
        return f"{value:.4g}"
    decimals = min(1 - math.floor(math.log10(deviation)), 6)
    return " ± ".join(f"{round(number, decimals):.{max(decimals, 0)}f}" for number in (value, deviation))


def format_time(time: int) -> str:
    """Return a time (UTC ns) to the minute, such as "2026-11-21 08:30".

    Examples
    --------
    >>> format_time(1_790_000_000_000_000_000)
    '2026-09-21 14:13'
    """
    return f"{datetime.fromtimestamp(time / 1e9, tz=UTC):%Y-%m-%d %H:%M}"


def format_age(time: int, *, now: int) -> str:
    """Return how long ago a time is (both UTC ns), in one unit.

    Examples
    --------
    >>> [format_age(-seconds * 10**9, now=0) for seconds in (5, 90, 7200, 86400 * 3, -300)]
    ['just now', '2 min ago', '2 h ago', '3 days ago', 'in 5 min']
    """
    seconds = abs(now - time) / 1e9
    for name, length, least in _UNITS:
        if seconds >= least:
            words = f"{seconds / length:.0f} {name}"
            return f"{words} ago" if now > time else f"in {words}"
    return "just now"


def format_duration(seconds: float) -> str:
    """Return a duration in its natural unit.

    Examples
    --------
    >>> [format_duration(seconds) for seconds in (90.0, 600.0, 7200.0)]
    ['90 s', '10 min', '2 h']
    """
    if seconds < 120:
        return f"{seconds:.4g} s"
    return f"{seconds / 60:.4g} min" if seconds < 7200 else f"{seconds / 3600:.4g} h"


def format_span(begin: int, end: int) -> str:
    """Return a span of time (UTC ns), such as "2026-11-21 08:30 to 08:40 UTC".

    Examples
    --------
    >>> begin = 1_790_000_000_000_000_000
    >>> format_span(begin, begin + 600_000_000_000)
    '2026-09-21 14:13 to 14:23 UTC'
    >>> format_span(begin, begin + 86_400_000_000_000)
    '2026-09-21 14:13 to 2026-09-22 14:13 UTC'
    """
    first, last = format_time(begin), format_time(end)
    return f"{first} to {last.removeprefix(first[:11])} UTC"
