"""The command `sprung baseline`."""

import json as json_module
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import INPUT, Channels, Files, Json, SamplingRate, VehicleFile, check_file, names, records
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.diagnosis import Baseline, Observation, ResidualTest
    from sprung.recording import Recording
    from sprung.vehicles import Vehicle

Minutes = Annotated[
    float, typer.Option("--window", metavar="MINUTES", help="Length of a window.", rich_help_panel=INPUT)
]


def baseline(
    files: Files,
    *,
    vehicle: VehicleFile,
    out: Annotated[Path, typer.Option(metavar="B.json", help="Baseline to write.", show_default=False)],
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    window: Minutes = 10.0,
    n_windows: Annotated[
        int, typer.Option("--windows", metavar="N", min=2, help="Fewest windows that teach a baseline.")
    ] = 6,
    previous: Annotated[
        Path | None,
        typer.Option(metavar="B.json", help="Baseline that this one replaces, after maintenance.", show_default=False),
    ] = None,
    reason: Annotated[
        str,
        typer.Option(
            metavar="TEXT", help="Why it is learnt, such as 'new dampers'; needed with --previous.", show_default=False
        ),
    ] = "",
    json: Json = None,
) -> None:
    """Learn what is normal for a vehicle from drives while it is healthy."""
    from dataclasses import replace

    from sprung.diagnosis import FEWEST_RESIDUALS, learn, learn_residuals
    from sprung.vehicles import read_vehicle

    if previous is not None and not reason.strip():
        raise ParameterError("learning again after --previous needs --reason TEXT, such as 'new dampers'")
    check_file("--out", out, inputs=[*files, vehicle])
    check_file("--json", json, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    before = None if previous is None else read_baseline(previous, description)
    with progress_bar() as report:
        observations, outputs = observed(
            files, description, sampling_rate=sampling_rate, channels=channels, minutes=window, report=report
        )
    found = learn(
        observations,
        vehicle=description.name,
        reason=reason.strip() or "first learning",
        previous=before,
        n_windows=n_windows,
    )
    sound = [
        part for one, part in zip(observations, outputs, strict=True) if part is not None and one.time in found.taught
    ]
    if len(sound) >= FEWEST_RESIDUALS:
        found = replace(found, residuals=learn_residuals(sound))
    write_json(found.to_dict(), str(out))
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        _show(found, observations, out)


def read_baseline(path: Path, vehicle: "Vehicle") -> "Baseline":
    """Return the baseline of a vehicle from a file."""
    from sprung.diagnosis import baseline_from_dict

    try:
        document = json_module.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}: give a baseline that `sprung baseline` wrote") from None
    except ValueError:
        raise ParameterError(f"{path} is no JSON: give a baseline that `sprung baseline` wrote") from None
    if not isinstance(document, dict):
        raise ParameterError(f"{path} is no baseline: give one that `sprung baseline` wrote")
    found = baseline_from_dict(document)
    if found.vehicle != vehicle.name:
        raise ParameterError(
            f"{path} was learnt of the vehicle {found.vehicle!r}, and the vehicle file is of {vehicle.name!r}: give a "
            f"baseline of {vehicle.name!r}, or learn one with `sprung baseline`"
        )
    return found


def observed(
    files: list[Path],
    vehicle: "Vehicle",
    *,
    sampling_rate: float | None,
    channels: str | None,
    minutes: float,
    report: Callable[[str, float], None],
) -> "tuple[list[Observation], list[Recording | None]]":
    """Return the observations of all windows of files, and the outputs of those with sound sensors."""
    from sprung._checks import check_number
    from sprung.diagnosis import VEHICLE_RATE, observe, outputs_at, windows

    check_number("--window", minutes, at_least=1)
    recordings = records(files, sampling_rate=sampling_rate, channels=names(channels), report=report)
    found: list[Observation] = []
    outputs: list[Recording | None] = []
    for number, (time, part) in enumerate(windows(recordings, length=60 * minutes), start=1):
        report(f"window {number}", 0.5)
        found.append(observe(part, vehicle, time=time))
        # What failing sensors say is no witness.
        outputs.append(None if found[-1].sensor_faults else outputs_at(part, VEHICLE_RATE))
    return found, outputs


def compared(
    normal: "Baseline", observations: "list[Observation]", outputs: "list[Recording | None]"
) -> "dict[float, ResidualTest]":
    """Return the residual tests of the windows with sound sensors, by time."""
    from sprung.diagnosis import compare_residuals

    reference = normal.residuals
    if reference is None:
        return {}
    return {
        one.time: compare_residuals(reference, part)
        for one, part in zip(observations, outputs, strict=True)
        if part is not None and one.is_conclusive and part.names == reference.channels
    }


def _show(found: "Baseline", observations: "list[Observation]", out: Path) -> None:
    """Print what is normal."""
    import numpy as np

    deviations = np.sqrt(np.diag(found.covariance))
    rows = [
        (str(component).replace("_", " ").replace(".", " "), f"{100 * np.expm1(mean):+.1f}", f"{100 * deviation:.1f}")
        for component, mean, deviation in zip(found.components, found.mean, deviations, strict=True)
    ]
    screen = console()
    screen.print(table("Baseline", ("component", "over nominal [%]", "std of a window [%]"), rows, n_words=1))
    met = ", ".join(f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in found.ranges.items())
    screen.print(
        notes(
            [
                f"version {found.version} ({found.reason}): {found.n_windows} of {len(observations)} windows taught it",
                *([f"conditions met: {met}"] if met else []),
                *found.notes,
                f"wrote {out}",
            ]
        )
    )
