"""Vehicles: description in a file, structure of masses and springs, matrices, exact modes and correlations."""

from sprung.vehicles.description import (
    Axle,
    Body,
    Chain,
    ChainMass,
    Corner,
    Description,
    MountedMass,
    Quarter,
    QuarterBody,
    QuarterCorner,
    Sensor,
    Vehicle,
    corner_names,
)
from sprung.vehicles.files import VEHICLES, parse_vehicle, read_vehicle, write_vehicle
from sprung.vehicles.models import body_row, chain, structure, wheel_hop_frequencies
from sprung.vehicles.modes import ExactModes, modes, participation
from sprung.vehicles.structure import Element, Structure, sensor_outputs
from sprung.vehicles.system import (
    MechanicalSystem,
    Outputs,
    StateSpace,
    discretised,
    exact_correlations,
    state_space,
    stationary_covariance,
)

__all__ = [
    "VEHICLES",
    "Axle",
    "Body",
    "Chain",
    "ChainMass",
    "Corner",
    "Description",
    "Element",
    "ExactModes",
    "MechanicalSystem",
    "MountedMass",
    "Outputs",
    "Quarter",
    "QuarterBody",
    "QuarterCorner",
    "Sensor",
    "StateSpace",
    "Structure",
    "Vehicle",
    "body_row",
    "chain",
    "corner_names",
    "discretised",
    "exact_correlations",
    "modes",
    "parse_vehicle",
    "participation",
    "read_vehicle",
    "sensor_outputs",
    "state_space",
    "stationary_covariance",
    "structure",
    "wheel_hop_frequencies",
    "write_vehicle",
]
