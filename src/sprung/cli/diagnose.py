"""The command `sprung diagnose`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.baseline import baseline_of, completed_vehicle, observed, type_of, windows_of
from sprung.cli.checks import check_file, check_folder, check_page, may_lack_sensors
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
from sprung.cli.pages import write_page
from sprung.cli.progress import progress_bar
from sprung.cli.reading import reads_files
from sprung.errors import DataError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sprung.diagnosis import Baseline, Diagnosis, ModeChange
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

    check_file("--json", json, inputs=[*files, vehicle, *filter(None, (baseline, of_type))])
    check_page(page, inputs=[*files, vehicle, *filter(None, (baseline, of_type))])
    check_folder("--figures", figures)
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
        paths = _draw(result, normal, changes, figures, file_format)
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


def _draw(
    diagnosis: "Diagnosis",
    baseline: "Baseline | None",
    changes: "Sequence[ModeChange]",
    folder: Path | None,
    file_format: str,
) -> list[Path]:
    """Write the figures and return their paths."""
    if folder is None or diagnosis.detection is None:
        return []
    from sprung.results.figures.saving import diagnosis_figures, save

    return save(diagnosis_figures(diagnosis, baseline, changes), folder, file_format=file_format)
