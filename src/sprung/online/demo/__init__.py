"""The demonstration: a small simulated fleet, its monitor and the pages."""

from sprung.online.demo.scenario import CarState, Demonstration, Member, drive_fleet, open_demo

__all__ = ["CarState", "Demonstration", "Member", "drive_fleet", "open_demo"]
