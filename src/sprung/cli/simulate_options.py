"""Options that the commands `sprung simulate ...` share."""

from pathlib import Path
from typing import Annotated

import typer

from sprung.cli.files import OUTPUT

DRIVE, CONDITION = "Drive", "Condition"

Out = Annotated[
    Path,
    typer.Option(
        metavar="FILE",
        help="File to write: .csv, .parquet, .npz or .mat.",
        show_default=False,
        rich_help_panel=OUTPUT,
    ),
]
Records = Annotated[
    int,
    typer.Option(
        "--records",
        metavar="N",
        min=1,
        max=1000,
        help="Number of records; several are numbered -01, -02 ..",
        rich_help_panel=OUTPUT,
    ),
]
VehicleName = Annotated[str, typer.Option(metavar="V.toml|NAME", help="Vehicle file or name of a shipped one.")]
Minutes = Annotated[float, typer.Option(metavar="M", help="Length of each record in minutes.")]
SamplingRate = Annotated[float, typer.Option(metavar="HZ", help="Sampling rate in Hz.")]
Snr = Annotated[
    float | None,
    typer.Option(metavar="S", help="RMS of the signal over RMS of the sensor noise. Default: no noise."),
]
Seed = Annotated[int, typer.Option(metavar="N", min=0, help="Seed of all random numbers.")]
NoiseBand = Annotated[
    tuple[float, float] | None, typer.Option(metavar="LO HI", help="Band of the sensor noise in Hz. Default: white.")
]
Speed = Annotated[
    tuple[float, float],
    typer.Option(metavar="LO HI", help="Range of the steady speeds in m/s.", rich_help_panel=DRIVE),
]
Stops = Annotated[int, typer.Option(metavar="N", min=0, help="Number of stops on the way.", rich_help_panel=DRIVE)]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        metavar="CORNER.COMPONENT=-0.2",
        help="Relative change of a spring, damper or tyre; append @ONSET+GROWTH in seconds for a change that begins"
        " later and grows. May be repeated.",
        rich_help_panel=CONDITION,
    ),
]
ConstantFaults = Annotated[
    list[str] | None,
    typer.Option(
        metavar="OWNER.COMPONENT=-0.2",
        help="Relative change of a spring or damper. May be repeated.",
        rich_help_panel=CONDITION,
    ),
]
PayloadMass = Annotated[
    float, typer.Option(metavar="KG", min=0, help="Mass of a payload on the body in kg.", rich_help_panel=CONDITION)
]
Temperature = Annotated[
    float,
    typer.Option(
        metavar="C", help="Temperature of the dampers in degrees Celsius; nominal at 20.", rich_help_panel=CONDITION
    ),
]
Nonlinear = Annotated[
    bool,
    typer.Option(
        "--nonlinear",
        help="Asymmetric dampers, friction, progressive springs and bump stops.",
        rich_help_panel=CONDITION,
    ),
]
