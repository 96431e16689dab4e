"""Geometry of the chart of evidence."""

import pytest

from sprung.online.site.alert_views import EvidencePoint
from sprung.online.site.pages.course import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, course_of


def points(*values):
    return [EvidencePoint(time=k, log_evidence=value) for k, value in enumerate(values)]


def test_the_scale_reaches_from_0_to_above_the_largest_value() -> None:
    """Values 0, 10, 20 with a threshold of 10: heights in proportion, 21 at the top."""
    course = course_of(points(0.0, 10.0, 20.0), 10.0)
    assert course is not None
    inner = HEIGHT - TOP - BOTTOM
    assert [dot.y for dot in course.dots] == pytest.approx([TOP + inner * (21 - value) / 21 for value in (0, 10, 20)])
    assert [dot.x for dot in course.dots] == pytest.approx([LEFT, (LEFT + WIDTH - RIGHT) / 2, WIDTH - RIGHT])
    assert [dot.is_above for dot in course.dots] == [False, True, True]
    assert course.threshold == pytest.approx(course.dots[1].y)
    assert [number for _, number in course.marks] == [0, 5, 10, 15, 20]
    assert course.path.startswith("M48.0 ")
    assert course.path.count("L") == 2


@pytest.mark.parametrize("values", [(-3.0,), (-0.5, -2.5, 1.0), (1e4, 2e4), (0.0,)])
def test_all_is_within_the_drawing(values) -> None:
    course = course_of(points(*values), 10.8)
    assert course is not None
    heights = [*(dot.y for dot in course.dots), course.threshold, *(y for y, _ in course.marks)]
    assert all(TOP - 1e-9 <= y <= HEIGHT - BOTTOM + 1e-9 for y in heights)
    assert 1 <= len(course.marks) <= 6


def test_no_chart_without_windows() -> None:
    assert course_of([], 10.8) is None
    assert course_of(points(1.0), None) is None
