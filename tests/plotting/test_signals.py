import numpy as np
import pytest

from sprung.modal import Modes
from sprung.plotting import (
    Spread,
    alignment_rates,
    cepstrum_figure,
    densities_figure,
    histories_figure,
    levels_figure,
    reference_mac_figure,
    response_figure,
    runs_figure,
    stable_rates_figure,
)
from sprung.recording import Channel, Recording


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


def test_window_shows_the_beginning(run) -> None:
    figure = histories_figure([("run", run)], title="t", window=2.0)
    assert np.max(figure.axes[0].lines[0].get_xdata()) == pytest.approx(1.99)


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


def test_rates_are_those_of_the_modes(chain) -> None:
    frequency, rate = alignment_rates(chain.subsets[0])
    for mode in range(len(chain.modes)):
        near = np.argmin(np.abs(frequency - chain.modes.natural_frequency[mode]))
        assert rate[near] == pytest.approx(chain.modes.stable_rate[mode], abs=0.05)
    figure = stable_rates_figure(chain, threshold=0.5)
    assert figure.axes[0].get_ylim()[0] == 0


def test_runs_say_how_many_found_a_value() -> None:
    values = np.array([[1.0, 2.0, np.nan], [np.nan, np.nan, np.nan]])
    figure = runs_figure([Spread("f [Hz]", ("one", "two"), values, 1.5, (1.4, np.nan))], title="t")
    axes = figure.axes[0]
    assert [text.get_text() for text in axes.texts] == ["2 of 3", "0 of 3"]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["one", "two"]
    assert axes.get_xlabel() == "f [Hz]"


def test_response_has_magnitude_and_phase() -> None:
    f = np.linspace(1, 10, 50)
    response = np.array([1 / (1 + 1j * value) for value in f], dtype=complex)
    figure = response_figure(f, [("r", response)], title="t", unit="-", marked=[("corner", 2.0)], has_phase=True)
    assert figure.axes[0].lines[0].get_ydata() == pytest.approx(np.abs(response))
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx(np.degrees(np.angle(response)))


def test_cepstrum_is_edited_by_the_lifter() -> None:
    q = np.arange(100) / 100
    lifter = (q < 0.25).astype(float)
    figure = cepstrum_figure(q, np.ones(100), lifter, title="t", pulse_period=0.3)
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx(lifter)
    assert len(figure.axes[0].lines) == 2 + 3


def test_mac_against_a_reference(chain) -> None:
    nothing = chain.modes.take(np.array([], dtype=int))
    figure = reference_mac_figure([("all", chain.modes), ("none", nothing)], chain.modes, title="t")
    values = [float(text.get_text()) for text in figure.axes[0].texts]
    assert np.reshape(values, (3, 3)).diagonal() == pytest.approx(1)
    assert figure.axes[1].texts[0].get_text() == "No mode was identified."
    assert isinstance(chain.modes, Modes)
