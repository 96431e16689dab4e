"""Exchanged sensors at opposite corners, which only the delay between the axles reveals."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from sprung.diagnosis.sensors.faults import SensorFault
from sprung.likelihood import CornerFit, CornerSettings, nominal_misfit
from sprung.likelihood.fitting import fit_windows
from sprung.vehicles.window import Window

#: Model error above which an exchange is tried, and share of it to which the exchange must reduce it.
_SUSPECT, _CURED = 0.3, 0.8


def exchanged_opposites(window: Window, fit: CornerFit, settings: CornerSettings | None) -> tuple[SensorFault, ...]:
    """Return swapped accelerometers at opposite corners, as faults.

    Parameters
    ----------
    window
        Window without failing channels.
    fit
        Fit to the window as recorded.
    settings
        Choices of the fit.

    Notes
    -----
    Such an exchange leaves bounce as it is and reverses pitch and roll. It is fitted only if it makes the nominal
    vehicle more likely (`nominal_misfit`). Which of the two pairs was exchanged cannot be determined.
    """
    if fit.model_error <= _SUSPECT:
        return ()
    as_recorded = nominal_misfit(window, settings=settings)
    fits = {
        pair: fit_windows([exchanged], settings=settings)
        for pair, exchanged in _exchanges(window)
        if nominal_misfit(exchanged, settings=settings) < as_recorded
    }
    if not fits:
        return ()
    best = min(fits, key=lambda pair: fits[pair].model_error)
    if fits[best].model_error > _CURED * fit.model_error:
        return ()
    words = f"{best[0]} with {best[1]}, or the other two corners with each other"
    return tuple(SensorFault(name, "swapped", words) for name in _places(window))


def _exchanges(window: Window) -> Iterator[tuple[tuple[str, str], Window]]:
    """Yield pairs of accelerometers at opposite corners, and the window with them exchanged."""
    places = _places(window)
    for pair in combinations(places, 2):
        apart = np.array(places[pair[0]])[:2] * np.array(places[pair[1]])[:2]
        if np.all(apart < 0):
            yield pair, window.exchanged(*pair)


def _places(window: Window) -> dict[str, tuple[float, float, float]]:
    """Return the positions of the recorded accelerometers [m], by channel."""
    return {
        sensor.channel: sensor.position
        for sensor in window.vehicle.sensor
        if sensor.quantity == "acceleration"
        and sensor.position is not None
        and sensor.channel in window.recording.names
    }
