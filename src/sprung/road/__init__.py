"""The road under a vehicle: its profile, International Roughness Index, classes of ISO 8608, potholes."""

from sprung.road.profile import RoadProfile, road_profile
from sprung.road.survey import (
    GOLDEN_CAR,
    GoldenCar,
    RoadEvent,
    RoadSurvey,
    Stretch,
    TrackRoughness,
    averaged,
    road_class_of,
    roughness_index,
    survey_road,
    suspension_slope,
    write_survey,
)

__all__ = [
    "GOLDEN_CAR",
    "GoldenCar",
    "RoadEvent",
    "RoadProfile",
    "RoadSurvey",
    "Stretch",
    "TrackRoughness",
    "averaged",
    "road_class_of",
    "road_profile",
    "roughness_index",
    "survey_road",
    "suspension_slope",
    "write_survey",
]
