"""Sensor checks: faults of channels, which are excluded before the suspension is assessed."""

from sprung.diagnosis.sensors.checks import SensorCheck, check_sensors, sensor_faults
from sprung.diagnosis.sensors.faults import KINDS, SensorFault
from sprung.diagnosis.sensors.opposite import exchanged_opposites
from sprung.diagnosis.sensors.speed import speed_fault

__all__ = [
    "KINDS",
    "SensorCheck",
    "SensorFault",
    "check_sensors",
    "exchanged_opposites",
    "sensor_faults",
    "speed_fault",
]
