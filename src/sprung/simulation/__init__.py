"""Simulated recordings with known truth: linear and nonlinear vehicles, and what sensors do to their signals."""

from sprung.simulation.drives import Drive, DriveSettings, simulate_drive
from sprung.simulation.laws import REALISTIC_LAWS, Law, damping_factor
from sprung.simulation.linear import response, settling_time, simulate, usual_excitation, with_linear_inputs, with_rises
from sprung.simulation.nonlinear import integrate, simulate_nonlinear
from sprung.simulation.sensors import (
    Clipped,
    Dead,
    Delayed,
    Drifting,
    Gained,
    Hum,
    Imperfection,
    Inverted,
    Jittered,
    Noisy,
    Quantised,
    Spiking,
    Stuck,
    Swapped,
    WithGap,
    with_imperfections,
    with_noise,
)
from sprung.simulation.truth import truth

__all__ = [
    "REALISTIC_LAWS",
    "Clipped",
    "Dead",
    "Delayed",
    "Drifting",
    "Drive",
    "DriveSettings",
    "Gained",
    "Hum",
    "Imperfection",
    "Inverted",
    "Jittered",
    "Law",
    "Noisy",
    "Quantised",
    "Spiking",
    "Stuck",
    "Swapped",
    "WithGap",
    "damping_factor",
    "integrate",
    "response",
    "settling_time",
    "simulate",
    "simulate_drive",
    "simulate_nonlinear",
    "truth",
    "usual_excitation",
    "with_imperfections",
    "with_linear_inputs",
    "with_noise",
    "with_rises",
]
