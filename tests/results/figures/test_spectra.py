"""Spectra, frequency responses and cepstra."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.recording import Channel
from sprung.results.figures import (
    cepstrum_figure,
    response_figure,
    spectra_figure,
)
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


def test_before_and_after_editing(edited) -> None:
    axes = spectra_figure(edited).axes[1]
    (before,), (after,) = curves(axes, "spectrum before editing"), curves(axes, "spectrum")
    np.testing.assert_allclose(10 ** (before.get_ydata() / 10), edited.spectra.densities[1, 1:])
    np.testing.assert_allclose(10 ** (after.get_ydata() / 10), edited.edited_spectra.densities[1, 1:])


def test_harmonics_are_faint_in_channels_that_do_not_show_them(chain_with_lines) -> None:
    strengths = [
        [line.get_alpha() for line in curves(axes, "harmonic")] for axes in spectra_figure(chain_with_lines).axes
    ]
    first, second, third = strengths
    assert first[0] > 2 * second[0]
    assert first[0] > 2 * third[0]
    assert first[1] == second[1] > 2 * third[1]


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
