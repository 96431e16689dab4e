"""The commands `sprung corners`, `bounce`, `plan`, `road`, `stability` and `ride`."""

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
    names,
    option,
    shares_options,
    vehicle_file,
)
from sprung.cli.output import Output, progress_bar


@shares_options
def corners(
    files: Files,
    *,
    vehicle: VehicleFile,
    allow_missing: AllowMissing = False,
    band: Annotated[
        tuple[float, float] | None, option("LO HI", "Frequencies to fit, in Hz. Default: around the vehicle's modes.")
    ] = None,
    segment: Annotated[float | None, option("SECONDS", "Length of a segment. Default: 7.5 periods of bounce.")] = None,
    width: Annotated[
        float, option("D", "Prior standard deviation of ln(value/nominal) of a component.", panel=INPUT)
    ] = 0.7,
    kind: Annotated[
        Literal["road", "rail", "rig"] | None,
        option(
            None,
            "Excitation of the wheels; that of a road or track reaches the rear wheels later. Default: the kind in"
            " the vehicle file.",
            panel=INPUT,
        ),
    ] = None,
    free: Annotated[
        str | None,
        option("A,B,..", "Components to fit, such as spring,damper or front_left.tyre. Default: all.", panel=INPUT),
    ] = None,
    payload: Annotated[
        bool | None,
        option(
            None,
            "Also fit mass, inertias and centre of gravity of the payload. Default: yes, except on a rig.",
            "--payload/--no-payload",
            panel=INPUT,
        ),
    ] = None,
    sensors: Annotated[
        bool, option(None, "Also fit positions and lags of the sensors.", "--sensors", panel=INPUT)
    ] = False,
    output: Output,
    reading: Reading,
) -> None:
    """Estimate spring, damper and tyre of each corner. From the spectra of a drive or a rig run."""
    from sprung.diagnosis.observation import fit_drive
    from sprung.likelihood import CornerSettings
    from sprung.likelihood.plate_test import plate_tests
    from sprung.results import tables
    from sprung.results.documents import corners_document
    from sprung.vehicles import read_vehicle

    output.check(*files, vehicle)
    description = read_vehicle(vehicle)
    may_lack = reading.may_lack(description, allow_missing=allow_missing)
    settings = CornerSettings(
        band=band,
        segment=segment,
        prior_std=width,
        free=names(free),
        has_payload=payload,
        has_free_sensors=sensors,
        kind=kind,
    )
    with progress_bar() as report:
        recordings = reading.records(files, report)
        report("fitting", 0.5)
        fit = fit_drive(recordings, description, settings=settings, allow_missing=may_lack)
        source = ", ".join(path.name for path in files)
        output.draw(lambda drawn: drawn.saving.corner_figures(fit, source=source))
        tests = plate_tests(fit)
        document = corners_document(fit, inspection=tests)
        output.report(
            lambda pages, inputs: pages.corners_report(fit, inputs, document=document), files, reading, vehicle=vehicle
        )
    inspection = [tables.plate_tests_table(tests)] if tests else []
    wheels = tables.run_out_tables(fit)
    shown = (tables.components_table(fit), tables.fitted_modes_table(fit), *inspection, *wheels)
    output.show(document, *shown, notes=[*tables.describe_payload(fit), *fit.notes])


@shares_options
def bounce(
    files: Files,
    *,
    vehicle: Annotated[str | None, vehicle_file("names of modes, springs and dampers.")] = None,
    before: Annotated[
        list[Path] | None,
        option(
            "FILE", "Earlier test of the same vehicle, with which this one is compared; may be repeated.", panel=INPUT
        ),
    ] = None,
    allow_missing: AllowMissing = False,
    output: Output,
    reading: Reading,
) -> None:
    """Identify the free motion after pushes, drops and releases. States frequency, damping and friction."""
    from sprung.bounce_tests import bounce as bounced
    from sprung.results import tables
    from sprung.results.documents import bounce_document
    from sprung.vehicles import read_description

    output.check(*files, *(before or ()), vehicle)
    with progress_bar() as report:
        description = None if vehicle is None else read_description(vehicle)
        may_lack = reading.may_lack(description, allow_missing=allow_missing)
        recordings = reading.records(files, report)
        earlier = reading.records(before, report) if before else None
        report("fitting the free motions", 0.5)
        result = bounced(recordings, vehicle=description, before=earlier, allow_missing=may_lack)
        source = ", ".join(path.name for path in files)
        output.draw(lambda drawn: {"bounce": drawn.bounce_figure(result, source=source)})
        document = bounce_document(result)
        output.report(
            lambda pages, inputs: pages.bounce_report(result, inputs, document=document),
            files,
            reading,
            vehicle=vehicle,
        )
    heading = f"{source}: {tables.describe_bounce(result)}"
    output.show(document, *tables.bounce_tables(result), notes=result.notes, heading=heading)


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
    sampling_rate: Annotated[float, option("HZ", "Sampling rate of the sensors.", panel=INPUT)] = 200.0,
    noise: Annotated[
        float | None,
        option("UG", "Noise density of the accelerometers, in micro-g per root of Hz. Default: 102.", panel=INPUT),
    ] = None,
    best: Annotated[int | None, option("N", "Also find the best places of N accelerometers.", panel=INPUT)] = None,
    output: Output,
) -> None:
    """Predict what a sensor kit will detect, and how soon."""
    from sprung import kits
    from sprung._checks import check_number
    from sprung.excitation import road_mix
    from sprung.likelihood.expected import ExpectedDrive
    from sprung.results import tables
    from sprung.results.documents import plan_document
    from sprung.units import conversion
    from sprung.vehicles import read_vehicle

    output.check(vehicle)
    description = read_vehicle(vehicle)
    drive = ExpectedDrive(
        minutes=minutes, speed=speed, roughness=road_mix(road), sampling_rate=sampling_rate, has_speed=has_speed
    )
    if noise is not None:
        drive = replace(drive, accelerometer_noise=noise * conversion("ug")[1])
    with_kit = description if kit is None else kits.kit_of(description, kit)
    planned = kits.plan(with_kit, drive=drive, false_alarms=false_alarms)
    sentences = tables.describe_plan(planned)
    if best is not None:
        places = kits.candidates(description)
        check_number("--best", best, at_least=1, at_most=len(places))
        chosen = kits.best_places(description, places, best, drive=drive)
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
    stretch: Annotated[
        float | None, option("METRES", "Length of a stretch. Default: 100, of a track 200.", panel=INPUT)
    ] = None,
    out: Annotated[
        Path | None, option("F.geojson|F.gpx|F.csv", "Write stretches and events for maps or tables.", panel=OUTPUT)
    ] = None,
    allow_missing: AllowMissing = False,
    output: Output,
    reading: Reading,
) -> None:
    """Measure the road under a vehicle, or the level of the track.

    Several files are passes over one road, which are averaged: by latitude and longitude where all have them, else by
    the distance from where each begins. A file that begins when the one before it ends continues its drive.
    """
    from sprung.results import tables
    from sprung.results.documents import road_document
    from sprung.road import check_survey_file, drives_of, has_places, survey_passes, write_survey
    from sprung.vehicles import read_vehicle

    output.check(*files, vehicle)
    if out is not None:
        check_file("--out", out, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    may_lack = reading.may_lack(description, allow_missing=allow_missing)
    with progress_bar() as report:
        drives = list(drives_of(reading.records([path], report) for path in files))
        if out is not None:
            check_survey_file(out, are_placed=any(has_places(record) for drive in drives for record in drive))
        survey = survey_passes(drives, description, stretch=stretch, allow_missing=may_lack, on_progress=report)
    source = ", ".join(path.name for path in files)
    output.draw(lambda drawn: {"road": drawn.road_figure(survey, source=source)})
    if out is not None:
        write_survey(survey, out)
        output.paths.append(out)
    sentences, shown = tables.describe_road(survey), tables.road_tables(survey)
    output.report(
        lambda pages, inputs: pages.plain_report(f"Road of {inputs.title}", sentences, shown, survey, inputs),
        files,
        reading,
        vehicle=vehicle,
    )
    output.show(road_document(survey), *shown, notes=sentences)


@shares_options
def stability(files: Files, *, vehicle: VehicleFile, output: Output, reading: Reading) -> None:
    """Estimate running stability and the lateral suspension on rails. From drives on straight track."""
    from sprung.likelihood.lateral import fit_lateral
    from sprung.results import tables
    from sprung.results.documents import stability_document
    from sprung.vehicles import read_vehicle

    output.check(*files, vehicle)
    description = read_vehicle(vehicle)
    with progress_bar() as report:
        recordings = list(reading.records(files, report))
        report("fitting", 0.5)
        fit = fit_lateral(recordings, description)
    source = ", ".join(path.name for path in files)
    output.draw(lambda drawn: {"stability": drawn.stability_figure(fit, source=source)})
    sentences, shown = tables.describe_stability(fit), tables.stability_tables(fit)
    title = f"Running stability of {description.name}"
    output.report(
        lambda pages, inputs: pages.plain_report(title, sentences, shown, fit, inputs), files, reading, vehicle=vehicle
    )
    output.show(stability_document(fit), *shown, notes=sentences)


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
    weighting: Annotated[
        Literal["Wk", "Wd", "Wf", "Wc", "We", "Wj"] | None,
        option(
            None,
            "Weighting of ISO 2631-1. Default: Wk vertical and Wd horizontal (seat). Wc: backrest (x), We: rotation,"
            " Wj: under the head of a lying person, Wf: motion sickness (z).",
            panel=INPUT,
        ),
    ] = None,
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
    """Assess ride comfort, running stability and suspension travel."""
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
        result = assess_ride(
            recordings,
            standards=(standard,),
            weighting=weighting,
            available_travel=travel,
            bogie_mass=bogie_mass,
        )
    source = ", ".join(path.name for path in files)
    output.draw(lambda drawn: {"ride": drawn.ride_figure(result, source=source)})
    sentences, shown = tables.describe_ride(result), tables.ride_tables(result)
    output.report(
        lambda pages, inputs: pages.plain_report(f"Ride of {inputs.title}", sentences, shown, result, inputs),
        files,
        reading,
    )
    output.show(ride_document(result), *shown, notes=sentences)
