"""Values of many runs and how far they spread."""

import numpy as np

from sprung.results.figures import (
    Spread,
    runs_figure,
)


def test_runs_say_how_many_found_a_value() -> None:
    values = np.array([[1.0, 2.0, np.nan], [np.nan, np.nan, np.nan]])
    figure = runs_figure([Spread("f [Hz]", ("one", "two"), values, 1.5, (1.4, np.nan))], title="t")
    axes = figure.axes[0]
    assert [text.get_text() for text in axes.texts] == ["2 of 3", "0 of 3"]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["one", "two"]
    assert axes.get_xlabel() == "f [Hz]"
