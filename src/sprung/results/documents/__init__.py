"""Published JSON documents, `sprung.*/1`: models of all of them, their files and their JSON Schemas."""

from sprung.results.documents.baseline import (
    BaselineDocument,
    baseline_document,
    baseline_from_document,
    read_baseline,
    write_baseline,
)
from sprung.results.documents.calibration import (
    CalibrationDocument,
    calibration_document,
    read_calibration,
    write_calibration,
)
from sprung.results.documents.corners import CornersDocument, corners_document, read_corners, write_corners
from sprung.results.documents.diagnosis import (
    DiagnosisDocument,
    detectable_document,
    detection_document,
    diagnosis_document,
    finding_document,
    observation_document,
    observation_from_document,
    read_diagnosis,
    restored_statistics,
    stored_statistics,
    write_diagnosis,
)
from sprung.results.documents.document import Document, document_text, write_document
from sprung.results.documents.fleet import FleetDocument, fleet_document
from sprung.results.documents.fleet_run import (
    FleetPlanDocument,
    FleetRunDocument,
    fleet_plan_document,
    fleet_run_document,
)
from sprung.results.documents.identification import (
    IdentificationDocument,
    identification_document,
    read_identification,
    write_identification,
)
from sprung.results.documents.lake import LakeDocument, LakeImportDocument, lake_document, lake_import_document
from sprung.results.documents.modes import mode_documents
from sprung.results.documents.monitoring import (
    AlertHistoryDocument,
    AlertsDocument,
    ReproductionDocument,
    VehiclesDocument,
)
from sprung.results.documents.recordings import (
    InspectionDocument,
    TruthDocument,
    inspection_document,
    read_inspections,
    read_truth,
    truth_document,
    write_inspections,
    write_truth,
)
from sprung.results.documents.schemas import DOCUMENTS, json_schema, read_document, write_json_schemas
from sprung.results.documents.tracking import TrackingDocument, read_tracking, tracking_document, write_tracking
from sprung.results.documents.type_baseline import (
    TypeBaselineDocument,
    read_type_baseline,
    type_baseline_document,
    type_baseline_from_document,
    write_type_baseline,
)
from sprung.results.documents.vehicles import ExportDocument, ReportDocument
from sprung.results.documents.work_order import WorkOrderDocument
from sprung.results.renderings import document_of, save

__all__ = [
    "DOCUMENTS",
    "AlertHistoryDocument",
    "AlertsDocument",
    "BaselineDocument",
    "CalibrationDocument",
    "CornersDocument",
    "DiagnosisDocument",
    "Document",
    "ExportDocument",
    "FleetDocument",
    "FleetPlanDocument",
    "FleetRunDocument",
    "IdentificationDocument",
    "InspectionDocument",
    "LakeDocument",
    "LakeImportDocument",
    "ReportDocument",
    "ReproductionDocument",
    "TrackingDocument",
    "TruthDocument",
    "TypeBaselineDocument",
    "VehiclesDocument",
    "WorkOrderDocument",
    "baseline_document",
    "baseline_from_document",
    "calibration_document",
    "corners_document",
    "detectable_document",
    "detection_document",
    "diagnosis_document",
    "document_of",
    "document_text",
    "finding_document",
    "fleet_document",
    "fleet_plan_document",
    "fleet_run_document",
    "identification_document",
    "inspection_document",
    "json_schema",
    "lake_document",
    "lake_import_document",
    "mode_documents",
    "observation_document",
    "observation_from_document",
    "read_baseline",
    "read_calibration",
    "read_corners",
    "read_diagnosis",
    "read_document",
    "read_identification",
    "read_inspections",
    "read_tracking",
    "read_truth",
    "read_type_baseline",
    "restored_statistics",
    "save",
    "stored_statistics",
    "tracking_document",
    "truth_document",
    "type_baseline_document",
    "type_baseline_from_document",
    "write_baseline",
    "write_calibration",
    "write_corners",
    "write_diagnosis",
    "write_document",
    "write_identification",
    "write_inspections",
    "write_json_schemas",
    "write_tracking",
    "write_truth",
    "write_type_baseline",
]
