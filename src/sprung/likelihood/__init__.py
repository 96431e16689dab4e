"""Whittle likelihood of a vehicle on its road: springs, dampers and tyres of every corner from the body's motion."""

from sprung.likelihood.coordinates import RigidLayout, rigid_layout
from sprung.likelihood.corners import CornerFit
from sprung.likelihood.fitting import fit_corners, fit_segments, nominal_misfit
from sprung.likelihood.from_modes import corners_from_modes
from sprung.likelihood.inputs import InputModel, RailInputs, RigInputs, RoadInputs, SurfaceInputs
from sprung.likelihood.masked_lines import SpectralLine, residual_lines
from sprung.likelihood.spectra import ClassSpectra, SegmentSpectra, class_spectra, segment_spectra
from sprung.likelihood.vehicle import CornerSettings, vehicle_model
from sprung.likelihood.whittle import MassChange, Model, SensorChange

__all__ = [
    "ClassSpectra",
    "CornerFit",
    "CornerSettings",
    "InputModel",
    "MassChange",
    "Model",
    "RailInputs",
    "RigInputs",
    "RigidLayout",
    "RoadInputs",
    "SegmentSpectra",
    "SensorChange",
    "SpectralLine",
    "SurfaceInputs",
    "class_spectra",
    "corners_from_modes",
    "fit_corners",
    "fit_segments",
    "nominal_misfit",
    "residual_lines",
    "rigid_layout",
    "segment_spectra",
    "vehicle_model",
]
