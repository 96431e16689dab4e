"""Geometry of the chart of evidence over windows."""

from collections.abc import Sequence
from dataclasses import dataclass

from sprung.online.site.alert_views import EvidencePoint

#: Size of the drawing, and of its margins: left, right, top, bottom.
WIDTH, HEIGHT = 600, 240
LEFT, RIGHT, TOP, BOTTOM = 48, 16, 16, 40
#: Candidate distances between marks of the axis, of which the first that needs few enough is taken; their most.
_STEPS, _MOST_MARKS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000), 5


@dataclass(frozen=True, slots=True)
class Dot:
    """Evidence after a window: place in the drawing, and whether it is at the threshold or above."""

    x: float
    y: float
    is_above: bool
    point: EvidencePoint


@dataclass(frozen=True, slots=True)
class Course:
    """Evidence after each of some windows, as it is drawn.

    Parameters
    ----------
    dots
        Windows in the order of time, at equal distances.
    threshold
        Place of the threshold.
    marks
        Places and numbers of the axis.
    """

    dots: tuple[Dot, ...]
    threshold: float
    marks: tuple[tuple[float, int], ...]

    @property
    def path(self) -> str:
        """Line through the windows, as SVG writes it."""
        return " ".join(f"{'L' if number else 'M'}{dot.x:.1f} {dot.y:.1f}" for number, dot in enumerate(self.dots))


def course_of(points: Sequence[EvidencePoint], threshold: float | None) -> Course | None:
    """Return the chart of the evidence; None without a window."""
    if not points or threshold is None:
        return None
    values = [point.log_evidence for point in points]
    low, high = min(0.0, *values), max(threshold, *values) * 1.05
    across = (WIDTH - LEFT - RIGHT) / max(1, len(points) - 1)

    def height(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low)

    step = next((step for step in _STEPS if (high - low) / step <= _MOST_MARKS), 10_000)
    first = -(-int(low) // step) * step
    marks = tuple((height(number), number) for number in range(first, int(high) + 1, step))
    dots = tuple(
        Dot(LEFT + across * k, height(point.log_evidence), point.log_evidence >= threshold, point)
        for k, point in enumerate(points)
    )
    return Course(dots, height(threshold), marks)
