"""Ride comfort: frequency weightings, ISO 2631-1, EN 12299, Sperling, EN 14363, travel of suspensions."""

from sprung.ride.comfort import STANDARDS, Ride, RidePoint, Travel, assess_ride, mean_comfort_in_words
from sprung.ride.weighting import WEIGHTINGS, Weighting, response_of, weighted

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
