"""The commands `sprung simulate road`, `rail`, `rig`, `chain` and `quarter`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.checks import check_file
from sprung.cli.options import OUTPUT, Json, complete_vehicles, option
from sprung.cli.output import progress_bar, show, write_json, write_result, written
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.simulation import DriveSettings
    from sprung.simulation.drives import SimulatedDrive
    from sprung.simulation.runs import SimulatedRun, StationaryRun
    from sprung.vehicles import Fault, Vehicle
    from sprung.vehicles.usable import AnyVehicle

    #: A simulation that lacks only its seed.
    Simulation = Callable[..., SimulatedDrive | SimulatedRun]

_MAX_SAMPLES = 1e8

Out = Annotated[Path, option("FILE", "File to write: .csv, .parquet, .npz or .mat.", panel=OUTPUT, show_default=False)]
Records = Annotated[
    int, option("N", "Number of records; several are numbered -01, -02 ..", panel=OUTPUT, min=1, max=1000)
]
VehicleName = Annotated[
    str, option("V.toml|NAME", "Vehicle file or name of a shipped vehicle.", autocompletion=complete_vehicles)
]
Minutes = Annotated[float, option("M", "Length of each record in minutes.")]
SamplingRate = Annotated[float, option("HZ", "Sampling rate in Hz.")]
Snr = Annotated[float | None, option("S", "RMS of the signal over RMS of the sensor noise. Default: no noise.")]
Seed = Annotated[int, option("N", "Seed of all random numbers.", min=0)]
NoiseBand = Annotated[
    tuple[float, float] | None, option("LO HI", "Band of the sensor noise in Hz. Default: white noise.")
]
Speed = Annotated[tuple[float, float], option("LO HI", "Range of the steady speeds in m/s.")]
Faults = Annotated[
    list[str] | None,
    option(
        "CORNER.COMPONENT=-0.2",
        "Relative change of a spring, damper or tyre. With @ONSET+GROWTH (in seconds) it begins later and grows. May be"
        " repeated.",
    ),
]
ConstantFaults = Annotated[
    list[str] | None,
    option("OWNER.COMPONENT=-0.2", "Relative change of a spring or damper. May be repeated."),
]
Conditions = Annotated[
    Path | None,
    option(
        "C.toml",
        "Conditions of the drive: payload, suspension, sensors, what differs from the vehicle file; on a road also"
        " potholes, driving and wheels. Default: a healthy vehicle on a calm drive.",
    ),
]

simulate = typer.Typer(
    help="Simulate recordings with known truth: FILE, and next to it FILE.truth.json and FILE.vehicle.toml."
)


@dataclass(frozen=True, slots=True)
class Output:
    """Files of `n_records` recordings, seed of the simulation, and the path of --json for a copy of the truth."""

    out: Path
    n_records: int
    seed: int
    json: str | None

    def __post_init__(self) -> None:
        check_file("--out", self.out)
        check_file("--json", self.json)
        if self.json is not None and Path(self.json).resolve() == self.out.resolve():
            raise ParameterError(f"--json {self.json} would overwrite --out: give another name")

    @property
    def paths(self) -> list[Path]:
        """File of every record."""
        if self.n_records == 1:
            return [self.out]
        return [self.out.with_stem(f"{self.out.stem}-{k:02d}") for k in range(1, self.n_records + 1)]


@simulate.command()
def road(
    *,
    out: Out,
    vehicle: VehicleName = "zafira",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 200.0,
    speed: Speed = (5.5, 20.0),
    road_class: Annotated[
        str | None, option("A..H", "Roughness class of ISO 8608. Default: that of --conditions, or C.", "--road")
    ] = None,
    fault: Faults = None,
    conditions: Conditions = None,
    snr: Snr = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a car that drives on a road."""
    from sprung.cli.conditions import RoadDriveConditions, read_conditions
    from sprung.simulation import RoadDrive

    output = Output(out, records, seed, json)
    car = _vehicle("road", vehicle)
    stated = read_conditions(RoadDriveConditions, conditions).settings(car.speed_channel)
    if road_class is not None:
        stated["road"] = replace(stated["road"], road_class=road_class)
    settings = RoadDrive(
        duration=60 * minutes, sampling_rate=sampling_rate, speed=speed, snr=snr, faults=_faults(fault), **stated
    )
    _simulate_drives(car, settings, output)


@simulate.command()
def rail(
    *,
    out: Out,
    vehicle: VehicleName = "y25",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 500.0,
    speed: Speed = (15.0, 30.0),
    fault: Faults = None,
    conditions: Conditions = None,
    snr: Snr = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a bogie that runs on a track."""
    from sprung.cli.conditions import DriveConditions, read_conditions
    from sprung.simulation import RailDrive

    output = Output(out, records, seed, json)
    bogie = _vehicle("rail", vehicle)
    stated = read_conditions(DriveConditions, conditions).settings(bogie.speed_channel)
    settings = RailDrive(
        duration=60 * minutes, sampling_rate=sampling_rate, speed=speed, snr=snr, faults=_faults(fault), **stated
    )
    _simulate_drives(bogie, settings, output)


@simulate.command()
def rig(
    *,
    out: Out,
    vehicle: VehicleName = "scale-bogie",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 1000.0,
    speed: Speed = (5.5, 5.9),
    fault: Faults = None,
    conditions: Conditions = None,
    snr: Snr = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a bogie on a roller rig."""
    from sprung.cli.conditions import RigRunConditions, read_conditions
    from sprung.simulation import RigRun

    output = Output(out, records, seed, json)
    bogie = _vehicle("rig", vehicle)
    stated = read_conditions(RigRunConditions, conditions).settings(bogie.speed_channel)
    settings = RigRun(
        duration=60 * minutes, sampling_rate=sampling_rate, speed=speed, snr=snr, faults=_faults(fault), **stated
    )
    _simulate_drives(bogie, settings, output)


@simulate.command()
def chain(
    *,
    out: Out,
    vehicle: VehicleName = "chain3",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 500.0,
    fault: ConstantFaults = None,
    snr: Snr = None,
    noise_band: NoiseBand = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a chain of masses, springs and dampers under random forces."""
    from sprung.simulation.runs import StationaryRun

    output = Output(out, records, seed, json)
    settings = StationaryRun(
        duration=60 * minutes, sampling_rate=sampling_rate, faults=_faults(fault), snr=snr, noise_band=noise_band
    )
    _simulate_runs("chain", vehicle, settings, output)


@simulate.command()
def quarter(
    *,
    out: Out,
    vehicle: VehicleName = "quarter",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 1000.0,
    case: Annotated[
        int,
        option(
            "1..4",
            "Base motion. 1: random. 2: random plus pulses. 3: random plus pulses and a 3.65 Hz sine. 4: as 3, plus a"
            " 17 Hz sine.",
            min=1,
            max=4,
        ),
    ] = 1,
    fault: ConstantFaults = None,
    snr: Snr = None,
    noise_band: NoiseBand = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a quarter vehicle: one wheel on a roller."""
    from sprung.excitation import QUARTER_CASES
    from sprung.simulation.runs import StationaryRun

    output = Output(out, records, seed, json)
    settings = StationaryRun(
        excitation=QUARTER_CASES[case - 1],
        duration=60 * minutes,
        sampling_rate=sampling_rate,
        faults=_faults(fault),
        snr=snr,
        noise_band=noise_band,
    )
    _simulate_runs("quarter", vehicle, settings, output)


def _faults(texts: Sequence[str] | None) -> "tuple[Fault, ...]":
    from sprung.vehicles import parse_fault

    return tuple(parse_fault(text) for text in texts or ())


def _vehicle(kind: Literal["road", "rail", "rig"], path_or_name: str) -> "Vehicle":
    """Return the vehicle on axles of a file or name, with the excitation of its wheels."""
    from sprung.vehicles import Vehicle, read_description

    vehicle = read_description(path_or_name)
    if not isinstance(vehicle, Vehicle):
        raise _wrong_kind(path_or_name, vehicle.kind, kind)
    return vehicle.model_copy(update={"kind": kind})


def _simulate_drives(vehicle: "Vehicle", settings: "DriveSettings", output: Output) -> None:
    """Simulate and write drives, with the wear of each carried over to the next."""
    from sprung.simulation import simulate_drive
    from sprung.simulation.runs import drive_document, drives_of_one_vehicle

    _check_length(settings.duration, max(settings.sampling_rate, 1000.0))
    drives = [partial(simulate_drive, vehicle, one) for one in drives_of_one_vehicle(settings, output.n_records)]
    _write(drives, vehicle, drive_document(settings), output)


def _simulate_runs(kind: str, path_or_name: str, settings: "StationaryRun", output: Output) -> None:
    """Simulate and write records of a chain or a quarter vehicle."""
    from sprung.simulation.runs import simulate_run
    from sprung.vehicles import Vehicle, read_description

    vehicle = read_description(path_or_name)
    if isinstance(vehicle, Vehicle) or vehicle.kind != kind:
        raise _wrong_kind(path_or_name, vehicle.kind, kind)
    if settings.noise_band is not None and settings.snr is None:
        raise ParameterError("--noise-band needs --snr: state how strong the noise is")
    _check_length(settings.duration, settings.sampling_rate)
    _write([partial(simulate_run, vehicle, settings)] * output.n_records, vehicle, {}, output)


def _wrong_kind(path_or_name: str, kind: str, needed: str) -> ParameterError:
    return ParameterError(f"vehicle {path_or_name!r} is of kind {kind}, not {needed}: give another one")


def _check_length(duration: float, sampling_rate: float) -> None:
    """Refuse records without a length, and those that do not fit into memory."""
    from sprung._checks import check_number

    check_number("--minutes", duration / 60, above=0)
    check_number("--sampling-rate", sampling_rate, above=0)
    n_samples = duration * sampling_rate
    check_number("samples in a record", n_samples, at_most=_MAX_SAMPLES, advice="lower --minutes, or use --records")


def _write(
    simulations: "Sequence[Simulation]", vehicle: "AnyVehicle", settings: dict[str, Any], output: Output
) -> None:
    """Simulate and write the recordings, and the truth and the vehicle file next to them; print the files."""
    from sprung.formats import write
    from sprung.results import tables
    from sprung.simulation.runs import joint_truth, record_seeds
    from sprung.vehicles import write_vehicle

    truths, paths = [], output.paths
    with progress_bar() as report:
        seeds = record_seeds(output.seed, len(paths))
        for number, (simulation, path, seed) in enumerate(zip(simulations, paths, seeds, strict=True)):
            report(f"simulating {path.name}", number / len(paths))
            run = simulation(seed=seed)
            write(run.recording, path)
            truths.append(run.truth)
    document = {**joint_truth(truths, seed=output.seed), **settings, "files": [str(path) for path in paths]}
    truth_path, vehicle_path = Path(f"{output.out}.truth.json"), Path(f"{output.out}.vehicle.toml")
    write_json(document, str(truth_path))
    write_vehicle(vehicle, vehicle_path)
    if write_result(document, output.json):
        show(tables.true_modes_table(document), written([*paths, truth_path, vehicle_path], output.json))
