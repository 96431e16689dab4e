"""Recordings over time, and runs."""

import numpy as np
import pytest

from sprung.recording import Channel, Recording
from sprung.results.figures import densities_figure, histories_figure, levels_figure


@pytest.fixture
def run():
    time = np.arange(20_000) / 100
    samples = np.stack([np.sqrt(2) * 3 * np.sin(2 * np.pi * 7 * time), np.cos(2 * np.pi * time)])
    return Recording(samples, 100.0, (Channel("a", "acceleration"), Channel("b", "acceleration")))


def test_histories_keep_the_extremes_of_long_records(run) -> None:
    figure = histories_figure([("run", run)], title="t")
    values = np.asarray(figure.axes[0].lines[0].get_ydata())
    assert len(values) <= 4000
    assert [values.min(), values.max()] == pytest.approx([run.samples[0].min(), run.samples[0].max()])
    assert "[m/s²]" in figure.axes[0].get_ylabel()
    assert figure.axes[-1].get_xlabel() == "Time [s]"


def test_levels_are_the_rms_of_each_interval(run) -> None:
    figure = levels_figure([("run", run)], title="t", interval=2.0)
    line = figure.axes[0].lines[0]
    assert line.get_ydata() == pytest.approx(3.0, rel=1e-9)
    assert np.size(line.get_xdata()) == 100


def test_density_integrates_to_the_power(run) -> None:
    figure = densities_figure([("raw", run), ("again", run)], title="t", highest=50.0, marked=[("line", 7.0)])
    line = figure.axes[0].lines[0]
    frequency, density = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert density.sum() * (frequency[1] - frequency[0]) == pytest.approx(9.0, rel=0.01)
    assert figure.axes[0].get_ylabel() == "PSD [(m/s²)²/Hz]"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["raw", "again"]
