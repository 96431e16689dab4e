"""The command `sprung corners`."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sprung.cli.checks import check_outputs, may_lack_sensors, names
from sprung.cli.options import INPUT, AllowMissing, Figures, FileFormat, Files, Json, Page, VehicleFile, option
from sprung.cli.output import progress_bar, show, write_figures, write_page, write_result, written
from sprung.cli.reading import reads_files

if TYPE_CHECKING:
    from sprung.formats import ReadSettings


@reads_files
def corners(
    files: Files,
    *,
    vehicle: VehicleFile,
    reading: "ReadSettings",
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
        typer.Option(
            help="Excitation of the wheels; that of a road or track reaches the rear wheels later. Default: the kind in"
            " the vehicle file.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    free: Annotated[
        str | None,
        option("A,B,..", "Components to fit, such as spring,damper or front_left.tyre. Default: all.", panel=INPUT),
    ] = None,
    payload: Annotated[
        bool | None,
        typer.Option(
            "--payload/--no-payload",
            help="Also fit mass, inertias and centre of gravity of the payload. Default: yes, except on a rig.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    sensors: Annotated[
        bool,
        typer.Option("--sensors", help="Also fit positions and lags of the sensors.", rich_help_panel=INPUT),
    ] = False,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    json: Json = None,
) -> None:
    """Estimate the springs, dampers and tyres of every corner from the spectra of a drive or a rig run."""
    from sprung.diagnosis.observation import fit_drive
    from sprung.formats import read_records
    from sprung.likelihood import CornerSettings
    from sprung.likelihood.plate_test import plate_tests
    from sprung.results import page as pages
    from sprung.results import tables
    from sprung.results.documents import corners_document
    from sprung.vehicles import read_vehicle

    check_outputs(json=json, page=page, figures=figures, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
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
        recordings = read_records(files, settings=reading, on_progress=report)
        report("fitting", 0.5)
        fit = fit_drive(recordings, description, settings=settings, allow_missing=may_lack)
        source = ", ".join(path.name for path in files)
        paths = write_figures(figures, lambda drawn: drawn.saving.corner_figures(fit, source=source), file_format)
        document = corners_document(fit)
        paths += write_page(
            page,
            lambda inputs: pages.corners_report(fit, inputs, document=document),
            files,
            reading=reading,
            others={"vehicle": vehicle},
        )
    if write_result(document, json):
        words = [*tables.payload_in_words(fit), *fit.notes, *written(paths, json)]
        inspection = [tables.plate_tests_table(tests)] if (tests := plate_tests(fit)) else []
        show(tables.components_table(fit), tables.fitted_modes_table(fit), *inspection, words)
