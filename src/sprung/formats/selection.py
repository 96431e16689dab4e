"""From the groups of a file to one table: the groups that are wanted, joined where they share a clock."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sprung.errors import ParameterError
from sprung.formats.joining import interpolated, side_by_side
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Group, Table
from sprung.formats.time_columns import timed


def selected_table(path: Path, groups: Sequence[Group], settings: ReadSettings) -> Table:
    """Return the table of the wanted groups and channels.

    Parameters
    ----------
    path
        Path of the file.
    groups
        Groups of the file.
    settings
        Names of the wanted groups and channels.

    Raises
    ------
    ParameterError
        If a group or channel is not in the file, or the groups have several clocks.
    """
    wanted = [_group(path, groups, name) for name in settings.groups] or list(groups)
    if settings.channels is not None and len(wanted) > 1:
        wanted = _holding(path, wanted, settings.channels)
    if len(wanted) == 1:
        return wanted[0].open(settings.channels)
    tables = [_distinct(wanted[:number], group, settings.channels) for number, group in enumerate(wanted)]
    if len({group.clock for group in wanted}) == 1:
        return side_by_side(tables)
    if settings.groups:
        return interpolated([timed(table, settings) for table in tables])
    raise ParameterError(
        f"{path} holds {len(wanted)} groups of channels with different clocks: choose with --group (in Python: groups="
        f"[...]), several to interpolate at the times of the first: {in_words(wanted)}"
    )


def in_words(groups: Sequence[Group]) -> str:
    """Return the names of groups with their channels."""
    return "; ".join(f"{group.name!r} ({', '.join(group.headings)})" for group in groups)


def _group(path: Path, groups: Sequence[Group], name: str) -> Group:
    """Return the group called `name`."""
    for group in groups:
        if group.name == name:
            return group
    raise ParameterError(f"{path} has no group {name!r}: choose from {', '.join(repr(group.name) for group in groups)}")


def _holding(path: Path, groups: Sequence[Group], channels: Sequence[str]) -> list[Group]:
    """Return the groups that hold some of the channels."""
    for name in channels:
        if not any(group.has(name) for group in groups):
            known = ", ".join(heading for group in groups for heading in group.headings)
            raise ParameterError(f"{path} has no channel {name!r}: choose from {known}")
    return [group for group in groups if any(group.has(name) for name in channels)]


def _own(group: Group, channels: Sequence[str] | None) -> list[str] | None:
    """Return those of the channels that the group holds."""
    return None if channels is None else [name for name in channels if group.has(name)]


def _distinct(before: Sequence[Group], group: Group, channels: Sequence[str] | None) -> Table:
    """Return the table of a group; names that an earlier group has as well begin with the name of the group."""
    table = group.open(_own(group, channels))
    taken = {heading for earlier in before for heading in earlier.headings}
    columns = (
        replace(column, name=f"{group.name}_{column.name}") if column.heading in taken else column
        for column in table.columns
    )
    return replace(table, columns=tuple(columns))
