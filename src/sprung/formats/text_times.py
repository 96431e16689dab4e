"""Time columns of text files: numbers, and dates and times of day in one or two columns."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sprung.errors import FormatError
from sprung.formats.columns import names_time, stated_unit
from sprung.formats.dates import DAY_FIRST, MONTH_FIRST, YEAR_FIRST, possible_orders
from sprung.formats.dialects import Layout
from sprung.formats.settings import ReadSettings
from sprung.formats.table import is_time, split_heading, time_column

#: Date-time that is read as it is.
ISO = re.compile(r"\d{4}-\d\d-\d\d([ T]\d\d:\d\d(:\d\d(\.\d*)?)?)?\s*(?P<zone>Z|[+-]\d\d(:?\d\d)?)?")


@dataclass(frozen=True, slots=True)
class TextTime:
    """Time column of a text file.

    Parameters
    ----------
    indices
        Indices of its one or two columns, such as those of date and time of day.
    order
        Order of day, month and year; empty for numbers and ISO date-times, which are read as they are.
    """

    indices: tuple[int, ...]
    order: str


def named_columns(layout: Layout) -> list[tuple[str, str]]:
    """Return heading and kind of the columns that have a name.

    Parameters
    ----------
    layout
        Layout of the file.
    """
    return [item for item in zip(layout.headings, layout.kinds, strict=True) if item[0]]


def text_time(
    path: Path, layout: Layout, settings: ReadSettings, texts: Callable[[int], Iterable[Any]]
) -> tuple[TextTime | None, list[str]]:
    """Return the time column that names, or texts of dates, show, with notes for the history; None without one.

    Parameters
    ----------
    path
        Path of the file.
    layout
        Layout of the file.
    settings
        Name of the time column and sampling rate, where stated.
    texts
        Function that yields a column, by its index, as arrays of texts.

    Raises
    ------
    FormatError
        If the column holds neither numbers nor dates, or day and month cannot be distinguished and no rate is stated.
    """
    heading = _time_heading(path, layout, settings)
    if heading is None:
        return None, []
    index = layout.headings.index(heading)
    kind = layout.kinds[index]
    if kind == "number":
        return TextTime((index,), ""), []
    if kind == "text":
        raise FormatError(
            f"{path}: time column {heading!r} holds {layout.first_row[index][:40]!r}: write seconds, or date-times as "
            "2024-05-31 12:00:00.250"
        )
    indices: tuple[int, ...] = (index,)
    if kind == "time of day" and "date" in layout.kinds:
        indices = (layout.kinds.index("date"), index)
    elif kind == "date" and "time of day" in layout.kinds:
        indices = (index, layout.kinds.index("time of day"))
    names = " and ".join(repr(layout.headings[k]) for k in indices)
    notes = (
        []
        if is_time(heading) and len(indices) == 1
        else [f"time: {names}, by {'its' if len(indices) == 1 else 'their'} dates and times"]
    )
    if len(indices) == 1 and ISO.fullmatch(layout.first_row[index]):
        return TextTime(indices, ""), notes
    order = _order(texts(indices[0])) if kind != "time of day" or len(indices) == 2 else YEAR_FIRST
    if order is None and settings.sampling_rate is None:
        raise FormatError(
            f"{path}: column {layout.headings[indices[0]]!r} holds dates such as {layout.first_row[indices[0]]!r}, of "
            "which day and month cannot be distinguished: write them as 2024-12-31, or state the sampling rate with "
            "--sampling-rate"
        )
    if order is None:
        return None, [f"dates in {names} left out: day and month cannot be distinguished"]
    if order != YEAR_FIRST:
        notes.append(f"dates in {layout.headings[indices[0]]!r} read as {order}")
    return TextTime(indices, order), notes


def _time_heading(path: Path, layout: Layout, settings: ReadSettings) -> str | None:
    """Return the heading of the time column: stated, by its name, or because it holds dates and times."""
    columns = named_columns(layout)
    named = [heading for heading, _ in columns]
    stated = [name for name in named if settings.time in (name, split_heading(name)[0])]
    if stated:
        return stated[0] if is_time(stated[0]) or layout.kinds[layout.headings.index(stated[0])] != "number" else None
    by_name = time_column(named, path=path, stated=settings.time)
    if by_name is not None or settings.time is not None:
        return by_name
    if any(kind == "number" and names_time(heading) and stated_unit(heading) for heading, kind in columns):
        return None
    texts = {kind: heading for heading, kind in reversed(columns)}
    return texts.get("moment") or texts.get("time of day") or texts.get("date")


def _order(texts: Iterable[Any]) -> str | None:
    """Return the order of day, month and year in a column; None if it does not show."""
    orders = {YEAR_FIRST, DAY_FIRST, MONTH_FIRST}
    for part in texts:
        orders &= possible_orders(part)
        if len(orders) <= 1:
            break
    return next(iter(orders)) if len(orders) == 1 else None
