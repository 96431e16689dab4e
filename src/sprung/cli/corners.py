"""The command `sprung corners`."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import (
    INPUT,
    Channels,
    Figures,
    Files,
    Json,
    SamplingRate,
    VehicleFile,
    check_file,
    names,
    option,
    records,
    save_figures,
)
from sprung.cli.printing import console, notes, rich_table
from sprung.cli.progress import progress_bar

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from sprung.likelihood import CornerFit
    from sprung.modal import Modes
    from sprung.recording import Recording
    from sprung.vehicles import Vehicle


def corners(
    files: Files,
    *,
    vehicle: VehicleFile,
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    band: Annotated[
        tuple[float, float] | None, option("LO HI", "Frequencies to fit, in Hz. Default: around the vehicle's modes.")
    ] = None,
    segment: Annotated[float | None, option("SECONDS", "Length of a segment. Default: 7.5 periods of bounce.")] = None,
    width: Annotated[
        float, option("D", "Prior standard deviation of ln(value/nominal) of a component.", panel=INPUT)
    ] = 0.7,
    kind: Annotated[
        Literal["road", "rail", "rig"] | None,
        typer.Option(
            help="Excitation of the wheels; that of a road or track reaches the rear wheels later. Default: the kind in"
            " the vehicle file.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    free: Annotated[
        str | None,
        option("A,B,..", "Components to fit, such as spring,damper or front_left.tyre. Default: all.", panel=INPUT),
    ] = None,
    payload: Annotated[
        bool | None,
        typer.Option(
            "--payload/--no-payload",
            help="Also fit mass, inertias and centre of gravity of the payload. Default: except on a rig.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    sensors: Annotated[
        bool,
        typer.Option("--sensors", help="Also fit positions and lags of the sensors.", rich_help_panel=INPUT),
    ] = False,
    figures: Figures = None,
    json: Json = None,
) -> None:
    """Estimate the springs, dampers and tyres of every corner from the spectra of a drive or a rig run."""
    from sprung.documents import corners_document
    from sprung.likelihood import CornerSettings, fit_corners
    from sprung.vehicles import read_vehicle

    check_file("--json", json, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    settings = CornerSettings(
        band=band,
        segment=segment,
        prior_std=width,
        free=names(free),
        has_payload=payload,
        has_free_sensors=sensors,
        kind=kind,
    )
    with progress_bar() as report:
        recordings = list(records(files, sampling_rate=sampling_rate, channels=names(channels), report=report))
        report("fitting", 0.5)
        fit = fit_corners(recordings, description, settings=settings, modes=_modes(recordings, description))
        paths = [] if figures is None else _save(fit, figures, ", ".join(path.name for path in files))
    if json is not None:
        write_json(corners_document(fit), json)
    if json != "-":
        _show(fit, paths)


def _modes(recordings: "list[Recording]", vehicle: "Vehicle") -> "Modes | None":
    """Return identified modes, which give the fit another start and a check; None where there are none."""
    from sprung.errors import DataError, IdentificationError
    from sprung.identification import cov_ssi

    try:
        return cov_ssi(recordings, vehicle=vehicle).modes
    except (DataError, IdentificationError):
        return None


def _save(fit: "CornerFit", folder: "Path", source: str) -> "list[Path]":
    """Write the figures."""
    from sprung.plotting import corners_figure, correlation_figure, fitted_spectra_figure

    draw = {"corners": corners_figure, "spectra": fitted_spectra_figure, "correlation": correlation_figure}
    return save_figures({name: figure(fit, source=source) for name, figure in draw.items()}, folder)


def _show(fit: "CornerFit", paths: "Sequence[Path]") -> None:
    """Print corners with bars against nominal, body modes and notes."""
    from sprung.tables import components_table, fitted_modes_table

    screen = console()
    screen.print(rich_table(components_table(fit)))
    screen.print(rich_table(fitted_modes_table(fit)))
    mass = fit.payload.get("payload_mass")
    sentences = [] if mass is None else [f"payload: {mass['value']:.0f} ± {mass['std']:.0f} kg"]
    screen.print(notes([*sentences, *fit.notes, *(f"wrote {path}" for path in paths)]))
