"""Whittle likelihood of a vehicle on its road: springs, dampers and tyres of every corner from the body's motion."""

from sprung.likelihood.corners import CornerFit
from sprung.likelihood.fitting import CornerSettings, fit_corners, fit_segments
from sprung.likelihood.inputs import IndependentInputs, InputModel, RoadInputs
from sprung.likelihood.layout import RigidLayout, rigid_layout
from sprung.likelihood.spectra import ClassSpectra, SegmentSpectra, class_spectra, segment_spectra
from sprung.likelihood.whittle import Component, MassChange, Model

__all__ = [
    "ClassSpectra",
    "Component",
    "CornerFit",
    "CornerSettings",
    "IndependentInputs",
    "InputModel",
    "MassChange",
    "Model",
    "RigidLayout",
    "RoadInputs",
    "SegmentSpectra",
    "class_spectra",
    "fit_corners",
    "fit_segments",
    "rigid_layout",
    "segment_spectra",
]
