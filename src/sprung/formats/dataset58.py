"""Dataset 58 of universal files: functions at nodes, of which time histories are read and written.

References
----------
Structural Dynamics Research Laboratory, University of Cincinnati, Universal File Formats: datasets 58 and 58b.
"""

import itertools
import mmap
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.errors import FormatError
from sprung.formats.stated import decoded, half_digit, mapped, plain, whole_lines
from sprung.formats.table import PIECE_ROWS, Block, rebatch, row_pieces, within

#: Words for the function types of the format.
FUNCTION_TYPES = (
    "general functions",
    "time histories",
    "auto spectra",
    "cross spectra",
    "frequency response functions",
    "transmissibilities",
    "coherence functions",
    "auto correlations",
    "cross correlations",
    "power spectral densities",
    "energy spectral densities",
    "probability density functions",
    "spectra",
)
# A line that begins or ends a dataset.
_MARK = b"\n    -1"
_MARK_LINE = re.compile(rb"\n? {4}-1[ \t]*\r?(?=\n|\Z)")
_END = re.compile(rb"[\r\n]{0,2} {4}-1[ \t]*(\r?\n|\Z)")
# Directions by the absolute value of their code.
_DIRECTIONS = ("", "X", "Y", "Z", "RX", "RY", "RZ")
_BYTE_ORDERS = ("", "<", ">")
#: Texts that stand for nothing.
NOTHING = ("", "NONE")


class Ordinate(NamedTuple):
    """Quantity of an ordinate: its code, its powers of length and force in SI, and the quantity about an axis."""

    code: int
    quantity: str
    length: int = 0
    force: int = 0
    about_axis: str = "unknown"


@dataclass(frozen=True, slots=True)
class Codes:
    """Numbers of the format."""

    time_history: int = 1  # type of a function
    time: int = 17  # quantity of an abscissa
    abscissae: frozenset[int] = frozenset({0, 1, 17})  # those that programs write for time
    single: int = 2  # real values of single precision
    double: int = 4
    complex_double: int = 6
    ieee_754: int = 2  # representation of binary numbers
    header_lines: int = 11
    longest_header: int = 4096  # bytes of a header that are read
    widths: tuple[tuple[int, ...], ...] = (  # columns of the lines of place, size, abscissa and ordinate
        (5, 10, 5, 10, 11, 10, 4),
        (10, 10, 10, 13, 13, 13),
        (10, 5, 5, 5, 21, 21),
        (10, 5, 5, 5, 21, 21),
    )
    abscissa_width: int = 13  # columns of an abscissa in text
    units: int = 164  # dataset of units, and of a header, nodes and elements, results at nodes
    description: int = 151
    geometry: frozenset[int] = frozenset({15, 18, 82, 2400, 2411, 2412, 2420, 2429, 2431, 2467})
    results: frozenset[int] = frozenset({55, 2414})

    ordinates: tuple[Ordinate, ...] = (  # of two for one quantity the latter is written
        Ordinate(3, "strain", about_axis="strain"),
        Ordinate(8, "displacement", length=1, about_axis="angle"),
        Ordinate(9, "force", force=1),
        Ordinate(11, "velocity", length=1, about_axis="angular_velocity"),
        Ordinate(12, "acceleration", length=1),
        Ordinate(13, "force", force=1),
        Ordinate(15, "pressure", length=-2, force=1),
    )
    temperature: int = 5  # code of an ordinate that is only written

    def ordinate_of(self, quantity: str) -> int:
        """Return the code of a quantity; 0 where the format has none."""
        known = {ordinate.about_axis: ordinate.code for ordinate in self.ordinates}
        known |= {ordinate.quantity: ordinate.code for ordinate in self.ordinates}
        return 0 if quantity == "unknown" else (known | {"temperature": self.temperature}).get(quantity, 0)

    def value_width(self, data_type: int) -> int:
        """Return the columns of a real value in text."""
        return 13 if data_type == self.single else 20


CODES = Codes()


@dataclass(frozen=True, slots=True)
class Function:
    """Header of a dataset 58, and where its values are in the file.

    Parameters
    ----------
    number
        Number of the dataset in the file, from 1.
    ids
        The five identification lines; empty instead of NONE.
    kind
        Function type; 1 is a time history.
    entity, node, direction
        Place of the response: name of the entity, number of the node, code of the direction.
    data_type
        2 and 4 are real numbers of single and double precision, others complex.
    n_values
        Number of values.
    is_even
        Whether the abscissa has a first value and a constant step; otherwise every value has its own.
    first, step
        Abscissa of the first value, and step, in the unit of the abscissa.
    step_digit
        Half the last printed digit of the step.
    abscissa_type, abscissa_unit
        Code of the quantity of the abscissa, and its unit.
    ordinate_type, ordinate_unit
        Code of the quantity of the values, and their unit.
    begin, end
        Offsets of the values in the file [bytes].
    binary
        NumPy types of an abscissa and a value, None for text.
    """

    number: int
    ids: tuple[str, ...]
    kind: int
    entity: str
    node: int
    direction: int
    data_type: int
    n_values: int
    is_even: bool
    first: float
    step: float
    step_digit: float
    abscissa_type: int
    abscissa_unit: str
    ordinate_type: int
    ordinate_unit: str
    begin: int
    end: int
    binary: tuple[str, str] | None

    @property
    def is_time_history(self) -> bool:
        """Whether the values are real numbers over time."""
        is_over_time = self.kind == CODES.time_history and self.abscissa_type in CODES.abscissae
        is_general = self.kind == 0 and self.abscissa_type == CODES.time
        return self.data_type in {CODES.single, CODES.double} and (is_over_time or is_general)

    @property
    def place(self) -> str:
        """Node and direction of the response, such as "1:+Z"."""
        code = abs(self.direction)
        axis = _DIRECTIONS[code] if code < len(_DIRECTIONS) else str(code)
        return f"{self.node}:{'-' if self.direction < 0 else '+'}{axis}" if axis else str(self.node)


@dataclass(frozen=True, slots=True)
class Contents:
    """Datasets of a universal file: the functions, and number and text (up to 4096 bytes) of all others."""

    functions: tuple[Function, ...]
    others: tuple[tuple[int, str], ...]


def contents_of(path: Path) -> Contents:
    """Return the datasets of a universal file, without reading the values of binary ones.

    Raises
    ------
    FormatError
        If a dataset has no end, or declares more values than it holds; the message names its number.
    """
    functions: list[Function] = []
    others: list[tuple[int, str]] = []
    with mapped(path) as content:
        position = 0
        while mark := _find_mark(content, position):
            number = 1 + len(functions) + len(others)
            begin = min(mark.end() + 1, len(content))
            kind = content[begin : begin + 7].decode("latin-1")
            if not kind[:6].strip().isdigit():
                raise _error(path, number, f"begins with {kind.strip()!r} in place of its type")
            if int(kind[:6]) == 58:
                function, position = _function(path, content, begin, number)
                functions.append(function)
                continue
            end = _find_mark(content, begin - 1)
            if end is None:
                raise _error(path, number, "has no end: the file is incomplete")
            others.append((int(kind[:6]), decoded(content[begin : min(end.start(), begin + CODES.longest_header)])))
            position = end.end()
    return Contents(tuple(functions), tuple(others))


def _find_mark(content: mmap.mmap, position: int) -> re.Match[bytes] | None:
    """Return the next line that begins or ends a dataset, with the line end before it."""
    if position == 0 and (first := _MARK_LINE.match(content)):
        return first
    while (position := content.find(_MARK, position)) >= 0:
        if mark := _MARK_LINE.match(content, position):
            return mark
        position += 1
    return None


def _error(path: Path, number: int, detail: str) -> FormatError:
    """Return the error of one dataset."""
    return FormatError(f"{path} cannot be read as a universal file: dataset {number} {detail}")


def _function(path: Path, content: mmap.mmap, begin: int, number: int) -> tuple[Function, int]:
    """Return the function whose type stands at `begin`, and the offset of the end of its dataset."""
    head = content[begin : begin + CODES.longest_header].split(b"\n", CODES.header_lines + 1)[:-1]
    if len(head) <= CODES.header_lines:
        raise _error(path, number, "has an incomplete header")
    lines = [decoded(line).rstrip("\r") for line in head]
    start = begin + sum(len(line) + 1 for line in head)
    try:
        place, size, abscissa, ordinate = map(_fields, lines[6:10], CODES.widths)
        data_type, n_values, is_even = int(size[0]), int(size[1]), _integer(size[2]) == 1
        first, step = float(size[3] or 0), float(size[4] or 0)
        kind = int(place[0])
    except ValueError as error:
        raise _error(path, number, f"has a header that is not of the format ({error})") from None
    if n_values < 0 or (is_even and not (step > 0 and np.isfinite([first, step]).all())):
        raise _error(path, number, f"declares {n_values} values in steps of {step:g}: both must be above 0")
    binary = None
    if lines[0][6:7].lower() == "b":
        try:
            binary, end, position = _binary_extent(content, start, lines[0], (data_type, n_values, is_even))
        except ValueError as error:
            raise _error(path, number, str(error)) from None
    else:
        mark = _find_mark(content, start - 1)
        if mark is None:
            raise _error(path, number, "has no end: the file is incomplete")
        end, position = max(start, mark.start()), mark.end()
        if 2 * n_values > end - start:
            raise _error(path, number, f"declares {n_values} values, but holds {end - start} bytes")
    function = Function(
        number=number,
        ids=tuple(map(_stated, lines[1:6])),
        kind=kind,
        entity=_stated(place[4]),
        node=_integer(place[5]),
        direction=_integer(place[6]),
        data_type=data_type,
        n_values=n_values,
        is_even=is_even,
        first=first,
        step=step,
        step_digit=half_digit(size[4]),
        abscissa_type=_integer(abscissa[0]),
        abscissa_unit=_stated(abscissa[5]),
        ordinate_type=_integer(ordinate[0]),
        ordinate_unit=_stated(ordinate[5]),
        begin=start,
        end=end,
        binary=binary,
    )
    return function, position


def _fields(line: str, widths: Sequence[int]) -> list[str]:
    """Return the fields of a line of fixed columns, without blanks."""
    edges = itertools.pairwise(itertools.accumulate(widths, initial=0))
    return [line[first:last].strip() for first, last in edges]


def _stated(field: str) -> str:
    """Return a text; an empty one instead of NONE."""
    return "" if field.strip() in NOTHING else plain(field)


def _integer(field: str) -> int:
    """Return an integer; an empty field is 0."""
    return int(field or 0)


def _binary_extent(
    content: mmap.mmap, start: int, line: str, declared: tuple[int, int, bool]
) -> tuple[tuple[str, str], int, int]:
    """Return the types of the binary values, and the offsets of their end and of the end of the dataset.

    The header states a number of bytes that many programs get wrong, so that the end mark after the values decides.
    """
    data_type, n_values, is_even = declared
    order, representation = _integer(line[7:13].strip()), _integer(line[13:19].strip())
    if not 0 < order < len(_BYTE_ORDERS) or representation != CODES.ieee_754:
        raise ValueError("holds binary numbers that are not in the representation of IEEE 754")
    value = f"{_BYTE_ORDERS[order]}f{8 if data_type in {CODES.double, CODES.complex_double} else 4}"
    n_parts = 1 if data_type in {CODES.single, CODES.double} else 2
    abscissae = ("",) if is_even else (value, f"{_BYTE_ORDERS[order]}f4")
    for abscissa in abscissae:
        size = n_values * (n_parts * np.dtype(value).itemsize + (np.dtype(abscissa).itemsize if abscissa else 0))
        end = start + size
        if end <= len(content) and (mark := _END.match(content, end)):
            return (abscissa, value), end, mark.end() - len(mark[1])
    raise ValueError(f"declares {n_values} values, but does not end after them ({len(content) - start} bytes are left)")


def values_of(
    path: Path, content: mmap.mmap, function: Function, first: int, last: int
) -> Iterator[tuple[Real | None, Real]]:
    """Yield abscissa (None for even spacing) and values from `first` to before `last`, in batches of one size.

    Raises
    ------
    FormatError
        If the values are not numbers, or fewer than declared.
    """
    if function.binary:
        rows = _binary_rows(content, function, first, last)
    else:
        rows = within(_text_rows(path, content, function), first, last)
    for block in rebatch(rows, PIECE_ROWS):
        yield (None if function.is_even else block.values[0]), block.values[-1]


def _binary_rows(content: mmap.mmap, function: Function, first: int, last: int) -> Iterator[Block]:
    """Yield rows of abscissa and value, or of the value alone."""
    abscissa, value = function.binary or ("", "")
    kind = np.dtype([("value", value)] if function.is_even else [("abscissa", abscissa), ("value", value)])
    for part in row_pieces(function.n_values, first, last):
        offset = function.begin + part.start * kind.itemsize
        size = (part.stop - part.start) * kind.itemsize
        rows = np.frombuffer(content[offset : offset + size], dtype=kind)
        yield Block(part.start + 1, None, np.array([rows[name] for name in kind.names or ()], dtype=np.float64))


def _text_rows(path: Path, content: mmap.mmap, function: Function) -> Iterator[Block]:
    """Yield rows of abscissa and value, or of the value alone, up to the declared number."""
    n_columns = 1 if function.is_even else 2
    done, rest = 0, np.empty(0)
    for begin, lines in whole_lines(content, function.begin, function.end):
        try:
            numbers = np.concatenate([rest, _numbers(lines, function)])
        except ValueError as error:
            raise _error(path, function.number, f"is not of numbers after byte {begin} ({error})") from None
        n_rows = min(function.n_values - done, numbers.size // n_columns)
        rest = numbers[n_rows * n_columns :]
        yield Block(done + 1, None, numbers[: n_rows * n_columns].reshape(n_rows, n_columns).T)
        done += n_rows
        if done == function.n_values:
            return
    raise _error(path, function.number, f"declares {function.n_values} values, but holds {done}")


def _numbers(lines: bytes, function: Function) -> Real:
    """Return the numbers in lines of text: by the blanks between them, where there are none by columns."""
    lines = lines.replace(b"D", b"E").replace(b"d", b"e")
    try:
        return np.array(lines.split(), dtype=np.float64)
    except ValueError:
        widths = [] if function.is_even else [CODES.abscissa_width]
        widths += [CODES.value_width(function.data_type)]
        rows = (_fields(line.decode(), widths * (len(line) // sum(widths) + 1)) for line in lines.splitlines())
        return np.array([float(field) for row in rows for field in row if field])


def header(
    ids: Sequence[str], *, place: tuple[int, int], n_values: int, step: float | None, ordinate: tuple[int, str]
) -> bytes:
    """Return the lines of a binary dataset of double precision up to its values.

    Parameters
    ----------
    ids
        The five identification lines.
    place
        Node, and code of the direction.
    n_values
        Number of values.
    step
        Step of the times [s]; None where every value has its own.
    ordinate
        Code of the quantity of the values, and their unit.
    """
    n_bytes = n_values * (8 if step is not None else 16)
    node, direction = place
    lines = [
        f"{-1:6d}",
        f"{58:6d}b{1:6d}{CODES.ieee_754:6d}{CODES.header_lines:12d}{n_bytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}",
        *(f"{line or 'NONE':<80}" for line in ids),
        f"{CODES.time_history:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{node:10d}{direction:4d} {'NONE':<10}{0:10d}{0:4d}",
        f"{CODES.double:10d}{n_values:10d}{int(step is not None):10d}{0:13.5e}{_exact(step or 0.0)}{0:13.5e}",
        _axis(CODES.time, "Time", "s"),
        _axis(ordinate[0], "NONE", ordinate[1]),
        _axis(0, "NONE", ""),
        _axis(0, "NONE", ""),
    ]
    return "".join(f"{line}\n" for line in lines).encode()


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:<20} {unit or 'NONE':<20}"


def _exact(number: float) -> str:
    """Return a number with as many digits as fit in twelve of thirteen columns; 0 with six."""
    for digits in range(10 if number else 0, 0, -1):
        mantissa, exponent = f"{number:.{digits}e}".split("e")
        text = f"{mantissa}E{int(exponent)}"
        if len(text) < 13:
            return f"{text:>13}"
    return f"{number:13.5e}"
