"""The commands `sprung corners` and `sprung bounce`."""

from pathlib import Path
from typing import Annotated, Literal

from sprung.cli.options import (
    INPUT,
    AllowMissing,
    Files,
    Reading,
    VehicleFile,
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
    """Estimate the springs, dampers and tyres of every corner from the spectra of a drive or a rig run."""
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
    shown = (tables.components_table(fit), tables.fitted_modes_table(fit), *inspection)
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
    """Find pushes, drops and releases, and state frequency, damping and friction of the free motion after them."""
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
