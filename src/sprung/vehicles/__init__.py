"""Vehicles: description in a file, structure of masses and springs, matrices, exact modes and correlations."""

from sprung.vehicles.components import Component
from sprung.vehicles.description import Chain, Description, Quarter, Vehicle, corner_names
from sprung.vehicles.faults import Fault, parse_fault, with_faults
from sprung.vehicles.files import (
    VEHICLES,
    parse_vehicle,
    read_description,
    read_vehicle,
    vehicle_from_text,
    vehicle_text,
    write_vehicle,
)
from sprung.vehicles.models import chain, modal_mass, structure, wheel_hop_frequencies
from sprung.vehicles.modes import ExactModes, modes, participation
from sprung.vehicles.response import frequency_response
from sprung.vehicles.sections import (
    Axle,
    Body,
    ChainMass,
    FlexibleMode,
    LearntNumber,
    MountedMass,
    QuarterBody,
    QuarterCorner,
    Sensor,
)
from sprung.vehicles.structure import BodyShape, Element, Structure, body_row, sensor_outputs
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
    "BodyShape",
    "Chain",
    "ChainMass",
    "Component",
    "Description",
    "Element",
    "ExactModes",
    "Fault",
    "FlexibleMode",
    "LearntNumber",
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
    "frequency_response",
    "modal_mass",
    "modes",
    "parse_fault",
    "parse_vehicle",
    "participation",
    "read_description",
    "read_vehicle",
    "sensor_outputs",
    "state_space",
    "stationary_covariance",
    "structure",
    "vehicle_from_text",
    "vehicle_text",
    "wheel_hop_frequencies",
    "with_faults",
    "write_vehicle",
]
