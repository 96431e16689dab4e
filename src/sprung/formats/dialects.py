"""Dialects of tables in text: delimiter, decimal sign, header, preamble, dates, and what the columns hold."""

import csv
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung.errors import FormatError
from sprung.formats.stated import decoded
from sprung.formats.table import MISSING, is_number, is_unit

#: Marks of lines of comment.
COMMENT_MARKS = (b"#", b"%", b"//")
#: Delimiter of columns that are separated by one or several blanks.
BLANK = " "

_MISSING_MARKS = tuple(text.encode() for text in MISSING if text.startswith("#"))
_DELIMITERS = (";", "\t", ",", "|", BLANK)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_UNFINISHED = re.compile(r"[+-]?\d*[.,]?\d*([eE][+-]?)?")
_STATED = re.compile(rb"sep=(.)\s*", re.IGNORECASE)
_OF_COLUMN = re.compile(r"# (?:(?P<name>.+), )?(?P<kind>comment|calibration): (?P<text>.*)")
_BLANKS = re.compile(rb"[ \t]+")
_EDGES = re.compile(rb"(?m)^ | (?=\r?$)")
#: Rows by which the columns are judged.
_SAMPLE_ROWS = 50
#: Longest comment.
_MAX_COMMENT = 500
#: Months in English and German by their first three letters.
_MONTHS = ("jan", "feb", "mar|mrz", "apr", "may|mai", "jun", "jul", "aug", "sep", "oct|okt", "nov", "dec|dez")
_PATTERN = (
    r"^[\s'\"]*(?:(?P<first>\d{1,4})(?P<mark>[./-])"
    rf"(?P<second>\d{{1,2}}|(?i:{'|'.join(_MONTHS)}))[./-](?P<third>\d{{1,4}}))?[T ,_]*"
    r"(?:(?P<hour>\d{1,2}):(?P<minute>\d{1,2})(?::(?P<whole>\d{2})(?:[.,:](?P<fraction>\d+))?)?"
    r"|(?P<minutes>\d{1,3}):(?P<rest>\d{2})[.,](?P<part>\d+))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|GMT|(?P<sign>[+-])(?P<zone>\d{2})(?::?(?P<rest_of_zone>\d{2}))?)?[\s'\"]*$"
)
_MOMENT = re.compile(_PATTERN)
#: Orders of day, month and year.
YEAR_FIRST = "year-month-day"
DAY_FIRST = "day.month.year"
MONTH_FIRST = "month/day/year"
_NANOSECONDS = {"hour": 3_600_000_000_000, "minute": 60_000_000_000, "second": 1_000_000_000}


@dataclass(frozen=True, slots=True)
class Layout:
    """Layout of the table in a text file.

    Parameters
    ----------
    delimiter, decimal
        Signs between fields and in numbers.
    headings
        Heading of each column; empty for a column without name.
    kinds
        What each column holds: "number", "moment", "date", "time of day" or "text".
    first_line, offset
        Number of the first line of the table, and its offset in the file [bytes].
    first_row
        Fields of the first row of numbers.
    comment
        Text above the header.
    is_ragged
        Whether rows may leave out their last fields, or hold delimiters in the last one.
    stated
        What lines such as "# acc_fl, calibration: 101.9 mV/g" above the header state of columns: "comment" and
        "calibration" by name.
    """

    delimiter: str
    decimal: str
    headings: tuple[str, ...]
    kinds: tuple[str, ...]
    first_line: int
    offset: int
    first_row: tuple[str, ...]
    comment: str = ""
    is_ragged: bool = False
    stated: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def kinds_by_heading(self) -> dict[str, str]:
        """Return what each column with a name holds."""
        return {heading: kind for heading, kind in zip(self.headings, self.kinds, strict=True) if heading}

    def regular(self, text: bytes) -> bytes:
        """Return lines with one delimiter between fields, of ragged ones as many as between the headings."""
        if not self.is_ragged:
            return single_blanks(text) if self.delimiter == BLANK else text
        sign, n_fields = self.delimiter.encode(), len(self.headings)
        lines = (line + (n_fields - 1 - line.count(sign)) * sign for line in text.splitlines())
        return b"\n".join(sign.join(line.split(sign)[:n_fields]) for line in lines)

    def parsed(self, text: bytes, types: Mapping[int, Any]) -> Any:
        """Return columns of lines of text, chosen and called by their indices, as a table of Arrow."""
        names = [str(index) for index in range(len(self.headings))]
        wanted = {names[index]: kind for index, kind in types.items()}
        signs = (self.delimiter, self.decimal)
        return parsed(self.regular(text), names, wanted, *signs, has_quotes=not self.is_ragged)

    def is_unfinished(self, line: bytes) -> bool:
        """Return whether the last line of a file was cut off: it has fewer fields, or an unfinished number."""
        row = fields(line, self.delimiter)
        if len(row) != len(self.headings):
            return len(row) < len(self.headings)
        last = row[-1]
        is_whole = last in MISSING or is_number(last.replace(self.decimal, ".")) or kind_of(last) is not None
        return not is_whole and _UNFINISHED.fullmatch(last) is not None


def layout_of(path: Path, lines: Sequence[bytes]) -> Layout:
    """Return the layout that the first lines of a file show, which are complete and with their ends."""
    delimiter, decimal = _signs(lines)
    data = next(
        (i for i, line in enumerate(lines) if not is_comment(line) and _is_data(fields(line, delimiter), decimal)), None
    )
    if data is None:
        raise FormatError(f"{path} holds no samples: its first {len(lines)} lines have no line of numbers")
    sample = list(_sample(lines[data:], delimiter))
    above = [fields(line, delimiter) for line in lines[:data]]
    header, named = _header(lines[:data], above, sample[0], decimal)
    preamble = data if named is None else header - all(is_unit(field) for field in above[header])
    if named is None:
        first, headings = data, tuple(f"column_{number}" for number in range(1, len(sample[0]) + 1))
    else:
        first = next(i for i in range(header + 1, len(lines)) if lines[i].strip() and not is_comment(lines[i]))
        headings = named
    return Layout(
        delimiter=delimiter,
        decimal=decimal,
        headings=headings,
        kinds=tuple(_kind([row[k] for row in sample if k < len(row)], decimal) for k in range(len(headings))),
        first_line=first + 1,
        offset=sum(len(line) for line in lines[:first]),
        first_row=tuple(sample[0]),
        comment=_comment(lines[:preamble]),
        stated=_of_columns(lines[:preamble]),
    )


def stated_line(kind: str, text: str, name: str = "") -> str:
    """Return the line that states a comment or a calibration, of the recording or of a column."""
    start = f"# {name}, {kind}" if name else f"# {kind}"
    return f"{start}: {' '.join(text.split())}\n"


def is_comment(line: bytes) -> bool:
    """Return whether a line is a comment."""
    start = line.lstrip()
    return start.startswith(COMMENT_MARKS) and not start.startswith(_MISSING_MARKS)


def fields(line: bytes, delimiter: str, *, strip: bool = True) -> list[str]:
    """Return the fields of a line; `strip` removes the blanks around them."""
    text = decoded(single_blanks(line) if delimiter == BLANK else line)
    try:
        row = next(csv.reader([text], delimiter=delimiter), [])
    except csv.Error:
        return [text]
    return [field.strip() for field in row] if strip else row


def single_blanks(text: bytes) -> bytes:
    """Return lines with one blank in place of several, and none at their ends."""
    return _EDGES.sub(b"", _BLANKS.sub(b" ", text))


def _signs(lines: Sequence[bytes]) -> tuple[str, str]:
    """Return the delimiter and the decimal sign."""
    stated = _STATED.fullmatch(lines[0].removeprefix(b"\xef\xbb\xbf"))
    candidates = (decoded(stated[1]),) if stated else _DELIMITERS
    whole = [line for line in lines[-_SAMPLE_ROWS:] if line.strip() and not is_comment(line)]
    last = ([line for line in whole if line.endswith(b"\n")] or whole)[-2:]
    for delimiter in candidates:
        for decimal in (".", ",") if delimiter != "," else (".",):
            rows = [fields(line, delimiter) for line in last]
            if rows and all(len(row) > 1 and all(_is_field(field, decimal) for field in row) for row in rows):
                return delimiter, _decimal(lines, delimiter)
    text = last[-1] if last else b""
    delimiter = next((sign for sign in candidates if sign.encode() in text.strip()), ",")
    return delimiter, _decimal(lines, delimiter)


def _decimal(lines: Sequence[bytes], delimiter: str) -> str:
    """Return the decimal sign."""
    rows = (fields(line, delimiter) for line in lines[-_SAMPLE_ROWS:])
    has_comma = delimiter != "," and any(_DECIMAL_COMMA.fullmatch(field) for row in rows for field in row)
    return "," if has_comma else "."


def _is_value(field: str, decimal: str) -> bool:
    """Return whether a field is a number, a date or a time of day."""
    return is_number(field.replace(decimal, ".")) or kind_of(field) is not None


def _is_field(field: str, decimal: str) -> bool:
    return field in MISSING or _is_value(field, decimal)


def _is_data(row: list[str], decimal: str) -> bool:
    """Return whether more than half of the fields of a row are numbers or missing values."""
    n_values = sum(_is_value(field, decimal) and field not in MISSING for field in row)
    n_missing = sum(field in MISSING for field in row)
    return n_values > 0 and n_values + n_missing > len(row) / 2


def _sample(lines: Sequence[bytes], delimiter: str) -> Iterator[list[str]]:
    """Yield the fields of the first rows of numbers."""
    for line in lines[:_SAMPLE_ROWS]:
        if line.strip() and not is_comment(line):
            yield fields(line, delimiter)


def _header(
    lines: Sequence[bytes], rows: list[list[str]], row: list[str], decimal: str
) -> tuple[int, tuple[str, ...] | None]:
    """Return the index of the last line with text and without numbers, and its names; None without names.

    Comments that do not name the columns, and titles, are no header.
    """
    for index in reversed(range(len(rows))):
        if any(rows[index]) and not any(_is_value(field, decimal) for field in rows[index]):
            named = _named(lines[index], rows, index, row)
            if named is not None or not is_comment(lines[index]):
                return index, named
    return len(rows), None


def _named(line: bytes, rows: list[list[str]], header: int, row: list[str]) -> tuple[str, ...] | None:
    """Return the heading of each field of a row; None if the header only looks like one.

    Where the header holds nothing but units, the names are in the row above it.
    """
    names = rows[header]
    above = rows[header - 1] if header else []
    if len(above) == len(names) and all(is_unit(field) for field in names):
        units = [field.strip("[]()") for field in names]
        names = [f"{name} [{unit}]" if unit else name for name, unit in zip(above, units, strict=True)]
    elif is_comment(line):
        names = _uncommented(names)
    if len(names) != len(row):
        names = _split_by_blanks(line, len(row)) or names
    if len(names) == len(row) - 1 and not row[-1]:
        names = [*names, ""]
    if len(names) == len(row) + 1 and not names[-1]:
        names = names[:-1]
    if len(names) == len(row) - 1 and [kind_of(field) for field in row[:2]] == ["date", "time of day"]:
        names = ["Date", *names]
    if len(names) != len(row) and (len(names) == 1 or is_comment(line)):
        return None
    return tuple(["unnamed_1", *names[1:]] if not names[0] and row[0] else names)


def _uncommented(names: list[str]) -> list[str]:
    """Return the names in a header that is marked as a comment."""
    rest = names[0].lstrip("#%/").strip()
    return [rest, *names[1:]] if rest or len(names) == 1 else names[1:]


def _split_by_blanks(line: bytes, n_fields: int) -> list[str] | None:
    """Return the names in a header that is separated by several blanks, or by one with units in brackets."""
    text = decoded(line).strip().lstrip("#%/").strip()
    for pattern in (r"\s{2,}|\t", r"\s+(?![\[(])"):
        names = re.split(pattern, text)
        if len(names) == n_fields:
            return names
    return None


def _kind(values: list[str], decimal: str) -> str:
    """Return what a column holds."""
    present = [value for value in values if value not in MISSING]
    if not present or any(is_number(value.replace(decimal, ".")) for value in present):
        return "number"
    kind, count = Counter(map(kind_of, present)).most_common(1)[0]
    if kind is not None and count > len(present) / 2:
        return kind
    is_text = len(present) > 1 and all(value[0].isalpha() or not value[0].isascii() for value in present)
    return "text" if is_text else "number"


def _of_columns(lines: Sequence[bytes]) -> dict[str, dict[str, str]]:
    """Return what lines of comment state of columns."""
    stated: dict[str, dict[str, str]] = {}
    for line in lines:
        match = _OF_COLUMN.fullmatch(decoded(line).strip())
        if match and match["name"]:
            stated.setdefault(match["name"], {})[match["kind"]] = match["text"]
    return stated


def _comment(lines: Sequence[bytes]) -> str:
    """Return the text of a preamble in a line, without what is stated of columns."""
    texts = []
    for line in lines:
        match = _OF_COLUMN.fullmatch(decoded(line).strip())
        if match and not match["name"] and match["kind"] == "comment":
            texts.append(match["text"])
        elif not match and not _STATED.fullmatch(line):
            texts.append(decoded(line).strip().strip(";,\t ").lstrip("#%/ "))
    text = "; ".join(text for text in texts if text)
    return text if len(text) <= _MAX_COMMENT else text[: _MAX_COMMENT - 4] + " ..."


def parsed(
    text: bytes,
    headings: Sequence[str],
    types: Mapping[str, Any],
    delimiter: str,
    decimal: str,
    *,
    has_quotes: bool = True,
) -> Any:
    """Return columns of lines of text as a table of Arrow: those of `types`; all, as they look, where it is empty."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    return arrow.read_csv(
        pa.BufferReader(text),
        read_options=arrow.ReadOptions(column_names=list(headings)),
        parse_options=arrow.ParseOptions(delimiter=delimiter, quote_char='"' if has_quotes else False),
        convert_options=arrow.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=list(MISSING),
            decimal_point=decimal,
            check_utf8=False,
        ),
    )


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

    Notes
    -----
    A year in front is followed by month and day; parts between points are day, month and year. Between strokes and
    hyphens a part above 12 is a day, AM and PM are American, and of two parts the one that changes while the other
    stays is the day.
    """
    import pyarrow.compute as pc

    fields = _date_fields(texts)
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
    """Return dates and times as UTC, `M8[ns]`; without any date as durations since midnight, `m8[ns]`.

    NaT stands where a text (Arrow) holds neither.
    """
    import pyarrow.compute as pc

    fields = _date_fields(texts)
    hour = _numbers(fields["hour"])
    half = pc.utf8_lower(pc.utf8_slice_codeunits(fields["half"], 0, 1)).to_numpy(zero_copy_only=False)
    hour = np.where(half == "", hour, hour % 12 + 12 * (half == "p"))
    sign = np.where(fields["sign"].to_numpy(zero_copy_only=False) == "-", -1, 1)
    nanoseconds = (
        hour * _NANOSECONDS["hour"]
        + (_numbers(fields["minute"]) + _numbers(fields["minutes"])) * _NANOSECONDS["minute"]
        + (_numbers(fields["whole"]) + _numbers(fields["rest"])) * _NANOSECONDS["second"]
        + _numbers(fields["fraction"], is_fraction=True)
        + _numbers(fields["part"], is_fraction=True)
        - _numbers(fields["zone"]) * sign * _NANOSECONDS["hour"]
        - _numbers(fields["rest_of_zone"]) * sign * _NANOSECONDS["minute"]
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


def _date_fields(texts: Any) -> dict[str, Any]:
    """Return the named parts of texts; empty where a text lacks a part, null where it is no date or time.

    The name of a month becomes its number, and the mark a point, as day and month are then in this order.
    """
    import pyarrow.compute as pc

    parts = pc.extract_regex(texts, _PATTERN)
    fields = {name: pc.struct_field(parts, name) for name in _MOMENT.groupindex}
    has_name = pc.match_substring_regex(fields["second"], "[A-Za-z]")
    if pc.any(has_name).as_py():
        fields["mark"] = pc.if_else(has_name, ".", fields["mark"])
        for number, names in enumerate(_MONTHS, 1):
            fields["second"] = pc.replace_substring_regex(fields["second"], f"(?i)^({names})$", str(number))
    return fields


def _numbers(digits: Any, *, is_fraction: bool = False) -> NDArray[np.int64]:
    """Return whole numbers, of decimal fractions those of 1e-9; 0 for an empty text."""
    import pyarrow as pa
    import pyarrow.compute as pc

    present = pc.fill_null(digits, "")
    plain = pc.utf8_slice_codeunits(pc.utf8_rpad(present, 9, "0"), 0, 9) if is_fraction else present
    numbers = pc.cast(pc.if_else(pc.equal(plain, ""), "0", plain), pa.int64())
    values: NDArray[np.int64] = numbers.to_numpy(zero_copy_only=False)
    return values
