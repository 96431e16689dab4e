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
    from sprung.vehicles import Chain, Quarter

#: Vehicle and sampling rate [Hz] of each kind where they are not given.
_USUAL_VEHICLE = {"chain": "chain3", "quarter": "quarter"}
_USUAL_RATE = {"chain": 500.0, "quarter": 1000.0}
_MOST_SAMPLES = 1e8


def simulate(
    kind: Annotated[
        Literal["chain", "quarter"],
        typer.Argument(help="chain: random forces on masses above one another. quarter: a wheel on a roller rig."),
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
        typer.Option(metavar="V.toml|NAME", help="Vehicle file or name. Default: chain3, quarter.", show_default=False),
    ] = None,
    minutes: Annotated[float, typer.Option(metavar="M", help="Length of a record.")] = 10.0,
    sampling_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Default: 500 for a chain, 1000 for a quarter vehicle.")
    ] = None,
    case: Annotated[
        int | None,
        typer.Option(
            metavar="1..4",
            min=1,
            max=4,
            help="Base motion of the quarter vehicle. 1: random (default). 2: and pulses. 3: and a sine of 3.65 Hz."
            " 4: and one of 17 Hz.",
        ),
    ] = None,
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
        raise ParameterError(f"--json {json} would be written over --out: give another name")
    if noise_band is not None and snr is None:
        raise ParameterError("--noise-band needs --snr: state how strong the noise is")
    if case is not None and kind != "quarter":
        raise ParameterError(f"--case {case} is of the quarter vehicle: leave it out, or simulate quarter")
    rate = _USUAL_RATE[kind] if sampling_rate is None else sampling_rate
    _check_length(minutes, rate)
    description = _vehicle(kind, vehicle)
    paths = [out] if n_records == 1 else [out.with_stem(f"{out.stem}-{k:02d}") for k in range(1, n_records + 1)]
    document = _simulated(
        description,
        paths,
        case=case,
        seed=seed,
        options={"duration": 60 * minutes, "sampling_rate": rate, "snr": snr, "noise_band": noise_band},
    )
    beside = [Path(f"{out}.truth.json"), Path(f"{out}.vehicle.toml")]
    write_json(document, str(beside[0]))
    _write_vehicle(description, beside[1])
    if json is not None:
        write_json(document, json)
    if json != "-":
        _show(document, [*paths, *beside])


def _check_length(minutes: float, sampling_rate: float) -> None:
    """Refuse records without a length, and those that no memory holds."""
    from sprung._checks import check_number

    check_number("--minutes", minutes, above=0)
    check_number("--sampling-rate", sampling_rate, above=0)
    n_samples = 60 * minutes * sampling_rate
    check_number("samples in a record", n_samples, at_most=_MOST_SAMPLES, advice="lower --minutes, or use --records")


def _vehicle(kind: str, path_or_name: str | None) -> "Chain | Quarter":
    """Return the vehicle to simulate."""
    from sprung.vehicles import Vehicle, read_vehicle

    vehicle = read_vehicle(_USUAL_VEHICLE[kind] if path_or_name is None else path_or_name)
    if isinstance(vehicle, Vehicle) or vehicle.kind != kind:
        raise ParameterError(f"vehicle {path_or_name!r} is of kind {vehicle.kind}, not {kind}: give another one")
    return vehicle


def _simulated(
    vehicle: "Chain | Quarter", paths: Sequence[Path], *, case: int | None, seed: int, options: dict[str, Any]
) -> dict[str, Any]:
    """Write the recordings and return what they hold."""
    import numpy as np

    from sprung.excitation import QUARTER_CASES
    from sprung.formats import write
    from sprung.simulation import simulate, truth, usual_excitation
    from sprung.vehicles import structure

    model = structure(vehicle)
    excitation = usual_excitation(model) if vehicle.kind == "chain" else QUARTER_CASES[(case or 1) - 1]
    with progress_bar() as report:
        for k, path in enumerate(paths):
            report(f"simulating {path.name}", k / len(paths))
            generator = np.random.default_rng(seed if len(paths) == 1 else [seed, k])
            write(simulate(model, excitation, **options, seed=generator), path)
    return {**truth(model, seed=seed), **options, "excitation": str(excitation), "files": [str(path) for path in paths]}


def _write_vehicle(vehicle: "Chain | Quarter", path: Path) -> None:
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
