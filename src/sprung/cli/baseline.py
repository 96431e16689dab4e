"""The command `sprung baseline`."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.checks import check_file, names
from sprung.cli.options import Channels, Files, Json, Minutes, SamplingRate, VehicleFile, option
from sprung.cli.output import show, write_result
from sprung.cli.progress import progress_bar
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.diagnosis import Baseline, Observation
    from sprung.vehicles import Vehicle


def baseline(
    files: Files,
    *,
    vehicle: VehicleFile,
    out: Annotated[Path, option("B.json", "Baseline file to write.")],
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    window: Minutes = 10.0,
    least_windows: Annotated[int | None, option("N", "Least number of usable windows (6).", "--windows", min=2)] = None,
    previous: Annotated[Path | None, option("B.json", "Baseline to replace, such as after maintenance.")] = None,
    reason: Annotated[
        str, option("TEXT", "Reason for learning, such as 'new dampers'; required with --previous.", show_default=False)
    ] = "",
    json: Json = None,
) -> None:
    """Learn the baseline of a vehicle from drives while it is healthy."""
    from sprung import tables
    from sprung.diagnosis import LEAST_WINDOWS, learn
    from sprung.documents import baseline_document, write_baseline
    from sprung.vehicles import read_vehicle

    if previous is not None and not reason.strip():
        raise ParameterError("--previous requires --reason TEXT, such as 'new dampers'")
    check_file("--out", out, inputs=[*files, vehicle])
    check_file("--json", json, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    before = None if previous is None else baseline_of(description, previous)
    with progress_bar() as report:
        observations = observed(
            files, description, sampling_rate=sampling_rate, channels=channels, minutes=window, report=report
        )
    least = LEAST_WINDOWS if least_windows is None else least_windows
    learnt = learn(observations, reason=reason.strip() or "first learning", previous=before, least_windows=least)
    write_baseline(learnt, out)
    if write_result(baseline_document(learnt), json):
        sentences = tables.baseline_in_words(learnt, n_windows=len(observations))
        show(tables.baseline_table(learnt), [*sentences, f"wrote {out}"])


def baseline_of(vehicle: "Vehicle", path: Path) -> "Baseline":
    """Read the baseline of a vehicle; that of another vehicle is refused."""
    from sprung.documents import read_baseline

    baseline = read_baseline(path)
    if baseline.vehicle != vehicle.name:
        raise ParameterError(
            f"{path} is the baseline of the vehicle {baseline.vehicle!r}, but the vehicle file describes "
            f"{vehicle.name!r}: give a baseline of {vehicle.name!r}, or learn one with `sprung baseline`"
        )
    return baseline


def observed(
    files: list[Path],
    vehicle: "Vehicle",
    *,
    sampling_rate: float | None,
    channels: str | None,
    minutes: float,
    report: Callable[[str, float], None],
) -> "list[Observation]":
    """Return the observations of all windows of files."""
    from sprung._checks import check_number
    from sprung.diagnosis import observe_window, windows
    from sprung.formats.records import read_records

    check_number("--window", minutes, at_least=1)
    recordings = read_records(files, sampling_rate=sampling_rate, channels=names(channels), on_progress=report)
    observations: list[Observation] = []
    for number, (time, part) in enumerate(windows(recordings, length=60 * minutes), start=1):
        report(f"window {number}", 0.5)
        observations.append(observe_window(part, vehicle, time=time))
    return observations
