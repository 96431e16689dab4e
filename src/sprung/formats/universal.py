"""Universal files (UFF, UNV): time histories, read and written."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from sprung.errors import FormatError, ParameterError
from sprung.formats.clock import neat_rate
from sprung.formats.dataset58 import (
    CODES,
    FUNCTION_TYPES,
    NOTHING,
    Contents,
    Function,
    Ordinate,
    contents_of,
    header,
    values_of,
)
from sprung.formats.settings import TIME_UNITS, ReadSettings
from sprung.formats.stated import column_group, described, distinct, mapped, plain, utc
from sprung.formats.table import Block, Column, Group, reported, seconds_of, stated_column
from sprung.recording import Channel, Recording
from sprung.units import UNITS

NAME, EXTRA = "a universal file", None
ENDINGS = (".unv", ".uff")

_BEGINNING = re.compile(rb"\s*-1[ \t]*\r?\n {0,5}\d{1,6}[bB]?\b")
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_DATE = re.compile(
    r"(?P<day>\d\d?)-(?P<month>[a-z]{3})-(?P<year>\d\d|\d{4})\s+(?P<time>\d\d?:\d\d:\d\d)(?:\.(?P<fraction>\d{1,9}))?"
    r"\s*(?P<zone>UTC)?",
    re.IGNORECASE,
)
# Years of two digits below this one are 2000 to 2069.
_PIVOT = 70
_CALIBRATION = "calibration:"
_WIDTH = 80


def recognises(head: bytes) -> bool:
    """Return whether a file begins with the mark of a dataset and its type."""
    return _BEGINNING.match(head) is not None


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the time histories of a universal file, those that were recorded together in one group.

    Functions were recorded together if they have the same abscissae, and dates (third identification line) that differ
    by less than their length. A second function of the same name belongs to another group. Channels are named after
    the entity of the response, the first identification line, or node and direction ("1:+Z"): what distinguishes them
    best, the earliest of equals.

    Raises
    ------
    FormatError
        If the file is damaged, or holds no time histories.

    Notes
    -----
    Values of binary datasets are read where they are needed; text is read in order, in pieces. Neither takes memory
    that grows with the file.
    """
    with reported(path, NAME):
        contents = contents_of(path)
        histories = [function for function in contents.functions if function.is_time_history and function.n_values]
        if not histories:
            raise FormatError(
                f"{path} holds {_describe(contents)}, but no time histories: export the time histories (dataset 58, "
                "function type 1)"
            )
        groups = _recorded_together(histories)
        names = [path.name] if len(groups) == 1 else distinct([_group_name(members) for members in groups])
        return tuple(_group(path, name, members, contents) for name, members in zip(names, groups, strict=True))


def _describe(contents: Contents) -> str:
    """Return what a file without time histories holds."""
    kinds = [
        FUNCTION_TYPES[function.kind] if 0 <= function.kind < len(FUNCTION_TYPES) else "functions"
        for function in contents.functions
    ]
    for kind, _ in contents.others:
        is_result = kind in CODES.results
        kinds.append("nodes and elements" if kind in CODES.geometry else "results at nodes" if is_result else "headers")
    return ", ".join(f"{words} ({count})" for words, count in Counter(kinds).items()) or "nothing"


def _recorded_together(histories: Sequence[Function]) -> list[dict[str, Function]]:
    """Return the functions in groups, by the names that distinguish them best."""
    candidates = (
        [function.entity for function in histories],
        [function.ids[0] for function in histories],
        [f"{function.entity}:{function.place}".removeprefix(":") for function in histories],
    )
    return min((_grouped(names, histories) for names in candidates if all(names)), key=len)


def _grouped(names: Sequence[str], histories: Sequence[Function]) -> list[dict[str, Function]]:
    """Return functions with the same abscissae and about the same date in groups in which no name repeats."""
    grouped: list[dict[str, Function]] = []
    for name, function in zip(names, histories, strict=True):
        for group in grouped:
            if name not in group and _together(next(iter(group.values())), function):
                group[name] = function
                break
        else:
            grouped.append({name: function})
    return grouped


def _together(one: Function, other: Function) -> bool:
    """Return whether two functions may have been recorded together."""
    if _abscissae(one) != _abscissae(other):
        return False
    (start, _), (other_start, _) = _date(one), _date(other)
    if start is None or other_start is None:
        return start is other_start
    length = one.n_values * one.step * _seconds(one) if one.is_even else np.inf
    return abs(start - other_start) < 1e9 * length


def _abscissae(function: Function) -> tuple[object, ...]:
    return function.is_even, function.first, function.step, function.n_values, function.abscissa_unit


def _seconds(function: Function) -> float:
    """Return the seconds in the unit of the abscissa."""
    return TIME_UNITS.get(function.abscissa_unit.strip("[]()").lower(), 1.0)


def _date(function: Function) -> tuple[int | None, bool]:
    """Return the date in the third line as nanoseconds since 1970, and whether it is stated as UTC."""
    match = _DATE.fullmatch(function.ids[2])
    if match is None or match["month"].lower() not in _MONTHS:
        return None, False
    year = int(match["year"])
    if len(match["year"]) == 2:
        year += 1900 if year >= _PIVOT else 2000
    month = _MONTHS.index(match["month"].lower()) + 1
    date = utc(year, month, match["day"], *match["time"].split(":"), fraction=match["fraction"])
    return date, date is not None and match["zone"] is not None


def _group_name(members: Mapping[str, Function]) -> str:
    """Return a name for one of several groups."""
    function = next(iter(members.values()))
    spacing = f"{_rate(function):.6g} Hz" if function.is_even else "uneven"
    return ", ".join(filter(None, (spacing, f"{function.n_values} samples", function.ids[2])))


def _rate(function: Function) -> float:
    """Return the sampling rate of even spacing [Hz]: the roundest one that the printed step allows."""
    seconds = _seconds(function)
    return neat_rate(function.step * seconds, function.step_digit * seconds)


def _group(path: Path, name: str, members: Mapping[str, Function], contents: Contents) -> Group:
    """Return a group of functions that were recorded together."""
    functions = list(members.values())
    units = _unit_factors(contents)
    columns = [_column(name, function, functions, units) for name, function in members.items()]
    lead = functions[0]
    start, _ = _date(lead)
    if lead.is_even and start is not None:
        start += round(1e9 * lead.first * _seconds(lead))

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _blocks(path, [functions[k] for k in indices], first, last)

    return column_group(
        path,
        name,
        columns,
        rows,
        clock=(_abscissae(lead), lead.number),
        n_rows=lead.n_values,
        sampling_rate=_rate(lead) if lead.is_even else None,
        time_heading=None if lead.is_even else "time [s]",
        start=start,
        comment=_comment(contents, functions),
    )


def _unit_factors(contents: Contents) -> tuple[float, float] | None:
    """Return the factors of length and force in dataset 164, by which values are divided to be in SI."""
    text = next((text for kind, text in contents.others if kind == CODES.units), None)
    if text is None:
        return None
    with suppress(ValueError):
        factors = [float(field.lower().replace("d", "e")) for field in " ".join(text.splitlines()[2:]).split()[:2]]
        if len(factors) == 2 and all(0 < factor < np.inf for factor in factors):
            return factors[0], factors[1]
    return None


def _column(name: str, function: Function, functions: Sequence[Function], units: tuple[float, float] | None) -> Column:
    """Return the channel of a function: by the label of its unit, else by its quantity and the units of the file."""
    lines = [line for line in (function.ids[0], function.ids[3], function.ids[4]) if line != name]
    if len({other.ids[1] for other in functions}) > 1:
        lines.insert(1, function.ids[1])
    if function.entity and name == function.ids[0]:
        lines.append(f"response {function.entity}")
    calibration = next((line for line in lines if line.startswith(_CALIBRATION)), "")
    column = stated_column(
        name,
        name,
        function.ordinate_unit,
        comment=described(*(line for line in lines if line != calibration)),
        calibration=calibration.removeprefix(_CALIBRATION).strip(),
    )
    ordinates = {ordinate.code: ordinate for ordinate in CODES.ordinates}
    ordinate = ordinates.get(function.ordinate_type, Ordinate(0, "unknown"))
    if column.quantity == "speed" and ordinate.quantity == "velocity":
        return replace(column, quantity="velocity")
    if function.ordinate_unit or units is None:
        return column
    if abs(function.direction) > 3:
        return replace(column, quantity=ordinate.about_axis)
    return replace(
        column, quantity=ordinate.quantity, factor=units[0] ** -ordinate.length * units[1] ** -ordinate.force
    )


def _comment(contents: Contents, functions: Sequence[Function]) -> str:
    """Return the description in the header of the file, the line that all functions share, and the time zone."""
    header_lines = next((text.splitlines() for kind, text in contents.others if kind == CODES.description), [])
    shared = {function.ids[1] for function in functions}
    start, is_utc = _date(functions[0])
    return described(
        *(line for line in header_lines[1:3] if line.strip() not in NOTHING),
        shared.pop() if len(shared) == 1 else "",
        "" if start is None or is_utc else "start in local time",
    )


def _blocks(path: Path, functions: Sequence[Function], first: int, last: int | None) -> Iterator[Block]:
    """Yield samples of some functions, counted from 1."""
    end = functions[0].n_values if last is None else min(last, functions[0].n_values)
    row = first
    with reported(path, NAME), mapped(path) as content:
        for parts in zip(*(values_of(path, content, each, first, end) for each in functions), strict=True):
            abscissae = [abscissa for abscissa, _ in parts if abscissa is not None]
            for function, abscissa in zip(functions[1:], abscissae[1:], strict=False):
                if not np.array_equal(abscissa, abscissae[0]):
                    raise FormatError(
                        f"{path}: datasets {functions[0].number} and {function.number} have different times: choose "
                        "channels of one clock with --channels"
                    )
            stamps = abscissae[0] * _seconds(functions[0]) if abscissae else None
            yield Block(row + 1, stamps, np.stack([values for _, values in parts]))
            row += parts[0][1].size


def write(recording: Recording, path: Path) -> None:
    """Write a recording as datasets 58b, one for each channel, after a header (151) and SI units (164).

    Parameters
    ----------
    recording
        Any recording. With gaps, every sample is written with its time (uneven abscissa), in twice the space.
    path
        Path of the file; an existing one is replaced.

    Raises
    ------
    ParameterError
        If the name of a channel is longer than 80 characters, or would not be read back.

    Notes
    -----
    Values are binary numbers of double precision in SI units, little endian. Identification lines: name of the channel,
    comment of the recording, start (UTC), comment and calibration of the channel, each cut after 80 characters.
    """
    for name in recording.names:
        if name != _text_line(name) or name in NOTHING:
            raise ParameterError(
                f"channel name {name!r} would not be read back from a universal file: rename it to plain text of at "
                f"most {_WIDTH} characters"
            )
    stamps = np.round(seconds_of(recording), 9) if recording.gaps else None
    with path.open("wb") as file:
        file.write(_heading(recording).encode())
        for index in range(len(recording.channels)):
            file.write(_header(recording, index))
            values = np.asarray(recording.samples[index] / _unit(recording.channels[index])[1], dtype="<f8")
            file.write((values if stamps is None else np.column_stack([stamps, values]).astype("<f8")).tobytes())
            file.write(f"{-1:6d}\n".encode())


def _heading(recording: Recording) -> str:
    """Return datasets 151 and 164: the comment, and SI units."""
    comment = _text_line(recording.comment) or "NONE"
    lines = [
        *(f"{-1:6d}", f"{151:6d}", "NONE", comment, "NONE", " " * 20, " " * 20, "sprung", " " * 20, f"{-1:6d}"),
        *(f"{-1:6d}", f"{164:6d}", f"{1:10d}{'SI':<20}{2:10d}"),
        "".join(f"{1.0:25.16E}".replace("E", "D") for _ in range(3)),
        f"{273.15:25.16E}".replace("E", "D"),
        f"{-1:6d}",
    ]
    return "".join(f"{line}\n" for line in lines)


def _header(recording: Recording, index: int) -> bytes:
    """Return the header of a channel."""
    channel = recording.channels[index]
    calibration = f"{_CALIBRATION} {channel.calibration}" if channel.calibration else ""
    ids = (channel.name, recording.comment, _date_line(recording.start), channel.comment, calibration)
    return header(
        list(map(_text_line, ids)),
        place=(index + 1, _direction(channel)),
        n_values=recording.n_samples,
        step=None if recording.gaps else 1 / recording.sampling_rate,
        ordinate=(CODES.ordinate_of(channel.quantity), _unit(channel)[0]),
    )


def _unit(channel: Channel) -> tuple[str, float]:
    """Return the label of a channel's unit, and the unit in SI units; metres are read as displacement."""
    if channel.quantity == "distance":
        return "km", UNITS["km"][1]
    return "strain" if channel.quantity == "strain" else channel.unit, 1.0


def _direction(channel: Channel) -> int:
    """Return the code of a direction along an axis; 0 for any other."""
    axes = [k for k, part in enumerate(channel.direction or ()) if abs(part) > 1 - 1e-9]
    if not axes or channel.direction is None:
        return 0
    code = axes[0] + (4 if channel.quantity in {"angle", "angular_velocity"} else 1)
    return code if channel.direction[axes[0]] > 0 else -code


def _date_line(start: int | None) -> str:
    """Return a start [ns since 1970] as in the third identification line, with all digits."""
    if start is None:
        return ""
    seconds, fraction = divmod(start, 10**9)
    date = datetime.fromtimestamp(seconds, UTC)
    year = f"{date.year % 100:02d}" if 1900 + _PIVOT <= date.year < 2000 + _PIVOT else f"{date.year:04d}"
    month = _MONTHS[date.month - 1].capitalize()
    return f"{date.day:02d}-{month}-{year} {date:%H:%M:%S}.{fraction:09d} UTC"


def _text_line(text: str) -> str:
    """Return a text as one line of at most 80 characters."""
    line = plain(text)
    return line if len(line) <= _WIDTH else line[: _WIDTH - 4] + " ..."
