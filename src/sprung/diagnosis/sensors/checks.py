"""All sensor checks of a window, in their order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sprung.diagnosis.sensors.channels import Channels, channels_of_motion
from sprung.diagnosis.sensors.faults import SensorFault
from sprung.diagnosis.sensors.rigid_body import rigid_body_faults
from sprung.diagnosis.sensors.single import clipped, dead, drifting, hum, noisy, spiking, stuck
from sprung.errors import DataError
from sprung.recording import Recording
from sprung.signals.data_faults import missing_share
from sprung.vehicles import Vehicle
from sprung.vehicles.window import Window, window_of

#: Size of a fault in words, by row of the channels that have it.
Check = Callable[[Channels], dict[int, str]]

#: Kind of fault and the check that finds it. The first fault of a channel counts; spectra are computed for the channels
#: without a fault of the first group. Checks against the rigid body follow (`rigid_body_faults`).
CHECKS_OF_SAMPLES: tuple[tuple[str, Check], ...] = (("dead", dead), ("stuck", stuck), ("clipped", clipped))
CHECKS_OF_SPECTRA: tuple[tuple[str, Check], ...] = (
    ("spiking", spiking),
    ("hum", hum),
    ("noisy", noisy),
    ("drifting", drifting),
)
#: Share of missing values up to which a channel's spectrum means something.
_MISSING = 0.5


@dataclass(frozen=True, slots=True)
class SensorCheck:
    """Result of the sensor checks of a window.

    Parameters
    ----------
    faults
        Faults of single channels.
    disagreement
        Ratio of the RMS of the residual to that of the channels, if no single channel explains it but other signs,
        gains, places or delays of several do; 0 otherwise.
    """

    faults: tuple[SensorFault, ...]
    disagreement: float = 0.0


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


def check_sensors(window: Window) -> SensorCheck:
    """Return the faults of the sensors of a window.

    Parameters
    ----------
    window
        Window of a minute or more.

    Raises
    ------
    DataError
        If the recording has no motion sensor of the vehicle file.

    Notes
    -----
    Dead, stuck, clipped, spiking, noisy and drifting channels and mains hum are found by comparing a channel with
    others of its quantity; inverted, swapped, wrongly scaled and late ones by the motion that the rigid body cannot
    explain, see `rigid_body_faults`.

    That residual needs accelerations at more places than the rigid body has motions: four on a car. Inverted, swapped,
    wrongly scaled and late sensors are not found with fewer, among angular velocities and displacements, or if
    those of one axle or side are wrong in the same way and the body scarcely moves in that direction. Exchanged sensors
    of opposite corners do not change the residual (see `exchanged_opposites`). A gain error below about 4 % and a delay
    below about 3 ms at one of four corners are not detectable (6 % and 4 ms if the body twists at 18 Hz).

    Several wrong channels: if (a + b d/dt)^T y with constant a and b, a of length 1, nearly vanishes but n^T y does
    not, signs, gains, places or delays are not those of the vehicle file. Noise, wheel lines and a flexible body do not
    have this property; places that are off by up to 25 cm do, but are tolerated. With four channels, two wrong ones may
    be taken for one.
    """
    if not window.vehicle.sensor or not window.outputs:
        raise DataError("the recording has none of the vehicle file's motion sensors: give accelerations")
    channels = channels_of_motion(window)
    faults = _faults(channels, CHECKS_OF_SAMPLES)
    alive = [
        name
        for name, values in zip(channels.names, channels.samples, strict=True)
        if name not in faults and missing_share(values) < _MISSING
    ]
    channels = channels.select(alive)
    if not channels.has_spectra:
        return SensorCheck(tuple(faults.values()))
    faults |= _faults(channels, CHECKS_OF_SPECTRA)
    against_body, disagreement = rigid_body_faults(channels.spectra, window.structure)
    for fault in against_body:
        faults.setdefault(fault.channel, fault)
    return SensorCheck(tuple(faults.values()), 0.0 if faults else disagreement)


def _faults(channels: Channels, checks: Sequence[tuple[str, Check]]) -> dict[str, SensorFault]:
    """Return the first fault that the checks find in each channel."""
    faults: dict[str, SensorFault] = {}
    for kind, check in checks:
        for row, detail in check(channels).items():
            name = channels.names[row]
            faults.setdefault(name, SensorFault(name, kind, detail))
    return faults
