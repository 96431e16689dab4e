"""Spectra, frequency responses and cepstra."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.recording import Channel
from sprung.results.figures import spectra_figure
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
