"""A report as values: sections of paragraphs, tables and pictures, and the page that shows them."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Resolution of the pictures in a page [dots per inch].
RESOLUTION = 110


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A paragraph of plain text."""

    text: str


@dataclass(frozen=True, slots=True)
class Table:
    """A table of words and formatted numbers.

    Parameters
    ----------
    title
        Title, with the number of the thesis' table where there is one.
    columns
        Headings with units; the first column holds words.
    rows
        Cells of each row, as many as there are columns.
    remark
        Sentence below the table.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    remark: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ParameterError(
                    f"a row of {self.title!r} has {len(row)} cells, but must have {len(self.columns)}: {row}"
                )


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure with its caption.

    Parameters
    ----------
    png
        PNG file.
    caption
        Caption, with the number of the thesis' figure where there is one.
    """

    png: bytes
    caption: str

    @property
    def encoded(self) -> str:
        """PNG file in Base64."""
        return base64.b64encode(self.png).decode("ascii")


Block = Paragraph | Table | Picture


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a report under one heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """Contents of one page.

    Parameters
    ----------
    title
        Heading.
    verdict
        What reproduces, what does not, and why, in one paragraph.
    sections
        Sections in reading order.
    settings
        Seeds, lengths and noise of the runs, one sentence each.
    """

    title: str
    verdict: str
    sections: tuple[Section, ...]
    settings: tuple[str, ...] = ()


def picture(figure: "Figure", caption: str) -> Picture:
    """Return a figure as a picture of a report."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=RESOLUTION)
    return Picture(buffer.getvalue(), caption)


def deviation(ours: float, published: float) -> str:
    """Return the relative deviation from a published number in percent; a dash where there is none.

    Examples
    --------
    >>> deviation(7.03, 7.01)
    '+0.29 %'
    """
    if not (np.isfinite(ours) and np.isfinite(published)) or published == 0:
        return "–"
    return f"{100 * (ours / published - 1):+.2f} %"


def spread(values: ArrayLike, *, digits: int = 2) -> str:
    """Return the median of runs with the range of 90 % of them; a dash where none has a value.

    Examples
    --------
    >>> spread([1.0, 2.0, 3.0, float("nan")])
    '2.00 (1.10 to 2.90)'
    """
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return "–"
    low, middle, high = np.percentile(finite, [5, 50, 95])
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def found_in(values: ArrayLike) -> str:
    """Return the number of runs with a value.

    Examples
    --------
    >>> found_in([1.0, float("nan"), 2.0])
    '2 of 3'
    """
    values = np.asarray(values, dtype=np.float64)
    return f"{np.isfinite(values).sum()} of {values.size}"


def render(report: Report, *, others: Sequence[tuple[str, str]] = ()) -> str:
    """Return a report as one HTML page that needs no network.

    Parameters
    ----------
    report
        Report to render.
    others
        File names and titles of the pages to link to.
    """
    from jinja2 import Environment

    template = resources.files("sprung.reproduce") / "templates" / "report.html"
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    kinds = {"Paragraph": Paragraph, "Table": Table, "Picture": Picture}
    environment.tests.update({name: lambda block, kind=kind: isinstance(block, kind) for name, kind in kinds.items()})
    return environment.from_string(template.read_text(encoding="utf-8")).render(report=report, others=others)
