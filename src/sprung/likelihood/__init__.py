"""Whittle likelihood of a vehicle on its road: springs, dampers and tyres of every corner from the body's motion."""

from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.components import FreeComponents
from sprung.likelihood.coordinates import RigidLayout, rigid_layout
from sprung.likelihood.corners import CornerFit, corners_from_modes
from sprung.likelihood.driving import Driving, driving
from sprung.likelihood.elements import ElementParameter, ElementScales, stiffness_scales
from sprung.likelihood.fitting import fit_corners, fit_segments
from sprung.likelihood.masked_lines import SpectralLine, residual_lines
from sprung.likelihood.noise import SensorNoise
from sprung.likelihood.payload import AddedMass, MassParameter, UnsprungMass, payload, unsprung_masses
from sprung.likelihood.rig import RigInputs
from sprung.likelihood.sensor_errors import (
    PositionParameter,
    SensorDelays,
    SensorPositions,
    sensor_positions,
)
from sprung.likelihood.spectra import ClassSpectra, SegmentSpectra, class_spectra, segment_spectra
from sprung.likelihood.surface import ClassRoughness, RailInputs, RoadInputs, SurfaceInputs, TrackLevels
from sprung.likelihood.vehicle import CornerSettings, vehicle_model
from sprung.likelihood.whittle import Model

__all__ = [
    "AddedMass",
    "ClassRoughness",
    "ClassSpectra",
    "CornerFit",
    "CornerSettings",
    "Driving",
    "ElementParameter",
    "ElementScales",
    "FreeComponents",
    "MassParameter",
    "Model",
    "ParameterBlock",
    "PositionParameter",
    "RailInputs",
    "RigInputs",
    "RigidLayout",
    "RoadInputs",
    "SegmentSpectra",
    "SensorDelays",
    "SensorNoise",
    "SensorPositions",
    "SpectralLine",
    "SurfaceInputs",
    "TrackLevels",
    "UnsprungMass",
    "class_spectra",
    "corners_from_modes",
    "driving",
    "fit_corners",
    "fit_segments",
    "payload",
    "residual_lines",
    "rigid_layout",
    "segment_spectra",
    "sensor_positions",
    "stiffness_scales",
    "unsprung_masses",
    "vehicle_model",
]
