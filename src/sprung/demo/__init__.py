"""The demonstration: a small simulated fleet and its monitor, until the monitor has found both faults."""

from sprung.demo.fleet import Member, drive_fleet
from sprung.demo.scenario import CarState, run_demo

__all__ = ["CarState", "Member", "drive_fleet", "run_demo"]
