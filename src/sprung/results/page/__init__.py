"""Reports: results as self-contained pages of sentences, tables and figures."""

from sprung.results.page.page import Report, pdf_of, render
from sprung.results.page.results import (
    Inputs,
    corners_report,
    diagnosis_report,
    identification_report,
    inspected,
    tracking_report,
)

__all__ = [
    "Inputs",
    "Report",
    "corners_report",
    "diagnosis_report",
    "identification_report",
    "inspected",
    "pdf_of",
    "render",
    "tracking_report",
]
