"""Sensor checks of a window: failing channels, which are excluded before the suspension is assessed."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from sprung._arrays import Real
from sprung.errors import DataError, ParameterError
from sprung.likelihood import CornerFit, CornerSettings, Model
from sprung.likelihood.fitting import fit_windows
from sprung.recording import Recording
from sprung.signals.conditioning import band_pass
from sprung.signals.data_faults import equal_runs
from sprung.vehicles import Vehicle
from sprung.vehicles.channel_faults import SensorFault
from sprung.vehicles.sensor_checks import SensorCheck, check_sensors
from sprung.vehicles.window import Window, window_of


@dataclass(frozen=True, slots=True)
class FitLimits:
    """Limits of the checks that need a fit of the vehicle."""

    #: Duration of a constant speed after which it is doubted [s]: no driver keeps a speed exactly for as long.
    constant_speed: float = 120.0
    #: RMS of a driving body's acceleration [m/s^2], exceeded on the best of roads, but not under an idling engine.
    driving: float = 0.1
    #: Band of this acceleration [Hz].
    body: tuple[float, float] = (0.5, 10.0)
    #: A speed is wrong if the delay between the axles gives another one by more than this factor.
    speed_factor: float = 1.25
    #: Share of the segments in which it has to.
    wrong_share: float = 0.25
    #: Smallest share of segments with a speed: shaking on a rig has fewer.
    share_with_speed: float = 0.75
    #: Largest model error with such a speed: shaking on a rig has a larger one.
    model_error: float = 1.0
    #: Model error above which an exchange is tried.
    suspect: float = 0.3
    #: ln of how much more likely an exchange must make the nominal vehicle: 640 where sensors are exchanged on a car
    #: whose file lacks an engine of 180 kg at 11 Hz.
    more_likely: float = 100.0


LIMITS = FitLimits()


def sensor_faults(recording: Recording, vehicle: Vehicle, *, allow_missing: bool = False) -> tuple[SensorFault, ...]:
    """Return the faults of single sensors of a recording.

    Parameters
    ----------
    recording
        Recording of a minute or more, as read.
    vehicle
        Vehicle with its sensors.
    allow_missing
        Whether the recording may lack sensors of the vehicle file; they are no faults here.

    Raises
    ------
    DataError, ParameterError
        As raised by `check_sensors` and `window_of`.

    References
    ----------
    As for `rigid_body_faults`.

    Examples
    --------
    An accelerometer that is mounted upside down:

    >>> from functools import partial
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.simulation.sensors import inverted, with_imperfections
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=120.0, sampling_rate=60.0, snr=50.0), seed=1).recording
    >>> wrong = with_imperfections(drive, [partial(inverted, channel="acc_rr")])
    >>> [(fault.channel, fault.kind) for fault in sensor_faults(wrong, vehicle)]
    [('acc_rr', 'inverted')]
    """
    return check_sensors(window_of(recording, vehicle, allow_missing=allow_missing)).faults


def valid_part(window: Window, *, settings: CornerSettings | None = None) -> tuple[Window, SensorCheck]:
    """Return the part of a window that is fitted, without failing channels, and the checks with a wrong speed.

    Parameters
    ----------
    window
        Window of a vehicle.
    settings
        Choices of the fit.
    """
    check = check_sensors(window)
    valid = window.without({fault.channel for fault in check.faults})
    wrong_speed = speed_fault(valid, settings=settings)
    if wrong_speed is None:
        return valid, check
    return valid.without({wrong_speed.channel}), replace(check, faults=(*check.faults, wrong_speed))


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
    if lengths[longest] < LIMITS.constant_speed * recording.sampling_rate:
        return None
    first, speed = int(starts[longest]), float(values[starts[longest]])
    stretch = window.part(first, first + int(lengths[longest])).without({window.speed})
    estimates = _speeds_by_delay(stretch, settings)
    is_off = np.abs(np.log(estimates / max(speed, 1e-9))) > np.log(LIMITS.speed_factor)
    if np.count_nonzero(is_off) <= LIMITS.wrong_share * estimates.size:
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
    n_needed = LIMITS.share_with_speed * (fit.n_segments + fit.n_rejected)
    if fit.model_error > LIMITS.model_error or fit.n_segments < n_needed:
        return np.zeros(0)
    spectra = fit.model.spectra
    return np.repeat(spectra.speeds, spectra.counts.astype(int))


def _is_driving(motion: Recording) -> bool:
    """Return whether the body moves as on a road."""
    names = [channel.name for channel in motion.channels if channel.quantity == "acceleration"]
    if not names:
        return False
    low, high = LIMITS.body
    moved = band_pass(motion.select(names), low, min(high, 0.4 * motion.sampling_rate))
    return bool(np.sqrt(np.mean(moved.samples**2)) > LIMITS.driving)


def exchanged_opposites(window: Window, fit: CornerFit, settings: CornerSettings | None) -> tuple[SensorFault, ...]:
    """Return swapped accelerometers at opposite corners of one part, as faults.

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
    if fit.model_error <= LIMITS.suspect:
        return ()
    names = window.recording.names
    sensors = {
        sensor.channel: sensor
        for sensor in window.vehicle.sensor
        if sensor.quantity == "acceleration" and sensor.position is not None and sensor.channel in names
    }
    carriers = {name: sensor.on for name, sensor in sensors.items()}
    places = {name: np.array(sensor.position)[:2] for name, sensor in sensors.items()}
    opposites = [
        (first, second)
        for first, second in combinations(places, 2)
        if carriers[first] == carriers[second] and np.all(places[first] * places[second] < 0)
    ]
    misfits = {pair: _nominal_misfit(_exchanged(fit.model, pair)) for pair in opposites}
    best = min(misfits, key=misfits.__getitem__, default=None)
    if best is None or misfits[best] > _nominal_misfit(fit.model) - LIMITS.more_likely:
        return ()
    if fit_windows([window.exchanged(*best)], settings=settings).model_error > fit.model_error:
        return ()
    words = f"{best[0]} with {best[1]}, or the other two corners with each other"
    return tuple(SensorFault(name, "swapped", words) for name in places if carriers[name] == carriers[best[0]])


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
