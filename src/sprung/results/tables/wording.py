"""How numbers, names and times are written wherever people read them."""

import math
from datetime import UTC, datetime

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
