"""All figures of an identification, as files."""

from os import PathLike
from pathlib import Path

from matplotlib.figure import Figure

from sprung.identification import Identification
from sprung.plotting.mac import mac_figure
from sprung.plotting.shapes import complexity_figure, shapes_figure
from sprung.plotting.spectra import spectra_figure
from sprung.plotting.stabilisation import stabilisation_figure
from sprung.plotting.subsets import subsets_figure

#: Resolution of saved figures [dots per inch].
RESOLUTION = 150


def save_figures(identification: Identification, directory: str | PathLike[str], *, source: str = "") -> list[Path]:
    """Write all figures that apply to an identification as PNG files.

    Parameters
    ----------
    identification
        Result of any method.
    directory
        Folder for the files, created if missing. Files of the same names are overwritten.
    source
        Name of the recording, for the headings.

    Returns
    -------
    list of pathlib.Path
        Paths of the files: always stabilisation.png and spectra.png; with modes of several channels mode_shapes.png,
        complexity.png and mac.png; with segments sorted by level subsets.png.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in figures(identification, source=source).items():
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=RESOLUTION)
        paths.append(path)
    return paths


def figures(identification: Identification, *, source: str = "") -> dict[str, Figure]:
    """Return all figures that apply to an identification, by the name of their file."""
    figures_by_name = {
        "stabilisation": stabilisation_figure(identification, source=source),
        "spectra": spectra_figure(identification, source=source),
    }
    modes, channels = identification.modes, identification.channels
    if len(modes) and len(channels) > 1:
        figures_by_name["mode_shapes"] = shapes_figure(modes, channels, source=source)
        figures_by_name["complexity"] = complexity_figure(modes, source=source)
        figures_by_name["mac"] = mac_figure(identification, source=source)
    if all(subset.level is not None for subset in identification.subsets):
        figures_by_name["subsets"] = subsets_figure(identification, source=source)
    return figures_by_name
