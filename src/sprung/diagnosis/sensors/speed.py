"""A speed channel that stays at one value while the vehicle drives on."""

import numpy as np

from sprung._arrays import Real
from sprung.diagnosis.sensors.faults import SensorFault
from sprung.errors import DataError, ParameterError
from sprung.likelihood import CornerSettings
from sprung.likelihood.fitting import fit_windows
from sprung.recording import Recording
from sprung.signals.conditioning import band_pass
from sprung.signals.data_faults import equal_runs
from sprung.vehicles.window import Window

#: Duration of a constant speed after which it is doubted [s]: no driver keeps a speed exactly for as long.
_LONG = 120.0
#: RMS of a driving body's acceleration [m/s^2] in a band [Hz]: exceeded on the best of roads, but not under an idling
#: engine.
_DRIVING, _BODY = 0.1, (0.5, 10.0)
#: A speed is wrong if the delay between the axles gives another one, by more than this factor, in more than this share
#: of the segments. Shaking on a rig is ruled out by the least share of segments with a speed and by the model error.
_FACTOR, _WRONG_SHARE, _LEAST_SHARE, _MOST_ERROR = 1.25, 0.25, 0.75, 1.0


def speed_fault(window: Window, *, settings: CornerSettings | None = None) -> SensorFault | None:
    """Return the fault of a window's speed channel, dead or stuck; None if none is found.

    Parameters
    ----------
    window
        Window without failing channels of motion.
    settings
        Choices of the fit.

    Notes
    -----
    A constant speed is not a fault in itself: the vehicle may stand, or keep its speed while the bus sends whole km/h.
    It is wrong only if the delay between the axles gives another speed. A standing vehicle and one on a rig have no
    such delay. Without accelerations no fault is found.
    """
    if window.speed is None or (settings or CornerSettings()).kind == "rig" or window.vehicle.kind == "rig":
        return None
    recording = window.recording
    values = recording.samples[recording.index(window.speed)]
    starts, lengths = equal_runs(values)
    longest = int(np.argmax(lengths))
    if lengths[longest] < _LONG * recording.sampling_rate:
        return None
    first, speed = int(starts[longest]), float(values[starts[longest]])
    stretch = window.part(first, first + int(lengths[longest])).without({window.speed})
    estimates = _speeds_by_delay(stretch, settings)
    is_off = np.abs(np.log(estimates / max(speed, 1e-9))) > np.log(_FACTOR)
    if np.count_nonzero(is_off) <= _WRONG_SHARE * estimates.size:
        return None
    return SensorFault(
        window.speed,
        "dead" if speed == 0 else "stuck",
        f"stays at {speed:.3g} m/s for {lengths[longest] / recording.sampling_rate:.0f} s, while the delay between the "
        f"axles gives {estimates.min():.2g} to {estimates.max():.2g} m/s",
    )


def _speeds_by_delay(stretch: Window, settings: CornerSettings | None) -> Real:
    """Return the speed of each segment by the delay between the axles; none if it gives none or the vehicle stands."""
    try:
        if not _is_driving(stretch.motion):
            return np.zeros(0)
        fit = fit_windows([stretch], settings=settings)
    except (DataError, ParameterError):
        return np.zeros(0)
    if fit.model_error > _MOST_ERROR or fit.n_segments < _LEAST_SHARE * (fit.n_segments + fit.n_rejected):
        return np.zeros(0)
    spectra = fit.model.spectra
    return np.repeat(spectra.speeds, spectra.counts.astype(int))


def _is_driving(motion: Recording) -> bool:
    """Return whether the body moves as on a road."""
    names = [channel.name for channel in motion.channels if channel.quantity == "acceleration"]
    if not names:
        return False
    low, high = _BODY
    moved = band_pass(motion.select(names), low, min(high, 0.4 * motion.sampling_rate))
    return bool(np.sqrt(np.mean(moved.samples**2)) > _DRIVING)
