"""Reports: results as self-contained pages of sentences, tables and figures."""

from sprung.results.page.inputs import Inputs, inspected
from sprung.results.page.page import Report, render
from sprung.results.page.pdf import pdf_of
from sprung.results.page.results import corners_report, diagnosis_report, identification_report, tracking_report

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
