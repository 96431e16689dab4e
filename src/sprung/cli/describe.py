"""The command `sprung describe`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from sprung.cli.checks import check_file
from sprung.cli.options import INPUT, option
from sprung.cli.output import show


def describe(
    *,
    mass: Annotated[float, option("KG", "Mass of the car as driven.")],
    wheelbase: Annotated[float, option("M", "Distance between the axles.")],
    track: Annotated[float, option("M", "Mean distance between the wheels of an axle.")],
    tyre: Annotated[str, option("SIZE", "Size of the tyres, such as 205/55R16.")],
    out: Annotated[Path, option("V.toml", "Vehicle file to write.")],
    name: Annotated[str, option("NAME", "Name of the vehicle.", panel=INPUT)] = "car",
    front_share: Annotated[float, option("S", "Share of the mass on the front axle.", panel=INPUT)] = 0.58,
    ride_frequency: Annotated[
        tuple[float, float], option("FRONT REAR", "Natural frequency of the body above each axle, in Hz.", panel=INPUT)
    ] = (1.2, 1.4),
    damping_ratio: Annotated[float, option("Z", "Damping ratio of the body above each axle.", panel=INPUT)] = 0.28,
    unsprung: Annotated[
        tuple[float, float] | None,
        option("FRONT REAR", "Unsprung mass of a wheel, in kg. Default: 2.8 % of the mass.", panel=INPUT),
    ] = None,
    pressure: Annotated[float, option("BAR", "Pressure of the tyres.", panel=INPUT)] = 2.3,
    sensors: Annotated[
        Literal["corners", "imu", "travel"],
        typer.Option(
            help="Accelerometers above the wheels (acc_fl ..), an IMU at the centre of gravity (acc_z, gyro_x, gyro_y),"
            " or spring deflections (travel_fl ..).",
            rich_help_panel=INPUT,
        ),
    ] = "corners",
) -> None:
    """Write a vehicle file from a data sheet, with guesses for what it does not state; complete it with calibrate."""
    from sprung.calibration import DataSheet, described
    from sprung.vehicles import structure, write_vehicle
    from sprung.vehicles.labels import plausibility_notes

    check_file("--out", out)
    sheet = DataSheet(
        mass=mass,
        wheelbase=wheelbase,
        track=track,
        tyre=tyre,
        front_share=front_share,
        ride_frequencies=ride_frequency,
        damping_ratio=damping_ratio,
        unsprung_masses=unsprung,
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
