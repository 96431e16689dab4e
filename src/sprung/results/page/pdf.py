"""Reports as PDF files."""

from sprung._checks import required


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
