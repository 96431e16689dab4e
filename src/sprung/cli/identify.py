"""The command `sprung identify`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import INPUT, Channels, Figures, Files, Json, SamplingRate, check_file, names, option, records
from sprung.cli.printing import console, notes, printable, rich_table
from sprung.cli.progress import progress_bar
from sprung.errors import IdentificationError, ParameterError

if TYPE_CHECKING:
    from sprung.identification import Identification, IdentificationSettings

_PREPARATION, _SIZES = "Preparation (default: chosen from the data)", "Identification (default: chosen from the data)"


def identify(
    files: Files,
    *,
    vehicle: Annotated[
        str | None,
        option(
            "V.toml|NAME",
            "Vehicle file or name of a shipped vehicle: gives sensor layout, band and labels.",
            panel=INPUT,
        ),
    ] = None,
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    method: Annotated[
        Literal["cov", "acs", "coss"],
        typer.Option(
            help="cov: correlations of whole records, which scatter least. acs: correlations averaged over segments."
            " coss: averaged over segments of similar level, which shows dependence on amplitude.",
            rich_help_panel=_SIZES,
        ),
    ] = "cov",
    subsets: Annotated[
        int | None, option("J", "Number of level ranges for coss (3).", panel=_SIZES, min=1, max=50)
    ] = None,
    segment: Annotated[float | None, option("SECONDS", "Length of the segments.", panel=_SIZES)] = None,
    block_rows: Annotated[int | None, option("I", "Number of block rows.", panel=_SIZES, min=2)] = None,
    max_order: Annotated[int | None, option("N", "Largest model order.", panel=_SIZES, min=2)] = None,
    stable_rate: Annotated[
        float | None, option("D", "Least share of orders at which a mode is stable (0.2).", panel=_SIZES)
    ] = None,
    references: Annotated[
        str | None,
        option(
            "A,B,..",
            "Reference channels; or disjoint: outputs and references from disjoint sets of channels, against sensor"
            " noise in the band of the modes.",
            panel=_SIZES,
        ),
    ] = None,
    thesis: Annotated[
        bool,
        typer.Option(
            "--thesis",
            help="Settings of F. Liu (2020): 12 to 45 (or I) block rows, correlations as data, loose criteria.",
            rich_help_panel=_SIZES,
        ),
    ] = False,
    band: Annotated[
        tuple[float, float] | None,
        option("LO HI", "Lowest and highest natural frequency, in Hz.", panel=_PREPARATION),
    ] = None,
    decimate_to: Annotated[
        float | None, option("HZ", "Sampling rate of the identification.", panel=_PREPARATION)
    ] = None,
    cepstrum: Annotated[
        float | None,
        option(
            "SECONDS",
            "Remove periodic excitation: keep the cepstrum up to this quefrency. A short one (0.25) adds damping to"
            " lightly damped modes.",
            panel=_PREPARATION,
        ),
    ] = None,
    figures: Figures = None,
    json: Json = None,
) -> None:
    """Identify natural frequencies, damping ratios and mode shapes from recordings of one condition."""
    from sprung.documents import identification_document
    from sprung.identification import METHODS
    from sprung.tables import why_none
    from sprung.vehicles import read_description

    check_file("--json", json, inputs=[*files, *([vehicle] if vehicle else [])])
    if figures is not None and figures.exists() and not figures.is_dir():
        raise ParameterError(f"--figures {figures} is a file: give the name of a folder")
    if subsets is not None and method != "coss":
        raise ParameterError(f"--subsets {subsets} needs --method coss: {method} does not sort segments")
    options = {
        "band": band,
        "decimate_to": decimate_to,
        "segment": segment,
        "n_subsets": subsets,
        "block_rows": block_rows,
        "max_order": max_order,
    }
    with progress_bar() as report:
        settings = _with_names(
            _thesis_settings(options) if thesis else _settings(options), references, cepstrum, stable_rate
        )
        description = None if vehicle is None else read_description(vehicle)
        recordings = records(files, sampling_rate=sampling_rate, channels=names(channels), report=report)
        identification = METHODS[method](recordings, settings=settings, vehicle=description, on_progress=report)
        if figures is not None:
            report("drawing figures", 1.0)
        paths = _figures(identification, figures, files)
    if json is not None:
        write_json(identification_document(identification, vehicle=description), json)
    if json != "-":
        _show(identification, files=files, figures=paths)
    if not len(identification.modes):
        raise IdentificationError(why_none(identification))


def _settings(options: dict[str, Any]) -> "IdentificationSettings":
    """Return settings with the options that are not None."""
    from sprung.identification import IdentificationSettings

    return IdentificationSettings(**{name: value for name, value in options.items() if value is not None})


def _thesis_settings(options: dict[str, Any]) -> "IdentificationSettings":
    """Return the settings of the thesis with the options that are not None."""
    from sprung.identification import as_in_thesis
    from sprung.identification.settings import THESIS_ROWS

    first, last = THESIS_ROWS[0], options["block_rows"] or THESIS_ROWS[1]
    if options["max_order"] is not None:
        raise ParameterError(
            f"--max-order {options['max_order']} does not apply with --thesis, whose ladder is over block rows: leave"
            " it out"
        )
    if last <= first:
        raise ParameterError(f"--block-rows {last} must be above {first} with --thesis, whose ladder starts there")
    return as_in_thesis(_settings({**options, "block_rows": None}), rows=(first, last))


def _with_names(
    settings: "IdentificationSettings", references: str | None, cepstrum: float | None, stable_rate: float | None
) -> "IdentificationSettings":
    """Return the settings with references, lifter and stable rate where they are given."""
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


def _figures(identification: "Identification", folder: Path | None, files: Sequence[Path]) -> list[Path]:
    """Write the figures and return their paths."""
    if folder is None:
        return []
    from sprung.plotting import save_figures

    return save_figures(identification, folder, source=files[0].name if len(files) == 1 else f"{len(files)} files")


def _show(identification: "Identification", *, files: Sequence[Path], figures: Sequence[Path]) -> None:
    """Print modes, harmonics and notes."""
    from sprung import tables

    screen = console()
    source = str(files[0]) if len(files) == 1 else f"{len(files)} files"
    modes = f"{tables.counted(len(identification.modes), 'mode')} by {identification.method}"
    channels = tables.counted(len(identification.channels), "channel")
    heading = f"{source}: {modes} from {channels} at {identification.sampling_rate:.5g} Hz"
    screen.print(printable(heading), style="bold", soft_wrap=True)
    if len(identification.modes):
        screen.print(rich_table(tables.modes_table(identification)))
        screen.print(tables.MODES_CAPTION, style="dim")
    if len(identification.modes) and len(identification.subsets) > 1:
        screen.print()
        screen.print(rich_table(tables.subsets_table(identification)))
    if identification.harmonics:
        screen.print()
        screen.print(rich_table(tables.harmonics_table(identification.harmonics)))
    screen.print()
    screen.print(notes(identification.notes))
    if figures:
        screen.print(printable(f"figures: {', '.join(map(str, figures))}"), soft_wrap=True)
