"""The commands `sprung describe` and `sprung calibrate`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from sprung._display import counted
from sprung.cli.options import (
    INPUT,
    AllowMissing,
    Figures,
    FileFormat,
    Files,
    Json,
    Minutes,
    Reading,
    VehicleFile,
    check_file,
    option,
    shares_options,
)
from sprung.cli.output import Output, progress_bar, show


def describe(
    *,
    mass: Annotated[float, option("KG", "Mass of the vehicle as driven.")],
    wheelbase: Annotated[
        list[float],
        option("M", "Distance of the rear axle from the front axle; of more axles, once for each further one."),
    ],
    track: Annotated[float, option("M", "Mean distance between the wheels of an axle.")],
    tyre: Annotated[
        list[str],
        option("SIZE", "Size of the tyres, such as 205/55R16 or 2x275/70R22.5 (twin); once, or once for each axle."),
    ],
    out: Annotated[Path, option("V.toml", "Vehicle file to write.")],
    name: Annotated[str, option("NAME", "Name of the vehicle.", panel=INPUT)] = "car",
    front_share: Annotated[float, option("S", "Share of the mass on the front axle.", panel=INPUT)] = 0.58,
    axle_load: Annotated[
        list[float] | None,
        option("KG", "Mass on each axle, from front to rear, once for each; more than two axles need it.", panel=INPUT),
    ] = None,
    ride_frequency: Annotated[
        tuple[float, float],
        option("FRONT REAR", "Natural frequency of the body above the front and each other axle, in Hz.", panel=INPUT),
    ] = (1.2, 1.4),
    damping_ratio: Annotated[float, option("Z", "Damping ratio of the body above each axle.", panel=INPUT)] = 0.28,
    unsprung: Annotated[
        tuple[float, float] | None,
        option(
            "FRONT REAR",
            "Unsprung mass of a wheel, in kg. Default: 2.8 % of the mass, or 5.6 % of that on its axle.",
            panel=INPUT,
        ),
    ] = None,
    height: Annotated[
        float | None, option("M", "Height of a van, truck or bus, for roll inertia and centre of gravity.", panel=INPUT)
    ] = None,
    rigid_axle: Annotated[
        list[str] | None,
        option(
            "NAME",
            "Axle whose wheels are joined (front, axle2 .., rear), once for each. Default: with a height, all but a"
            " front axle under 3.5 t; otherwise none.",
            panel=INPUT,
        ),
    ] = None,
    seats: Annotated[
        int | None,
        option(
            "N",
            "Number of seats, on which every drive has its own load. Default: 5 in a car; with a height 2 up to 3.5 t,"
            " 0 above.",
            panel=INPUT,
        ),
    ] = None,
    pressure: Annotated[float, option("BAR", "Pressure of the tyres.", panel=INPUT)] = 2.3,
    sensors: Annotated[
        Literal["corners", "imu", "travel"],
        option(
            None,
            "Accelerometers above the wheels (acc_fl ..), an IMU at the centre of gravity (acc_z, gyro_x, gyro_y),"
            " or spring deflections (travel_fl ..).",
            panel=INPUT,
        ),
    ] = "corners",
) -> None:
    """Write a vehicle file from a data sheet. The rest is estimated: complete it with calibrate."""
    from sprung.calibration import DataSheet, described
    from sprung.vehicles import structure, write_vehicle
    from sprung.vehicles.labels import plausibility_notes

    check_file("--out", out)
    sheet = DataSheet(
        mass=mass,
        wheelbase=tuple(wheelbase),
        track=track,
        tyre=tuple(tyre),
        front_share=front_share,
        axle_loads=tuple(axle_load) if axle_load else None,
        ride_frequencies=ride_frequency,
        damping_ratio=damping_ratio,
        unsprung_masses=unsprung,
        height=height,
        rigid_axles=None if rigid_axle is None else tuple(rigid_axle),
        seats=seats,
        pressure=1e5 * pressure,
        sensors=sensors,
        name=name,
    )
    vehicle = described(sheet)
    write_vehicle(vehicle, out)
    modes = structure(vehicle).modes()
    body = [
        f"{label} {frequency:.2f} Hz"
        for label, frequency in zip(modes.labels, modes.natural_frequency, strict=True)
        if label in {"bounce", "pitch", "roll"}
    ]
    show(
        [
            f"guessed vehicle: {', '.join(body)}",
            *plausibility_notes(vehicle),
            f"wrote {out}: state where the sensors are, then complete it with `sprung calibrate` on healthy drives",
        ]
    )


def fmu(
    vehicle: Annotated[str, typer.Argument(metavar="V.toml|NAME", help="Vehicle file or name of a shipped vehicle.")],
    *,
    out: Annotated[Path, option("F.fmu", "FMU to write.")],
    step: Annotated[float, option("SECONDS", "Step of the model; communication steps are multiples of it.")] = 1e-3,
    fault: Annotated[
        list[str] | None,
        option("CORNER.COMPONENT=-0.2", "Relative change of a spring, damper or tyre. May be repeated."),
    ] = None,
) -> None:
    """Write a vehicle as a Functional Mock-up Unit. FMI 3.0, co-simulation, for other programs; it runs in Python."""
    from sprung.simulation import driven_structure, write_fmu
    from sprung.vehicles import Vehicle, parse_fault, read_description, structure, with_faults

    check_file("--out", out, inputs=[vehicle])
    described = read_description(vehicle)
    faults = [parse_fault(text) for text in fault or ()]
    if isinstance(described, Vehicle):
        driven = driven_structure(described, faults=faults)
    else:
        driven = with_faults(structure(described), faults)
    write_fmu(driven, out, step=step, name=described.name)
    show(
        [
            f"inputs: {', '.join(driven.inputs)}; and the rate of each",
            f"outputs: {', '.join(driven.outputs.names)}",
            f"wrote {out}: it needs the shared library of Python 3 where it runs",
        ]
    )


@shares_options
def calibrate(
    files: Files,
    *,
    vehicle: VehicleFile,
    out: Annotated[Path, option("V2.toml", "Completed vehicle file to write.")],
    allow_missing: AllowMissing = False,
    window: Minutes = 10.0,
    mounts: Annotated[int, option("N", "Largest number of masses on mounts to add.", min=0, panel=INPUT)] = 3,
    modes: Annotated[
        bool, option(None, "Add torsion and bending where the drives show them.", "--modes/--no-modes", panel=INPUT)
    ] = True,
    figures: Figures = None,
    file_format: FileFormat = "png",
    json: Json = None,
    reading: Reading,
) -> None:
    """Complete a vehicle file from healthy drives. Sensors, wheels, masses on mounts, modes of the body."""
    from sprung.baseline_progress import learning_progress
    from sprung.calibration import CalibrationSettings
    from sprung.calibration import calibrate as calibrated
    from sprung.diagnosis import observe_window, windows
    from sprung.results import tables
    from sprung.results.documents import calibration_document
    from sprung.vehicles import read_vehicle, write_vehicle

    check_file("--out", out, inputs=files)
    output = Output(figures, file_format, json=json)
    output.check(*files, vehicle)
    description = read_vehicle(vehicle)
    may_lack = reading.may_lack(description, allow_missing=allow_missing)
    settings = CalibrationSettings(most_mounts=mounts, has_modes=modes)
    with progress_bar() as report:
        parts = [part for _, part in windows(reading.records(files, report), length=60 * window)]
        report(f"calibrating on {counted(len(parts), 'window')}", 0.5)
        result = calibrated(parts, description, settings=settings, allow_missing=may_lack)
        write_vehicle(result.vehicle, out)
        output.paths.append(out)
        report("observing the windows", 0.9)
        observations = [observe_window(part, result.vehicle, allow_missing=may_lack) for part in parts]
        progress = f"for a baseline: {learning_progress(observations, result.vehicle)}"
        source = ", ".join(path.name for path in files)
        output.draw(
            lambda drawn: {
                "misfit": drawn.misfit_figure(result, source=source),
                "learnt": drawn.learnt_figure(result, source=source),
            }
        )
    notes = [*tables.describe_calibration(result), progress]
    output.show(calibration_document(result), tables.calibration_table(result), notes=notes)
