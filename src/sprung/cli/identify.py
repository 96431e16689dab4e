"""The command `sprung identify`."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from sprung.cli.checks import check_file, names
from sprung.cli.options import OUTPUT, AllowMissing, Files, Group, declared, option, shares_options, vehicle_file
from sprung.cli.output import Output, progress_bar
from sprung.cli.reading import Reading
from sprung.errors import IdentificationError, ParameterError

if TYPE_CHECKING:
    from sprung.identification import Identification, IdentificationSettings

_SHAPES = (".gif", ".html", ".unv", ".uff")
_PREPARATION, _SIZES = "Preparation (default: chosen from the data)", "Identification (default: chosen from the data)"


@dataclass(frozen=True, slots=True)
class Identifying(Group):
    """How modes are identified; what is None is chosen from the data."""

    method: Literal["cov", "acs", "coss", "plscf", "fdd"] = declared(
        None,
        "cov: correlations of whole records, which scatter least. acs: correlations averaged over segments."
        " coss: averaged over segments of similar level, which shows dependence on amplitude. For comparison:"
        " plscf (polynomials fitted to half spectra) and fdd (peaks of the singular values).",
        default="cov",
        panel=_SIZES,
    )
    subsets: int | None = declared("J", "Number of level ranges for coss (3).", panel=_SIZES, min=1, max=50)
    segment: float | None = declared("SECONDS", "Length of the segments.", panel=_SIZES)
    block_rows: int | None = declared("I", "Number of block rows.", panel=_SIZES, min=2)
    max_order: int | None = declared("N", "Largest model order.", panel=_SIZES, min=2)
    stable_rate: float | None = declared("D", "Minimum share of orders at which a mode is stable (0.2).", panel=_SIZES)
    references: str | None = declared(
        "A,B,..",
        "Reference channels (with --setups, those that stay in place), or disjoint: outputs and references from"
        " disjoint sets of channels, which rejects sensor noise in the band of the modes.",
        panel=_SIZES,
    )
    setups: bool = declared(
        None,
        "Each file is a set-up of roving sensors: identify them one by one and merge the mode shapes at the"
        " references. Files whose channel names differ are treated as set-ups without this option.",
        "--setups",
        default=False,
        panel=_SIZES,
    )
    thesis: bool = declared(
        None,
        "Settings of F. Liu (2020): 12 to 45 (or I) block rows, correlations as data, loose criteria.",
        "--thesis",
        default=False,
        panel=_SIZES,
    )
    refine: bool = declared(
        None,
        "Refine the modes by the likelihood of the spectra of whole records, where it fits them.",
        "--refine/--no-refine",
        default=True,
        panel=_SIZES,
    )
    kind: Literal["auto", "random", "free"] = declared(
        None,
        "random: stationary random motion. free: free motion after pushes, drops or releases. auto: free where"
        " records are quiet but for motions that die away.",
        default="auto",
        panel=_PREPARATION,
    )
    band: tuple[float, float] | None = declared(
        "LO HI", "Lowest and highest natural frequency, in Hz.", panel=_PREPARATION
    )
    decimate_to: float | None = declared("HZ", "Sampling rate of the identification.", panel=_PREPARATION)
    cepstrum: float | None = declared(
        "SECONDS",
        "Remove periodic excitation: keep the cepstrum up to this quefrency. A low value (0.25) adds damping to"
        " lightly damped modes.",
        panel=_PREPARATION,
    )
    pick: str | None = declared(
        "F1,F2,..",
        "Frequencies in Hz at which to pick modes by hand: the nearest stable poles, or maxima with fdd.",
        panel=_SIZES,
    )

    @property
    def settings(self) -> "IdentificationSettings":
        """Settings of the identification."""
        from sprung.identification import IdentificationSettings, as_in_thesis
        from sprung.identification.settings import THESIS_ROWS
        from sprung.signals.cepstrum import ShortPass

        if self.subsets is not None and self.method != "coss":
            raise ParameterError(f"--subsets {self.subsets} needs --method coss: {self.method} does not sort segments")
        names_alike = ("band", "decimate_to", "segment", "max_order", "refine", "kind")
        given = {name: getattr(self, name) for name in names_alike}
        given |= {"n_subsets": self.subsets, "block_rows": None if self.thesis else self.block_rows}
        settings = IdentificationSettings(
            lifter=None if self.cepstrum is None else ShortPass(self.cepstrum),
            references=None if self.references == "disjoint" else names(self.references),
            has_disjoint_references=self.references == "disjoint",
            **{name: value for name, value in given.items() if value is not None},
        )
        if self.thesis:
            first, last = THESIS_ROWS[0], self.block_rows or THESIS_ROWS[1]
            if self.max_order is not None:
                raise ParameterError(
                    f"--max-order {self.max_order} does not apply with --thesis, whose ladder is over block rows:"
                    " leave it out"
                )
            if last <= first:
                raise ParameterError(
                    f"--block-rows {last} must be above {first} with --thesis, whose ladder starts there"
                )
            settings = as_in_thesis(settings, rows=(first, last))
        if self.stable_rate is None:
            return settings
        return replace(settings, criteria=replace(settings.criteria, stable_rate=self.stable_rate))

    @property
    def picked(self) -> list[float]:
        """Frequencies of --pick."""
        try:
            return [float(part) for part in names(self.pick) or ()]
        except ValueError:
            raise ParameterError(
                f"--pick {self.pick} must be frequencies in Hz, separated by commas: such as 1.88,2.42"
            ) from None


@shares_options
def identify(
    files: Files,
    *,
    vehicle: Annotated[str | None, vehicle_file("gives sensor layout, band and labels.")] = None,
    allow_missing: AllowMissing = False,
    identifying: Identifying,
    output: Output,
    shapes: Annotated[
        Path | None,
        option(
            "FILE",
            "Write the mode shapes: animated as .gif or .html, or with the geometry as a universal file, .unv or .uff.",
            panel=OUTPUT,
        ),
    ] = None,
    reading: Reading,
) -> None:
    """Identify natural frequencies, damping ratios and mode shapes from recordings of one condition."""
    from sprung._checks import check_one_of
    from sprung.identification import METHODS, identify_setups, pick_modes
    from sprung.results import tables
    from sprung.results.documents import identification_document
    from sprung.vehicles import read_description

    output.check(*files, vehicle)
    check_file("--shapes", shapes, inputs=files)
    if shapes is not None:
        check_one_of("ending of --shapes", shapes.suffix.lower(), _SHAPES)
    if identifying.setups and len(files) < 2:
        raise ParameterError("--setups needs at least two files, one for each set-up")
    settings, picked, method = identifying.settings, identifying.picked, METHODS[identifying.method]
    source = str(files[0]) if len(files) == 1 else f"{len(files)} files"
    with progress_bar() as report:
        description = None if vehicle is None else read_description(vehicle)
        if description is not None:
            settings = replace(settings, allow_missing=reading.may_lack(description, allow_missing=allow_missing))
        if identifying.setups:
            identification = identify_setups(
                method,
                [reading.records([file], report) for file in files],
                references=settings.references,
                settings=replace(settings, references=None),
                vehicle=description,
                on_progress=report,
            )
        else:
            recordings = reading.records(files, report)
            identification = method(recordings, settings=settings, vehicle=description, on_progress=report)
        if picked:
            identification = pick_modes(identification, picked, vehicle=description)
        if output.figures is not None:
            report("drawing figures", 1.0)
        output.draw(lambda drawn: drawn.figures(identification, source=Path(source).name))
        output.paths += _write_shapes(identification, shapes, Path(source).name)
        document = identification_document(identification, vehicle=description)
        output.report(
            lambda pages, inputs: pages.identification_report(identification, inputs, document=document),
            files,
            reading,
            vehicle=vehicle,
        )
    heading = f"{source}: {tables.describe_identification(identification)}"
    output.show(document, *tables.identification_tables(identification), notes=identification.notes, heading=heading)
    if not len(identification.modes):
        raise IdentificationError(tables.why_none(identification))


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
