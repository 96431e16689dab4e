"""Exchanged sensors at opposite corners, which only the delay between the axles reveals."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from sprung.diagnosis.sensors.faults import SensorFault
from sprung.likelihood import CornerFit, CornerSettings, Model
from sprung.likelihood.fitting import fit_windows
from sprung.vehicles.window import Window

#: Model error above which an exchange is tried, and ln of how much more likely it must make the nominal vehicle: with
#: an engine that the file lacks, 180 kg at 11 Hz, 640 where sensors are exchanged.
_SUSPECT, _MORE_LIKELY = 0.3, 100.0


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
    Such an exchange leaves bounce as it is and reverses pitch and roll. Only the exchange that makes the nominal
    vehicle most likely is fitted, if it makes it far more likely than no exchange; the fit must not be worse. That
    takes no new spectra: instead of the samples, the places of two sensors are exchanged in the model. Which of the two
    pairs was exchanged cannot be determined.
    """
    if fit.model_error <= _SUSPECT:
        return ()
    misfits = {pair: _nominal_misfit(_exchanged(fit.model, pair)) for pair in _opposites(window)}
    best = min(misfits, key=misfits.__getitem__, default=None)
    if best is None or misfits[best] > _nominal_misfit(fit.model) - _MORE_LIKELY:
        return ()
    if fit_windows([window.exchanged(*best)], settings=settings).model_error > fit.model_error:
        return ()
    words = f"{best[0]} with {best[1]}, or the other two corners with each other"
    return tuple(SensorFault(name, "swapped", words) for name in _places(window))


def _opposites(window: Window) -> Iterator[tuple[str, str]]:
    """Yield pairs of accelerometers at opposite corners."""
    places = _places(window)
    for pair in combinations(places, 2):
        apart = np.array(places[pair[0]])[:2] * np.array(places[pair[1]])[:2]
        if np.all(apart < 0):
            yield pair


def _exchanged(model: Model, pair: tuple[str, str]) -> Model:
    """Return the model with the places of two sensors exchanged."""
    layout = model.layout
    motion = layout.motion.copy()
    rows = [layout.names.index(name) for name in pair]
    motion[rows] = motion[rows[::-1]]
    return replace(model, layout=replace(layout, motion=motion))


def _nominal_misfit(model: Model) -> float:
    """Return minus the log likelihood of the nominal vehicle on a road of the window's roughness."""
    return model.objective(model.scaled_start())[0]


def _places(window: Window) -> dict[str, tuple[float, float, float]]:
    """Return the positions of the recorded accelerometers [m], by channel."""
    return {
        sensor.channel: sensor.position
        for sensor in window.vehicle.sensor
        if sensor.quantity == "acceleration"
        and sensor.position is not None
        and sensor.channel in window.recording.names
    }
