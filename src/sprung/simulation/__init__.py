"""Simulated recordings with known truth: linear and nonlinear vehicles, and what sensors do to their signals."""

from sprung.simulation.drives import Drive, DriveSettings, simulate_drive
from sprung.simulation.force_laws import REALISTIC_FORCE_LAWS, ForceLaw, damping_factor
from sprung.simulation.linear import response, settling_time, simulate, usual_excitation, with_linear_inputs, with_rises
from sprung.simulation.nonlinear import integrate, simulate_nonlinear
from sprung.simulation.sensors import (
    Imperfection,
    clipped,
    dead,
    delayed,
    drifting,
    inverted,
    jittered,
    noisy,
    quantised,
    scaled,
    spiking,
    stuck,
    swapped,
    with_gap,
    with_hum,
    with_imperfections,
    with_noise,
)
from sprung.simulation.truth import truth

__all__ = [
    "REALISTIC_FORCE_LAWS",
    "Drive",
    "DriveSettings",
    "ForceLaw",
    "Imperfection",
    "clipped",
    "damping_factor",
    "dead",
    "delayed",
    "drifting",
    "integrate",
    "inverted",
    "jittered",
    "noisy",
    "quantised",
    "response",
    "scaled",
    "settling_time",
    "simulate",
    "simulate_drive",
    "simulate_nonlinear",
    "spiking",
    "stuck",
    "swapped",
    "truth",
    "usual_excitation",
    "with_gap",
    "with_hum",
    "with_imperfections",
    "with_linear_inputs",
    "with_noise",
    "with_rises",
]
