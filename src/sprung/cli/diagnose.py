"""The command `sprung diagnose`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.baseline import baseline_of, observed
from sprung.cli.documents import write_json
from sprung.cli.files import (
    INPUT,
    Channels,
    Figures,
    Files,
    Json,
    Minutes,
    SamplingRate,
    VehicleFile,
    check_file,
    option,
    save_figures,
)
from sprung.cli.printing import console, notes, rich_table
from sprung.cli.progress import progress_bar
from sprung.errors import DataError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sprung.diagnosis import Baseline, Diagnosis, ModeChange


def diagnose(
    files: Files,
    *,
    vehicle: VehicleFile,
    baseline: Annotated[
        Path | None,
        option(
            "B.json",
            "Baseline from sprung baseline. Default: left against right and the vehicle file, with wide limits.",
        ),
    ] = None,
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    window: Minutes = 10.0,
    false_alarms: Annotated[float, option("RATE", "False alarms per vehicle and day of driving.", panel=INPUT)] = 1e-3,
    hours_per_day: Annotated[float, option("H", "Hours of driving per day.", panel=INPUT)] = 8.0,
    figures: Figures = None,
    json: Json = None,
) -> None:
    """Find which spring, damper, tyre or sensor changed, by how much, since when and with what certainty."""
    from sprung._checks import check_number
    from sprung.diagnosis import diagnose as diagnosed
    from sprung.diagnosis import mode_changes
    from sprung.documents import diagnosis_document
    from sprung.vehicles import read_vehicle

    check_file("--json", json, inputs=[*files, vehicle, *([baseline] if baseline else [])])
    check_number("--hours-per-day", hours_per_day, above=0, at_most=24)
    description = read_vehicle(vehicle)
    normal = None if baseline is None else baseline_of(description, baseline)
    with progress_bar() as report:
        observations = observed(
            files, description, sampling_rate=sampling_rate, channels=channels, minutes=window, report=report
        )
        found = diagnosed(
            observations,
            normal,
            false_alarms=false_alarms,
            windows_per_day=hours_per_day * 60 / window,
        )
        changes = [
            change
            for one in found.findings
            for change in mode_changes(description, one, normal, observations=observations)
        ]
        paths = [] if figures is None else _save(found, normal, changes, figures)
    if json is not None:
        write_json(diagnosis_document(found, modes=changes), json)
    if json != "-":
        _show(found, changes, paths)
    if found.detection is None and not found.sensor_faults:
        raise DataError(f"no window was usable: {_why_not(found, normal)}")


def _why_not(found: "Diagnosis", normal: "Baseline | None") -> str:
    """Return why no window was usable."""
    reasons = [one.reason for one in found.observations if not one.is_conclusive]
    if reasons:
        return reasons[0]
    if normal is not None and found.observations:
        return "their components differ from those of the baseline: fit the same ones, or learn again"
    return found.notes[-1] if found.notes else "there are no windows"


def _save(
    diagnosis: "Diagnosis", baseline: "Baseline | None", changes: "Sequence[ModeChange]", folder: Path
) -> list[Path]:
    """Write the figures."""
    from sprung.plotting import corner_changes_figure, evidence_figure, mode_changes_figure, trends_figure

    if diagnosis.detection is None:
        return []
    figures = {
        "evidence": evidence_figure(diagnosis),
        "trends": trends_figure(diagnosis, baseline),
        "corners": corner_changes_figure(diagnosis, baseline),
    }
    if changes:
        figures["modes"] = mode_changes_figure(changes, heading=diagnosis.findings[0].sentence)
    return save_figures(figures, folder)


def _show(diagnosis: "Diagnosis", changes: "Sequence[ModeChange]", paths: "Sequence[Path]") -> None:
    """Print findings, sensor faults and the best hypotheses."""
    from sprung import tables

    screen = console()
    screen.print(notes(tables.diagnosis_in_words(diagnosis)))
    if diagnosis.detection is not None:
        screen.print(rich_table(tables.hypotheses_table(diagnosis.detection)))
    if changes:
        screen.print(rich_table(tables.mode_changes_table(changes)))
    screen.print(notes([*diagnosis.notes, *(f"wrote {path}" for path in paths)]))
