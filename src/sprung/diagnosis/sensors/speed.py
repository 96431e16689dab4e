"""A speed channel that stays where it is while the vehicle drives on."""

import numpy as np

from sprung._arrays import Real
from sprung.diagnosis.sensors import SensorFault
from sprung.errors import DataError, ParameterError
from sprung.likelihood import CornerSettings, fit_corners
from sprung.recording import Recording
from sprung.signals.conditioning import band_pass
from sprung.vehicles import Vehicle
from sprung.vehicles.usable import speed_channel, usable

#: A speed is doubted that stays the same for so long [s], while the body moves more than this (RMS, [m/s^2]) in this
#: band [Hz]: on the best of roads it moves more, under an idling engine less.
_LONG, _DRIVES, _BODY = 120.0, 0.1, (0.5, 10.0)
#: It is wrong if the delay between the axles tells more than this share of the segments a speed off by this factor,
#: tells the speed in at least so many of them, and fits so well: what shakes a vehicle on a rig does neither.
_WRONG_SHARE, _FACTOR, _TOLD, _WORST = 0.25, 1.25, 0.75, 1.0


def speed_fault(
    recording: Recording, vehicle: Vehicle, *, settings: CornerSettings | None = None
) -> SensorFault | None:
    """Return what is wrong with the speed channel of a window: dead, stuck, or None.

    Parameters
    ----------
    recording
        A window without failing channels of motion.
    vehicle
        Says where the sensors and axles are.
    settings
        Of the fit.

    Notes
    -----
    That a speed stays exactly the same proves nothing: a vehicle stands, or keeps its speed and the bus sends whole
    km/h. It is wrong only where the delay between the axles says another speed. A standing vehicle and one on a rig
    have no such delay. Without accelerations nothing is said.
    """
    name = speed_channel(recording, vehicle)
    if name is None or (settings or CornerSettings()).kind == "rig" or vehicle.kind == "rig":
        return None
    values = recording.samples[recording.index(name)]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0]))
    lengths = np.diff(starts, append=values.size)
    longest = int(np.argmax(lengths))
    if lengths[longest] < _LONG * recording.sampling_rate:
        return None
    first, speed = int(starts[longest]), float(values[starts[longest]])
    part = recording.part(first, first + int(lengths[longest])).select([n for n in recording.names if n != name])
    told = _told(part, vehicle, settings)
    is_off = np.abs(np.log(told / max(speed, 1e-9))) > np.log(_FACTOR)
    if np.count_nonzero(is_off) <= _WRONG_SHARE * told.size:
        return None
    return SensorFault(
        name,
        "dead" if speed == 0 else "stuck",
        f"stays at {speed:.3g} m/s for {lengths[longest] / recording.sampling_rate:.0f} s, while the delay between the "
        f"axles says {told.min():.2g} to {told.max():.2g} m/s",
    )


def _told(part: Recording, vehicle: Vehicle, settings: CornerSettings | None) -> Real:
    """Return the speed of each segment as the delay tells it; none where it does not or the vehicle stands."""
    try:
        if not _drives(usable(part, vehicle=vehicle)):
            return np.zeros(0)
        fit = fit_corners(part, vehicle, settings=settings)
    except (DataError, ParameterError):
        return np.zeros(0)
    if fit.model_error > _WORST or fit.n_segments < _TOLD * (fit.n_segments + fit.n_rejected):
        return np.zeros(0)
    spectra = fit.model.spectra
    return np.repeat(spectra.speeds, spectra.counts.astype(int))


def _drives(motion: Recording) -> bool:
    """Tell whether the body moves as on a road."""
    names = [channel.name for channel in motion.channels if channel.quantity == "acceleration"]
    if not names:
        return False
    low, high = _BODY
    moved = band_pass(motion.select(names), low, min(high, 0.4 * motion.sampling_rate))
    return bool(np.sqrt(np.mean(moved.samples**2)) > _DRIVES)
