"""Periods of time that people choose."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime

from sprung.errors import ParameterError
from sprung.results.tables.wording import format_time

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
