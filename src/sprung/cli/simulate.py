"""The commands `sprung simulate road`, `rail`, `rig`, `chain` and `quarter`."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli import simulate_conditions as values
from sprung.cli import simulate_options as options
from sprung.cli.checks import check_file
from sprung.cli.options import Json, option
from sprung.cli.output import show, write_json, write_result, written
from sprung.cli.progress import progress_bar
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.simulation import DriveSettings
    from sprung.simulation.drives import SimulatedDrive
    from sprung.simulation.runs import SimulatedRun, StationaryRun
    from sprung.vehicles import Vehicle
    from sprung.vehicles.usable import AnyVehicle

    #: A simulation that lacks only its seed.
    Simulation = Callable[..., SimulatedDrive | SimulatedRun]

_MOST_SAMPLES = 1e8

simulate = typer.Typer(
    help="Simulate recordings with known truth: FILE, and next to it FILE.truth.json and FILE.vehicle.toml."
)


@dataclass(frozen=True, slots=True)
class Output:
    """Output files of a command.

    Parameters
    ----------
    out
        File to write.
    n_records
        Number of records.
    seed
        Seed of the simulation.
    json
        File for a copy of the truth, "-" for standard output, None for none.
    """

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
    out: options.Out,
    vehicle: options.VehicleName = "zafira",
    minutes: options.Minutes = 10.0,
    sampling_rate: options.SamplingRate = 200.0,
    speed: options.Speed = (5.5, 20.0),
    stops: options.Stops = 0,
    braking: options.Braking = 0.0,
    cornering: options.Cornering = 0.0,
    height: options.Height = None,
    road_class: options.RoadClass = "C",
    right_rougher: options.RightRougher = 0.0,
    potholes: options.PotholeRate = None,
    pothole_side: options.PotholeSide = None,
    cross_slope: options.CrossSlope = 0.0,
    fault: options.Faults = None,
    payload: options.Payloads = None,
    temperature: options.Temperature = 20.0,
    tyre_temperature: options.TyreTemperature = 20.0,
    nonlinear: options.Nonlinear = False,
    unbalance: options.Unbalance = 0.0,
    run_out: options.RunOut = None,
    wheel_radius: options.WheelRadius = 0.31,
    differs: options.Differs = None,
    mounted_mass: options.MountedMasses = None,
    flexible_mode: options.FlexibleModes = None,
    scatter: options.Scatter = None,
    wear: options.Wear = None,
    individual: options.Individual = 0,
    tilt: options.Tilt = 0.0,
    misplaced: options.Misplaced = 0.0,
    moved: options.Moved = None,
    gain_error: options.GainError = 0.0,
    lag: options.Lag = 0.0,
    noise_density: options.NoiseDensity = 0.0,
    bits: options.Bits = None,
    full_scale: options.Range = 2.0,
    speed_delay: options.SpeedDelay = 0.0,
    speed_rate: options.SpeedRate = None,
    speed_scale: options.SpeedScale = 1.0,
    also: options.Also = None,
    snr: options.Snr = None,
    records: options.Records = 1,
    seed: options.Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a car that drives on a road."""
    from sprung.simulation import Deviations, Driving, PartScatter, RoadConditions, RoadDrive, SensorErrors, Wear

    output = Output(out, records, seed, json)
    car = values.with_sensors(_vehicle("road", vehicle), also)
    deviations = Deviations(
        values=values.changes("--differs", differs),
        mounted_masses=values.mounted_masses(mounted_mass),
        flexible_modes=values.flexible_modes(flexible_mode),
        scatter=None if scatter is None else PartScatter(*(share / 100 for share in scatter)),
        wear=tuple(Wear(part.component, part.change) for part in values.faults(wear)),
        sensors=SensorErrors(
            places=misplaced / 100,
            moved=values.offsets(moved),
            tilt=math.radians(tilt),
            gain=gain_error / 100,
            lag=lag / 1000,
        ),
        individual=individual,
    )
    settings = RoadDrive(
        road=RoadConditions(
            road_class, values.potholes(potholes, pothole_side, nonlinear=nonlinear), right_rougher_db=right_rougher
        ),
        driving=Driving(braking, cornering, cross_slope / 100, height),
        wheel_orders=values.wheel_orders(unbalance, run_out, wheel_radius),
        duration=60 * minutes,
        sampling_rate=sampling_rate,
        speed=speed,
        n_stops=stops,
        snr=snr,
        deviations=deviations,
        imperfections=values.imperfections(
            car.speed_channel,
            accelerometers=(noise_density, full_scale, bits),
            speed=(speed_delay, speed_rate, speed_scale),
        ),
        **_condition(fault, payload, (temperature, tyre_temperature), nonlinear),
    )
    _simulate_drives(car, settings, output)


@simulate.command()
def rail(
    *,
    out: options.Out,
    vehicle: options.VehicleName = "y25",
    minutes: options.Minutes = 10.0,
    sampling_rate: options.SamplingRate = 500.0,
    speed: options.Speed = (15.0, 30.0),
    stops: options.Stops = 0,
    fault: options.Faults = None,
    payload: options.Payloads = None,
    temperature: options.Temperature = 20.0,
    nonlinear: options.Nonlinear = False,
    snr: options.Snr = None,
    records: options.Records = 1,
    seed: options.Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a bogie that runs on a track."""
    from sprung.simulation import RailDrive

    output = Output(out, records, seed, json)
    settings = RailDrive(
        duration=60 * minutes,
        sampling_rate=sampling_rate,
        speed=speed,
        n_stops=stops,
        snr=snr,
        **_condition(fault, payload, (temperature, 20.0), nonlinear),
    )
    _simulate_drives(_vehicle("rail", vehicle), settings, output)


@simulate.command()
def rig(
    *,
    out: options.Out,
    vehicle: options.VehicleName = "scale-bogie",
    minutes: options.Minutes = 10.0,
    sampling_rate: options.SamplingRate = 1000.0,
    speed: options.Speed = (5.5, 5.9),
    stops: options.Stops = 0,
    driven: Annotated[
        Literal["all", "front"], option(None, "Wheelsets on driven rollers.", panel=options.DRIVE)
    ] = "all",
    fault: options.Faults = None,
    payload: options.Payloads = None,
    temperature: options.Temperature = 20.0,
    nonlinear: options.Nonlinear = False,
    snr: options.Snr = None,
    records: options.Records = 1,
    seed: options.Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a bogie on a roller rig."""
    from sprung.simulation import RigRun

    output = Output(out, records, seed, json)
    settings = RigRun(
        driven=driven,
        duration=60 * minutes,
        sampling_rate=sampling_rate,
        speed=speed,
        n_stops=stops,
        snr=snr,
        **_condition(fault, payload, (temperature, 20.0), nonlinear),
    )
    _simulate_drives(_vehicle("rig", vehicle), settings, output)


@simulate.command()
def chain(
    *,
    out: options.Out,
    vehicle: options.VehicleName = "chain3",
    minutes: options.Minutes = 10.0,
    sampling_rate: options.SamplingRate = 500.0,
    fault: options.ConstantFaults = None,
    snr: options.Snr = None,
    noise_band: options.NoiseBand = None,
    records: options.Records = 1,
    seed: options.Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a chain of masses, springs and dampers under random forces."""
    from sprung.simulation.runs import StationaryRun

    output = Output(out, records, seed, json)
    settings = StationaryRun(
        duration=60 * minutes, sampling_rate=sampling_rate, faults=values.faults(fault), snr=snr, noise_band=noise_band
    )
    _simulate_runs("chain", vehicle, settings, output)


@simulate.command()
def quarter(
    *,
    out: options.Out,
    vehicle: options.VehicleName = "quarter",
    minutes: options.Minutes = 10.0,
    sampling_rate: options.SamplingRate = 1000.0,
    case: Annotated[
        int,
        option(
            "1..4",
            "Base motion. 1: random. 2: random plus pulses. 3: random plus pulses and a 3.65 Hz sine. 4: as 3, plus a"
            " 17 Hz sine.",
            panel=options.DRIVE,
            min=1,
            max=4,
        ),
    ] = 1,
    fault: options.ConstantFaults = None,
    snr: options.Snr = None,
    noise_band: options.NoiseBand = None,
    records: options.Records = 1,
    seed: options.Seed = 0,
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
        faults=values.faults(fault),
        snr=snr,
        noise_band=noise_band,
    )
    _simulate_runs("quarter", vehicle, settings, output)


def _condition(
    faults: Sequence[str] | None, payloads: Sequence[str] | None, temperatures: tuple[float, float], nonlinear: bool
) -> dict[str, Any]:
    """Return the settings of a drive that describe the condition of its vehicle."""
    from sprung.simulation import REALISTIC_FORCE_LAWS, SuspensionConditions

    suspension = SuspensionConditions(temperatures[0], REALISTIC_FORCE_LAWS if nonlinear else {}, temperatures[1])
    return {"faults": values.faults(faults), "payload": values.payloads(payloads), "suspension": suspension}


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
    """Return the error for a vehicle that does not suit the simulation."""
    return ParameterError(f"vehicle {path_or_name!r} is of kind {kind}, not {needed}: give another one")


def _check_length(duration: float, sampling_rate: float) -> None:
    """Refuse records without a length, and those that do not fit into memory."""
    from sprung._checks import check_number

    check_number("--minutes", duration / 60, above=0)
    check_number("--sampling-rate", sampling_rate, above=0)
    n_samples = duration * sampling_rate
    check_number("samples in a record", n_samples, at_most=_MOST_SAMPLES, advice="lower --minutes, or use --records")


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
