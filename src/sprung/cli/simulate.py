"""The command `sprung simulate`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import OUTPUT, Json, check_file
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from sprung.recording import Recording
    from sprung.vehicles import Chain, Quarter, Vehicle

    AnyVehicle = Chain | Quarter | Vehicle

#: Vehicle of each kind where none is given, and sampling rate [Hz] where the library has no usual one.
_USUAL_VEHICLE = {"chain": "chain3", "quarter": "quarter", "road": "zafira", "rail": "y25", "rig": "scale-bogie"}
_USUAL_RATE = {"chain": 500.0, "quarter": 1000.0}
_MOST_SAMPLES = 1e8
WAY, FAULTS = "Drive", "Condition"


def simulate(
    kind: Annotated[
        Literal["road", "rail", "rig", "chain", "quarter"],
        typer.Argument(
            help="road: a car on a road. rail: a bogie on a track. rig: a bogie on rollers. chain: random forces on"
            " masses above one another. quarter: one wheel on a roller."
        ),
    ],
    *,
    out: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="File to write: .csv, .parquet, .npz or .mat.",
            show_default=False,
            rich_help_panel=OUTPUT,
        ),
    ],
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="V.toml|NAME",
            help="Vehicle file or name. Default: zafira, y25, scale-bogie, chain3, quarter.",
            show_default=False,
        ),
    ] = None,
    minutes: Annotated[float, typer.Option(metavar="M", help="Length of a record.")] = 10.0,
    sampling_rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", help="Default: 200 on a road, 500 on rails or for a chain, 1000 on a rig or quarter."
        ),
    ] = None,
    speed: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="LO HI",
            help="Range of the speed in m/s. Default: 5.5 20 on a road, 15 30 on rails, 5.5 5.9 on a rig.",
            rich_help_panel=WAY,
        ),
    ] = None,
    road: Annotated[
        str | None, typer.Option(metavar="A..H", help="Class of the road, ISO 8608. Default: C.", rich_help_panel=WAY)
    ] = None,
    stops: Annotated[int, typer.Option(metavar="N", min=0, help="Stops on the way.", rich_help_panel=WAY)] = 0,
    driven: Annotated[
        Literal["all", "front"] | None,
        typer.Option(help="Wheelsets that a rig drives. Default: all.", rich_help_panel=WAY),
    ] = None,
    case: Annotated[
        int | None,
        typer.Option(
            metavar="1..4",
            min=1,
            max=4,
            help="Base motion of the quarter vehicle. 1: random (default). 2: and pulses. 3: and a sine of 3.65 Hz."
            " 4: and one of 17 Hz.",
            rich_help_panel=WAY,
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CORNER.COMPONENT=-0.2",
            help="Change of a spring, damper or tyre; with @ONSET+GROWTH in seconds one that begins later and grows."
            " Can be repeated.",
            rich_help_panel=FAULTS,
        ),
    ] = None,
    payload: Annotated[
        float, typer.Option(metavar="KG", min=0, help="Mass on the body.", rich_help_panel=FAULTS)
    ] = 0.0,
    temperature: Annotated[
        float, typer.Option(metavar="C", help="Of the dampers, nominal at 20.", rich_help_panel=FAULTS)
    ] = 20.0,
    nonlinear: Annotated[
        bool,
        typer.Option(
            "--nonlinear",
            help="Asymmetric dampers, friction, progressive springs, bump stops; potholes on the road.",
            rich_help_panel=FAULTS,
        ),
    ] = False,
    snr: Annotated[
        float | None,
        typer.Option(metavar="S", help="RMS of the signal over that of the sensor noise. Default: no noise."),
    ] = None,
    noise_band: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LO HI", help="Band of the noise in Hz. Default: white.")
    ] = None,
    n_records: Annotated[
        int,
        typer.Option(
            "--records",
            metavar="N",
            min=1,
            max=1000,
            help="Records; several end in -01, -02 ...",
            rich_help_panel=OUTPUT,
        ),
    ] = 1,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of all randomness.")] = 0,
    json: Json = None,
) -> None:
    """Simulate recordings with known truth; FILE.truth.json and FILE.vehicle.toml are written beside them."""
    check_file("--out", out)
    check_file("--json", json)
    if json is not None and Path(json).resolve() == out.resolve():
        raise ParameterError(f"--json {json} would overwrite --out: give another name")
    if noise_band is not None and snr is None:
        raise ParameterError("--noise-band needs --snr: state how strong the noise is")
    is_drive = kind in {"road", "rail", "rig"}
    _check_options(
        kind,
        {
            "--case": (case is not None, kind == "quarter"),
            "--speed": (speed is not None, is_drive),
            "--road": (road is not None, kind == "road"),
            "--stops": (stops > 0, is_drive),
            "--driven": (driven is not None, kind == "rig"),
            "--payload": (payload > 0, is_drive),
            "--temperature": (temperature != 20.0, is_drive),
            "--nonlinear": (nonlinear, is_drive),
        },
    )
    description = _vehicle(kind, vehicle)
    given = {
        "speed": speed,
        "road": road or "C",
        "n_stops": stops,
        "payload": payload,
        "temperature": temperature,
        "is_nonlinear": nonlinear,
        "driven": driven or "all",
    }
    options = {"duration": 60 * minutes, "sampling_rate": sampling_rate, "snr": snr, "noise_band": noise_band}
    run, said = (
        _drive(kind, description, fault or [], options, given)
        if is_drive
        else _shaken(description, fault or [], options, case)
    )
    paths = [out] if n_records == 1 else [out.with_stem(f"{out.stem}-{k:02d}") for k in range(1, n_records + 1)]
    document = {**_simulated(run, paths, seed), **options, **said, "files": [str(path) for path in paths]}
    beside = [Path(f"{out}.truth.json"), Path(f"{out}.vehicle.toml")]
    write_json(document, str(beside[0]))
    _write_vehicle(description, beside[1])
    if json is not None:
        write_json(document, json)
    if json != "-":
        _show(document, [*paths, *beside])


def _check_options(kind: str, options: "dict[str, tuple[bool, bool]]") -> None:
    """Refuse options that are given but mean nothing for the kind."""
    for name, (is_given, is_used) in options.items():
        if is_given and not is_used:
            raise ParameterError(f"{name} means nothing for {kind}: leave it out")


def _check_length(duration: float, sampling_rate: float) -> None:
    """Refuse records without a length, and those that no memory holds."""
    from sprung._checks import check_number

    check_number("--minutes", duration / 60, above=0)
    check_number("--sampling-rate", sampling_rate, above=0)
    n_samples = duration * sampling_rate
    check_number("samples in a record", n_samples, at_most=_MOST_SAMPLES, advice="lower --minutes, or use --records")


def _vehicle(kind: str, path_or_name: str | None) -> "AnyVehicle":
    """Return the vehicle to simulate."""
    from sprung.vehicles import Vehicle, read_description

    vehicle = read_description(_USUAL_VEHICLE[kind] if path_or_name is None else path_or_name)
    if isinstance(vehicle, Vehicle) != (kind in {"road", "rail", "rig"}) or (
        not isinstance(vehicle, Vehicle) and vehicle.kind != kind
    ):
        raise ParameterError(f"vehicle {path_or_name!r} is of kind {vehicle.kind}, not {kind}: give another one")
    return vehicle


def _drive(
    kind: Any, vehicle: Any, faults: Sequence[str], options: dict[str, Any], given: dict[str, Any]
) -> "tuple[Callable[[int | list[int]], tuple[Recording, dict[str, Any]]], dict[str, Any]]":
    """Return what simulates one drive for a seed, and its settings as the truth has them."""
    from sprung.simulation import DriveSettings, simulate_drive
    from sprung.vehicles import parse_fault

    if options["noise_band"] is not None:
        raise ParameterError(f"--noise-band means nothing for {kind}, whose sensor noise is white: leave it out")
    parsed = tuple(parse_fault(text) for text in faults)
    sizes = {"duration": options["duration"], "sampling_rate": options["sampling_rate"], "snr": options["snr"]}
    settings = DriveSettings(kind=kind, faults=parsed, **sizes, **given)
    _check_length(settings.duration, max(settings.rate, 1000.0))
    options["sampling_rate"] = settings.rate

    def run(seed: "int | list[int]") -> "tuple[Recording, dict[str, Any]]":
        drive = simulate_drive(vehicle, settings, seed=seed)
        return drive.recording, drive.truth

    named = {"nonlinear": given["is_nonlinear"], "payload": given["payload"], "temperature": given["temperature"]}
    return run, {"kind": kind, "road": given["road"] if kind == "road" else None, **named}


def _shaken(
    vehicle: Any, faults: Sequence[str], options: dict[str, Any], case: int | None
) -> "tuple[Callable[[int | list[int]], tuple[Recording, dict[str, Any]]], dict[str, Any]]":
    """Return what simulates a chain or quarter vehicle for a seed, and its excitation in words."""
    from sprung.excitation import QUARTER_CASES
    from sprung.simulation import simulate, truth, usual_excitation
    from sprung.vehicles import parse_fault, structure, with_faults

    if options["sampling_rate"] is None:
        options["sampling_rate"] = _USUAL_RATE[vehicle.kind]
    _check_length(options["duration"], options["sampling_rate"])
    parsed = tuple(parse_fault(text) for text in faults)
    for one in parsed:
        if not one.is_constant:
            raise ParameterError(f"the fault of {one.component} begins later or grows: only drives have such faults")
    healthy = structure(vehicle)
    model = with_faults(healthy, parsed)
    excitation = usual_excitation(model) if vehicle.kind == "chain" else QUARTER_CASES[(case or 1) - 1]

    def run(seed: "int | list[int]") -> "tuple[Recording, dict[str, Any]]":
        import numpy as np

        recording = simulate(model, excitation, **options, seed=np.random.default_rng(seed))
        return recording, truth(healthy, faults=parsed)

    return run, {"excitation": str(excitation)}


def _simulated(
    run: "Callable[[int | list[int]], tuple[Recording, dict[str, Any]]]", paths: Sequence[Path], seed: int
) -> dict[str, Any]:
    """Write the recordings and return what they hold."""
    from sprung.formats import write

    documents = []
    with progress_bar() as report:
        for k, path in enumerate(paths):
            report(f"simulating {path.name}", k / len(paths))
            recording, document = run(seed if len(paths) == 1 else [seed, k])
            write(recording, path)
            documents.append(document)
    first = {**documents[0], "seed": seed}
    if len(documents) > 1 and first["speed"] is not None:
        first["speeds"] = [document["speed"] for document in documents]
    return first


def _write_vehicle(vehicle: "AnyVehicle", path: Path) -> None:
    """Write the vehicle file."""
    from sprung.vehicles import write_vehicle

    write_vehicle(vehicle, path)


def _show(document: dict[str, Any], paths: Sequence[Path]) -> None:
    """Print the true modes and what was written."""
    rows = [
        (f"{mode['natural_frequency']:.4g}", f"{100 * mode['damping_ratio']:.4g}", mode["label"] or "")
        for mode in document["modes"]
    ]
    out = console()
    out.print(table("True modes", ("frequency [Hz]", "damping [%]", "label"), rows, n_words=0))
    out.print(notes(f"wrote {path}" for path in paths))
