"""The commands `sprung simulate road`, `rail`, `rig`, `chain` and `quarter`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import Json, check_file
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.cli.simulate_options import (
    CONDITION,
    DRIVE,
    ConstantFaults,
    Faults,
    Minutes,
    NoiseBand,
    Nonlinear,
    Out,
    PayloadMass,
    Records,
    SamplingRate,
    Seed,
    Snr,
    Speed,
    Stops,
    Temperature,
    VehicleName,
)
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from sprung.excitation import Excitation
    from sprung.recording import Recording
    from sprung.simulation import DriveSettings, SuspensionConditions
    from sprung.vehicles import Chain, Fault, Quarter, Vehicle

    AnyVehicle = Chain | Quarter | Vehicle
    #: Simulates one record with a seed; returns it with its truth.
    Run = Callable[[int | list[int]], tuple[Recording, dict[str, Any]]]

_MOST_SAMPLES = 1e8

simulate = typer.Typer(
    help="Simulate recordings with known truth; FILE.truth.json and FILE.vehicle.toml are written next to FILE.",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@dataclass(frozen=True, slots=True)
class Output:
    """Where the records of a command go.

    Parameters
    ----------
    out
        File to write.
    n_records
        Number of records.
    seed
        Seed of the first record.
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
    out: Out,
    vehicle: VehicleName = "zafira",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 200.0,
    speed: Speed = (5.5, 20.0),
    road_class: Annotated[
        str, typer.Option("--road", metavar="A..H", help="Roughness class of ISO 8608.", rich_help_panel=DRIVE)
    ] = "C",
    stops: Stops = 0,
    fault: Faults = None,
    payload: PayloadMass = 0.0,
    temperature: Temperature = 20.0,
    nonlinear: Annotated[
        bool,
        typer.Option(
            "--nonlinear",
            help="Asymmetric dampers, friction, progressive springs and bump stops; potholes on the road.",
            rich_help_panel=CONDITION,
        ),
    ] = False,
    snr: Snr = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a car that drives on a road."""
    from sprung.simulation import FEW_POTHOLES, Payload, RoadConditions, RoadDrive

    output = Output(out, records, seed, json)
    settings = RoadDrive(
        road=RoadConditions(road_class, potholes=FEW_POTHOLES if nonlinear else None),
        duration=60 * minutes,
        sampling_rate=sampling_rate,
        speed=speed,
        n_stops=stops,
        faults=_faults(fault),
        payload=Payload(payload),
        suspension=_suspension(temperature, nonlinear),
        snr=snr,
    )
    _simulate_drives("road", vehicle, settings, output, road=road_class)


@simulate.command()
def rail(
    *,
    out: Out,
    vehicle: VehicleName = "y25",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 500.0,
    speed: Speed = (15.0, 30.0),
    stops: Stops = 0,
    fault: Faults = None,
    payload: PayloadMass = 0.0,
    temperature: Temperature = 20.0,
    nonlinear: Nonlinear = False,
    snr: Snr = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a bogie that runs on a track."""
    from sprung.simulation import Payload, RailDrive

    output = Output(out, records, seed, json)
    settings = RailDrive(
        duration=60 * minutes,
        sampling_rate=sampling_rate,
        speed=speed,
        n_stops=stops,
        faults=_faults(fault),
        payload=Payload(payload),
        suspension=_suspension(temperature, nonlinear),
        snr=snr,
    )
    _simulate_drives("rail", vehicle, settings, output)


@simulate.command()
def rig(
    *,
    out: Out,
    vehicle: VehicleName = "scale-bogie",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 1000.0,
    speed: Speed = (5.5, 5.9),
    stops: Stops = 0,
    driven: Annotated[
        Literal["all", "front"], typer.Option(help="Wheelsets on driven rollers.", rich_help_panel=DRIVE)
    ] = "all",
    fault: Faults = None,
    payload: PayloadMass = 0.0,
    temperature: Temperature = 20.0,
    nonlinear: Nonlinear = False,
    snr: Snr = None,
    records: Records = 1,
    seed: Seed = 0,
    json: Json = None,
) -> None:
    """Simulate a bogie on a roller rig."""
    from sprung.simulation import Payload, RigRun

    output = Output(out, records, seed, json)
    settings = RigRun(
        driven=driven,
        duration=60 * minutes,
        sampling_rate=sampling_rate,
        speed=speed,
        n_stops=stops,
        faults=_faults(fault),
        payload=Payload(payload),
        suspension=_suspension(temperature, nonlinear),
        snr=snr,
    )
    _simulate_drives("rig", vehicle, settings, output)


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
    from sprung.simulation import usual_excitation
    from sprung.vehicles import structure

    output, model = Output(out, records, seed, json), _vehicle("chain", vehicle)
    options = _record_options(minutes, sampling_rate, snr, noise_band)
    _simulate_shaken(model, usual_excitation(structure(model)), _faults(fault), options, output)


@simulate.command()
def quarter(
    *,
    out: Out,
    vehicle: VehicleName = "quarter",
    minutes: Minutes = 10.0,
    sampling_rate: SamplingRate = 1000.0,
    case: Annotated[
        int,
        typer.Option(
            metavar="1..4",
            min=1,
            max=4,
            help="Base motion. 1: random. 2: random plus pulses. 3: random plus pulses and a 3.65 Hz sine."
            " 4: as 3, plus a 17 Hz sine.",
            rich_help_panel=DRIVE,
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

    output, model = Output(out, records, seed, json), _vehicle("quarter", vehicle)
    options = _record_options(minutes, sampling_rate, snr, noise_band)
    _simulate_shaken(model, QUARTER_CASES[case - 1], _faults(fault), options, output)


def _suspension(temperature: float, nonlinear: bool) -> "SuspensionConditions":
    from sprung.simulation import REALISTIC_FORCE_LAWS, SuspensionConditions

    return SuspensionConditions(temperature, REALISTIC_FORCE_LAWS if nonlinear else {})


def _record_options(
    minutes: float, sampling_rate: float, snr: float | None, noise_band: tuple[float, float] | None
) -> dict[str, Any]:
    """Return the length and noise of a record without a drive."""
    if noise_band is not None and snr is None:
        raise ParameterError("--noise-band needs --snr: state how strong the noise is")
    _check_length(60 * minutes, sampling_rate)
    return {"duration": 60 * minutes, "sampling_rate": sampling_rate, "snr": snr, "noise_band": noise_band}


def _check_length(duration: float, sampling_rate: float) -> None:
    """Refuse records without a length, and those that no memory holds."""
    from sprung._checks import check_number

    check_number("--minutes", duration / 60, above=0)
    check_number("--sampling-rate", sampling_rate, above=0)
    n_samples = duration * sampling_rate
    check_number("samples in a record", n_samples, at_most=_MOST_SAMPLES, advice="lower --minutes, or use --records")


def _faults(texts: Sequence[str] | None) -> "tuple[Fault, ...]":
    from sprung.vehicles import parse_fault

    return tuple(parse_fault(text) for text in texts or ())


def _vehicle(kind: str, path_or_name: str) -> Any:
    """Return the vehicle to simulate, of a type that suits the kind of simulation."""
    from sprung.vehicles import Vehicle, read_description

    vehicle = read_description(path_or_name)
    is_drive = kind in {"road", "rail", "rig"}
    if isinstance(vehicle, Vehicle) != is_drive or (not is_drive and vehicle.kind != kind):
        raise ParameterError(f"vehicle {path_or_name!r} is of kind {vehicle.kind}, not {kind}: give another one")
    return vehicle


def _simulate_drives(
    kind: str, vehicle_name: str, settings: "DriveSettings", output: Output, *, road: str | None = None
) -> None:
    """Simulate and write drives."""
    from sprung.simulation import simulate_drive

    vehicle = _vehicle(kind, vehicle_name)
    _check_length(settings.duration, max(settings.sampling_rate, 1000.0))

    def run(seed: "int | list[int]") -> "tuple[Recording, dict[str, Any]]":
        drive = simulate_drive(vehicle, settings, seed=seed)
        return drive.recording, drive.truth

    described = {
        "duration": settings.duration,
        "sampling_rate": settings.sampling_rate,
        "snr": settings.snr,
        "noise_band": None,
        "kind": kind,
        "road": road,
        "nonlinear": bool(settings.suspension.force_laws),
        "payload": settings.payload.mass,
        "temperature": settings.suspension.temperature,
    }
    _write(run, vehicle, described, output)


def _simulate_shaken(
    vehicle: Any, excitation: "Excitation", faults: "Sequence[Fault]", options: dict[str, Any], output: Output
) -> None:
    """Simulate and write records of a chain or a quarter vehicle."""
    from sprung.simulation import simulate, truth
    from sprung.vehicles import structure, with_faults

    for fault in faults:
        if not fault.is_constant:
            raise ParameterError(
                f"the fault of {fault.component} begins later or grows, as only faults of drives can: give its change"
            )
    healthy = structure(vehicle)
    faulty = with_faults(healthy, faults)

    def run(seed: "int | list[int]") -> "tuple[Recording, dict[str, Any]]":
        import numpy as np

        recording = simulate(faulty, excitation, **options, seed=np.random.default_rng(seed))
        return recording, truth(healthy, faults=faults)

    _write(run, vehicle, {**options, "excitation": str(excitation)}, output)


def _write(run: "Run", vehicle: "AnyVehicle", described: dict[str, Any], output: Output) -> None:
    """Write the recordings, and the truth and the vehicle file next to them; print what was written."""
    from sprung.vehicles import write_vehicle

    document = {
        **_write_recordings(run, output),
        **described,
        "files": [str(path) for path in output.paths],
    }
    truth_path, vehicle_path = Path(f"{output.out}.truth.json"), Path(f"{output.out}.vehicle.toml")
    write_json(document, str(truth_path))
    write_vehicle(vehicle, vehicle_path)
    if output.json is not None:
        write_json(document, output.json)
    if output.json != "-":
        _show(document, [*output.paths, truth_path, vehicle_path])


def _write_recordings(run: "Run", output: Output) -> dict[str, Any]:
    """Write the recordings and return their truth."""
    from sprung.formats import write

    documents = []
    paths = output.paths
    with progress_bar() as report:
        for k, path in enumerate(paths):
            report(f"simulating {path.name}", k / len(paths))
            recording, document = run(output.seed if len(paths) == 1 else [output.seed, k])
            write(recording, path)
            documents.append(document)
    first = {**documents[0], "seed": output.seed}
    if len(documents) > 1 and first["speed"] is not None:
        first["speeds"] = [document["speed"] for document in documents]
    return first


def _show(document: dict[str, Any], paths: Sequence[Path]) -> None:
    """Print the true modes and the files that were written."""
    rows = [
        (f"{mode['natural_frequency']:.4g}", f"{100 * mode['damping_ratio']:.4g}", mode["label"] or "")
        for mode in document["modes"]
    ]
    out = console()
    out.print(table("True modes", ("frequency [Hz]", "damping [%]", "label"), rows, n_words=0))
    out.print(notes(f"wrote {path}" for path in paths))
