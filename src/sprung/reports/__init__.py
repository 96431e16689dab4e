"""Reports: results as self-contained pages of sentences, tables and figures."""

from sprung.reports.inputs import Inputs, inspected
from sprung.reports.page import Report, render
from sprung.reports.pdf import pdf_of
from sprung.reports.results import corners_report, diagnosis_report, identification_report, tracking_report

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
