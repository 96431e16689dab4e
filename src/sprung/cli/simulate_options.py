"""Options that the commands `sprung simulate ...` share."""

from pathlib import Path
from typing import Annotated

import typer

from sprung.cli.options import OUTPUT, option

DRIVE, CONDITION = "Drive", "Condition"

Out = Annotated[Path, option("FILE", "File to write: .csv, .parquet, .npz or .mat.", panel=OUTPUT, show_default=False)]
Records = Annotated[
    int,
    option("N", "Number of records; several are numbered -01, -02 ..", panel=OUTPUT, min=1, max=1000),
]
VehicleName = Annotated[str, option("V.toml|NAME", "Vehicle file or name of a shipped vehicle.")]
Minutes = Annotated[float, option("M", "Length of each record in minutes.")]
SamplingRate = Annotated[float, option("HZ", "Sampling rate in Hz.")]
Snr = Annotated[float | None, option("S", "RMS of the signal over RMS of the sensor noise. Default: no noise.")]
Seed = Annotated[int, option("N", "Seed of all random numbers.", min=0)]
NoiseBand = Annotated[
    tuple[float, float] | None, option("LO HI", "Band of the sensor noise in Hz. Default: white noise.")
]
Speed = Annotated[tuple[float, float], option("LO HI", "Range of the steady speeds in m/s.", panel=DRIVE)]
Stops = Annotated[int, option("N", "Number of stops on the way.", panel=DRIVE, min=0)]
Faults = Annotated[
    list[str] | None,
    option(
        "CORNER.COMPONENT=-0.2",
        "Relative change of a spring, damper or tyre. With @ONSET+GROWTH (in seconds) it begins later and grows. May be"
        " repeated.",
        panel=CONDITION,
    ),
]
ConstantFaults = Annotated[
    list[str] | None,
    option("OWNER.COMPONENT=-0.2", "Relative change of a spring or damper. May be repeated.", panel=CONDITION),
]
PayloadMass = Annotated[float, option("KG", "Mass of a payload on the body in kg.", panel=CONDITION, min=0)]
Temperature = Annotated[
    float, option("C", "Temperature of the dampers in degrees Celsius; nominal at 20.", panel=CONDITION)
]
Nonlinear = Annotated[
    bool,
    typer.Option(
        "--nonlinear",
        help="Asymmetric dampers, friction, progressive springs and bump stops; potholes where there is a road.",
        rich_help_panel=CONDITION,
    ),
]
