"""LabVIEW measurement files (LVM): text in segments, each with a header for its channels."""

import mmap
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sprung._arrays import Real
from sprung.errors import FormatError
from sprung.formats import csv
from sprung.formats.clock import neat_rate
from sprung.formats.dialects import Layout
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import (
    column_group,
    decoded,
    described,
    distinct,
    half_digit,
    mapped,
    plain,
    utc,
    whole_lines,
)
from sprung.formats.table import Block, Group, is_number, reported, stated_column, within

NAME, EXTRA = "a LabVIEW measurement", None
ENDINGS = (".lvm",)

_SIGNATURE = b"LabVIEW Measurement"
_END_OF_HEADER = b"***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}
_LONGEST_LINE = 1_048_576
_MOMENT = re.compile(r"(\d{4})/(\d\d?)/(\d\d?) (\d\d?):(\d\d):(\d\d)(?:[.,](\d+))?")
_NOTES = ("Description", "Notes", "Project", "Test_Name", "Test_Series", "Test_Numbers", "UUT_Name", "Model_Number")


@dataclass(frozen=True, slots=True)
class _Heading:
    """Header of one channel in a segment."""

    name: str
    unit: str
    n_samples: str
    step: str
    first: float
    start: int | None
    x: int | None  #: Index of the field with its times.
    y: int  #: Index of the field with its values.


@dataclass(frozen=True, slots=True)
class _Segment:
    """Channels of a segment, the layout of its rows, where they end in the file [bytes], and a comment."""

    headings: tuple[_Heading, ...]
    layout: Layout
    end: int
    comment: str


@dataclass(frozen=True, slots=True)
class _Dialect:
    """Characters between fields and before decimals, columns of times ("no", "one", "multi"), comment."""

    separator: str
    decimal: str
    x_columns: str
    comment: str


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of LVM."""
    return head.startswith(_SIGNATURE)


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the channels of an LVM file that have the same times in one group.

    Segments with the same channels follow one another, with gaps between them where their times leave some. Channels
    without samples are left out. Dates have no zone and count as UTC. Times are those of the columns `X_Value` where
    there are some, otherwise X0 and Delta_X.

    Raises
    ------
    FormatError
        If the file is damaged.
    """
    with reported(path, NAME), mapped(path) as content:
        dialect, segments = _contents(path, content)
    families: dict[tuple[object, ...], list[tuple[_Segment, list[int]]]] = {}
    for segment in segments:
        members: dict[tuple[object, ...], list[int]] = {}
        for index, heading in enumerate(segment.headings):
            members.setdefault((heading.n_samples, heading.step, heading.first, heading.start), []).append(index)
        for indices in members.values():
            own = [segment.headings[index] for index in indices]
            family = (own[0].step, *((heading.name, heading.unit) for heading in own))
            families.setdefault(family, []).append((segment, indices))
    if not families:
        raise FormatError(f"{path} holds no samples: no segment has a channel with samples")
    names = [path.name] if len(families) == 1 else distinct([_group_name(parts) for parts in families.values()])
    return tuple(_group(path, name, dialect, parts) for name, parts in zip(names, families.values(), strict=True))


def _line_end(path: Path, content: mmap.mmap, begin: int) -> int:
    """Return the offset after the line that begins at `begin`."""
    end = content.find(b"\n", begin, begin + _LONGEST_LINE) + 1
    if not end and len(content) - begin > _LONGEST_LINE:
        raise FormatError(f"{path} has a line of more than {_LONGEST_LINE} bytes: this is not a LabVIEW measurement")
    return end or len(content)


def _contents(path: Path, content: mmap.mmap) -> tuple[_Dialect, list[_Segment]]:
    """Return the dialect of a file and its segments."""
    ends = []
    position = content.find(_END_OF_HEADER)
    while position >= 0:
        if content[max(0, position - 1) : position] in {b"\n", b""}:
            ends.append(position)
        position = content.find(_END_OF_HEADER, position + 1)
    if len(ends) < 2:
        raise FormatError(
            f"{path} cannot be read as a LabVIEW measurement: it has {len(ends)} header, but needs those of the file "
            "and of a segment: the file is incomplete"
        )
    begins = [_header_begin(content, end) for end in ends[1:]]
    dialect = _dialect(path, content[: min(ends[0], _LONGEST_LINE)], content, ends[1])
    segments = [
        _segment(path, content, dialect, (begin, end, until))
        for begin, end, until in zip(begins, ends[1:], [*begins[1:], len(content)], strict=True)
    ]
    return dialect, segments


def _header_begin(content: mmap.mmap, end: int) -> int:
    """Return the offset of the first line of the header that ends at `end`: lines that begin with a letter."""
    begin = end
    while begin > 0 and end - begin < _LONGEST_LINE:
        previous = content.rfind(b"\n", max(0, begin - _LONGEST_LINE), begin - 1) + 1
        if not content[previous : previous + 1].isalpha():
            break
        begin = previous
    return begin


def _dialect(path: Path, head: bytes, content: mmap.mmap, end: int) -> _Dialect:
    """Return the dialect that the header of the file states; the first row decides where it leaves the decimal out."""
    separator = "\t" if b"Separator\t" in head or b"Separator," not in head else ","
    fields = dict(line.split(separator, 1) for line in decoded(head).splitlines() if separator in line)
    stated = {key.strip(): value.strip().strip(separator) for key, value in fields.items()}
    separator = _SEPARATORS.get(stated.get("Separator", "Tab").lower(), separator)
    names_begin = _line_end(path, content, end)
    row_begin = _line_end(path, content, names_begin)
    row = content[row_begin : _line_end(path, content, row_begin)]
    decimal = stated.get("Decimal_Separator") or ("," if separator != "," and b"," in row else ".")
    if decimal not in {".", ","} or decimal == separator:
        raise FormatError(f"{path} states the decimal separator {decimal!r}: it must be a point or a comma")
    notes = [stated[key] for key in _NOTES if key in stated]
    operator = f"operator {stated['Operator']}" if stated.get("Operator") else ""
    return _Dialect(separator, decimal, stated.get("X_Columns", "One").lower(), described(*notes, operator))


def _segment(path: Path, content: mmap.mmap, dialect: _Dialect, extent: tuple[int, int, int]) -> _Segment:
    """Return a segment from the offsets of its header, of the end of its header, and of the next segment."""
    begin, end, until = extent
    lines = [line.split(dialect.separator) for line in decoded(content[begin:end]).splitlines()]
    stated = {fields[0].strip(): [field.strip() for field in fields[1:]] for fields in lines}
    names_begin = _line_end(path, content, end)
    rows_begin = _line_end(path, content, names_begin)
    names, first_row = (
        [field.strip() for field in decoded(content[first : _line_end(path, content, first)]).split(dialect.separator)]
        for first in (names_begin, rows_begin)
    )
    has_comment = names[-1] == "Comment"
    pitch = 2 if dialect.x_columns == "multi" else 1
    headings = []
    for y in range(1, len(names) - has_comment, pitch):
        x = None if dialect.x_columns == "no" else 0 if pitch == 1 else y - 1
        heading = _heading(path, stated, y - 1, dialect.decimal, (names[y], x, y))
        if heading.n_samples != "0":
            headings.append(heading)
    labels = distinct([heading.name for heading in headings])
    remark = first_row[len(names) - 1] if has_comment and len(first_row) >= len(names) else ""
    return _Segment(
        tuple(replace(heading, name=label) for label, heading in zip(labels, headings, strict=True)),
        Layout(
            delimiter=dialect.separator,
            decimal=dialect.decimal,
            headings=tuple(names),
            kinds=("number",) * len(names),
            first_line=1,
            offset=rows_begin,
            first_row=tuple(first_row),
            is_ragged=True,
        ),
        max(rows_begin, until),
        described(*(" ".join(stated[key]) for key in _NOTES if key in stated), remark),
    )


def _heading(
    path: Path, stated: dict[str, list[str]], index: int, decimal: str, column: tuple[str, int | None, int]
) -> _Heading:
    """Return the header of the channel whose entries are the ones at `index`."""

    def entry(key: str) -> str:
        entries = stated.get(key, [])
        return entries[index] if index < len(entries) else ""

    first, step = (entry(key).replace(decimal, ".").replace(",", ".") for key in ("X0", "Delta_X"))
    if not all(is_number(text) for text in (first or "0", step or "1")):
        raise FormatError(f"{path}: channel {column[0]!r} has X0 {first!r} and Delta_X {step!r}: both must be numbers")
    return _Heading(
        name=plain(column[0]) or f"channel_{column[2]}",
        unit=plain(entry("Y_Unit_Label")),
        n_samples=entry("Samples"),
        step=step,
        first=float(first or 0),
        start=_start(entry("Date"), entry("Time")),
        x=column[1],
        y=column[2],
    )


def _start(date: str, time: str) -> int | None:
    """Return a date and a time of day as UTC in nanoseconds since 1970; None without them."""
    match = _MOMENT.fullmatch(f"{date} {time}")
    return utc(*match.groups()[:6], fraction=match[7]) if match else None


def _rate(heading: _Heading) -> float | None:
    """Return the sampling rate of Delta_X [Hz]: the roundest one that its digits allow."""
    step = float(heading.step or 0)
    if not 0 < step < np.inf:
        return None
    return neat_rate(step, half_digit(heading.step))


def _group_name(parts: Sequence[tuple[_Segment, list[int]]]) -> str:
    """Return a name for one of several groups."""
    segment, indices = parts[0]
    heading = segment.headings[indices[0]]
    rate = _rate(heading)
    texts = ["" if rate is None else f"{rate:.6g} Hz", f"{heading.n_samples} samples" if heading.n_samples else ""]
    return ", ".join(text for text in texts if text) or "segment"


def _group(path: Path, name: str, dialect: _Dialect, parts: Sequence[tuple[_Segment, list[int]]]) -> Group:
    """Return a group of channels in one or several segments."""
    segment, indices = parts[0]
    headings = [segment.headings[index] for index in indices]
    columns = [stated_column(heading.name, heading.name, heading.unit) for heading in headings]
    lead = headings[0]
    rate = _rate(lead)
    has_times = lead.x is not None or len(parts) > 1
    if not has_times and rate is None:
        raise FormatError(f"{path}: channel {lead.name!r} has neither times nor a Delta_X above 0: export it again")
    comment = described(
        dialect.comment, *(part.comment for part, _ in parts), "start in local time" if lead.start is not None else ""
    )

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        own = [(part, [part.headings[each[k]] for k in indices]) for part, each in parts]
        return within(_blocks(path, own, has_times=has_times), first, last)

    return column_group(
        path,
        name,
        columns,
        rows,
        clock=name,
        sampling_rate=None if has_times else rate,
        time_heading="X_Value [s]" if has_times else None,
        row_word="line",
        start=lead.start if lead.start is None or has_times else lead.start + round(1e9 * lead.first),
        comment=comment,
    )


def _blocks(path: Path, parts: Sequence[tuple[_Segment, list[_Heading]]], *, has_times: bool) -> Iterator[Block]:
    """Yield the rows of some channels in the segments, numbered by their lines."""
    import pyarrow as pa

    origin = parts[0][1][0].start
    n_lines, place = 0, 0
    for segment, headings in parts:
        lead = headings[0]
        offset = 0.0 if origin is None or lead.start is None else (lead.start - origin) * 1e-9
        step = 1 / (_rate(lead) or np.nan)
        with mapped(path) as content:
            n_lines += sum(piece.count(b"\n") for _, piece in whole_lines(content, place, segment.layout.offset))
        place = segment.layout.offset
        layout = replace(segment.layout, first_line=1 + n_lines)
        indices = [heading.y for heading in headings]
        clocks = [heading.x for heading in headings if heading.x is not None]
        n_done = 0
        for line, table in csv.tables(path, layout, dict.fromkeys([*clocks, *indices], pa.float64()), segment.end):
            stamps: Real | None = None
            if clocks:
                xs = csv.numbers(table, clocks)
                _check_times(path, headings, xs)
                stamps = offset + xs[0]
            elif has_times:
                stamps = offset + lead.first + step * np.arange(n_done, n_done + table.num_rows, dtype=np.float64)
            n_done += table.num_rows
            yield Block(line, stamps, csv.numbers(table, indices))


def _check_times(path: Path, headings: Sequence[_Heading], xs: Real) -> None:
    """Raise if channels have different times."""
    for heading, x in zip(headings[1:], xs[1:], strict=True):
        if np.any(x != xs[0], where=~(np.isnan(x) | np.isnan(xs[0]))):
            raise FormatError(
                f"{path}: channels {headings[0].name!r} and {heading.name!r} have different times: choose channels "
                "with a common time base with --channels"
            )
