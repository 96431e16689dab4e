"""Excitation of a vehicle: random forces, hammer blows, base motions, roads, tracks, roller rigs, harmonics."""

from sprung.excitation.noise import BAND_ORDER, Excitation, HammerBlows, RandomInputs, noise
from sprung.excitation.orders import Lines, Stack, Sum
from sprung.excitation.rig import QUARTER_CASES, BaseMotion, RollerRig, pulse_indices
from sprung.excitation.route import (
    GRAVITY,
    BodyAccelerations,
    CrossSlope,
    Route,
    SmoothSteps,
    SpeedChanges,
    SpeedProfile,
    constant_speed,
    random_cross_slope,
    random_curvature,
    random_speed,
)
from sprung.excitation.surface import (
    ROAD_CLASSES,
    Joints,
    Potholes,
    Profile,
    Rail,
    Road,
    SurfaceMotion,
    rail_quality,
    road_class,
)

__all__ = [
    "BAND_ORDER",
    "GRAVITY",
    "QUARTER_CASES",
    "ROAD_CLASSES",
    "BaseMotion",
    "BodyAccelerations",
    "CrossSlope",
    "Excitation",
    "HammerBlows",
    "Joints",
    "Lines",
    "Potholes",
    "Profile",
    "Rail",
    "RandomInputs",
    "Road",
    "RollerRig",
    "Route",
    "SmoothSteps",
    "SpeedChanges",
    "SpeedProfile",
    "Stack",
    "Sum",
    "SurfaceMotion",
    "constant_speed",
    "noise",
    "pulse_indices",
    "rail_quality",
    "random_cross_slope",
    "random_curvature",
    "random_speed",
    "road_class",
]
