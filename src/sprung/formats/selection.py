"""From the groups of a file to one table: the groups that are wanted, joined where they share a clock."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sprung.errors import ParameterError
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Block, Group, Table, rebatch

_BLOCK_ROWS = 1 << 16


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
    if len({group.clock for group in wanted}) > 1:
        raise ParameterError(
            f"{path} holds {len(wanted)} groups of channels with different clocks: choose one with --group (in Python: "
            f"group=...): {in_words(wanted)}"
        )
    return _joined([group.open(_own(group, settings.channels)) for group in wanted])


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


def _joined(tables: Sequence[Table]) -> Table:
    """Return tables with the same rows as one."""

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        parts = (rebatch(table.blocks(first, last), _BLOCK_ROWS) for table in tables)
        for same in zip(*parts, strict=True):
            yield replace(same[0], values=np.concatenate([block.values for block in same]))

    columns = tuple(column for table in tables for column in table.columns)
    return replace(tables[0], columns=columns, blocks=blocks)
