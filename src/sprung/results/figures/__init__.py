"""Figures: one function for each, from values to a matplotlib figure."""

from sprung.results.figures.animation import save_animation
from sprung.results.figures.bounce import bounce_figure
from sprung.results.figures.corners import (
    corners_figure,
    correlation_figure,
    fitted_spectra_figure,
    learnt_figure,
    misfit_figure,
)
from sprung.results.figures.diagnosis import corner_changes_figure, evidence_figure, mode_changes_figure, trends_figure
from sprung.results.figures.history import (
    Stretch,
    components_history_figure,
    evidence_history_figure,
    findings_history_figure,
    modes_history_figure,
    plan_figure,
    tracks_figure,
)
from sprung.results.figures.measured import kit_figure, ride_figure, road_figure
from sprung.results.figures.saving import figures, save_figures
from sprung.results.figures.shapes import complexity_figure, shapes_figure
from sprung.results.figures.signals import (
    Spread,
    densities_figure,
    histories_figure,
    levels_figure,
    overview_figures,
    runs_figure,
    spectrogram_figure,
)
from sprung.results.figures.spectra import cepstrum_figure, response_figure, spectra_figure
from sprung.results.figures.stabilisation import stabilisation_figure
from sprung.results.figures.subsets import (
    alignment_rates,
    mac_figure,
    reference_mac_figure,
    stable_rates_figure,
    subsets_figure,
)
from sprung.results.renderings import picture_of

__all__ = [
    "Spread",
    "Stretch",
    "alignment_rates",
    "bounce_figure",
    "cepstrum_figure",
    "complexity_figure",
    "components_history_figure",
    "corner_changes_figure",
    "corners_figure",
    "correlation_figure",
    "densities_figure",
    "evidence_figure",
    "evidence_history_figure",
    "figures",
    "findings_history_figure",
    "fitted_spectra_figure",
    "histories_figure",
    "kit_figure",
    "learnt_figure",
    "levels_figure",
    "mac_figure",
    "misfit_figure",
    "mode_changes_figure",
    "modes_history_figure",
    "overview_figures",
    "picture_of",
    "plan_figure",
    "reference_mac_figure",
    "response_figure",
    "ride_figure",
    "road_figure",
    "runs_figure",
    "save_animation",
    "save_figures",
    "shapes_figure",
    "spectra_figure",
    "spectrogram_figure",
    "stabilisation_figure",
    "stable_rates_figure",
    "subsets_figure",
    "tracks_figure",
    "trends_figure",
]
