"""What values offer to people: short texts, tables in notebooks, data frames, files and pictures.

A value knows its numbers only. What shows, writes or draws it is on higher floors, and is looked up by name when it is
first asked for.
"""

import textwrap
from collections.abc import Iterable
from os import PathLike
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Widest line and most lines of a short text, and most names in a list.
_WIDTH, _MAX_LINES, _MAX_NAMES = 120, 3, 8


class Tabular:
    """Value that notebooks show as the tables of the command line, and that can become a data frame."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        text: str = resolve_name("sprung.results.renderings:as_html")(self)
        return text

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame; columns have their unit in brackets in their name, such as "score [-]".

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        return resolve_name("sprung.results.renderings:data_frame")(self)


class Savable:
    """Result with a published JSON document."""

    __slots__ = ()

    def save(self, path: str | PathLike[str]) -> None:
        """Write the result as its published JSON document, which `sprung.read_document` and its own reader read.

        Parameters
        ----------
        path
            File to write; an existing one is replaced.
        """
        resolve_name("sprung.results.renderings:save")(self, path)


class Drawable:
    """Value with one obvious picture."""

    __slots__ = ()

    def plot(self) -> "Figure":
        """Return the picture of the value; further ones are in `sprung.results.figures`."""
        figure: Figure = resolve_name("sprung.results.renderings:picture_of")(self)
        return figure


def in_short(*lines: str) -> str:
    """Return the first three lines that are not empty, each of at most 120 letters."""
    kept = [line for line in lines if line][:_MAX_LINES]
    return "\n".join(textwrap.shorten(line, _WIDTH, placeholder=" ...") for line in kept)


def listed(names: Iterable[str]) -> str:
    """Return names separated by commas, only the first few of many.

    Examples
    --------
    >>> listed("abcdefghij")
    'a, b, c, d, e, f, g and 3 more'
    """
    every = list(names)
    if len(every) <= _MAX_NAMES:
        return ", ".join(every)
    return ", ".join(every[: _MAX_NAMES - 1]) + f" and {len(every) - _MAX_NAMES + 1} more"


def counted(number: int, thing: str, plural: str = "s") -> str:
    """Return a number of things, such as "1 mode" or "3 modes", whose name is `plural` longer if they are several.

    Examples
    --------
    >>> [counted(number, "mode") for number in (0, 1, 3)]
    ['0 modes', '1 mode', '3 modes']
    """
    return f"{number} {thing}{'' if number == 1 else plural}"
