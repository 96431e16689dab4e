"""The command `sprung diagnose`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.baseline import baseline_of, completed_vehicle, observed, type_of, windows_of
from sprung.cli.checks import check_outputs, may_lack_sensors
from sprung.cli.options import (
    INPUT,
    AllowMissing,
    Figures,
    FileFormat,
    Files,
    Json,
    Minutes,
    Page,
    TypeFile,
    VehicleFile,
    option,
)
from sprung.cli.output import show, write_result, written
from sprung.cli.pages import write_figures, write_page
from sprung.cli.progress import progress_bar
from sprung.cli.reading import reads_files
from sprung.errors import DataError, ParameterError

if TYPE_CHECKING:
    from sprung.formats import ReadSettings


@reads_files
def diagnose(
    files: Files,
    *,
    vehicle: VehicleFile,
    baseline: Annotated[
        Path | None,
        option(
            "B.json",
            "Baseline from sprung baseline. Default: that of --type, or left compared with right, with wide limits.",
        ),
    ] = None,
    of_type: TypeFile = None,
    reading: "ReadSettings",
    allow_missing: AllowMissing = False,
    window: Minutes = 10.0,
    false_alarms: Annotated[float, option("RATE", "False alarms per vehicle and day of driving.", panel=INPUT)] = 1e-3,
    hours_per_day: Annotated[float, option("H", "Hours of driving per day.", panel=INPUT)] = 8.0,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    json: Json = None,
) -> None:
    """Find which spring, damper, tyre or sensor changed, by how much, since when and with what certainty."""
    from sprung import diagnosis
    from sprung._checks import check_number
    from sprung.results import tables
    from sprung.results.documents import diagnosis_document
    from sprung.results.page import diagnosis_report
    from sprung.vehicles import read_vehicle

    check_outputs(json=json, page=page, figures=figures, inputs=[*files, vehicle, baseline, of_type])
    check_number("--hours-per-day", hours_per_day, above=0, at_most=24)
    if baseline is not None and of_type is not None:
        raise ParameterError("--type is for a vehicle without its own baseline: give --type or --baseline, not both")
    description = read_vehicle(vehicle)
    type_baseline = None if of_type is None else type_of(description, of_type)
    normal = None if baseline is None else baseline_of(description, baseline)
    description = completed_vehicle(description, normal)
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
    with progress_bar() as report:
        parts = windows_of(files, reading=reading, minutes=window, report=report)
        observations = observed(parts, description, allow_missing=may_lack, report=report)
        result = diagnosis.diagnose(
            observations,
            normal,
            type_baseline=type_baseline,
            false_alarms=false_alarms,
            windows_per_day=hours_per_day * 60 / window,
        )
        changes = [
            change
            for finding in result.findings
            for change in diagnosis.mode_changes(description, finding, normal, observations=observations)
        ]
        folder = None if result.detection is None else figures
        paths = write_figures(
            folder, lambda drawn: drawn.saving.diagnosis_figures(result, normal, changes), file_format
        )
        document = diagnosis_document(result, modes=changes)
        paths += write_page(
            page,
            lambda inputs: diagnosis_report(result, inputs, baseline=normal, changes=changes, document=document),
            files,
            reading=reading,
            others={"vehicle": vehicle, "baseline": baseline, "type": of_type},
        )
    if write_result(document, json):
        words = [*result.notes, *written(paths, json)]
        show(tables.diagnosis_in_words(result), *tables.diagnosis_tables(result, changes), words)
    if result.detection is None and not result.sensor_faults:
        raise DataError(f"no window was usable: {tables.why_unusable(result, normal)}")
