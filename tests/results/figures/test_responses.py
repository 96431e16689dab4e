"""Frequency responses and cepstra."""

import numpy as np
import pytest

from sprung.results.figures import (
    cepstrum_figure,
    response_figure,
)


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
