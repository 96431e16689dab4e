"""The command `sprung identify`."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.checks import check_file, check_outputs, may_lack_sensors, names
from sprung.cli.options import (
    INPUT,
    OUTPUT,
    AllowMissing,
    Figures,
    FileFormat,
    Files,
    Json,
    Page,
    complete_vehicles,
    option,
)
from sprung.cli.output import progress_bar, show, write_figures, write_page, write_result, written
from sprung.cli.reading import reads_files
from sprung.errors import IdentificationError, ParameterError

if TYPE_CHECKING:
    from sprung.formats import ReadSettings
    from sprung.identification import Identification, IdentificationSettings

_SHAPES = (".gif", ".html", ".unv", ".uff")
_PREPARATION, _SIZES = "Preparation (default: chosen from the data)", "Identification (default: chosen from the data)"


@reads_files
def identify(
    files: Files,
    *,
    vehicle: Annotated[
        str | None,
        option(
            "V.toml|NAME",
            "Vehicle file or name of a shipped vehicle: gives sensor layout, band and labels.",
            autocompletion=complete_vehicles,
            panel=INPUT,
        ),
    ] = None,
    reading: "ReadSettings",
    allow_missing: AllowMissing = False,
    method: Annotated[
        Literal["cov", "acs", "coss", "plscf", "fdd"],
        typer.Option(
            help="cov: correlations of whole records, which scatter least. acs: correlations averaged over segments."
            " coss: averaged over segments of similar level, which shows dependence on amplitude. For comparison:"
            " plscf (polynomials fitted to half spectra) and fdd (peaks of the singular values).",
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
        float | None, option("D", "Minimum share of orders at which a mode is stable (0.2).", panel=_SIZES)
    ] = None,
    references: Annotated[
        str | None,
        option(
            "A,B,..",
            "Reference channels (with --setups, those that stay in place), or disjoint: outputs and references from"
            " disjoint sets of channels, which rejects sensor noise in the band of the modes.",
            panel=_SIZES,
        ),
    ] = None,
    setups: Annotated[
        bool,
        typer.Option(
            "--setups",
            help="Each file is a set-up of roving sensors: identify them one by one and merge the mode shapes at the"
            " references. Files whose channel names differ are treated as set-ups without this option.",
            rich_help_panel=_SIZES,
        ),
    ] = False,
    thesis: Annotated[
        bool,
        typer.Option(
            "--thesis",
            help="Settings of F. Liu (2020): 12 to 45 (or I) block rows, correlations as data, loose criteria.",
            rich_help_panel=_SIZES,
        ),
    ] = False,
    refine: Annotated[
        bool,
        typer.Option(
            "--refine/--no-refine",
            help="Refine the modes by the likelihood of the spectra of whole records, where it fits them.",
            rich_help_panel=_SIZES,
        ),
    ] = True,
    kind: Annotated[
        Literal["auto", "random", "free"],
        typer.Option(
            help="random: stationary random motion. free: free motion after pushes, drops or releases. auto: free where"
            " records are quiet but for motions that die away.",
            rich_help_panel=_PREPARATION,
        ),
    ] = "auto",
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
            "Remove periodic excitation: keep the cepstrum up to this quefrency. A low value (0.25) adds damping to"
            " lightly damped modes.",
            panel=_PREPARATION,
        ),
    ] = None,
    pick: Annotated[
        str | None,
        option(
            "F1,F2,..",
            "Frequencies in Hz at which to pick modes by hand: the nearest stable poles, or maxima with fdd.",
            panel=_SIZES,
        ),
    ] = None,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    shapes: Annotated[
        Path | None,
        option(
            "FILE",
            "Write the mode shapes: animated as .gif or .html, or with the geometry as a universal file, .unv or .uff.",
            panel=OUTPUT,
        ),
    ] = None,
    json: Json = None,
) -> None:
    """Identify natural frequencies, damping ratios and mode shapes from recordings of one condition."""
    from sprung._checks import check_one_of
    from sprung.formats import read_records
    from sprung.identification import METHODS, identify_setups, pick_modes
    from sprung.results import page as pages
    from sprung.results import tables
    from sprung.results.documents import identification_document
    from sprung.vehicles import read_description

    check_outputs(json=json, page=page, figures=figures, inputs=[*files, vehicle])
    check_file("--shapes", shapes, inputs=files)
    if shapes is not None:
        check_one_of("ending of --shapes", shapes.suffix.lower(), _SHAPES)
    if subsets is not None and method != "coss":
        raise ParameterError(f"--subsets {subsets} needs --method coss: {method} does not sort segments")
    if setups and len(files) < 2:
        raise ParameterError("--setups needs at least two files, one for each set-up")
    settings = _settings(
        thesis=thesis,
        stable_rate=stable_rate,
        cepstrum=cepstrum,
        references=references,
        band=band,
        decimate_to=decimate_to,
        segment=segment,
        n_subsets=subsets,
        block_rows=block_rows,
        max_order=max_order,
        refine=refine,
        kind=kind,
    )
    picked = _frequencies(pick)
    source = str(files[0]) if len(files) == 1 else f"{len(files)} files"
    with progress_bar() as report:
        description = None if vehicle is None else read_description(vehicle)
        if description is not None:
            may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
            settings = replace(settings, allow_missing=may_lack)
        read = partial(read_records, settings=reading, on_progress=report)
        if setups:
            identification = identify_setups(
                METHODS[method],
                [read([file]) for file in files],
                references=settings.references,
                settings=replace(settings, references=None),
                vehicle=description,
                on_progress=report,
            )
        else:
            identification = METHODS[method](read(files), settings=settings, vehicle=description, on_progress=report)
        if picked:
            identification = pick_modes(identification, picked, vehicle=description)
        if figures is not None:
            report("drawing figures", 1.0)
        paths = [
            *write_figures(figures, lambda drawn: drawn.figures(identification, source=Path(source).name), file_format),
            *_write_shapes(identification, shapes, Path(source).name),
        ]
        document = identification_document(identification, vehicle=description)
        paths += write_page(
            page,
            lambda inputs: pages.identification_report(identification, inputs, document=document),
            files,
            reading=reading,
            others={"vehicle": vehicle},
        )
    if write_result(document, json):
        words = [*identification.notes, *written(paths, json)]
        heading = f"{source}: {tables.identification_in_words(identification)}"
        show(*tables.identification_tables(identification), words, heading=heading)
    if not len(identification.modes):
        raise IdentificationError(tables.why_none(identification))


def _frequencies(pick: str | None) -> list[float]:
    """Return the frequencies of --pick."""
    parts = names(pick) or ()
    try:
        return [float(part) for part in parts]
    except ValueError:
        raise ParameterError(
            f"--pick {pick} must be frequencies in Hz, separated by commas: such as 1.88,2.42"
        ) from None


def _settings(
    *, thesis: bool, stable_rate: float | None, cepstrum: float | None, references: str | None, **numbers: Any
) -> "IdentificationSettings":
    """Return the settings that the options give; what is None is chosen from the data."""
    from sprung.identification import IdentificationSettings, as_in_thesis
    from sprung.identification.settings import THESIS_ROWS
    from sprung.signals.cepstrum import ShortPass

    rows = (THESIS_ROWS[0], numbers["block_rows"] or THESIS_ROWS[1])
    if thesis:
        _check_ladder(numbers["max_order"], rows)
        numbers["block_rows"] = None
    settings = IdentificationSettings(
        lifter=None if cepstrum is None else ShortPass(cepstrum),
        references=None if references == "disjoint" else names(references),
        has_disjoint_references=references == "disjoint",
        **{name: value for name, value in numbers.items() if value is not None},
    )
    if thesis:
        settings = as_in_thesis(settings, rows=rows)
    if stable_rate is None:
        return settings
    return replace(settings, criteria=replace(settings.criteria, stable_rate=stable_rate))


def _check_ladder(max_order: int | None, rows: tuple[int, int]) -> None:
    """Refuse options that conflict with the ladder of --thesis."""
    if max_order is not None:
        raise ParameterError(
            f"--max-order {max_order} does not apply with --thesis, whose ladder is over block rows: leave it out"
        )
    if rows[1] <= rows[0]:
        raise ParameterError(f"--block-rows {rows[1]} must be above {rows[0]} with --thesis, whose ladder starts there")


def _write_shapes(identification: "Identification", path: Path | None, source: str) -> list[Path]:
    """Write the mode shapes to a file if there is one and there are modes, and return its path."""
    if path is None or not len(identification.modes):
        return []
    modes, channels = identification.modes, identification.channels
    if path.suffix.lower() in {".unv", ".uff"}:
        from sprung.formats.universal_modes import write_universal

        write_universal(modes, channels, path)
    else:
        from sprung.results.figures import save_animation

        save_animation(modes, channels, path, source=source)
    return [path]
