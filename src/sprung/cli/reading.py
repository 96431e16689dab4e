"""Options of every command that reads recordings."""

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from sprung.cli.checks import names
from sprung.cli.options import option

if TYPE_CHECKING:
    from sprung.formats import ReadSettings

_READING = "Reading"
_OPTIONS: dict[str, Any] = {
    "channels": Annotated[
        str | None,
        option(
            "A,B,..", "Channels to read, including the speed channel if it is needed. Default: all.", panel=_READING
        ),
    ],
    "group": Annotated[
        str | None,
        option(
            "A,B,..",
            "Groups of channels to read from a file with several; the first sets the times. sprung info lists them.",
            panel=_READING,
        ),
    ],
    "begin": Annotated[float | None, option("SECONDS", "Start of the part to read.", "--from", panel=_READING)],
    "end": Annotated[float | None, option("SECONDS", "End of the part to read.", "--to", panel=_READING)],
    "sampling_rate": Annotated[
        float | None,
        option("HZ", "Sampling rate of files without a time column, or with an inconsistent one.", panel=_READING),
    ],
    "time": Annotated[str | None, option("NAME", "Time column. Default: found by name and steps.", panel=_READING)],
    "time_unit": Annotated[str | None, option("UNIT", "Unit of the time column: s, ms, us or ns.", panel=_READING)],
    "bridge": Annotated[
        float | None, option("SECONDS", "Longest gap to interpolate across. Default: 0.", panel=_READING)
    ],
    "dbc": Annotated[
        list[Path] | None, option("F.dbc", "Database that decodes raw CAN frames; may be repeated.", panel=_READING)
    ],
    "name_table": Annotated[
        Path | None,
        option(
            "F.toml", "Names of channels and what they measure, in addition to those known.", "--names", panel=_READING
        ),
    ],
}


def reads_files(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of reading, which it receives as one argument `reading`, a `ReadSettings`."""
    signature = inspect.signature(command)
    own = [parameter for name, parameter in signature.parameters.items() if name != "reading"]
    added = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind)
        for name, kind in _OPTIONS.items()
    ]

    @wraps(command)
    def run(**arguments: Any) -> None:
        values = {name: arguments.pop(name) for name in _OPTIONS}
        command(**arguments, reading=_settings(**values))

    parameters = [*own, *added]
    vars(run)["__signature__"] = signature.replace(parameters=parameters)
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _settings(
    *,
    channels: str | None,
    group: str | None,
    begin: float | None,
    bridge: float | None,
    dbc: list[Path] | None,
    name_table: Path | None,
    **same: Any,
) -> "ReadSettings":
    """Return the settings that the options give."""
    from sprung.formats import ReadSettings

    return ReadSettings(
        channels=names(channels),
        groups=names(group) or (),
        start=begin,
        bridge=bridge or 0.0,
        databases=tuple(dbc or ()),
        names=name_table,
        **same,
    )
