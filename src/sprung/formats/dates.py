"""Dates and times of day in text, such as 2024-12-31 13:05:01,25, 31.12.2024 13:05:01, 12/31/2024 1:05:01.25 PM."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

_PATTERN = (
    r"^\s*(?:(?P<first>\d{1,4})(?P<mark>[./-])(?P<second>\d{1,2})[./-](?P<third>\d{1,4}))?[T ,_]*"
    r"(?:(?P<hour>\d{1,2}):(?P<minute>\d{1,2})(?::(?P<whole>\d{2})(?:[.,:](?P<fraction>\d+))?)?"
    r"|(?P<minutes>\d{1,3}):(?P<rest>\d{2})[.,](?P<part>\d+))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)?\s*$"
)
_MOMENT = re.compile(_PATTERN)
#: Orders of day, month and year.
YEAR_FIRST, DAY_FIRST, MONTH_FIRST = "year-month-day", "day.month.year", "month/day/year"
_NANOSECONDS = {"hour": 3_600_000_000_000, "minute": 60_000_000_000, "second": 1_000_000_000}


def kind_of(text: str) -> str | None:
    """Return "moment", "date" or "time of day" for a text that holds one; None for any other."""
    match = _MOMENT.match(text)
    if match is None:
        return None
    has_time = match["hour"] is not None or match["minutes"] is not None
    if match["first"] is None:
        return "time of day" if has_time else None
    return "moment" if has_time else "date"


def possible_orders(texts: Any) -> set[str]:
    """Return the orders of day, month and year that texts may have; none if they are at odds.

    Parameters
    ----------
    texts
        Array of texts (Arrow), consecutive rows of a column.

    Notes
    -----
    A year in front is followed by month and day; parts between points are day, month and year. Between strokes and
    hyphens a part above 12 is a day, AM and PM are American, and of two parts the one that changes while the other
    stays is the day.
    """
    import pyarrow.compute as pc

    fields = _fields(texts)
    first, second = _numbers(fields["first"]), _numbers(fields["second"])
    is_date = first > 0
    if not is_date.any():
        return {YEAR_FIRST, DAY_FIRST, MONTH_FIRST}
    first, second = first[is_date], second[is_date]
    if np.any(first > 31):
        return {YEAR_FIRST}
    if pc.any(pc.equal(fields["mark"], ".")).as_py():
        return {DAY_FIRST}
    orders = {DAY_FIRST, MONTH_FIRST}
    first_changes, second_changes = np.ptp(first) > 0, np.ptp(second) > 0
    if np.any(first > 12) or (first_changes and not second_changes):
        orders -= {MONTH_FIRST}
    if np.any(second > 12) or (second_changes and not first_changes):
        orders -= {DAY_FIRST}
    if len(orders) == 2 and pc.any(pc.not_equal(fields["half"], "")).as_py():
        orders -= {DAY_FIRST}
    return {DAY_FIRST} if len(orders) == 2 and np.array_equal(first, second) else orders


def moments(texts: Any, order: str) -> NDArray[Any]:
    """Return dates and times as UTC, those without a date as durations since midnight.

    Parameters
    ----------
    texts
        Array of texts (Arrow).
    order
        Order of day, month and year.

    Returns
    -------
    numpy.ndarray
        `M8[ns]` where any text has a date, else `m8[ns]`; NaT where a text holds neither.
    """
    import pyarrow.compute as pc

    fields = _fields(texts)
    hour = _numbers(fields["hour"])
    half = pc.utf8_lower(pc.utf8_slice_codeunits(fields["half"], 0, 1)).to_numpy(zero_copy_only=False)
    hour = np.where(half == "", hour, hour % 12 + 12 * (half == "p"))
    nanoseconds = (
        hour * _NANOSECONDS["hour"]
        + (_numbers(fields["minute"]) + _numbers(fields["minutes"])) * _NANOSECONDS["minute"]
        + (_numbers(fields["whole"]) + _numbers(fields["rest"])) * _NANOSECONDS["second"]
        + _numbers(_nine_digits(fields["fraction"]))
        + _numbers(_nine_digits(fields["part"]))
        - _offsets(fields["zone"])
    )
    is_text = np.asarray(pc.is_valid(fields["first"]))
    first, second, third = (_numbers(fields[name]) for name in ("first", "second", "third"))
    times = nanoseconds.astype("m8[ns]")
    if np.any(first > 0):
        year, month, day = {
            YEAR_FIRST: (first, second, third),
            DAY_FIRST: (third, second, first),
            MONTH_FIRST: (third, first, second),
        }[order]
        year = np.where(year < 100, year + 2000, year)
        is_text &= (month >= 1) & (month <= 12) & (day >= 1) & (day <= 31)
        months = ((year - 1970) * 12 + month - 1).astype("M8[M]")
        times = (months.astype("M8[D]") + (day - 1)).astype("M8[ns]") + times
    return np.where(is_text, times, np.array("NaT", dtype=times.dtype))


def _fields(texts: Any) -> dict[str, Any]:
    """Return the named parts of texts; empty where a text lacks a part, null where it is no date or time."""
    import pyarrow.compute as pc

    parts = pc.extract_regex(texts, _PATTERN)
    return {name: pc.struct_field(parts, name) for name in _MOMENT.groupindex}


def _numbers(digits: Any) -> NDArray[np.int64]:
    """Return whole numbers; 0 for an empty text."""
    import pyarrow as pa
    import pyarrow.compute as pc

    plain = pc.if_else(pc.equal(pc.fill_null(digits, ""), ""), "0", pc.fill_null(digits, "0"))
    numbers: NDArray[np.int64] = pc.cast(plain, pa.int64()).to_numpy(zero_copy_only=False)
    return numbers


def _nine_digits(fraction: Any) -> Any:
    """Return a decimal fraction as nanoseconds."""
    import pyarrow.compute as pc

    return pc.utf8_slice_codeunits(pc.utf8_rpad(pc.fill_null(fraction, ""), 9, "0"), 0, 9)


def _offsets(zone: Any) -> NDArray[np.int64]:
    """Return the offsets of time zones from UTC [ns]."""
    codes = zone.dictionary_encode()
    if hasattr(codes, "combine_chunks"):
        codes = codes.combine_chunks()
    offsets = [_offset(text or "") for text in codes.dictionary.to_pylist()]
    indices = codes.indices.fill_null(0).to_numpy(zero_copy_only=False)
    return np.array(offsets or [0], dtype=np.int64)[indices]


def _offset(zone: str) -> int:
    """Return the offset of one time zone from UTC [ns]."""
    if zone[:1] not in {"+", "-"}:
        return 0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    minutes = 60 * int(digits[:2]) + int(digits[2:])
    return (minutes if zone[0] == "+" else -minutes) * _NANOSECONDS["minute"]
