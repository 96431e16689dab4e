"""Options that the commands `sprung simulate ...` share."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from sprung.cli.completion import vehicles
from sprung.cli.options import OUTPUT, option

DRIVE, CONDITION = "Drive", "Condition"
ROAD, WHEELS, VEHICLE, SENSORS = "Road", "Wheels", "Deviations of the vehicle from its file", "Sensors"

Out = Annotated[Path, option("FILE", "File to write: .csv, .parquet, .npz or .mat.", panel=OUTPUT, show_default=False)]
Records = Annotated[
    int,
    option("N", "Number of records; several are numbered -01, -02 ..", panel=OUTPUT, min=1, max=1000),
]
VehicleName = Annotated[
    str, option("V.toml|NAME", "Vehicle file or name of a shipped vehicle.", autocompletion=vehicles)
]
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
Payloads = Annotated[
    list[str] | None,
    option(
        "KG[,X,Y]",
        "Payload on the body in kg, and its place X ahead and Y to the left of the centre of gravity in m: 80,-0.9,-0.4"
        " is a passenger in the rear right seat. May be repeated.",
        "--payload",
        panel=CONDITION,
    ),
]
Temperature = Annotated[
    float, option("C", "Temperature of the dampers in degrees Celsius; nominal at 20.", panel=CONDITION)
]
TyreTemperature = Annotated[
    float, option("C", "Temperature of the air in the tyres in degrees Celsius; nominal at 20.", panel=CONDITION)
]
Nonlinear = Annotated[
    bool,
    typer.Option(
        "--nonlinear",
        help="Asymmetric dampers, friction, progressive springs and bump stops; potholes where there is a road.",
        rich_help_panel=CONDITION,
    ),
]

RoadClass = Annotated[str, option("A..H", "Roughness class of ISO 8608.", "--road", panel=ROAD)]
RightRougher = Annotated[
    float, option("DB", "Unevenness of the right track relative to the left one in dB.", panel=ROAD, min=-20, max=20)
]
PotholeRate = Annotated[
    float | None,
    option(
        "N",
        "Potholes and bumps per kilometre. Default: none, 3 with --nonlinear.",
        "--potholes",
        panel=ROAD,
        min=0,
        show_default=False,
    ),
]
PotholeSide = Annotated[
    Literal["left", "right"] | None, option(None, "Only side with potholes. Default: either, or both.", panel=ROAD)
]
CrossSlope = Annotated[
    float, option("PERCENT", "Largest slope of the road to either side in percent.", panel=ROAD, min=0, max=30)
]
Braking = Annotated[
    float,
    option(
        "M/S2",
        "Largest deceleration in m/s2: braking and accelerating (up to 0.7 of it) pitch the body. Default: a calm drive"
        " without pitching.",
        panel=DRIVE,
        min=0,
        max=10,
        show_default=False,
    ),
]
Cornering = Annotated[
    float,
    option("M/S2", "Largest lateral acceleration in m/s2: curves roll the body.", panel=DRIVE, min=0, max=10),
]
Height = Annotated[
    float | None,
    option(
        "M",
        "Height of the body's centre of gravity above the ground in m. Default: that of the vehicle file, or 0.55.",
        panel=DRIVE,
        show_default=False,
    ),
]
Unbalance = Annotated[
    float,
    option("G.M", "Typical unbalance of a wheel in g m (5 g on a rim of 0.2 m are 1 g m).", panel=WHEELS, min=0),
]
RunOut = Annotated[
    list[float] | None,
    option(
        "MM",
        "Typical radial run-out (amplitude) of a wheel in mm. Repeated: of the second, third .. harmonic of rotation.",
        panel=WHEELS,
        min=0,
    ),
]
WheelRadius = Annotated[float, option("M", "Rolling radius of the wheels in m.", panel=WHEELS)]
Differs = Annotated[
    list[str] | None,
    option(
        "NAME=CHANGE",
        "Relative difference of the vehicle from its file, such as mass=0.07 (7 % heavier); also pitch_inertia,"
        " roll_inertia, wheelbase, track, unsprung_mass, anti_roll_stiffness. May be repeated.",
        panel=VEHICLE,
    ),
]
MountedMasses = Annotated[
    list[str] | None,
    option(
        "KG,X,Y,HZ,DAMPING",
        "Engine, tank or cab on mounts that the file lacks: mass in kg, place in m, natural frequency in Hz, damping"
        " ratio, such as 180,1.1,0,11,0.08. May be repeated.",
        "--mounted-mass",
        panel=VEHICLE,
    ),
]
FlexibleModes = Annotated[
    list[str] | None,
    option(
        "SHAPE,HZ,DAMPING",
        "Torsion or bending of the body that the file lacks: natural frequency in Hz, damping ratio, such as"
        " torsion,24,0.03.",
        "--flexible-mode",
        panel=VEHICLE,
    ),
]
Scatter = Annotated[
    tuple[float, float, float] | None,
    option(
        "SPRINGS DAMPERS TYRES",
        "Manufacturing scatter of parts, standard deviations in percent, such as 4 5 3 for a used car.",
        panel=VEHICLE,
    ),
]
Wear = Annotated[
    list[str] | None,
    option(
        "CORNER.COMPONENT=-0.01",
        "Part that wears with every drive, such as by 1 % of what is left; with --records each record is a drive."
        " May be repeated.",
        panel=VEHICLE,
    ),
]
Individual = Annotated[
    int,
    option(
        "N",
        "Number of the vehicle among those of its type: the seed of its scatter, wheels and sensor errors, which are"
        " the same on all its drives.",
        panel=VEHICLE,
        min=0,
    ),
]
Tilt = Annotated[
    float, option("DEGREES", "Tilt of every sensor about a random axis in degrees.", panel=SENSORS, min=0, max=90)
]
Misplaced = Annotated[
    float,
    option("CM", "Distance of every sensor from its place in the file, in a random direction, in cm.", panel=SENSORS),
]
Moved = Annotated[
    list[str] | None,
    option(
        "CHANNEL=X,Y,Z",
        "One sensor off its place in the file, in m: acc_fl=0.39,0,0. May be repeated.",
        panel=SENSORS,
    ),
]
GainError = Annotated[
    float, option("PERCENT", "Standard deviation of the sensors' gains in percent.", panel=SENSORS, min=0)
]
Lag = Annotated[float, option("MS", "Largest delay of a sensor in ms; delays are random.", panel=SENSORS, min=0)]
NoiseDensity = Annotated[
    float,
    option("UG/RTHZ", "Noise of the accelerometers in micro-g per root Hz; MEMS have 20 to 300.", panel=SENSORS, min=0),
]
Bits = Annotated[int | None, option("N", "Resolution of the accelerometers in bits.", panel=SENSORS, min=1, max=32)]
Range = Annotated[float, option("G", "Range of the accelerometers in g; 2 means +-2 g.", "--range", panel=SENSORS)]
SpeedDelay = Annotated[float, option("S", "Delay of the speed at its update in s.", panel=SENSORS, min=0)]
SpeedRate = Annotated[
    float | None, option("HZ", "Updates of the speed per second, held in between, as from GPS.", panel=SENSORS)
]
SpeedScale = Annotated[float, option("FACTOR", "Ratio of recorded to true speed.", panel=SENSORS)]
Also = Annotated[
    list[str] | None,
    option(
        "NAME",
        "Further sensor at the centre of gravity, also added to the written vehicle file: acc_x, acc_y, yaw_rate or"
        " temperature. May be repeated.",
        panel=SENSORS,
    ),
]
