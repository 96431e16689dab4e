"""The command `sprung corners`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import INPUT, OUTPUT, Channels, Files, Json, SamplingRate, check_file, names, records
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar

if TYPE_CHECKING:
    from sprung.likelihood import CornerFit
    from sprung.modal import Modes
    from sprung.recording import Recording
    from sprung.vehicles import Vehicle

_BAR, _FULL = 8, 0.4
_UNITS = {"spring": "N/m", "damper": "N s/m", "tyre": "N/m"}


def corners(
    files: Files,
    *,
    vehicle: Annotated[
        Path,
        typer.Option(
            metavar="V.toml|NAME",
            help="Vehicle file: geometry, masses, sensors, nominal components.",
            show_default=False,
        ),
    ],
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="LO HI", help="Frequencies fitted, in Hz. Default: around the vehicle's modes.", show_default=False
        ),
    ] = None,
    segment: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Length of a segment. Default: 7.5 periods of bounce.", show_default=False
        ),
    ] = None,
    width: Annotated[
        float,
        typer.Option(
            metavar="D",
            help="How far components may be from nominal: standard deviation of ln(value/nominal).",
            rich_help_panel=INPUT,
        ),
    ] = 0.7,
    kind: Annotated[
        Literal["road", "rail", "rig"] | None,
        typer.Option(
            help="What drives the wheels; road and rail repeat at the rear wheels. Default: as the vehicle file says.",
            show_default=False,
            rich_help_panel=INPUT,
        ),
    ] = None,
    free: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,..",
            help="Components to fit, such as spring,damper or front_left.tyre. Default: all.",
            show_default=False,
            rich_help_panel=INPUT,
        ),
    ] = None,
    payload: Annotated[
        bool | None,
        typer.Option(
            "--payload/--no-payload",
            help="Fit mass, inertias and centre of gravity too. Default: not on a rig.",
            show_default=False,
            rich_help_panel=INPUT,
        ),
    ] = None,
    sensors: Annotated[
        bool,
        typer.Option("--sensors", help="Fit places and lags of the sensors too.", rich_help_panel=INPUT),
    ] = False,
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for figures.", show_default=False, rich_help_panel=OUTPUT)
    ] = None,
    json: Json = None,
) -> None:
    """Fit springs, dampers and tyres of every corner to drives (with speed) or runs on a rig, by their spectra."""
    from sprung.likelihood import CornerSettings, fit_corners
    from sprung.vehicles import read_vehicle

    check_file("--json", json, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    settings = CornerSettings(
        band=band,
        segment=segment,
        width=width,
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
        write_json(document(fit), json)
    if json != "-":
        _show(fit, paths)


def _modes(recordings: "list[Recording]", vehicle: "Vehicle") -> "Modes | None":
    """Return identified modes, another start of the fit and a check of it; None where none can be had."""
    from sprung.errors import DataError, IdentificationError
    from sprung.identification import cov_ssi

    try:
        return cov_ssi(recordings, vehicle=vehicle).modes
    except (DataError, IdentificationError):
        return None


def document(fit: "CornerFit") -> dict[str, Any]:
    """Return a fit as the JSON object `sprung.corners/1`."""
    import numpy as np

    found: dict[str, dict[str, Any]] = {}
    for row, component in enumerate(fit.components):
        value = float(fit.values[row])
        found.setdefault(component.corner, {})[component.kind] = {
            "value": value,
            "std": value * float(fit.log_ratios_std[row]),
            "relative_to_nominal": value / float(fit.nominal[row]),
            "is_identifiable": bool(fit.is_identifiable[row]),
        }
        if fit.from_modes is not None:
            by_modes = float(fit.nominal[row] * np.exp(fit.from_modes[row]))
            found[component.corner][component.kind]["from_modes"] = by_modes
    modes, (frequency_std, damping_std) = fit.modes(), fit.modes_std()
    inputs = {name: float(value) for name, value in fit.inputs.items()}
    return {
        "schema": "sprung.corners/1",
        "corners": found,
        "modes": [
            {
                "natural_frequency": float(modes.natural_frequency[k]),
                "natural_frequency_std": float(frequency_std[k]),
                "damping_ratio": float(modes.damping_ratio[k]),
                "damping_ratio_std": float(damping_std[k]),
                "mode_shape": {"real": shape.real.tolist(), "imag": shape.imag.tolist()},
                "label": modes.labels[k],
            }
            for k, shape in enumerate(modes.mode_shapes)
        ],
        "channels": list(modes.channels),
        "road": inputs,
        "payload": fit.payload,
        "sensors": fit.sensors,
        "fit": {
            "model_error": fit.model_error,
            "n_segments": fit.n_segments,
            "n_rejected": fit.n_rejected,
            "band": [float(fit.model.spectra.frequencies[0]), float(fit.model.spectra.frequencies[-1])],
            "parameters": list(fit.model.names[: len(fit.components)]),
            "correlation": _correlation(fit),
        },
        "notes": list(fit.notes),
    }


def _correlation(fit: "CornerFit") -> list[list[float]]:
    """Correlation of the components' estimates."""
    import numpy as np

    count = len(fit.components)
    deviations = np.sqrt(np.diag(fit.covariance))[:count]
    values: list[list[float]] = (fit.covariance[:count, :count] / np.outer(deviations, deviations)).round(4).tolist()
    return values


def _save(fit: "CornerFit", folder: Path, source: str) -> list[Path]:
    """Write the figures."""
    from sprung.plotting import corners_figure, correlation_figure, fitted_spectra_figure

    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in (
        ("corners", corners_figure),
        ("spectra", fitted_spectra_figure),
        ("correlation", correlation_figure),
    ):
        path = folder / f"{name}.png"
        draw(fit, source=source).savefig(path, dpi=150)
        paths.append(path)
    return paths


def _show(fit: "CornerFit", paths: list[Path]) -> None:
    """Print corners with bars against nominal, body modes and notes."""
    out = console()
    rows = []
    for row, component in enumerate(fit.components):
        change, deviation = float(fit.values[row] / fit.nominal[row] - 1), float(fit.log_ratios_std[row])
        told = bool(fit.is_identifiable[row])
        rows.append(
            (
                component.corner.replace("_", " "),
                f"{component.kind} [{_UNITS.get(component.kind, '-')}]",
                f"{fit.values[row]:.4g}" if told else "–",
                f"{fit.values[row] * deviation:.2g}" if told else "–",
                f"{100 * change:+.1f}" if told else "–",
                _bar(change) if told else "cannot tell",
            )
        )
    columns = ("corner", "component", "value", "±", "change [%]", f"-{100 * _FULL:.0f} % .. +{100 * _FULL:.0f} %")
    out.print(table("Corners", columns, rows, n_words=2))
    modes, (frequency_std, damping_std) = fit.modes(), fit.modes_std()
    lines = [
        (
            f"{modes.natural_frequency[k]:.4g}",
            f"{frequency_std[k]:.2g}",
            f"{100 * modes.damping_ratio[k]:.3g}",
            f"{100 * damping_std[k]:.2g}",
            (modes.labels[k] or "").replace("_", " "),
        )
        for k in range(modes.poles.size)
    ]
    out.print(
        table("Modes of the fitted vehicle", ("frequency [Hz]", "±", "damping [%]", "±", "label"), lines, n_words=0)
    )
    load = fit.payload.get("payload_mass")
    said = [] if load is None else [f"on the body beyond the vehicle file: {load['value']:.0f} ± {load['std']:.0f} kg"]
    out.print(notes([*said, *fit.notes, *(f"wrote {path}" for path in paths)]))


def _bar(change: float) -> str:
    """Draw a change as a bar to the left or right of a middle line."""
    length = min(_BAR, round(abs(change) / _FULL * _BAR))
    left = ("█" * length).rjust(_BAR) if change < 0 else " " * _BAR
    return f"{left}│{'█' * length if change >= 0 else ''}"
