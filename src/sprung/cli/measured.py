"""The commands `sprung plan`, `sprung road` and `sprung ride`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from sprung.cli.options import (
    INPUT,
    OUTPUT,
    AllowMissing,
    Files,
    Reading,
    VehicleFile,
    check_file,
    complete_vehicles,
    option,
    shares_options,
)
from sprung.cli.output import Output, progress_bar


@shares_options
def plan(
    vehicle: Annotated[
        Path, typer.Argument(metavar="V.toml|NAME", help="Vehicle file.", autocompletion=complete_vehicles)
    ],
    *,
    kit: Annotated[
        Literal["four", "three", "two", "imu"] | None,
        option(None, "Sensors: accelerometers above the wheels, or an IMU. Default: those of the file."),
    ] = None,
    minutes: Annotated[float, option("M", "Length of a window.", panel=INPUT)] = 10.0,
    speed: Annotated[tuple[float, float], option("LO HI", "Range of speeds, in m/s.", panel=INPUT)] = (8.0, 25.0),
    road: Annotated[
        str, option("A..H|A:0.3,B:0.5,..", "Class of the road, ISO 8608, or classes with their shares.", panel=INPUT)
    ] = "B",
    has_speed: Annotated[
        bool, option(None, "Whether the speed will be recorded.", "--with-speed/--without-speed", panel=INPUT)
    ] = True,
    false_alarms: Annotated[float, option("RATE", "False alarms per vehicle and day of driving.", panel=INPUT)] = 1e-3,
    noise: Annotated[
        float | None,
        option("UG", "Noise density of the accelerometers, in micro-g per root of Hz. Default: 102.", panel=INPUT),
    ] = None,
    best: Annotated[int | None, option("N", "Also find the best places of N accelerometers.", panel=INPUT)] = None,
    output: Output,
) -> None:
    """Predict what a kit of sensors will see on a vehicle, and how soon, before it is bought."""
    from sprung import kits
    from sprung.excitation import road_mix
    from sprung.likelihood.expected import ExpectedDrive
    from sprung.results import tables
    from sprung.results.documents import plan_document
    from sprung.units import conversion
    from sprung.vehicles import read_vehicle

    output.check(vehicle)
    description = read_vehicle(vehicle)
    drive = ExpectedDrive(minutes=minutes, speed=speed, roughness=road_mix(road), has_speed=has_speed)
    if noise is not None:
        drive = replace(drive, accelerometer_noise=noise * conversion("ug")[1])
    with_kit = description if kit is None else kits.kit_of(description, kit)
    planned = kits.plan(with_kit, drive=drive, false_alarms=false_alarms)
    sentences = tables.describe_plan(planned)
    if best is not None:
        chosen = kits.best_places(description, kits.candidates(description), best, drive=drive)
        sentences.append(f"best places of {best}: {', '.join(sensor.channel for sensor in chosen)}")
    output.draw(lambda drawn: {"plan": drawn.kit_figure(planned)})
    shown = tables.plan_tables(planned)
    title = f"What a kit will see on {description.name}"
    output.report(lambda pages, inputs: pages.plain_report(title, sentences, shown, planned, inputs), [vehicle], None)
    output.show(plan_document(planned), *shown, notes=sentences)


@shares_options
def road(
    files: Files,
    *,
    vehicle: VehicleFile,
    stretch: Annotated[float, option("METRES", "Length of a stretch.", panel=INPUT)] = 100.0,
    out: Annotated[
        Path | None, option("F.geojson|F.gpx|F.csv", "Write stretches and events for maps or tables.", panel=OUTPUT)
    ] = None,
    allow_missing: AllowMissing = False,
    output: Output,
    reading: Reading,
) -> None:
    """Measure the road under a vehicle: roughness index, classes, potholes, along the way.

    Several files are passes over one road, which are averaged: by latitude and longitude where all have them, else by
    the distance from where each begins. A file that begins when the one before it ends continues its drive.
    """
    from sprung.results import tables
    from sprung.results.documents import road_document
    from sprung.road import drives_of, survey_passes, write_survey
    from sprung.vehicles import read_vehicle

    output.check(*files, vehicle)
    if out is not None:
        check_file("--out", out, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    may_lack = reading.may_lack(description, allow_missing=allow_missing)
    with progress_bar() as report:
        drives = drives_of(reading.records([path], report) for path in files)
        survey = survey_passes(drives, description, stretch=stretch, allow_missing=may_lack, on_progress=report)
    source = ", ".join(path.name for path in files)
    output.draw(lambda drawn: {"road": drawn.road_figure(survey, source=source)})
    if out is not None:
        write_survey(survey, out)
        output.paths.append(out)
    shown = [tables.road_table(survey), *([tables.events_table(survey)] if survey.events else [])]
    output.report(
        lambda pages, inputs: pages.plain_report(f"Road of {inputs.title}", survey.notes, shown, survey, inputs),
        files,
        reading,
        vehicle=vehicle,
    )
    output.show(road_document(survey), *shown, notes=survey.notes)


@shares_options
def ride(
    files: Files,
    *,
    standard: Annotated[
        Literal["iso2631", "en12299", "sperling", "en14363"],
        option(
            None,
            "ISO 2631-1 (seat), EN 12299 (floor), Sperling's Wz, or EN 14363 (lateral, of bogie frames).",
            panel=INPUT,
        ),
    ] = "iso2631",
    vehicle: Annotated[
        Path | None, option("V.toml|NAME", "Vehicle file, for units and directions of the sensors.", panel=INPUT)
    ] = None,
    travel: Annotated[float | None, option("METRES", "Available travel of a suspension.", panel=INPUT)] = None,
    bogie_mass: Annotated[
        float | None, option("KG", "Mass of a bogie with its wheelsets, for the limit of EN 14363.", panel=INPUT)
    ] = None,
    output: Output,
    reading: Reading,
) -> None:
    """Assess ride comfort and running stability by standards, and the use of the suspensions' travel."""
    from sprung.results import tables
    from sprung.results.documents import ride_document
    from sprung.ride import assess_ride
    from sprung.vehicles import read_vehicle
    from sprung.vehicles.window import window_of

    output.check(*files)
    with progress_bar() as report:
        recordings = list(reading.records(files, report))
        if vehicle is not None:
            description = read_vehicle(vehicle)
            recordings = [window_of(run, description, allow_missing=True).recording for run in recordings]
        result = assess_ride(recordings, standards=(standard,), available_travel=travel, bogie_mass=bogie_mass)
    source = ", ".join(path.name for path in files)
    output.draw(lambda drawn: {"ride": drawn.ride_figure(result, source=source)})
    sentences, shown = tables.describe_ride(result), tables.ride_tables(result)
    output.report(
        lambda pages, inputs: pages.plain_report(f"Ride of {inputs.title}", sentences, shown, result, inputs),
        files,
        reading,
    )
    output.show(ride_document(result), *shown, notes=sentences)
