"""All sensor checks of a window, in their order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sprung.diagnosis.sensors.channels import Channels, channels_of_motion
from sprung.diagnosis.sensors.faults import SensorFault
from sprung.diagnosis.sensors.rigid_body import rigid_body_faults
from sprung.diagnosis.sensors.single import clipped, dead, drifting, hum, noisy, spiking, stuck
from sprung.errors import DataError
from sprung.recording import Recording
from sprung.signals.inspection import missing_share
from sprung.vehicles import Vehicle
from sprung.vehicles.window import Window, window_of

#: Size of a fault in words, by row of the channels that have it.
Check = Callable[[Channels], dict[int, str]]

#: Kind of fault and the check that finds it. The first fault of a channel counts; spectra are computed of the channels
#: without a fault of the first group. Faults against the rigid body follow (`rigid_body_faults`).
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
    """What the checks of a window's sensors found.

    Parameters
    ----------
    faults
        Faults of single channels.
    disagreement
        RMS of the residual channel over that of the channels, where no single channel explains it but other signs,
        gains, places or delays of several do; 0 otherwise.
    """

    faults: tuple[SensorFault, ...]
    disagreement: float = 0.0


def sensor_faults(recording: Recording, vehicle: Vehicle) -> tuple[SensorFault, ...]:
    """Return the faults of single sensors of a recording.

    Parameters
    ----------
    recording
        Recording of a minute or more, as read.
    vehicle
        Vehicle with its sensors.

    Raises
    ------
    DataError, ParameterError
        As raised by `check_sensors` and `window_of`.
    """
    return check_sensors(window_of(recording, vehicle)).faults


def check_sensors(window: Window) -> SensorCheck:
    """Return the faults of the sensors of a window.

    Parameters
    ----------
    window
        Window of a minute or more.

    Raises
    ------
    DataError
        If no sensor of motion of the vehicle file is in the recording.

    Notes
    -----
    Dead, stuck, clipped, spiking, noisy and drifting channels and mains hum show in a channel next to others of its
    quantity; inverted, swapped, wrongly scaled and late ones in what the rigid body cannot explain, see
    `rigid_body_faults`.

    That residual needs accelerations at more places than the rigid body has motions there: four on a car. With fewer,
    with angular velocities or displacements among them, and where those of one axle or side are wrong alike and the
    body hardly moves that way, inverted, swapped, wrongly scaled and late sensors are not found here. Exchanged sensors
    of opposite corners leave it as it is (see `exchanged_opposites`). A gain that is off by less than about 6 % in one
    of four corners is below its limit.

    Several wrong channels: where (a + b d/dt)^T y with constant a and b, a of length 1, nearly vanishes, but n^T y does
    not, signs, gains, places or delays are not those of the vehicle file. Noise, lines of wheels and a body that bends
    follow no such rule. With four channels, two wrong ones may be taken for one.
    """
    if not window.vehicle.sensor or not window.outputs:
        raise DataError("the recording has no channel of motion of the vehicle file's sensors: give accelerations")
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
    """Return the first fault of each channel that checks find."""
    faults: dict[str, SensorFault] = {}
    for kind, check in checks:
        for row, detail in check(channels).items():
            name = channels.names[row]
            faults.setdefault(name, SensorFault(name, kind, detail))
    return faults
