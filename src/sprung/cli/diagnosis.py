"""The commands `sprung baseline` and `sprung diagnose`."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.checks import check_file, check_outputs, may_lack_sensors
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
from sprung.cli.output import progress_bar, show, write_figures, write_page, write_result, written
from sprung.cli.reading import reads_files
from sprung.errors import DataError, ParameterError

if TYPE_CHECKING:
    from sprung.calibration import Calibration
    from sprung.diagnosis import Baseline, Observation, TypeBaseline
    from sprung.formats import ReadSettings
    from sprung.recording import Recording
    from sprung.vehicles import Vehicle


@reads_files
def baseline(
    files: Files,
    *,
    vehicle: VehicleFile,
    out: Annotated[Path, option("B.json", "Baseline file to write.")],
    reading: "ReadSettings",
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
) -> None:
    """Learn the baseline of a vehicle from drives while it is healthy."""
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
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
    with progress_bar() as report:

        def parts() -> "Iterator[tuple[float, Recording]]":
            return windows_of(files, reading=reading, minutes=window, report=report)

        observations = observed(parts(), description, allow_missing=may_lack, report=report)
        calibration = _calibration(parts, description, observations, is_wanted=calibrate if of_type is None else False)
        if calibration is not None:
            observations = observed(parts(), calibration.vehicle, allow_missing=may_lack, report=report)
    learnt = learn(
        observations,
        reason=reason.strip() or "first learning",
        previous=before,
        type_baseline=type_baseline,
        min_windows=min_windows,
    )
    if calibration is not None or (before is not None and before.vehicle_file):
        complete = description if calibration is None else calibration.vehicle
        learnt = replace(learnt, vehicle_file=vehicle_text(complete))
    write_baseline(learnt, out)
    if write_result(baseline_document(learnt), json):
        layout = list(dict.fromkeys(note for observation in observations for note in observation.notes))
        sentences = [*tables.baseline_in_words(learnt, n_windows=len(observations)), *layout]
        completed = [] if calibration is None else tables.calibration_in_words(calibration)
        show(tables.baseline_table(learnt), [*sentences, *completed, *written([out], json)])


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
    from sprung.results import page as pages
    from sprung.results import tables
    from sprung.results.documents import diagnosis_document
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
            lambda inputs: pages.diagnosis_report(result, inputs, baseline=normal, changes=changes, document=document),
            files,
            reading=reading,
            others={"vehicle": vehicle, "baseline": baseline, "type": of_type},
        )
    if write_result(document, json):
        words = [*result.notes, *written(paths, json)]
        show(tables.diagnosis_in_words(result), *tables.diagnosis_tables(result, changes), words)
    if result.detection is None and not result.sensor_faults:
        raise DataError(f"no window was usable: {tables.why_unusable(result, normal)}")


@reads_files
def compare(
    files: Files,
    *,
    others: Annotated[list[Path], option("FILE", "Drive of the second set; may be repeated.", "--with")],
    vehicle: VehicleFile,
    reading: "ReadSettings",
    allow_missing: AllowMissing = False,
    window: Minutes = 5.0,
    false_alarms: Annotated[
        float, option("P", "Probability that an unchanged vehicle is called different.", panel=INPUT)
    ] = 0.01,
    json: Json = None,
) -> None:
    """Compare two sets of drives of one vehicle: what differs, by how much, and what would have been found."""
    from sprung import diagnosis
    from sprung.results import tables
    from sprung.results.documents import comparison_document
    from sprung.vehicles import read_vehicle

    check_file("--json", json, inputs=[*files, *others, vehicle])
    description = read_vehicle(vehicle)
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
    with progress_bar() as report:
        first, second = (
            observed(
                windows_of(each, reading=reading, minutes=window, report=report),
                description,
                allow_missing=may_lack,
                report=report,
            )
            for each in (files, others)
        )
        result = diagnosis.compare(first, second, false_alarms=false_alarms)
    if write_result(comparison_document(result), json):
        parts = tables.diagnosis_tables(result, ())
        show(tables.diagnosis_in_words(result), *parts, [*result.notes, *written([], json)])
    if result.detection is None and not result.sensor_faults:
        raise DataError(f"no window was usable: {tables.why_unusable(result, result.baseline)}")


def _calibration(
    parts: "Callable[[], Iterator[tuple[float, Recording]]]",
    vehicle: "Vehicle",
    observations: "list[Observation]",
    *,
    is_wanted: bool | None,
) -> "Calibration | None":
    """Return the calibration of a vehicle file, if requested or if the file fits the windows badly; None otherwise."""
    from sprung.calibration import calibrate, calibrated_if_imperfect, chosen_windows, usable_spectra

    if is_wanted is False:
        return None
    errors = [one.conditions.get("model_error", math.inf) for one in observations]
    chosen = chosen_windows(len(errors))
    recordings = (part for number, (_, part) in enumerate(parts()) if number in chosen)
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
    if baseline.vehicle != vehicle.name:
        raise ParameterError(
            f"{path} is the baseline of the vehicle {baseline.vehicle!r}, but the vehicle file describes "
            f"{vehicle.name!r}: give a baseline of {vehicle.name!r}, or learn one with `sprung baseline`"
        )
    return baseline


def type_of(vehicle: "Vehicle", path: Path) -> "TypeBaseline":
    """Read the baseline of a vehicle's type; that of another type is refused."""
    from sprung.results.documents import read_type_baseline

    type_baseline = read_type_baseline(path)
    if type_baseline.name != vehicle.name:
        raise ParameterError(
            f"{path} is the baseline of the type {type_baseline.name!r}, but the vehicle file describes "
            f"{vehicle.name!r}: give that of {vehicle.name!r}, or learn one with `sprung fleet rank`"
        )
    return type_baseline


def completed_vehicle(vehicle: "Vehicle", baseline: "Baseline | None") -> "Vehicle":
    """Return the vehicle in terms of which a baseline was learnt: that of its calibration, if there was one."""
    from sprung.vehicles import vehicle_from_text

    if baseline is None or not baseline.vehicle_file:
        return vehicle
    return vehicle_from_text(baseline.vehicle_file, source="the vehicle file of the baseline")


def windows_of(
    files: list[Path],
    *,
    reading: "ReadSettings",
    minutes: float,
    report: Callable[[str, float], None],
) -> "Iterator[tuple[float, Recording]]":
    """Return the windows of files with their times, read one after the other."""
    from sprung._checks import check_number
    from sprung.diagnosis import windows
    from sprung.formats import read_records

    check_number("--window", minutes, at_least=1)
    recordings = read_records(files, settings=reading, on_progress=report)
    return windows(recordings, length=60 * minutes)


def observed(
    parts: "Iterable[tuple[float, Recording]]",
    vehicle: "Vehicle",
    *,
    allow_missing: bool,
    report: Callable[[str, float], None],
) -> "list[Observation]":
    """Return the observations of windows."""
    from sprung.diagnosis import observe_window

    observations: list[Observation] = []
    for number, (time, part) in enumerate(parts, start=1):
        report(f"window {number}", 0.5)
        observations.append(observe_window(part, vehicle, time=time, allow_missing=allow_missing))
    return observations
