"""The commands `sprung plan`, `sprung road` and `sprung ride`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sprung.cli.checks import check_file, check_outputs, may_lack_sensors
from sprung.cli.options import (
    INPUT,
    OUTPUT,
    AllowMissing,
    Figures,
    FileFormat,
    Files,
    Json,
    Page,
    VehicleFile,
    complete_vehicles,
    option,
)
from sprung.cli.output import progress_bar, show, write_figures, write_page, write_result, written
from sprung.cli.reading import reads_files

if TYPE_CHECKING:
    from sprung.formats import ReadSettings


def plan(
    vehicle: Annotated[
        Path, typer.Argument(metavar="V.toml|NAME", help="Vehicle file.", autocompletion=complete_vehicles)
    ],
    *,
    kit: Annotated[
        Literal["four", "three", "two", "imu"] | None,
        typer.Option(help="Sensors: accelerometers above the wheels, or an IMU. Default: those of the file."),
    ] = None,
    minutes: Annotated[float, option("M", "Length of a window.", panel=INPUT)] = 10.0,
    speed: Annotated[tuple[float, float], option("LO HI", "Range of speeds, in m/s.", panel=INPUT)] = (8.0, 25.0),
    road: Annotated[str, option("A..H", "Class of the road, ISO 8608.", panel=INPUT)] = "B",
    has_speed: Annotated[
        bool, option(None, "Whether the speed will be recorded.", "--with-speed/--without-speed", panel=INPUT)
    ] = True,
    best: Annotated[int | None, option("N", "Also find the best places of N accelerometers.", panel=INPUT)] = None,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    json: Json = None,
) -> None:
    """Predict what a kit of sensors will see on a vehicle, and how soon, before it is bought."""
    from sprung import kits
    from sprung.excitation import road_class
    from sprung.formats import ReadSettings
    from sprung.likelihood.expected import ExpectedDrive
    from sprung.results import tables
    from sprung.results.documents import plan_document
    from sprung.results.page import plain_report
    from sprung.vehicles import read_vehicle

    check_outputs(json=json, page=page, figures=figures, inputs=[vehicle])
    description = read_vehicle(vehicle)
    drive = ExpectedDrive(minutes=minutes, speed=speed, roughness=road_class(road).roughness, has_speed=has_speed)
    planned = kits.plan(description if kit is None else kits.kit_of(description, kit), drive=drive)
    sentences = tables.plan_in_words(planned)
    if best is not None:
        chosen = kits.best_places(description, kits.candidates(description), best, drive=drive)
        sentences.append(f"best places of {best}: {', '.join(sensor.channel for sensor in chosen)}")
    paths = write_figures(figures, lambda drawn: {"plan": drawn.kit_figure(planned)}, file_format)
    document = plan_document(planned)
    paths += write_page(
        page,
        lambda inputs: plain_report(
            f"What a kit will see on {description.name}", sentences, tables.plan_tables(planned), planned, inputs
        ),
        [vehicle],
        reading=ReadSettings(),
        others={},
        has_recordings=False,
    )
    if write_result(document, json):
        show(*tables.plan_tables(planned), [*sentences, *written(paths, json)])


@reads_files
def road(
    files: Files,
    *,
    vehicle: VehicleFile,
    reading: "ReadSettings",
    stretch: Annotated[float, option("METRES", "Length of a stretch.", panel=INPUT)] = 100.0,
    out: Annotated[
        Path | None, option("F.geojson|F.gpx|F.csv", "Write stretches and events for maps or tables.", panel=OUTPUT)
    ] = None,
    allow_missing: AllowMissing = False,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    json: Json = None,
) -> None:
    """Measure the road under a vehicle: roughness index, classes, potholes, along the way."""
    from sprung.formats import read_records
    from sprung.results import tables
    from sprung.results.documents import road_document
    from sprung.results.page import plain_report
    from sprung.road import survey_road, write_survey
    from sprung.vehicles import read_vehicle

    check_outputs(json=json, page=page, figures=figures, inputs=[*files, vehicle])
    if out is not None:
        check_file("--out", out, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
    with progress_bar() as report:
        recordings = read_records(files, settings=reading, on_progress=report)
        report("fitting the vehicle", 0.5)
        survey = survey_road(recordings, description, stretch=stretch, allow_missing=may_lack)
    source = ", ".join(path.name for path in files)
    paths = write_figures(figures, lambda drawn: {"road": drawn.road_figure(survey, source=source)}, file_format)
    if out is not None:
        write_survey(survey, out)
        paths.append(out)
    shown = [tables.road_table(survey), *([tables.events_table(survey)] if survey.events else [])]
    paths += write_page(
        page,
        lambda inputs: plain_report(f"Road of {inputs.title}", survey.notes, shown, survey, inputs),
        files,
        reading=reading,
        others={"vehicle": vehicle},
    )
    if write_result(road_document(survey), json):
        show(*shown, [*survey.notes, *written(paths, json)])


@reads_files
def ride(
    files: Files,
    *,
    reading: "ReadSettings",
    standard: Annotated[
        Literal["iso2631", "en12299", "sperling", "en14363"],
        typer.Option(
            help="ISO 2631-1 (seat), EN 12299 (floor), Sperling's Wz, or EN 14363 (lateral, of bogie frames).",
            rich_help_panel=INPUT,
        ),
    ] = "iso2631",
    vehicle: Annotated[
        Path | None, option("V.toml|NAME", "Vehicle file, for units and directions of the sensors.", panel=INPUT)
    ] = None,
    travel: Annotated[float | None, option("METRES", "Available travel of a suspension.", panel=INPUT)] = None,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    json: Json = None,
) -> None:
    """Assess ride comfort and running stability by standards, and the use of the suspensions' travel."""
    from sprung.formats import read_records
    from sprung.results import tables
    from sprung.results.documents import ride_document
    from sprung.results.page import plain_report
    from sprung.ride import assess_ride
    from sprung.vehicles import read_vehicle
    from sprung.vehicles.window import window_of

    check_outputs(json=json, page=page, figures=figures, inputs=files)
    with progress_bar() as report:
        recordings = list(read_records(files, settings=reading, on_progress=report))
        if vehicle is not None:
            description = read_vehicle(vehicle)
            recordings = [window_of(run, description, allow_missing=True).recording for run in recordings]
        result = assess_ride(recordings, standards=(standard,), available_travel=travel)
    source = ", ".join(path.name for path in files)
    paths = write_figures(figures, lambda drawn: {"ride": drawn.ride_figure(result, source=source)}, file_format)
    sentences, shown = tables.ride_in_words(result), tables.ride_tables(result)
    paths += write_page(
        page,
        lambda inputs: plain_report(f"Ride of {inputs.title}", sentences, shown, result, inputs),
        files,
        reading=reading,
        others={},
    )
    if write_result(ride_document(result), json):
        show(*shown, [*sentences, *written(paths, json)])
