"""Values over dates, and tracked modes."""

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from sprung.identification.tracking import TrackingSettings, track_modes
from sprung.modal import Modes
from sprung.results.figures import modes_history_figure, plan_figure, tracks_figure
from sprung.vehicles import Component

COMPONENTS = tuple(
    Component(f"{end}_{side}", kind)
    for end in ("front", "rear")
    for side in ("left", "right")
    for kind in ("spring", "damper", "tyre")
)
DAY = 86400 * 10**9
TIMES = 1_795_219_200_000_000_000 + DAY * np.arange(20)


def drawn(figure: Figure) -> list[Any]:
    """Return the axes of a figure that could be drawn."""
    figure.canvas.draw()
    return list(figure.axes)


def texts(figure: Figure) -> set[str]:
    """Return all texts of a figure."""
    figure.canvas.draw()
    axes = [text.get_text() for each in figure.axes for text in each.findobj() if hasattr(text, "get_text")]
    return set(axes)


def test_many_windows_are_drawn_as_medians_with_their_spread() -> None:
    """Thirty days of 48 windows in groups of twelve hours."""
    times = TIMES[0] + 1800 * 10**9 * np.arange(30 * 48)
    frequencies = np.tile(np.linspace(1.0, 2.0, 24), 60)
    left, _ = drawn(modes_history_figure({"bounce": (times, frequencies, np.full(len(times), 0.2))}))
    np.testing.assert_allclose(left.lines[0].get_ydata(), np.full(60, 1.5))
    ends = np.array([segment[:, 1] for segment in left.collections[0].get_segments()])
    np.testing.assert_allclose(ends, np.tile([1.025, 1.975], (60, 1)))


def test_the_plan_marks_parts_with_alerts_by_a_sign_and_cuts_off_wide_intervals() -> None:
    values, wide = np.zeros(12), np.full(12, 0.02)
    values[0], wide[4] = -0.3, 3.0
    figure = plan_figure(
        COMPONENTS,
        values,
        values[:, None] + np.outer(wide, [-1, 1]),
        steps={"front_left.spring": 3},
        detectable={"front_left.spring": 0.07},
        heading=("a", "b"),
    )
    shown = texts(figure)
    assert {"■ −30.0 %", "+0.0 %", "forward", "front left", "rear right tyre"} <= shown
    left, right = figure.axes[1].get_xlim()
    assert -40 < left < -30 < 30 < right < 40
    assert sum(line.get_clip_on() is False and line.get_marker() in {4, 5, 8, 9} for line in figure.axes[1].lines) == 2


def modes(*frequencies):
    n = len(frequencies)
    return Modes(
        poles=np.array([2 * np.pi * frequency * (1j - 0.01) for frequency in frequencies], dtype=np.complex128),
        mode_shapes=np.eye(3, dtype=complex)[:n],
        channels=("a", "b", "c"),
        natural_frequency_std=np.full(n, 0.01),
        damping_ratio_std=np.full(n, 0.001),
        stable_rate=np.ones(n),
        labels=("bounce", None, None)[:n],
    )


@pytest.fixture(scope="module")
def tracked():
    return followed()


def followed():
    """Twenty hours: 2 Hz throughout with a jump to 2.1 Hz, 5 Hz from hour 8 on, no results in hours 4 to 6."""
    windows = [modes(2.0 if k < 14 else 2.1, *([5.0] if k >= 8 else [])) for k in range(20)]
    windows[4:7] = [None] * 3
    return track_modes(windows, times=np.arange(0.0, 72000.0, 3600.0))


def panels(figure):
    """Return the axes of a track by its label on the ordinate."""
    return [axes for axes in figure.axes if axes.get_ylabel() == "f [Hz]"]


def test_gaps_births_and_jumps(tracked) -> None:
    figure = tracks_figure(tracked, source="run.csv")
    figure.draw_without_rendering()
    first, second = panels(figure)
    assert first.get_title(loc="left").startswith("1 bounce: 2.0")
    runs = [line.get_xdata() for line in first.lines if line.get_marker() == "None" and len(line.get_xdata()) > 2]
    assert [list(run) for run in runs] == [list(range(4)), list(range(7, 20))]
    assert [line.get_xdata()[0] for line in first.lines if line.get_linestyle() == "--"] == [14]
    births = [line.get_xdata()[0] for line in second.lines if line.get_marker() in {">", "<"}]
    assert births == [8]
    assert "run.csv" in figure.get_suptitle()
    assert any(axes.get_xlabel() == "time since the first window [h]" for axes in figure.axes)


def test_no_track_is_said() -> None:
    nothing = track_modes([modes(2.0), modes(3.0)], settings=TrackingSettings(min_count=2, out_of=2))
    (axes,) = tracks_figure(nothing).axes
    assert axes.texts[0].get_text() == "No mode was found in enough windows."
