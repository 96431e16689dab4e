"""The command `sprung diagnose`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.baseline import Minutes, VehicleFile, compared, observed, read_baseline, vehicle_of
from sprung.cli.documents import write_json
from sprung.cli.files import INPUT, OUTPUT, Channels, Files, Json, SamplingRate, check_file
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.errors import DataError

if TYPE_CHECKING:
    from sprung.diagnosis import Baseline, Diagnosis, ModeChange

_SHOWN = 5


def diagnose(
    files: Files,
    *,
    vehicle: VehicleFile,
    baseline: Annotated[
        Path | None,
        typer.Option(
            metavar="B.json",
            help="From sprung baseline; without it: left against right and the vehicle file, with wide limits.",
            show_default=False,
        ),
    ] = None,
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    window: Minutes = 10.0,
    false_alarms: Annotated[
        float, typer.Option(metavar="RATE", help="False alarms per vehicle and day of driving.", rich_help_panel=INPUT)
    ] = 1e-3,
    hours_per_day: Annotated[
        float, typer.Option(metavar="H", help="Hours of driving in a day.", rich_help_panel=INPUT)
    ] = 8.0,
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for figures.", show_default=False, rich_help_panel=OUTPUT)
    ] = None,
    json: Json = None,
) -> None:
    """Say which spring, damper, tyre or sensor changed, by how much, since when and how sure it is."""
    from dataclasses import replace

    from sprung._checks import check_number
    from sprung.diagnosis import diagnose as diagnosed
    from sprung.diagnosis import mode_changes, second_opinion

    check_file("--json", json, inputs=[*files, vehicle, *([baseline] if baseline else [])])
    check_number("--hours-per-day", hours_per_day, above=0, at_most=24)
    description = vehicle_of(vehicle)
    normal = None if baseline is None else read_baseline(baseline)
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
        changes = [change for one in found.findings for change in mode_changes(description, one, normal)]
        paths = [] if figures is None else _save(found, normal, changes, figures)
    if json is not None:
        document = {
            **found.to_dict(),
            "modes": [change.to_dict() for change in changes],
            "residual_test": [{"time": time, "p_value": test.p_value} for time, test in tests.items()],
        }
        write_json(document, json)
    if json != "-":
        _show(found, changes, paths)
    if found.detection is None and not found.sensor_faults:
        raise DataError(f"no window can tell: {observations[0].reason if observations else 'there is none'}")


def _save(found: "Diagnosis", normal: "Baseline | None", changes: "list[ModeChange]", folder: Path) -> list[Path]:
    """Write the figures."""
    from sprung.plotting import corner_changes_figure, evidence_figure, mode_changes_figure, trends_figure

    if found.detection is None:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in (("evidence", evidence_figure), ("trends", trends_figure)):
        paths.append(folder / f"{name}.png")
        draw(found).savefig(paths[-1], dpi=150)
    paths.append(folder / "corners.png")
    corner_changes_figure(found, normal).savefig(paths[-1], dpi=150)
    if changes:
        paths.append(folder / "modes.png")
        mode_changes_figure(changes, heading=found.findings[0].sentence).savefig(paths[-1], dpi=150)
    return paths


def _show(found: "Diagnosis", changes: "list[ModeChange]", paths: list[Path]) -> None:
    """Print findings, sensor faults and the likeliest hypotheses."""
    screen = console()
    told = [finding.sentence for finding in found.findings]
    told += [
        f"sensor {fault.channel} is {fault.kind.replace('_', ' ')}: {fault.detail}" for fault in found.sensor_faults
    ]
    if not told:
        told = ["no window can tell whether anything has changed" if found.detection is None else "nothing has changed"]
    screen.print(notes(told))
    if found.detection is not None:
        rows = [
            (
                one.hypothesis.name.replace("_", " ").replace(".", " ").replace("all ", "every "),
                f"{one.log_evidence:.1f}",
                f"{100 * one.change:+.1f}" if one.score else "",
                f"{100 * one.interval[0]:+.1f} .. {100 * one.interval[1]:+.1f}" if one.score else "",
            )
            for one in found.detection.candidates[:_SHOWN]
        ]
        columns = ("hypothesis", "ln evidence", "change [%]", "95 % [%]")
        screen.print(table("What may have changed", columns, rows, n_words=1))
        last = found.detection.evidence[-1]
        screen.print(notes([f"ln evidence of any change {last:.1f}; an alarm needs {found.detection.threshold:.1f}"]))
    if changes:
        lines = [
            (
                f"{one.frequency[0]:.3g}",
                f"{one.frequency[1]:.3g}",
                f"{100 * one.damping[0]:.3g}",
                f"{100 * one.damping[1]:.3g}",
                f"{one.mac:.3f}",
                one.label,
            )
            for one in changes
        ]
        columns_ = ("before [Hz]", "after [Hz]", "damping [%]", "after [%]", "MAC", "label")
        screen.print(table("Body modes of the baseline and with the change", columns_, lines, n_words=0))
    screen.print(notes([*found.notes, *(f"wrote {path}" for path in paths)]))
