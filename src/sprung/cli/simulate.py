"""The commands `sprung simulate road`, `rail`, `rig`, `chain`, `quarter` and `sprung reproduce`."""

from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, replace
from datetime import date, timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.options import (
    OUTPUT,
    Group,
    Json,
    check_file,
    check_folder,
    complete_vehicles,
    declared,
    names,
    option,
    shares_options,
)
from sprung.cli.output import progress_bar, show, write_json, write_result, written
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.cli.conditions import DriveConditions
    from sprung.excitation import Excitation
    from sprung.simulation import DriveSettings, Fmu
    from sprung.vehicles import Fault
    from sprung.vehicles.sensor_layout import AnyVehicle

#: Most samples of a record, and rate at which drives are computed at least [Hz].
_MAX_SAMPLES, _DRIVE_RATE = 1e8, 1000.0

VehicleName = Annotated[
    str, option("V.toml|NAME", "Vehicle file or name of a shipped vehicle.", autocompletion=complete_vehicles)
]
SamplingRate = Annotated[float, option("HZ", "Sampling rate in Hz.")]
Speed = Annotated[tuple[float, float], option("LO HI", "Range of the steady speeds in m/s.")]

simulate = typer.Typer(
    help="Simulate recordings with known truth. Writes FILE, and next to it FILE.truth.json and FILE.vehicle.toml."
)


@dataclass(frozen=True, kw_only=True)
class Run(Group):
    """Options of every simulation."""

    out: Path = declared(
        "FILE", "File to write: .csv, .parquet, .npz or .mat.", default=MISSING, panel=OUTPUT, show_default=False
    )
    vehicle: VehicleName
    minutes: float = declared("M", "Length of each record in minutes.", default=10.0)
    sampling_rate: SamplingRate
    fault: list[str] | None = declared(
        "OWNER.COMPONENT=-0.2", "Relative change of a spring or damper. May be repeated."
    )
    snr: float | None = declared("S", "RMS of the signal over RMS of the sensor noise. Default: no noise.")
    records: int = declared(
        "N", "Number of records; several are numbered -01, -02 ..", default=1, panel=OUTPUT, min=1, max=1000
    )
    start: str | None = declared(
        "TIME",
        "Start of the first record, such as 2026-11-21T08:30 (UTC); further ones follow one another. Default: 08:00 of"
        " 2025-01-01, a day later for each --seed (0 to 364, then over again).",
    )
    seed: int = declared("N", "Seed of all random numbers.", default=0, min=0)
    json: Json = None

    def __post_init__(self) -> None:
        check_file("--out", self.out)
        check_file("--json", self.json)
        if self.json is not None and Path(self.json).resolve() == self.out.resolve():
            raise ParameterError(f"--json {self.json} would overwrite --out: give another name")

    @property
    def faults(self) -> "tuple[Fault, ...]":
        """Faults of the vehicle."""
        from sprung.vehicles import parse_fault

        return tuple(parse_fault(text) for text in self.fault or ())

    def _check_length(self, *, least_rate: float = 0.0) -> None:
        """Refuse records without a length, and those that do not fit into memory."""
        from sprung._checks import check_number

        check_number("--minutes", self.minutes, above=0)
        check_number("--sampling-rate", self.sampling_rate, above=0)
        n_samples = 60 * self.minutes * max(self.sampling_rate, least_rate)
        check_number("samples in a record", n_samples, at_most=_MAX_SAMPLES, advice="lower --minutes, or use --records")

    def _wrong_kind(self, kind: str, needed: str) -> ParameterError:
        return ParameterError(f"vehicle {self.vehicle!r} is of kind {kind}, not {needed}: give another one")

    def _write(self, simulations: Sequence[Callable[..., Any]], vehicle: "AnyVehicle", **settings: Any) -> None:
        """Simulate and write the recordings, and the truth and the vehicle file next to them; print the files."""
        from sprung.formats import write
        from sprung.results import tables
        from sprung.results.tables.wording import parse_time
        from sprung.simulation.runs import joint_truth, record_seeds
        from sprung.vehicles import write_vehicle

        # Drives of different seeds do not overlap, and outputs are reproducible.
        day = date(2025, 1, 1) + timedelta(days=self.seed % 365)
        start = parse_time("--start", self.start or f"{day}T08:00") or 0
        truths, paths = [], [self.out]
        if self.records > 1:
            paths = [self.out.with_stem(f"{self.out.stem}-{k:02d}") for k in range(1, self.records + 1)]
        with progress_bar() as report:
            seeds = record_seeds(self.seed, len(paths))
            for number, (simulation, path, seed) in enumerate(zip(simulations, paths, seeds, strict=True)):
                report(f"simulating {path.name}", number / len(paths))
                run = simulation(seed=seed)
                write(replace(run.recording, start=start + number * round(60e9 * self.minutes)), path)
                truths.append(run.truth)
        document = {**joint_truth(truths, seed=self.seed), **settings, "files": [str(path) for path in paths]}
        truth_path, vehicle_path = Path(f"{self.out}.truth.json"), Path(f"{self.out}.vehicle.toml")
        write_json(document, str(truth_path))
        write_vehicle(vehicle, vehicle_path)
        if write_result(document, self.json):
            table = [tables.true_modes_table(document)] * bool(document["modes"])
            show(*table, written([*paths, truth_path, vehicle_path], self.json))


@dataclass(frozen=True, kw_only=True)
class Drive(Run):
    """Options of drives."""

    speed: Speed
    fault: list[str] | None = declared(
        "CORNER.COMPONENT=-0.2",
        "Relative change of a spring, damper or tyre. With @ONSET+GROWTH (in seconds) it begins later and grows."
        " May be repeated.",
    )
    conditions: Path | None = declared(
        "C.toml",
        "Conditions of the drive: payload, suspension, sensors, what differs from the vehicle file; on a road also"
        " potholes, driving and wheels. Default: a healthy vehicle on a calm drive.",
    )

    def simulate(
        self,
        kind: Literal["road", "rail", "rig"],
        model: "type[DriveConditions]",
        settings: "type[DriveSettings]",
        *,
        road_class: str | None = None,
        surface: Path | None = None,
        fmu: "Fmu | None" = None,
    ) -> None:
        """Simulate and write drives, with the wear of each carried over to the next."""
        from sprung.cli.conditions import read_conditions
        from sprung.excitation import read_surface
        from sprung.simulation import simulate_drive
        from sprung.simulation.runs import drive_document, drives_of_one_vehicle
        from sprung.vehicles import Vehicle, read_description

        described = read_description(self.vehicle)
        if not isinstance(described, Vehicle):
            raise self._wrong_kind(described.kind, kind)
        if described.bogie and kind != "rail":
            raise self._wrong_kind("rail, on bogies", kind)
        vehicle = described.model_copy(update={"kind": kind})
        stated = read_conditions(model, self.conditions).settings(vehicle)
        if road_class is not None:
            stated["road"] = replace(stated["road"], road_class=road_class)
        if surface is not None:
            stated["surface"] = read_surface(surface, half_track=vehicle.axle[0].half_track)
        self._check_length(least_rate=_DRIVE_RATE)
        drive = settings(
            duration=60 * self.minutes,
            sampling_rate=self.sampling_rate,
            speed=self.speed,
            snr=self.snr,
            faults=self.faults,
            fmu=fmu,
            **stated,
        )
        drives = [partial(simulate_drive, vehicle, one) for one in drives_of_one_vehicle(drive, self.records)]
        self._write(drives, vehicle, **drive_document(drive))


@dataclass(frozen=True, kw_only=True)
class Shaken(Run):
    """Options of runs of what does not drive."""

    noise_band: tuple[float, float] | None = declared("LO HI", "Band of the sensor noise in Hz. Default: white noise.")

    def simulate(self, kind: Literal["chain", "quarter"], excitation: "Excitation | None" = None) -> None:
        """Simulate and write records of a chain or a quarter vehicle."""
        from sprung.simulation.runs import StationaryRun, simulate_run
        from sprung.vehicles import Vehicle, read_description

        vehicle = read_description(self.vehicle)
        if isinstance(vehicle, Vehicle) or vehicle.kind != kind:
            raise self._wrong_kind(vehicle.kind, kind)
        if self.noise_band is not None and self.snr is None:
            raise ParameterError("--noise-band needs --snr: state how strong the noise is")
        self._check_length()
        run = StationaryRun(
            excitation=excitation,
            duration=60 * self.minutes,
            sampling_rate=self.sampling_rate,
            faults=self.faults,
            snr=self.snr,
            noise_band=self.noise_band,
        )
        self._write([partial(simulate_run, vehicle, run)] * self.records, vehicle)


@dataclass(frozen=True, kw_only=True)
class _Road(Drive):
    vehicle: VehicleName = "zafira"
    sampling_rate: SamplingRate = 200.0
    speed: Speed = (5.5, 20.0)
    road_class: str | None = declared(
        "A..H", "Roughness class of ISO 8608. Default: that of --conditions, or C.", "--road"
    )
    surface: Path | None = declared(
        "F.crg", "Measured road surface (ASAM OpenCRG) in place of a random one; longer drives go back and forth on it."
    )
    fmu: Path | None = declared(
        "F.fmu", "Functional Mock-up Unit that is driven in place of the vehicle file, and is the truth."
    )
    fmu_inputs: str | None = declared(
        "A,B,..",
        "Inputs of the FMU for the height of the road under each wheel: front left, front right, .. Default:"
        " road_front_left ..",
    )


@simulate.command()
@shares_options
def road(*, options: _Road) -> None:
    """Simulate a car that drives on a road."""
    from sprung.cli.conditions import RoadDriveConditions
    from sprung.simulation import Fmu, RoadDrive

    if options.fmu_inputs is not None and options.fmu is None:
        raise ParameterError("--fmu-inputs needs --fmu: name the FMU")
    if options.surface is not None and options.road_class is not None:
        raise ParameterError("--surface takes the place of a road class: give --surface or --road, not both")
    fmu = None if options.fmu is None else Fmu(options.fmu, inputs=names(options.fmu_inputs))
    road_class, surface = options.road_class, options.surface
    options.simulate("road", RoadDriveConditions, RoadDrive, road_class=road_class, surface=surface, fmu=fmu)


@dataclass(frozen=True, kw_only=True)
class _Rail(Drive):
    vehicle: VehicleName = "y25"
    sampling_rate: SamplingRate = 500.0
    speed: Speed = (15.0, 30.0)


@simulate.command()
@shares_options
def rail(*, options: _Rail) -> None:
    """Simulate a bogie, or a vehicle on bogies, that runs on a track."""
    from sprung.cli.conditions import RailDriveConditions
    from sprung.simulation import RailDrive

    options.simulate("rail", RailDriveConditions, RailDrive)


@dataclass(frozen=True, kw_only=True)
class _Rig(Drive):
    vehicle: VehicleName = "scale-bogie"
    sampling_rate: SamplingRate = 1000.0
    speed: Speed = (5.5, 5.9)


@simulate.command()
@shares_options
def rig(*, options: _Rig) -> None:
    """Simulate a bogie on a roller rig."""
    from sprung.cli.conditions import RigRunConditions
    from sprung.simulation import RigRun

    options.simulate("rig", RigRunConditions, RigRun)


@dataclass(frozen=True, kw_only=True)
class _Chain(Shaken):
    vehicle: VehicleName = "chain3"
    sampling_rate: SamplingRate = 500.0


@simulate.command()
@shares_options
def chain(*, options: _Chain) -> None:
    """Simulate a chain of masses and springs under random forces."""
    options.simulate("chain")


@dataclass(frozen=True, kw_only=True)
class _Quarter(Shaken):
    vehicle: VehicleName = "quarter"
    sampling_rate: SamplingRate = 1000.0
    case: int = declared(
        "1..4",
        "Base motion. 1: random. 2: random plus pulses. 3: random plus pulses and a 3.65 Hz sine. 4: as 3, plus a"
        " 17 Hz sine.",
        default=1,
        min=1,
        max=4,
    )


@simulate.command()
@shares_options
def quarter(*, options: _Quarter) -> None:
    """Simulate a quarter vehicle: one wheel on a roller."""
    from sprung.excitation import QUARTER_CASES

    options.simulate("quarter", QUARTER_CASES[options.case - 1])


def reproduce(
    chapters: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="CHAPTER", help="Chapters: 4, 5, 6, 7, 8 or comparison. Default: all.", show_default=False
        ),
    ] = None,
    *,
    out: Annotated[
        Path, option("DIR", "Folder for the pages; created if it does not exist.", panel=OUTPUT, show_default=False)
    ],
    seeds: Annotated[int, option("N", "Number of runs where the thesis shows one.", min=2, max=10_000)] = 50,
    processes: Annotated[
        int | None, option("N", "Number of processes. Default: one for each processor.", min=1, max=1000)
    ] = None,
    json: Json = None,
) -> None:
    """Recompute tables and figures of Liu's thesis (2020). A page for each chapter, published values next to ours."""
    from sprung.reproduce import reproduce

    check_file("--json", json)
    check_folder("--out", out)
    with progress_bar() as report:
        paths = reproduce(chapters or (), directory=out, n_seeds=seeds, n_processes=processes, on_progress=report)
    document = {"schema": "sprung.reproduction/1", "seeds": seeds, "files": [str(path) for path in paths]}
    if write_result(document, json):
        show(written(paths, json))
