"""The commands `sprung baseline` and `sprung diagnose`."""

import math
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from sprung.cli.options import (
    INPUT,
    AllowMissing,
    Files,
    Json,
    Minutes,
    Reading,
    TypeFile,
    VehicleFile,
    check_file,
    option,
    shares_options,
)
from sprung.cli.output import Output, progress_bar, show, write_result, written
from sprung.errors import DataError, ParameterError

if TYPE_CHECKING:
    from sprung.calibration import Calibration
    from sprung.diagnosis import Baseline, Observation, TypeBaseline
    from sprung.recording import Recording
    from sprung.vehicles import Vehicle


@shares_options
def baseline(
    files: Files,
    *,
    vehicle: VehicleFile,
    out: Annotated[Path, option("B.json", "Baseline file to write.")],
    allow_missing: AllowMissing = False,
    window: Minutes = 10.0,
    min_windows: Annotated[
        int | None, option("N", "Minimum number of usable windows (6; 2 with --type).", "--windows", min=2)
    ] = None,
    of_type: TypeFile = None,
    previous: Annotated[Path | None, option("B.json", "Baseline to replace, such as after maintenance.")] = None,
    reason: Annotated[
        str, option("TEXT", "Reason for learning, such as 'new dampers'; required with --previous.", show_default=False)
    ] = "",
    calibrate: Annotated[
        bool | None,
        option(
            None,
            "Complete the vehicle file first. Default: if it fits badly or sensors are out of place.",
            "--calibrate/--no-calibrate",
            panel=INPUT,
        ),
    ] = None,
    json: Json = None,
    reading: Reading,
) -> None:
    """Learn the baseline of a healthy vehicle from drives."""
    from sprung.baseline_progress import learning_progress
    from sprung.diagnosis import learn
    from sprung.results import tables
    from sprung.results.documents import baseline_document, write_baseline
    from sprung.vehicles import read_vehicle, vehicle_text

    if previous is not None and not reason.strip():
        raise ParameterError("--previous requires --reason TEXT, such as 'new dampers'")
    if of_type is not None and calibrate:
        raise ParameterError("--calibrate changes the vehicle file on which the type's baseline rests: omit one")
    inputs = [*files, vehicle, *filter(None, (of_type,))]
    check_file("--out", out, inputs=inputs)
    check_file("--json", json, inputs=inputs)
    description = read_vehicle(vehicle)
    type_baseline = None if of_type is None else type_of(description, of_type)
    before = None if previous is None else baseline_of(description, previous)
    description = completed_vehicle(description, before)
    with progress_bar() as report:
        drives = _Drives(files, reading, window, allow_missing, report)
        observations = drives.observed(description)
        is_wanted = calibrate if of_type is None else False
        calibration = _calibration(drives, description, observations, is_wanted=is_wanted)
        if calibration is not None:
            observations = drives.observed(calibration.vehicle)
    complete = description if calibration is None else calibration.vehicle
    progress = str(learning_progress(observations, complete))
    try:
        learnt = learn(
            observations,
            reason=reason.strip() or "first learning",
            previous=before,
            type_baseline=type_baseline,
            min_windows=min_windows,
        )
    except DataError as error:
        raise DataError(f"{error}; {progress}" if any(one.is_valid for one in observations) else str(error)) from error
    if calibration is not None or (before is not None and before.vehicle_file):
        learnt = replace(learnt, vehicle_file=vehicle_text(complete))
    write_baseline(learnt, out)
    if write_result(baseline_document(learnt), json):
        layout = list(dict.fromkeys(note for observation in observations for note in observation.notes))
        sentences = [*tables.describe_baseline(learnt, n_windows=len(observations)), *layout]
        completed = [] if calibration is None else tables.describe_calibration(calibration)
        show(tables.baseline_table(learnt), [*sentences, progress, *completed, *written([out], json)])


@shares_options
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
    allow_missing: AllowMissing = False,
    window: Minutes = 10.0,
    false_alarms: Annotated[float, option("RATE", "False alarms per vehicle and day of driving.", panel=INPUT)] = 1e-3,
    hours_per_day: Annotated[float, option("H", "Hours of driving per day.", panel=INPUT)] = 8.0,
    output: Output,
    reading: Reading,
) -> None:
    """Find which part or sensor changed, since when, and by how much. Each change has an interval."""
    from sprung import diagnosis
    from sprung._checks import check_number
    from sprung.results import tables
    from sprung.results.documents import diagnosis_document
    from sprung.vehicles import read_vehicle

    output.check(*files, vehicle, baseline, of_type)
    check_number("--hours-per-day", hours_per_day, above=0, at_most=24)
    if baseline is not None and of_type is not None:
        raise ParameterError("--type is for a vehicle without its own baseline: give --type or --baseline, not both")
    description = read_vehicle(vehicle)
    type_baseline = None if of_type is None else type_of(description, of_type)
    normal = None if baseline is None else baseline_of(description, baseline)
    description = completed_vehicle(description, normal)
    with progress_bar() as report:
        observations = _Drives(files, reading, window, allow_missing, report).observed(description, normal)
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
        if result.detection is not None:
            output.draw(lambda drawn: drawn.saving.diagnosis_figures(result, normal, changes))
        document = diagnosis_document(result, modes=changes)
        facts: dict[str, Any] = {"baseline": normal, "changes": changes, "document": document}
        output.report(
            lambda pages, inputs: pages.diagnosis_report(result, inputs, **facts),
            files,
            reading,
            vehicle=vehicle,
            baseline=baseline,
            type=of_type,
        )
    shown = tables.diagnosis_tables(result, changes)
    output.show(document, tables.describe_diagnosis(result), *shown, notes=result.notes)
    if result.detection is None and not result.sensor_faults:
        raise DataError(f"no window was usable: {tables.why_unusable(result, normal)}")


@shares_options
def compare(
    files: Files,
    *,
    others: Annotated[list[Path], option("FILE", "Drive of the second set; may be repeated.", "--with")],
    vehicle: VehicleFile,
    allow_missing: AllowMissing = False,
    window: Minutes = 5.0,
    false_alarms: Annotated[
        float, option("P", "Probability that an unchanged vehicle is called different.", panel=INPUT)
    ] = 0.01,
    json: Json = None,
    reading: Reading,
) -> None:
    """Compare two sets of drives of one vehicle. What differs, by how much, and what would have been found."""
    from sprung import diagnosis
    from sprung.results import tables
    from sprung.results.documents import comparison_document
    from sprung.vehicles import read_vehicle

    check_file("--json", json, inputs=[*files, *others, vehicle])
    description = read_vehicle(vehicle)
    with progress_bar() as report:
        sets = (_Drives(each, reading, window, allow_missing, report) for each in (files, others))
        first, second = (each.observed(description) for each in sets)
        try:
            result = diagnosis.compare(first, second, false_alarms=false_alarms)
        except DataError as error:
            if not all(_is_free_motion(each, description, reading) for each in (files, others)):
                raise
            earlier = [part for path in files for part in ("--before", str(path))]
            command = shlex.join(["sprung", "bounce", *map(str, others), *earlier, "--vehicle", str(vehicle)])
            raise DataError(f"these are no drives but pushes, drops or releases: compare them by {command}") from error
    if write_result(comparison_document(result), json):
        parts = tables.diagnosis_tables(result, ())
        show(tables.describe_diagnosis(result), *parts, [*result.notes, *written([], json)])
    if result.detection is None and not result.sensor_faults:
        raise DataError(f"no window was usable: {tables.why_unusable(result, result.baseline)}")


def _is_free_motion(files: list[Path], vehicle: "Vehicle", reading: Reading) -> bool:
    """Return whether the first recording is of free motion, as `sprung bounce` takes it."""
    from sprung.identification.methods import free_fit
    from sprung.identification.settings import IdentificationSettings

    run = next(iter(reading.records(files[:1], lambda doing, share: None)))
    return free_fit([run], IdentificationSettings(allow_missing=True), vehicle) is not None


@dataclass(frozen=True)
class _Drives:
    """Recordings, read one after the other and cut into windows of some minutes."""

    files: list[Path]
    reading: Reading
    minutes: float
    allow_missing: bool
    report: Callable[[str, float], None]

    def windows(self) -> "Iterator[tuple[float, Recording]]":
        """Return the windows with their times."""
        from sprung._checks import check_number
        from sprung.diagnosis import windows

        check_number("--window", self.minutes, at_least=1)
        return windows(self.reading.records(self.files, self.report), length=60 * self.minutes)

    def observed(self, vehicle: "Vehicle", baseline: "Baseline | None" = None) -> "list[Observation]":
        """Return the observations of the windows; with a baseline, the fits start from it."""
        from sprung.diagnosis import observe_window
        from sprung.likelihood import CornerSettings

        settings = None if baseline is None else CornerSettings(expected=baseline.expected)
        may_lack = self.reading.may_lack(vehicle, allow_missing=self.allow_missing)
        observations: list[Observation] = []
        for number, (time, part) in enumerate(self.windows(), start=1):
            self.report(f"window {number}", 0.5)
            window = observe_window(part, vehicle, time=time, settings=settings, allow_missing=may_lack)
            observations.append(window)
        return observations


def _calibration(
    drives: _Drives, vehicle: "Vehicle", observations: "list[Observation]", *, is_wanted: bool | None
) -> "Calibration | None":
    """Return the calibration of a vehicle file, if requested or if the file fits the windows badly; None otherwise."""
    from sprung.calibration import calibrate, calibrated_if_imperfect, chosen_windows, usable_spectra
    from sprung.vehicles.sensor_checks import CONTRADICTIONS

    if is_wanted is False:
        return None
    errors = [one.conditions.get("model_error", math.inf) for one in observations]
    contradicted = [any(fault.kind in CONTRADICTIONS for fault in one.sensor_faults) for one in observations]
    # What was asked for refuses exchanged sensors itself; unasked, it would put them where they read as healthy ones.
    chosen = [number for number in chosen_windows(len(errors)) if is_wanted or not contradicted[number]]
    recordings = (part for number, (_, part) in enumerate(drives.windows()) if number in chosen)
    if is_wanted:
        return calibrate(list(recordings), vehicle, allow_missing=True)  # the windows have been observed
    try:
        return calibrated_if_imperfect(usable_spectra(recordings, vehicle), vehicle, model_errors=errors)
    except DataError:  # the observations state the reason
        return None


def baseline_of(vehicle: "Vehicle", path: Path) -> "Baseline":
    """Read the baseline of a vehicle; that of another vehicle is refused."""
    from sprung.results.documents import read_baseline

    baseline = read_baseline(path)
    _check_name(vehicle, path, f"vehicle {baseline.vehicle!r}", "a baseline", "sprung baseline")
    return baseline


def type_of(vehicle: "Vehicle", path: Path) -> "TypeBaseline":
    """Read the baseline of a vehicle's type; that of another type is refused."""
    from sprung.results.documents import read_type_baseline

    type_baseline = read_type_baseline(path)
    _check_name(vehicle, path, f"type {type_baseline.name!r}", "that", "sprung fleet rank")
    return type_baseline


def _check_name(vehicle: "Vehicle", path: Path, stated: str, wanted: str, command: str) -> None:
    if not stated.endswith(f" {vehicle.name!r}"):
        raise ParameterError(
            f"{path} is the baseline of the {stated}, but the vehicle file describes {vehicle.name!r}: give {wanted} of"
            f" {vehicle.name!r}, or learn one with `{command}`"
        )


def completed_vehicle(vehicle: "Vehicle", baseline: "Baseline | None") -> "Vehicle":
    """Return the vehicle in terms of which a baseline was learnt: that of its calibration, if there was one."""
    from sprung.vehicles import vehicle_from_text

    if baseline is None or not baseline.vehicle_file:
        return vehicle
    return vehicle_from_text(baseline.vehicle_file, source="the vehicle file of the baseline")
