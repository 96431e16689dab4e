"""All pictures of an identification, as files."""

from os import PathLike
from pathlib import Path

from matplotlib.figure import Figure

from sprung.identification import Identification
from sprung.plotting.mac import mac_figure
from sprung.plotting.shapes import complexity_figure, shapes_figure
from sprung.plotting.spectra import spectra_figure
from sprung.plotting.stabilisation import stabilisation_figure
from sprung.plotting.subsets import subsets_figure

#: Resolution of saved pictures [dots per inch].
RESOLUTION = 150


def save_figures(identification: Identification, directory: str | PathLike[str], *, source: str = "") -> list[Path]:
    """Write all pictures that apply to an identification as PNG files.

    Parameters
    ----------
    identification
        Of any method.
    directory
        Where to; made if it is not there. Files of the same names are overwritten.
    source
        Name of the recording, for the headings.

    Returns
    -------
    list of pathlib.Path
        Always stabilisation.png and spectra.png; with modes of several channels mode_shapes.png, complexity.png and
        mac.png; with segments sorted by level subsets.png.
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
    """Return all pictures that apply to an identification, by the name of their file."""
    found = {
        "stabilisation": stabilisation_figure(identification, source=source),
        "spectra": spectra_figure(identification, source=source),
    }
    modes, channels = identification.modes, identification.channels
    if len(modes) and len(channels) > 1:
        found["mode_shapes"] = shapes_figure(modes, channels, source=source)
        found["complexity"] = complexity_figure(modes, source=source)
        found["mac"] = mac_figure(identification, source=source)
    if all(subset.level is not None for subset in identification.subsets):
        found["subsets"] = subsets_figure(identification, source=source)
    return found
