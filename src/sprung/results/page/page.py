"""Self-contained pages of sentences, tables and pictures, as HTML and as PDF."""

import base64
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from io import BytesIO
from typing import TYPE_CHECKING, Any

from sprung._checks import required
from sprung.results.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Resolution of the pictures in a page [dots per inch].
RESOLUTION = 110


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A paragraph of plain text."""

    text: str


@dataclass(frozen=True, slots=True)
class Sentences:
    """A list of sentences."""

    lines: tuple[str, ...]


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

    @property
    def is_tall(self) -> bool:
        """Whether the picture is higher than wide, by the header of the file: such a one fills a printed page."""
        width, height = struct.unpack(">II", self.png[16:24])
        return bool(height > width)


Block = Paragraph | Sentences | Table | Picture


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a report under one heading; lists without sentences are left out."""

    title: str
    blocks: tuple[Block, ...]

    def __post_init__(self) -> None:
        said = tuple(block for block in self.blocks if not isinstance(block, Sentences) or block.lines)
        object.__setattr__(self, "blocks", said)


@dataclass(frozen=True, slots=True)
class Report:
    """Contents of one page.

    Parameters
    ----------
    title
        Heading.
    verdict
        The result in one paragraph: for a chapter, what reproduces, what does not, and why.
    sections
        Sections in reading order.
    settings
        Settings, one sentence each: of a chapter, seeds, lengths and noise of the runs.
    document
        The result as a JSON document, embedded for programs; None for none.
    footer
        Line at the end of the page; empty for none.
    """

    title: str
    verdict: str
    sections: tuple[Section, ...]
    settings: tuple[str, ...] = ()
    document: Mapping[str, Any] | None = None
    footer: str = ""

    @property
    def data(self) -> str:
        """JSON text of the document that cannot end the element it stands in; empty for none."""
        if self.document is None:
            return ""
        return json.dumps(self.document, allow_nan=False).replace("<", "\\u003c").replace("&", "\\u0026")


def picture(figure: "Figure", caption: str, *, resolution: int = RESOLUTION) -> Picture:
    """Return a figure as a picture of a report, with a resolution in dots per inch."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=resolution)
    return Picture(buffer.getvalue(), caption)


def pictures(drawn: Mapping[str, "Figure"]) -> tuple[Picture, ...]:
    """Return figures by their captions as pictures of the page."""
    return tuple(picture(figure, caption) for caption, figure in drawn.items())


def render(report: Report, *, others: Sequence[tuple[str, str]] = ()) -> str:
    """Return a report as one HTML page that needs no network.

    Parameters
    ----------
    report
        Report to render.
    others
        File names and titles of the pages to link to.

    Examples
    --------
    >>> from sprung.results.page import Report
    >>> from sprung.results.page.page import Paragraph, Section
    >>> data = Section("Data", (Paragraph("f < 50 Hz"),))
    >>> report = Report("Drive of 21 November", "No change detected.", (data,), ())
    >>> page = render(report)
    >>> "<h1>Drive of 21 November</h1>" in page, "f &lt; 50 Hz" in page
    (True, True)
    """
    from jinja2 import Environment

    template = resources.files("sprung.results.page") / "templates" / "page.html"
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    kinds = {"Paragraph": Paragraph, "Sentences": Sentences, "Picture": Picture}
    environment.tests.update({name: lambda block, kind=kind: isinstance(block, kind) for name, kind in kinds.items()})
    return environment.from_string(template.read_text(encoding="utf-8")).render(report=report, others=others)


def pdf_of(page: str) -> bytes:
    """Return a report as a PDF file, paged for A4.

    Parameters
    ----------
    page
        HTML page of `render`; whatever it refers to outside of itself is left out.

    Raises
    ------
    MissingPackageError
        If weasyprint is not installed.

    Examples
    --------
    The package weasyprint is an extra of sprung:

    >>> page = pdf_of("<h1>Drive of 21 November</h1>")  # doctest: +SKIP
    >>> page[:5]  # doctest: +SKIP
    b'%PDF-'
    """
    weasyprint, urls = (
        required(name, purpose="a report as PDF", extra="pdf") for name in ("weasyprint", "weasyprint.urls")
    )
    written: bytes = weasyprint.HTML(string=page, url_fetcher=urls.URLFetcher(allowed_protocols=("data",))).write_pdf()
    return written
