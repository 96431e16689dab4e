"""The commands `sprung simulate road`, `rail`, `rig`, `chain` and `quarter`, and their files of conditions."""

from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer
from pydantic import BaseModel, ConfigDict, Field

from sprung.cli.options import OUTPUT, Group, Json, check_file, complete_vehicles, declared, option, shares_options
from sprung.cli.output import progress_bar, show, write_json, write_result, written
from sprung.errors import FormatError, ParameterError
from sprung.simulation import (
    REALISTIC_FORCE_LAWS,
    Deviations,
    Driving,
    Imperfection,
    Payload,
    RoadConditions,
    SuspensionConditions,
    WheelOrders,
    delayed,
    held,
    mems_accelerometers,
    scaled,
)
from sprung.toml import checked, toml_fields
from sprung.vehicles.sections import NotNegative, Positive

if TYPE_CHECKING:
    from sprung.excitation import Excitation
    from sprung.simulation import DriveSettings
    from sprung.vehicles import Fault
    from sprung.vehicles.sensor_layout import AnyVehicle


_FINEST_BITS = 32

_Conditions = TypeVar("_Conditions", bound="DriveConditions")


class Table(BaseModel):
    """Table of a file of conditions: without unknown keys, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Suspension(Table):
    """Departures of the suspension from the linear one of the vehicle file.

    Parameters
    ----------
    temperature
        Temperature of the dampers [°C]; damping is nominal at 20 °C.
    tyre_temperature
        Temperature of the air in the tyres [°C]; their stiffness is nominal at 20 °C.
    nonlinear
        Asymmetric dampers, friction, progressive springs and bump stops.
    """

    temperature: float = 20.0
    tyre_temperature: float = 20.0
    nonlinear: bool = False


class Accelerometers(Table):
    """Noise, range and resolution of the accelerometers.

    Parameters
    ----------
    noise_density
        One-sided spectral density of the noise, its square root [m/s^2 / sqrt(Hz)]; MEMS have 2e-4 to 3e-3.
    full_scale
        Half the range [m/s^2]; it matters where `bits` is given.
    bits
        Number of bits over the range; default: as fine as a 32-bit number.
    """

    noise_density: NotNegative = 0.0
    full_scale: Positive = 19.62
    bits: Annotated[int, Field(ge=1, le=_FINEST_BITS)] | None = None


class SpeedChannel(Table):
    """Errors of the recorded speed.

    Parameters
    ----------
    delay
        Delay of the speed at its update [s].
    rate
        Updates per second [Hz], held in between, as from GPS; default: one for each sample.
    scale
        Ratio of recorded to true speed.
    """

    delay: NotNegative = 0.0
    rate: Positive | None = None
    scale: Positive = 1.0


class DriveConditions(Table):
    """Conditions of all drives.

    Parameters
    ----------
    n_stops
        Number of stops on the way.
    """

    n_stops: int = Field(0, ge=0)
    payload: tuple[Payload, ...] = ()
    suspension: Suspension = Suspension()
    deviations: Deviations = Deviations()
    accelerometers: Accelerometers = Accelerometers()
    speed_channel: SpeedChannel = SpeedChannel()

    def settings(self, speed_channel: str) -> dict[str, Any]:
        """Return the settings of a drive that the file states; the vehicle names the channel of its speed."""
        suspension = self.suspension
        laws = REALISTIC_FORCE_LAWS if suspension.nonlinear else {}
        own = self.__class__.model_fields.keys() - DriveConditions.model_fields
        return {
            "n_stops": self.n_stops,
            "payload": self.payload,
            "suspension": SuspensionConditions(suspension.temperature, laws, suspension.tyre_temperature),
            "deviations": self.deviations,
            "imperfections": (*self._accelerometer_imperfections(), *self._speed_imperfections(speed_channel)),
            **{name: getattr(self, name) for name in own},
        }

    def _accelerometer_imperfections(self) -> tuple[Imperfection, ...]:
        sensors = self.accelerometers
        noise, resolution = mems_accelerometers(
            noise_density=sensors.noise_density, full_scale=sensors.full_scale, bits=sensors.bits or _FINEST_BITS
        )
        return (*([noise] if sensors.noise_density else []), *([resolution] if sensors.bits else []))

    def _speed_imperfections(self, channel: str) -> tuple[Imperfection, ...]:
        speed = self.speed_channel
        parts: list[Imperfection] = []
        if speed.scale != 1:
            parts.append(partial(scaled, channel=channel, factor=speed.scale))
        if speed.rate is not None:
            parts.append(partial(held, channel=channel, rate=speed.rate, delay=speed.delay))
        elif speed.delay:
            parts.append(partial(delayed, channel=channel, delay=speed.delay))
        return tuple(parts)


class RoadDriveConditions(DriveConditions):
    """Conditions of drives on a road."""

    road: RoadConditions = RoadConditions()
    driving: Driving = Driving()
    wheel_orders: WheelOrders | None = None


class RigRunConditions(DriveConditions):
    """Conditions of runs on a roller rig.

    Parameters
    ----------
    driven
        Wheelsets that stand on driven rollers.
    """

    driven: Literal["all", "front"] = "all"


def read_conditions(model: type[_Conditions], path: Path | None) -> _Conditions:
    """Return the conditions of a file; without one, those of a healthy vehicle on a calm drive.

    Raises
    ------
    FormatError
        If the file is not valid TOML, or a field is unknown or outside its range.
    """
    if path is None:
        return model()
    try:
        return checked(model, toml_fields(path.read_bytes(), source=str(path)))
    except ParameterError as error:
        raise FormatError(f"{path}: {error}") from None


#: Most samples of a record, and rate at which drives are computed at least [Hz].
_MAX_SAMPLES, _DRIVE_RATE = 1e8, 1000.0

VehicleName = Annotated[
    str, option("V.toml|NAME", "Vehicle file or name of a shipped vehicle.", autocompletion=complete_vehicles)
]
SamplingRate = Annotated[float, option("HZ", "Sampling rate in Hz.")]
Speed = Annotated[tuple[float, float], option("LO HI", "Range of the steady speeds in m/s.")]

simulate = typer.Typer(
    help="Simulate recordings with known truth: FILE, and next to it FILE.truth.json and FILE.vehicle.toml."
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
        from sprung.simulation.runs import joint_truth, record_seeds
        from sprung.vehicles import write_vehicle

        truths, paths = [], [self.out]
        if self.records > 1:
            paths = [self.out.with_stem(f"{self.out.stem}-{k:02d}") for k in range(1, self.records + 1)]
        with progress_bar() as report:
            seeds = record_seeds(self.seed, len(paths))
            for number, (simulation, path, seed) in enumerate(zip(simulations, paths, seeds, strict=True)):
                report(f"simulating {path.name}", number / len(paths))
                run = simulation(seed=seed)
                write(run.recording, path)
                truths.append(run.truth)
        document = {**joint_truth(truths, seed=self.seed), **settings, "files": [str(path) for path in paths]}
        truth_path, vehicle_path = Path(f"{self.out}.truth.json"), Path(f"{self.out}.vehicle.toml")
        write_json(document, str(truth_path))
        write_vehicle(vehicle, vehicle_path)
        if write_result(document, self.json):
            show(tables.true_modes_table(document), written([*paths, truth_path, vehicle_path], self.json))


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
    ) -> None:
        """Simulate and write drives, with the wear of each carried over to the next."""
        from sprung.cli.simulate import read_conditions
        from sprung.simulation import simulate_drive
        from sprung.simulation.runs import drive_document, drives_of_one_vehicle
        from sprung.vehicles import Vehicle, read_description

        described = read_description(self.vehicle)
        if not isinstance(described, Vehicle):
            raise self._wrong_kind(described.kind, kind)
        vehicle = described.model_copy(update={"kind": kind})
        stated = read_conditions(model, self.conditions).settings(vehicle.speed_channel)
        if road_class is not None:
            stated["road"] = replace(stated["road"], road_class=road_class)
        self._check_length(least_rate=_DRIVE_RATE)
        drive = settings(
            duration=60 * self.minutes,
            sampling_rate=self.sampling_rate,
            speed=self.speed,
            snr=self.snr,
            faults=self.faults,
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


@simulate.command()
@shares_options
def road(*, options: _Road) -> None:
    """Simulate a car that drives on a road."""
    from sprung.cli.simulate import RoadDriveConditions
    from sprung.simulation import RoadDrive

    options.simulate("road", RoadDriveConditions, RoadDrive, road_class=options.road_class)


@dataclass(frozen=True, kw_only=True)
class _Rail(Drive):
    vehicle: VehicleName = "y25"
    sampling_rate: SamplingRate = 500.0
    speed: Speed = (15.0, 30.0)


@simulate.command()
@shares_options
def rail(*, options: _Rail) -> None:
    """Simulate a bogie that runs on a track."""
    from sprung.cli.simulate import DriveConditions
    from sprung.simulation import RailDrive

    options.simulate("rail", DriveConditions, RailDrive)


@dataclass(frozen=True, kw_only=True)
class _Rig(Drive):
    vehicle: VehicleName = "scale-bogie"
    sampling_rate: SamplingRate = 1000.0
    speed: Speed = (5.5, 5.9)


@simulate.command()
@shares_options
def rig(*, options: _Rig) -> None:
    """Simulate a bogie on a roller rig."""
    from sprung.cli.simulate import RigRunConditions
    from sprung.simulation import RigRun

    options.simulate("rig", RigRunConditions, RigRun)


@dataclass(frozen=True, kw_only=True)
class _Chain(Shaken):
    vehicle: VehicleName = "chain3"
    sampling_rate: SamplingRate = 500.0


@simulate.command()
@shares_options
def chain(*, options: _Chain) -> None:
    """Simulate a chain of masses, springs and dampers under random forces."""
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
