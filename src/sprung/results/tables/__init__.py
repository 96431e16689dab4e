"""Results as tables and sentences, for the command line, reports and pages."""

from sprung._display import counted
from sprung.results.tables.calibration import calibration_in_words, calibration_table
from sprung.results.tables.corners import components_table, fitted_modes_table, payload_in_words
from sprung.results.tables.diagnosis import (
    baseline_in_words,
    baseline_table,
    diagnosis_in_words,
    diagnosis_tables,
    findings_table,
    hypotheses_table,
    mode_changes_table,
    no_change_in_words,
    observations_table,
    trend_in_words,
    why_unusable,
)
from sprung.results.tables.fleet import fleet_tables, type_in_words
from sprung.results.tables.fleet_run import fleet_plan_in_words, fleet_plan_table, fleet_run_in_words, fleet_run_tables
from sprung.results.tables.identification import (
    harmonics_table,
    identification_in_words,
    identification_tables,
    modes_table,
    orders_in_words,
    shapes_in_words,
    subsets_table,
    why_none,
)
from sprung.results.tables.inspection import inspection_in_words, inspection_table, true_modes_table
from sprung.results.tables.lake import lake_import_table, lake_in_words, lake_table
from sprung.results.tables.monitoring import (
    accounts_table,
    alert_history_table,
    alerts_table,
    quarantine_table,
    tokens_table,
    vehicles_table,
)
from sprung.results.tables.table import Table, age_in_words, span_in_words, time_in_words, with_deviation
from sprung.results.tables.tracking import tracks_in_words, tracks_notes, tracks_table

__all__ = [
    "Table",
    "accounts_table",
    "age_in_words",
    "alert_history_table",
    "alerts_table",
    "baseline_in_words",
    "baseline_table",
    "calibration_in_words",
    "calibration_table",
    "components_table",
    "counted",
    "diagnosis_in_words",
    "diagnosis_tables",
    "findings_table",
    "fitted_modes_table",
    "fleet_plan_in_words",
    "fleet_plan_table",
    "fleet_run_in_words",
    "fleet_run_tables",
    "fleet_tables",
    "harmonics_table",
    "hypotheses_table",
    "identification_in_words",
    "identification_tables",
    "inspection_in_words",
    "inspection_table",
    "lake_import_table",
    "lake_in_words",
    "lake_table",
    "mode_changes_table",
    "modes_table",
    "no_change_in_words",
    "observations_table",
    "orders_in_words",
    "payload_in_words",
    "quarantine_table",
    "shapes_in_words",
    "span_in_words",
    "subsets_table",
    "time_in_words",
    "tokens_table",
    "tracks_in_words",
    "tracks_notes",
    "tracks_table",
    "trend_in_words",
    "true_modes_table",
    "type_in_words",
    "vehicles_table",
    "why_none",
    "why_unusable",
    "with_deviation",
]
