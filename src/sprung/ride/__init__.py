"""Ride comfort: frequency weightings, ISO 2631-1, EN 12299, Sperling, EN 14363, travel of suspensions."""

from sprung.ride.comfort import (
    STANDARDS,
    WEIGHTINGS,
    Ride,
    RidePoint,
    Travel,
    Weighting,
    assess_ride,
    mean_comfort_in_words,
    response_of,
    weighted,
)

__all__ = [
    "STANDARDS",
    "WEIGHTINGS",
    "Ride",
    "RidePoint",
    "Travel",
    "Weighting",
    "assess_ride",
    "mean_comfort_in_words",
    "response_of",
    "weighted",
]
