"""The command `sprung fleet` with its sub-commands."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.checks import check_file
from sprung.cli.options import OUTPUT, Json, option
from sprung.cli.output import show, write_result, written
from sprung.errors import DataError, ParameterError
from sprung.fleet.commands import lake, runs, stream

if TYPE_CHECKING:
    from sprung.diagnosis import Observation


application = typer.Typer(no_args_is_help=True)


@application.callback()
def fleet() -> None:
    """Keep and analyse the archive of a fleet, analyse its streams, and compare its vehicles."""


application.command("import")(lake.import_files)
application.command()(lake.archive)
application.command()(runs.run)
application.command()(runs.explain)
application.command()(stream.stream)


@application.command()
def rank(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="CAR.json",
            help=(
                "Results of sprung diagnose --json, one for each vehicle, made with one vehicle file. Each is named "
                "after its vehicle; files of the same name in several folders belong to one vehicle."
            ),
            show_default=False,
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        option("T.json", "Write the baseline of the type, for --type of sprung baseline and diagnose.", panel=OUTPUT),
    ] = None,
    rate: Annotated[float, option("SHARE", "Expected share of sound vehicles among those reported to deviate.")] = 0.05,
    json: Json = None,
) -> None:
    """Compare the vehicles of a type with each other, and learn what is normal for the type."""
    from sprung.diagnosis import learn_type, rank_fleet
    from sprung.results import tables
    from sprung.results.documents import fleet_document, write_type_baseline

    check_file("--out", out, inputs=files)
    check_file("--json", json, inputs=files)
    windows = _windows_by_vehicle(files)
    of_type = learn_type(windows)
    notes = [f"{vehicle} has no usable window" for vehicle, own in windows.items() if not _has_usable(own)]
    try:
        rankings = [(of_type.name, rank_fleet(windows, rate=rate))]
    except DataError as error:
        if out is None:
            raise
        rankings, notes = [], [*notes, f"not ranked: {error}"]
    if out is not None:
        write_type_baseline(of_type, out)
    document = fleet_document(rankings, rate=rate, notes=notes)
    if write_result(document, json):
        outputs = written([] if out is None else [out], json)
        show(*tables.fleet_tables(document.as_json()), [tables.type_in_words(of_type), *notes, *outputs])


def _windows_by_vehicle(files: list[Path]) -> "Mapping[str, list[Observation]]":
    """Return the windows of each vehicle, all of one type."""
    from sprung.results.documents import read_diagnosis

    windows: dict[str, list[Observation]] = {}
    types: dict[str, Path] = {}
    for path in files:
        document = read_diagnosis(path)
        if document.vehicle is not None:
            types.setdefault(document.vehicle, path)
        own = windows.setdefault(path.stem, [])
        own += [replace(window, vehicle=document.vehicle or "") for window in document.windows]
    if len(types) > 1:
        cases = ", ".join(f"{name!r} ({path})" for name, path in types.items())
        raise ParameterError(f"the files belong to the types {cases}: give those of one type")
    return windows


def _has_usable(windows: "list[Observation]") -> bool:
    """Return whether any window can be compared."""
    return any(window.is_conclusive and not window.sensor_faults for window in windows)
