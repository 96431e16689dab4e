"""The command `sprung diagnose`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.baseline import Minutes, compared, observed, read_baseline
from sprung.cli.documents import write_json
from sprung.cli.files import INPUT, OUTPUT, Channels, Files, Json, SamplingRate, VehicleFile, check_file
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.errors import DataError

if TYPE_CHECKING:
    from sprung.diagnosis import Baseline, Diagnosis, ModeChange, Trend

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
    from sprung.vehicles import read_vehicle

    check_file("--json", json, inputs=[*files, vehicle, *([baseline] if baseline else [])])
    check_number("--hours-per-day", hours_per_day, above=0, at_most=24)
    description = read_vehicle(vehicle)
    normal = None if baseline is None else read_baseline(baseline, description)
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
        document = {
            **found.to_dict(),
            "modes": [change.to_dict() for change in changes],
            "residual_test": [{"time": time, "p_value": test.p_value} for time, test in tests.items()],
        }
        write_json(document, json)
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


def _save(found: "Diagnosis", normal: "Baseline | None", changes: "list[ModeChange]", folder: Path) -> list[Path]:
    """Write the figures."""
    from sprung.plotting import corner_changes_figure, evidence_figure, mode_changes_figure, trends_figure

    if found.detection is None:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {
        "evidence": evidence_figure(found),
        "trends": trends_figure(found, normal),
        "corners": corner_changes_figure(found, normal),
    }
    if changes:
        drawn["modes"] = mode_changes_figure(changes, heading=found.findings[0].sentence)
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=150)
    return [folder / f"{name}.png" for name in drawn]


def _show(found: "Diagnosis", changes: "list[ModeChange]", paths: list[Path]) -> None:
    """Print findings, sensor faults and the likeliest hypotheses."""
    screen = console()
    told = [line for one in found.findings for line in (one.sentence, _trend_words(one.trend))]
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
                "" if one.change is None else f"{100 * one.change:+.1f}",
                "" if one.interval is None else f"{100 * one.interval[0]:+.1f} .. {100 * one.interval[1]:+.1f}",
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
                _measured_words(one.measured_before),
                _measured_words(one.measured_since),
                one.label,
            )
            for one in changes
        ]
        columns_ = (
            *("before [Hz]", "after [Hz]", "damping [%]", "after [%]", "MAC"),
            *("measured before", "measured since", "label"),
        )
        title = "Body modes as the finding implies, and as measured"
        screen.print(table(title, columns_, lines, n_words=0))
    screen.print(notes([*found.notes, *(f"wrote {path}" for path in paths)]))


def _trend_words(trend: "Trend | None") -> str:
    """Return in words how a change goes on."""
    if trend is None:
        return "no trend: that takes a named part and four windows since the onset"
    low, high = (f"{100 * end:+.1f}" for end in trend.interval)
    if trend.interval[0] * trend.interval[1] <= 0:
        return f"no trend: {low} to {high} % per hour of driving"
    text = f"trend: {100 * trend.per_hour:+.1f} % ({low} to {high}) per hour of driving"
    if trend.hours_to_limit is None:
        return text
    soonest, latest = trend.hours_to_limit
    return f"{text}, 30 % {f'in {soonest:.1f} to {latest:.1f} hours' if latest else 'is reached'}"


def _measured_words(mode: tuple[float, float] | None) -> str:
    """Return frequency and damping of a mode in words; nothing where it was not met."""
    return "" if mode is None else f"{mode[0]:.3g} Hz, {100 * mode[1]:.3g} %"
