"""The command `sprung diagnose`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.baseline import Minutes, baseline_of, compared, observed
from sprung.cli.documents import write_json
from sprung.cli.files import INPUT, Channels, Figures, Files, Json, SamplingRate, VehicleFile, check_file, save_figures
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.errors import DataError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from sprung.diagnosis import Baseline, Detection, Diagnosis, ModeChange, Trend

#: Hypotheses in the table.
_SHOWN = 5


def diagnose(
    files: Files,
    *,
    vehicle: VehicleFile,
    baseline: Annotated[
        Path | None,
        typer.Option(
            metavar="B.json",
            help="Baseline from sprung baseline. Default: left against right and the vehicle file, with wide limits.",
            show_default=False,
        ),
    ] = None,
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    window: Minutes = 10.0,
    false_alarms: Annotated[
        float,
        typer.Option(
            metavar="RATE", help="Rate of false alarms per vehicle and day of driving.", rich_help_panel=INPUT
        ),
    ] = 1e-3,
    hours_per_day: Annotated[
        float, typer.Option(metavar="H", help="Hours of driving per day.", rich_help_panel=INPUT)
    ] = 8.0,
    figures: Figures = None,
    json: Json = None,
) -> None:
    """Find which spring, damper, tyre or sensor changed, by how much, since when and with what certainty."""
    from dataclasses import replace

    from sprung._checks import check_number
    from sprung.diagnosis import diagnose as diagnosed
    from sprung.diagnosis import mode_changes, second_opinion
    from sprung.documents import diagnosis_document
    from sprung.vehicles import read_vehicle

    check_file("--json", json, inputs=[*files, vehicle, *([baseline] if baseline else [])])
    check_number("--hours-per-day", hours_per_day, above=0, at_most=24)
    description = read_vehicle(vehicle)
    normal = None if baseline is None else baseline_of(description, baseline)
    with progress_bar() as report:
        observations, outputs = observed(
            files, description, sampling_rate=sampling_rate, channels=channels, minutes=window, report=report
        )
        found = diagnosed(
            observations,
            normal,
            vehicle=description.name,
            false_alarms=false_alarms,
            windows_per_day=hours_per_day * 60 / window,
        )
        tests = {} if normal is None else compared(normal, observations, outputs)
        if tests:
            found = replace(found, notes=(*found.notes, second_opinion(list(tests.values()))))
        changes = [
            change
            for one in found.findings
            for change in mode_changes(description, one, normal, observations=observations)
        ]
        paths = [] if figures is None else _save(found, normal, changes, figures)
    if json is not None:
        write_json(diagnosis_document(found, modes=changes, residual_tests=tests), json)
    if json != "-":
        _show(found, changes, paths)
    if found.detection is None and not found.sensor_faults:
        raise DataError(f"no window can tell: {_why_not(found, normal)}")


def _why_not(found: "Diagnosis", normal: "Baseline | None") -> str:
    """Say why no window can tell, or why those that can were set aside."""
    reasons = [one.reason for one in found.observations if not one.is_conclusive]
    if reasons:
        return reasons[0]
    if normal is not None and found.observations:
        return "they have other components than the baseline: fit the same ones, or learn again"
    return found.notes[-1] if found.notes else "there is none"


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
    screen = console()
    screen.print(notes(_findings(diagnosis)))
    if diagnosis.detection is not None:
        screen.print(_hypotheses_table(diagnosis.detection))
    if changes:
        screen.print(_modes_table(changes))
    screen.print(notes([*diagnosis.notes, *(f"wrote {path}" for path in paths)]))


def _findings(diagnosis: "Diagnosis") -> list[str]:
    """Return findings and sensor faults in words."""
    sentences = [line for finding in diagnosis.findings for line in (finding.sentence, trend_in_words(finding.trend))]
    sentences += [
        f"sensor {fault.channel} is {fault.kind.replace('_', ' ')}: {fault.detail}" for fault in diagnosis.sensor_faults
    ]
    if diagnosis.detection is None:
        return sentences or ["inconclusive: no window was usable"]
    numbers = f"ln evidence {diagnosis.detection.evidence[-1]:.1f}; alarm threshold {diagnosis.detection.threshold:.1f}"
    return [*sentences, numbers] if sentences else [f"no change detected ({numbers})"]


def _hypotheses_table(detection: "Detection") -> "Table":
    rows = [
        (
            candidate.hypothesis.name.replace("_", " ").replace(".", " ").replace("all ", "every "),
            f"{candidate.log_evidence:.1f}",
            "" if candidate.change is None else f"{100 * candidate.change:+.1f}",
            "" if candidate.interval is None else " .. ".join(f"{100 * end:+.1f}" for end in candidate.interval),
        )
        for candidate in detection.candidates[:_SHOWN]
    ]
    return table("Hypotheses", ("hypothesis", "ln evidence", "change [%]", "95 % [%]"), rows, n_words=1)


def _modes_table(changes: "Sequence[ModeChange]") -> "Table":
    columns = (
        *("before [Hz]", "after [Hz]", "before [%]", "after [%]", "MAC"),
        *("measured before", "measured since", "label"),
    )
    rows = [
        (
            *(f"{frequency:.3g}" for frequency in change.frequency),
            *(f"{100 * ratio:.3g}" for ratio in change.damping),
            f"{change.mac:.3f}",
            _mode_in_words(change.measured_before),
            _mode_in_words(change.measured_since),
            change.label,
        )
        for change in changes
    ]
    return table(
        "Frequency and damping of the body modes, as the finding implies and as measured", columns, rows, n_words=0
    )


def trend_in_words(trend: "Trend | None") -> str:
    """Return a sentence about how a change develops."""
    if trend is None:
        return "no trend: it needs a single part and at least four windows since the onset"
    low, high = (f"{100 * end:+.1f}" for end in trend.interval)
    if trend.interval[0] * trend.interval[1] <= 0:
        return f"no trend: {low} to {high} % per hour of driving"
    text = f"trend: {100 * trend.per_hour:+.1f} % ({low} to {high}) per hour of driving"
    if trend.hours_to_limit is None:
        return text
    soonest, latest = trend.hours_to_limit
    return f"{text}, 30 % {f'in {soonest:.1f} to {latest:.1f} hours' if latest else 'is reached'}"


def _mode_in_words(mode: tuple[float, float] | None) -> str:
    """Return frequency and damping ratio of a mode; empty where it is unknown."""
    return "" if mode is None else f"{mode[0]:.3g} Hz, {100 * mode[1]:.3g} %"
