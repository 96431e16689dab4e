"""Recordings over time, and runs."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.recording import Channel, Recording
from sprung.results.figures import densities_figure, histories_figure, levels_figure, spectra_figure
from sprung.signals.spectrum import SpectralMatrix


def curves(axes, gid):
    return [line for line in axes.get_lines() if line.get_gid() == gid]


def test_a_curve_of_each_channel_in_decibels(chain) -> None:
    figure = spectra_figure(chain)
    assert len(figure.axes) == 3
    for row, axes in enumerate(figure.axes):
        (curve,) = curves(axes, "spectrum")
        np.testing.assert_allclose(10 ** (curve.get_ydata() / 10), chain.spectra.densities[row, 1:])
        np.testing.assert_allclose(curve.get_xdata(), chain.spectra.frequencies[1:])
        assert not curves(axes, "spectrum before editing")
        assert axes.get_ylabel() == f"acc_{row + 1}\n[dB re 1 (m/s²)²/Hz]"
        assert len(curves(axes, "mode")) == 3
    assert figure.axes[-1].get_xlabel() == "Frequency [Hz]"


@pytest.mark.parametrize(("quantity", "unit"), [("displacement", "[dB re 1 m²/Hz]"), ("unknown", "[dB], as recorded")])
def test_units_of_other_quantities(chain, quantity, unit) -> None:
    channels = tuple(Channel(channel.name, quantity) for channel in chain.channels)
    axes = spectra_figure(replace(chain, channels=channels)).axes[0]
    assert axes.get_ylabel().endswith(unit)


@pytest.mark.slow
def test_very_many_channels_are_cut_off_and_that_is_said(chain) -> None:
    names = tuple(f"a{k}" for k in range(30))
    rows = np.arange(30) % 3
    spectra = SpectralMatrix(
        chain.spectra.frequencies, chain.spectra.matrix[np.ix_(rows, rows)], names, chain.spectra.segment_length, 5
    )
    figure = spectra_figure(replace(chain, channels=tuple(map(Channel, names)), spectra=spectra))
    assert sum(bool(curves(axes, "spectrum")) for axes in figure.axes) == 24
    assert "first 24 of 30 channels" in figure.get_suptitle()
    figure.draw_without_rendering()


def test_silence_is_drawn(chain) -> None:
    silent = replace(chain, spectra=replace(chain.spectra, matrix=np.zeros_like(chain.spectra.matrix)))
    figure = spectra_figure(silent)
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert np.isfinite(axes.get_ylim()).all()


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
