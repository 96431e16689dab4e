"""Results as tables and sentences, for the command line, reports and pages."""

from sprung.tables.corners import components_table, fitted_modes_table
from sprung.tables.diagnosis import (
    baseline_table,
    diagnosis_in_words,
    hypotheses_table,
    mode_changes_table,
    trend_in_words,
)
from sprung.tables.identification import (
    MODES_CAPTION,
    counted,
    harmonics_table,
    modes_table,
    orders_in_words,
    shapes_in_words,
    subsets_table,
    why_none,
    with_deviation,
)
from sprung.tables.inspection import inspection_in_words, inspection_table
from sprung.tables.table import Table

__all__ = [
    "MODES_CAPTION",
    "Table",
    "baseline_table",
    "components_table",
    "counted",
    "diagnosis_in_words",
    "fitted_modes_table",
    "harmonics_table",
    "hypotheses_table",
    "inspection_in_words",
    "inspection_table",
    "mode_changes_table",
    "modes_table",
    "orders_in_words",
    "shapes_in_words",
    "subsets_table",
    "trend_in_words",
    "why_none",
    "with_deviation",
]
