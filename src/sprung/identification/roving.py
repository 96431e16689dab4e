"""Roving sensors: which records are different set-ups, and which of their channels are the same points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sprung.errors import ParameterError
from sprung.recording import Channel, Recording
from sprung.vehicles.usable import AnyVehicle, output_channels

#: Positions [m] and directions are the same up to this difference.
_SAME_PLACE = 1e-6


@dataclass(frozen=True, eq=False, slots=True)
class Points:
    """Points of a structure, measured by the channels of several set-ups.

    Parameters
    ----------
    channels
        One channel for each point. Channels of one name that were moved between set-ups carry the number of the set-up:
        "acc (2)".
    rows
        Index into `channels` of each channel of each set-up.
    references
        Names of the points that every set-up measures; if there are none, of those that several set-ups measure.
    """

    channels: tuple[Channel, ...]
    rows: tuple[tuple[int, ...], ...]
    references: tuple[str, ...]


def group_by_setup(records: Sequence[Recording], *, vehicle: AnyVehicle | None = None) -> tuple[list[Recording], ...]:
    """Group the records that measure the same points.

    Parameters
    ----------
    records
        Records of one structure.
    vehicle
        Vehicle whose sensors are the outputs; None: every channel of motion is one.

    Returns
    -------
    tuple of list
        Records of each set-up, in their order. Two records are of one set-up if their outputs have the same names, and
        no output of one name has another position or direction.
    """
    groups: list[list[Recording]] = []
    layouts: list[dict[str, Channel]] = []
    for record in records:
        layout = {name: record.channels[record.index(name)] for name in output_channels(record, vehicle)}
        same = [k for k, known in enumerate(layouts) if _is_same_layout(layout, known)]
        if same:
            groups[same[0]].append(record)
        else:
            groups.append([record])
            layouts.append(layout)
    return tuple(groups)


def _is_same_layout(layout: dict[str, Channel], other: dict[str, Channel]) -> bool:
    """Whether two records have the same outputs at the same places, as far as places are known."""
    return layout.keys() == other.keys() and all(_is_same_place(layout[name], other[name]) for name in layout)


def _is_same_place(channel: Channel, other: Channel) -> bool:
    """Whether two channels may measure the same point: no known position or direction differs."""
    pairs = ((channel.position, other.position), (channel.direction, other.direction))
    return all(
        one is None or two is None or all(abs(a - b) <= _SAME_PLACE for a, b in zip(one, two, strict=True))
        for one, two in pairs
    )


def common_points(layouts: Sequence[Sequence[Channel]], *, references: Sequence[str] | None = None) -> Points:
    """Return the points that the channels of several set-ups measure.

    Parameters
    ----------
    layouts
        Channels of each set-up.
    references
        Names of the channels that stay in place in all set-ups; all others have moved, also where names repeat. None:
        channels of one name are one point unless their positions or directions differ.

    Returns
    -------
    Points

    Raises
    ------
    ParameterError
        If a set-up lacks a reference, all set-ups have the same channels at the same places, or a set-up shares no
        point with the others.
    """
    points: list[tuple[Channel, list[int]]] = []
    rows: list[tuple[int, ...]] = []
    for number, layout in enumerate(layouts):
        own = []
        for channel in layout:
            same = [
                k
                for k, (point, _) in enumerate(points)
                if point.name == channel.name
                and (channel.name in references if references is not None else _is_same_place(channel, point))
            ]
            if same:
                points[same[0]][1].append(number)
            else:
                points.append((channel, [number]))
            own.append(same[0] if same else len(points) - 1)
        rows.append(tuple(own))
    _check_references(layouts, references)
    if all(len(numbers) == len(layouts) for _, numbers in points):
        raise ParameterError(
            f"all {len(layouts)} set-ups have the same channels {', '.join(point.name for point, _ in points)}: name"
            " those that stayed in place as references (--references)"
        )
    _check_connected(rows, layouts)
    shared = [point.name for point, numbers in points if len(numbers) == len(layouts)]
    names = [point.name for point, _ in points]
    channels = tuple(
        replace(point, name=f"{point.name} ({numbers[0] + 1})") if names.count(point.name) > 1 else point
        for point, numbers in points
    )
    several = [channel.name for channel, (_, numbers) in zip(channels, points, strict=True) if len(numbers) > 1]
    return Points(channels, tuple(rows), tuple(shared or several))


def _check_references(layouts: Sequence[Sequence[Channel]], references: Sequence[str] | None) -> None:
    """Refuse references that are not channels of every set-up."""
    for number, layout in enumerate(layouts, start=1):
        names = [channel.name for channel in layout]
        missing = [name for name in references or () if name not in names]
        if missing:
            raise ParameterError(
                f"reference {missing[0]!r} is not a channel of set-up {number}, which has {', '.join(names)}:"
                " name channels that all set-ups have"
            )


def _check_connected(rows: Sequence[Sequence[int]], layouts: Sequence[Sequence[Channel]]) -> None:
    """Refuse set-ups that share no point with the first one, directly or through others."""
    joined, waiting = set(rows[0]), set(range(1, len(rows)))
    while waiting:
        linked = [number for number in waiting if joined & set(rows[number])]
        if not linked:
            number = min(waiting)
            names = ", ".join(channel.name for channel in layouts[number])
            raise ParameterError(
                f"set-up {number + 1} ({names}) shares no channel with the others, so that its mode shapes have no"
                " common scale: keep at least one sensor in place, or identify it by itself"
            )
        for number in linked:
            joined |= set(rows[number])
            waiting.remove(number)
