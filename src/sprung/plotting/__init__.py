"""Pictures of an identification: one function for each, which takes values and returns a matplotlib figure."""

from sprung.plotting.mac import mac_figure
from sprung.plotting.saving import figures, save_figures
from sprung.plotting.shapes import complexity_figure, shapes_figure
from sprung.plotting.spectra import spectra_figure
from sprung.plotting.stabilisation import stabilisation_figure
from sprung.plotting.subsets import subsets_figure

__all__ = [
    "complexity_figure",
    "figures",
    "mac_figure",
    "save_figures",
    "shapes_figure",
    "spectra_figure",
    "stabilisation_figure",
    "subsets_figure",
]
