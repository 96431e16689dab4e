"""The figure of modes over time."""

import numpy as np
import pytest

from sprung.identification.tracking import track_modes
from sprung.identification.tracking import TrackingSettings
from sprung.modal import Modes
from sprung.results.figures import tracks_figure


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


def test_axes_of_dates_and_of_numbers(tracked) -> None:
    labels = {axes.get_xlabel() for axes in tracks_figure(tracked, start=1_790_000_000 * 10**9).axes}
    assert "time (UTC)" in labels
    assert "window" in {axes.get_xlabel() for axes in tracks_figure(tracked, has_times=False).axes}


def test_no_track_is_said() -> None:
    nothing = track_modes([modes(2.0), modes(3.0)], settings=TrackingSettings(min_count=2, out_of=2))
    (axes,) = tracks_figure(nothing).axes
    assert axes.texts[0].get_text() == "No mode was found in enough windows."


def test_the_legend_lists_what_the_figure_shows(tracked) -> None:
    (legend,) = tracks_figure(tracked).legends
    assert [text.get_text() for text in legend.get_texts()] == [
        *("window, with 95 % interval", "first window of a mode", "last window", "jump", "window without modes"),
    ]
    (plain,) = tracks_figure(track_modes([modes(2.0, 5.0)] * 6)).legends
    assert [text.get_text() for text in plain.get_texts()] == ["window, with 95 % interval"]
