"""Figures of roads and tracks."""

from sprung.results.figures import road_figure
from sprung.road import RoadEvent, RoadSurvey, Stretch, TrackLevel


def test_panels_of_a_track_share_their_distances() -> None:
    """A defect before the first stretch is marked on the first panel alone."""
    rail = TrackLevel(1e-3, 1e-4, 2e-3, 1e-4)
    stretches = tuple(Stretch(begin, begin + 200, begin / 20, begin / 20 + 10, rail, rail) for begin in (300.0, 500.0))
    defect = RoadEvent(120.0, 6.0, "both", "dip", 0.02, 3.0)
    first, second = road_figure(RoadSurvey(stretches, (defect,))).axes
    assert first.get_xlim() == second.get_xlim()
    assert first.get_xlim()[0] < 120
