"""LabVIEW measurement files (LVM): text in segments, each with a header for its channels."""

import mmap
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sprung._arrays import Real
from sprung.errors import FormatError
from sprung.formats.clock import neat_rate
from sprung.formats.dialects import parsed
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group, decoded, described, distinct, half_digit, mapped, plain, whole_lines
from sprung.formats.table import Block, Group, is_number, reported, stated_column, within

NAME, EXTRA = "a LabVIEW measurement", None
ENDINGS = (".lvm",)

_SIGNATURE = b"LabVIEW Measurement"
_END_OF_HEADER = b"***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}
_LONGEST_LINE = 1_048_576
_DATE = re.compile(r"(\d{4})/(\d\d?)/(\d\d?)")
_TIME = re.compile(r"(\d\d?):(\d\d):(\d\d)(?:[.,](\d+))?")
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
    """Channels of a segment, and where its rows are in the file [bytes]."""

    headings: tuple[_Heading, ...]
    n_fields: int
    begin: int
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
    names = [name.strip() for name in decoded(content[names_begin:rows_begin]).strip("\r\n").split(dialect.separator)]
    has_comment = names[-1] == "Comment"
    pitch = 2 if dialect.x_columns == "multi" else 1
    headings = []
    for y in range(1, len(names) - has_comment, pitch):
        x = None if dialect.x_columns == "no" else 0 if pitch == 1 else y - 1
        heading = _heading(path, stated, y - 1, dialect.decimal, (names[y], x, y))
        if heading.n_samples != "0":
            headings.append(heading)
    labels = distinct([heading.name for heading in headings])
    first_row = (
        decoded(content[rows_begin : _line_end(path, content, rows_begin)]).strip("\r\n").split(dialect.separator)
    )
    remark = first_row[len(names) - 1] if has_comment and len(first_row) >= len(names) else ""
    notes = described(*(" ".join(stated[key]) for key in _NOTES if key in stated), remark)
    named = tuple(replace(heading, name=label) for label, heading in zip(labels, headings, strict=True))
    return _Segment(named, len(names), rows_begin, max(rows_begin, until), notes)


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
    day, clock = _DATE.fullmatch(date), _TIME.fullmatch(time)
    if day is None or clock is None:
        return None
    with suppress(ValueError):
        year, month, number = map(int, day.groups())
        moment = np.datetime64(f"{year:04d}-{month:02d}-{number:02d}T{int(clock[1]):02d}:{clock[2]}:{clock[3]}", "s")
        return int(moment.astype(np.int64)) * 10**9 + int((clock[4] or "").ljust(9, "0")[:9])
    return None


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
        return within(_blocks(path, dialect, own, has_times=has_times), first, last)

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


def _blocks(
    path: Path, dialect: _Dialect, parts: Sequence[tuple[_Segment, list[_Heading]]], *, has_times: bool
) -> Iterator[Block]:
    """Yield the rows of some channels in the segments, numbered by their lines."""
    origin = parts[0][1][0].start
    with reported(path, NAME), mapped(path) as content:
        for segment, headings in parts:
            lead = headings[0]
            offset = 0.0 if origin is None or lead.start is None else (lead.start - origin) * 1e-9
            n_done = 0
            for line, piece in _pieces(content, segment):
                numbers = _numbers(path, dialect, segment, headings, (line, piece))
                xs = [numbers[2 * k] for k in range(len(headings)) if headings[k].x is not None]
                values = numbers[1::2]
                stamps: Real | None = None
                if xs:
                    _check_times(path, headings, xs)
                    stamps = offset + xs[0]
                elif has_times:
                    step = 1 / (_rate(lead) or np.nan)
                    stamps = offset + lead.first + step * np.arange(n_done, n_done + values.shape[1], dtype=np.float64)
                n_done += values.shape[1]
                yield Block(line, stamps, values)


def _check_times(path: Path, headings: Sequence[_Heading], xs: Sequence[Real]) -> None:
    """Raise if channels have different times."""
    for heading, x in zip(headings[1:], xs[1:], strict=True):
        if np.any(x != xs[0], where=~(np.isnan(x) | np.isnan(xs[0]))):
            raise FormatError(
                f"{path}: channels {headings[0].name!r} and {heading.name!r} have different times: choose channels "
                "with a common time base with --channels"
            )


def _pieces(content: mmap.mmap, segment: _Segment) -> Iterator[tuple[int, bytes]]:
    """Yield pieces of whole lines, each with the number of its first one."""
    line = 1 + sum(piece.count(b"\n") for _, piece in whole_lines(content, 0, segment.begin))
    for _, piece in whole_lines(content, segment.begin, segment.end):
        yield line, piece
        line += piece.count(b"\n")


def _numbers(
    path: Path,
    dialect: _Dialect,
    segment: _Segment,
    headings: Sequence[_Heading],
    numbered: tuple[int, bytes],
) -> Real:
    """Return times and values of the channels in lines of text, shape (2 channels, rows); NaN for empty fields."""
    import pyarrow as pa

    first_line, piece = numbered
    end = piece.find(b"\n", len(piece.rstrip(b" \t,;\r\n")))
    rows = piece if end < 0 else piece[:end]
    if not rows.strip():
        return np.empty((2 * len(headings), 0))
    indices = [index for each in headings for index in (each.x, each.y)]
    separator = dialect.separator.encode()
    n_fields = rows.partition(b"\n")[0].count(separator) + 1
    try:
        return _parse(rows, dialect, n_fields, indices)
    except pa.ArrowInvalid:  # rows of several widths
        lines = [_of_width(line, separator, segment.n_fields) for line in rows.splitlines()]
    try:
        return _parse(b"\n".join(lines), dialect, segment.n_fields, indices)
    except pa.ArrowInvalid:
        raise _located(path, dialect, headings, lines, first_line) from None


def _parse(rows: bytes, dialect: _Dialect, n_fields: int, indices: Sequence[int | None]) -> Real:
    """Return some fields of rows of one width, shape (fields, rows); NaN for fields that rows do not have."""
    import pyarrow as pa

    wanted = {str(index): pa.float64() for index in indices if index is not None and index < n_fields}
    names = [str(index) for index in range(n_fields)]
    types = wanted or {"0": pa.string()}
    table = parsed(rows, names, types, delimiter=dialect.separator, decimal=dialect.decimal, quote=False)
    numbers = np.full((len(indices), table.num_rows), np.nan)
    for row, index in enumerate(indices):
        if str(index) in wanted:
            numbers[row] = table.column(str(index)).to_numpy()
    return numbers


def _of_width(line: bytes, separator: bytes, n_fields: int) -> bytes:
    """Return a line with as many fields as the heading: rows leave the last ones out, comments may hold separators."""
    missing = n_fields - 1 - line.count(separator)
    if missing >= 0:
        return line + missing * separator
    return separator.join(line.split(separator)[:n_fields])


def _located(
    path: Path, dialect: _Dialect, headings: Sequence[_Heading], lines: Sequence[bytes], first_line: int
) -> FormatError:
    """Return the error that names the first field that is not a number."""
    for number, line in enumerate(lines, first_line):
        fields = [decoded(field).strip() for field in line.split(dialect.separator.encode())]
        for heading in headings:
            for index in (heading.x, heading.y):
                text = "" if index is None else fields[index]
                if text and not is_number(text.replace(dialect.decimal, ".")):
                    return FormatError(
                        f"{path}, line {number}, channel {heading.name!r}: {text[:40]!r} is not a number: correct it, "
                        "or leave it empty where nothing was measured"
                    )
    return FormatError(f"{path}, line {first_line}: the numbers below cannot be read: export the file again")
