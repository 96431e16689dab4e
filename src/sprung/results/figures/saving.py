"""All figures of an identification, a fit or a diagnosis, as files."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

from matplotlib.figure import Figure

from sprung._checks import check_one_of
from sprung.diagnosis import Baseline, Diagnosis, ModeChange
from sprung.identification import Identification
from sprung.likelihood import CornerFit
from sprung.results.figures.diagnosis import (
    corner_changes_figure,
    corners_figure,
    correlation_figure,
    evidence_figure,
    fitted_spectra_figure,
    mode_changes_figure,
    trends_figure,
)
from sprung.results.figures.draw import STYLE
from sprung.results.figures.shapes import complexity_figure, shapes_figure
from sprung.results.figures.signals import spectra_figure
from sprung.results.figures.stabilisation import mac_figure, stabilisation_figure, subsets_figure

#: Formats of saved figures.
FILE_FORMATS = ("png", "svg", "pdf")


def save_figures(
    identification: Identification, directory: str | PathLike[str], *, source: str = "", file_format: str = "png"
) -> list[Path]:
    """Write all figures that apply to an identification as files.

    Parameters
    ----------
    identification
        Result of any method.
    directory
        Folder for the files, created if missing. Files of the same names are overwritten.
    source
        Name of the recording, for the headings.
    file_format
        "png", "svg" or "pdf".

    Returns
    -------
    list of pathlib.Path
        Paths of the files, here as PNG: always stabilisation.png and spectra.png (for each set-up of roving sensors,
        where there are several); with modes of several channels mode_shapes.png, complexity.png and mac.png; with
        segments sorted by level subsets.png.

    Raises
    ------
    ParameterError
        If the format is another one.

    Examples
    --------
    One channel has no mode shapes:

    >>> from tempfile import TemporaryDirectory
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run.select(["acc_1"]))
    >>> with TemporaryDirectory() as folder:
    ...     sorted(path.name for path in save_figures(identification, folder))
    ['spectra.png', 'stabilisation.png']
    """
    return save(figures(identification, source=source), directory, file_format=file_format)


def save(
    figures_by_name: Mapping[str, Figure], directory: str | PathLike[str], *, file_format: str = "png"
) -> list[Path]:
    """Write figures as files into a folder, created where it does not exist, and return their paths.

    Parameters
    ----------
    figures_by_name
        Figures by the name of their file, without ending.
    directory
        Folder for the files.
    file_format
        "png", "svg" or "pdf".

    Raises
    ------
    ParameterError
        If the format is another one.
    """
    check_one_of("file_format", file_format, FILE_FORMATS)
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.{file_format}" for name in figures_by_name]
    for path, figure in zip(paths, figures_by_name.values(), strict=True):
        figure.savefig(path, dpi=STYLE.file)
    return paths


def figures(identification: Identification, *, source: str = "") -> dict[str, Figure]:
    """Return all figures that apply to an identification, by the name of their file.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> sorted(figures(identification, source="run.csv"))
    ['complexity', 'mac', 'mode_shapes', 'spectra', 'stabilisation']
    """
    figures_by_name: dict[str, Figure] = {}
    for end, each in _set_ups(identification).items():
        figures_by_name[f"stabilisation{end}"] = stabilisation_figure(each, source=source + end.replace("_", " "))
        figures_by_name[f"spectra{end}"] = spectra_figure(each, source=source + end.replace("_", " "))
    modes, channels = identification.modes, identification.channels
    if len(modes) and len(channels) > 1:
        figures_by_name["mode_shapes"] = shapes_figure(modes, channels, source=source)
        figures_by_name["complexity"] = complexity_figure(modes, channels, source=source)
        figures_by_name["mac"] = mac_figure(identification, source=source)
    if identification.subsets and all(subset.level is not None for subset in identification.subsets):
        figures_by_name["subsets"] = subsets_figure(identification, source=source)
    return figures_by_name


def _set_ups(identification: Identification) -> dict[str, Identification]:
    """Return the identification of each set-up of roving sensors with the end of its file names, or the only one."""
    if identification.setups is None:
        return {"": identification}
    return {f"_set-up_{part.number}": part.identification for part in identification.setups.parts}


def corner_figures(fit: CornerFit, *, source: str = "") -> dict[str, Figure]:
    """Return all figures of a fit of springs, dampers and tyres, by the name of their file."""
    return {
        "corners": corners_figure(fit, source=source),
        "spectra": fitted_spectra_figure(fit, source=source),
        "correlation": correlation_figure(fit, source=source),
    }


def diagnosis_figures(
    diagnosis: Diagnosis, baseline: Baseline | None = None, changes: Sequence[ModeChange] = ()
) -> dict[str, Figure]:
    """Return all figures of a diagnosis with usable windows, by the name of their file.

    Parameters
    ----------
    diagnosis
        Result of `sprung.diagnose`.
    baseline
        Baseline of the diagnosis; None: the vehicle file.
    changes
        Modes before and after the findings.
    """
    figures_by_name = {
        "evidence": evidence_figure(diagnosis),
        "trends": trends_figure(diagnosis, baseline),
        "corners": corner_changes_figure(diagnosis, baseline),
    }
    if changes:
        figures_by_name["modes"] = mode_changes_figure(changes, heading=diagnosis.findings[0].sentence)
    return figures_by_name
