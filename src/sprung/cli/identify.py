"""The command `sprung identify`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.documents import identification_document, write_json
from sprung.cli.files import INPUT, OUTPUT, Channels, Files, Json, SamplingRate, check_file, names, records
from sprung.cli.modes import show_identification, why_none
from sprung.cli.progress import progress_bar
from sprung.errors import IdentificationError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from sprung.identification import Identification, IdentificationSettings
    from sprung.vehicles.usable import AnyVehicle

_PREPARATION, _SIZES = "Preparation (default: chosen from the data)", "Identification (default: chosen from the data)"
#: First and last number of block rows of the thesis' ladder for the 3-DOF chain.
_THESIS_ROWS = (12, 45)


def identify(
    files: Files,
    *,
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="V.toml|NAME",
            help="Vehicle file, or a vehicle that comes with sprung: gives sensor layout, band and labels.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    method: Annotated[
        Literal["cov", "acs", "coss"],
        typer.Option(
            help="cov: correlations of whole records; it scatters least, so it is the default. acs: averaged over"
            " segments. coss: averaged over segments of similar level, which shows what changes with amplitude.",
            rich_help_panel=_SIZES,
        ),
    ] = "cov",
    subsets: Annotated[
        int | None,
        typer.Option(metavar="J", min=1, max=50, help="Ranges of level for coss (3).", rich_help_panel=_SIZES),
    ] = None,
    segment: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Length of the segments.", rich_help_panel=_SIZES)
    ] = None,
    block_rows: Annotated[
        int | None,
        typer.Option(metavar="I", min=2, help="Block rows of the block matrix.", rich_help_panel=_SIZES),
    ] = None,
    max_order: Annotated[
        int | None, typer.Option(metavar="N", min=2, help="Largest model order.", rich_help_panel=_SIZES)
    ] = None,
    stable_rate: Annotated[
        float | None,
        typer.Option(
            metavar="D", help="Share of the orders at which a mode must be stable (0.2).", rich_help_panel=_SIZES
        ),
    ] = None,
    references: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,..",
            help="Reference channels, or the word disjoint: outputs and references from disjoint sets of channels, for"
            " sensor noise in the modes' own band.",
            rich_help_panel=_SIZES,
        ),
    ] = None,
    thesis: Annotated[
        bool,
        typer.Option(
            "--thesis",
            help="As in F. Liu (2020): a ladder of 12 to 45 (or I) block rows, correlations as data, loose criteria.",
            rich_help_panel=_SIZES,
        ),
    ] = False,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="LO HI", help="Lowest and highest natural frequency wanted, in Hz.", rich_help_panel=_PREPARATION
        ),
    ] = None,
    decimate_to: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Sampling rate for the identification.", rich_help_panel=_PREPARATION),
    ] = None,
    cepstrum: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Take periodic excitation out: keep the cepstrum up to this quefrency. Short ones (0.25) add damping"
            " to lightly damped modes.",
            rich_help_panel=_PREPARATION,
        ),
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write figures into this folder.", rich_help_panel=OUTPUT)
    ] = None,
    json: Json = None,
) -> None:
    """Identify natural frequencies, damping ratios and mode shapes from recordings of one condition."""
    check_file("--json", json, inputs=[*files, *([vehicle] if vehicle else [])])
    if figures is not None and figures.exists() and not figures.is_dir():
        raise ParameterError(f"--figures {figures} is a file: give the name of a folder")
    if subsets is not None and method != "coss":
        raise ParameterError(f"--subsets {subsets} needs --method coss: {method} does not sort segments")
    given = {
        "band": band,
        "decimate_to": decimate_to,
        "segment": segment,
        "n_subsets": subsets,
        "block_rows": block_rows,
        "max_order": max_order,
    }
    with progress_bar() as report:
        settings = _with_words(_preset(given) if thesis else _given(given), references, cepstrum, stable_rate)
        description = _vehicle(vehicle)
        recordings = records(files, sampling_rate=sampling_rate, channels=names(channels), report=report)
        identification = _method(method)(recordings, settings=settings, vehicle=description, on_progress=report)
        if figures is not None:
            report("drawing figures", 1.0)
        paths = _figures(identification, figures, files)
    if json is not None:
        write_json(identification_document(identification, vehicle=description), json)
    if json != "-":
        show_identification(identification, files=files, figures=paths)
    if not len(identification.modes):
        raise IdentificationError(why_none(identification))


def _given(given: dict[str, Any]) -> "IdentificationSettings":
    """Return the settings with what is given."""
    from sprung.identification import IdentificationSettings

    return IdentificationSettings(**{name: value for name, value in given.items() if value is not None})


def _preset(given: dict[str, Any]) -> "IdentificationSettings":
    """Return the settings of the thesis with what is given."""
    from sprung.identification.stabilisation import THESIS_CRITERIA

    first, last = _THESIS_ROWS[0], given["block_rows"] or _THESIS_ROWS[1]
    if given["max_order"] is not None:
        raise ParameterError(
            f"--max-order {given['max_order']} has no meaning with --thesis, whose ladder is over block rows: leave it"
            " out"
        )
    if last <= first:
        raise ParameterError(f"--block-rows {last} must be above {first} with --thesis, whose ladder starts there")
    return replace(_given(given), row_ladder=(first, last), is_hankel=True, is_weighted=False, criteria=THESIS_CRITERIA)


def _with_words(
    settings: "IdentificationSettings", references: str | None, cepstrum: float | None, stable_rate: float | None
) -> "IdentificationSettings":
    """Return the settings with the options that stand for values of their own."""
    from sprung.signals.cepstrum import ShortPass

    if references == "disjoint":
        settings = replace(settings, has_disjoint_references=True)
    elif references is not None:
        settings = replace(settings, references=names(references))
    if cepstrum is not None:
        settings = replace(settings, lifter=ShortPass(cepstrum))
    if stable_rate is not None:
        settings = replace(settings, criteria=replace(settings.criteria, stable_rate=stable_rate))
    return settings


def _vehicle(path_or_name: str | None) -> "AnyVehicle | None":
    """Return the vehicle of a file or a name."""
    from sprung.vehicles import read_description

    return None if path_or_name is None else read_description(path_or_name)


def _method(name: str) -> "Callable[..., Identification]":
    """Return the method of a name."""
    from sprung.identification import METHODS

    return METHODS[name]


def _figures(identification: "Identification", folder: Path | None, files: Sequence[Path]) -> list[Path]:
    """Write the figures and return their paths."""
    if folder is None:
        return []
    from sprung.plotting import save_figures

    return save_figures(identification, folder, source=files[0].name if len(files) == 1 else f"{len(files)} files")
