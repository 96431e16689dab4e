"""Checks of the sensors of a window against each other and the rigid body, before anything is fitted to it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sprung.errors import DataError
from sprung.signals.data_faults import missing_share
from sprung.vehicles.channel_faults import (
    CHECKS_OF_SAMPLES,
    CHECKS_OF_SPECTRA,
    LIMITS,
    Channels,
    SensorFault,
    faults_by,
)
from sprung.vehicles.rigid_body import rigid_body_faults
from sprung.vehicles.window import Window

#: Faults by which a recording and a vehicle file contradict each other about what a channel measures.
CONTRADICTIONS = ("inverted", "swapped")


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
    channels = Channels.of(window)
    faults = faults_by(CHECKS_OF_SAMPLES, channels)
    every = enumerate(zip(channels.recording.names, channels.samples, strict=True))
    channels = channels.take(
        [row for row, (name, values) in every if name not in faults and missing_share(values) < LIMITS.missing]
    )
    if not channels.has_spectra:
        return SensorCheck(tuple(faults.values()))
    faults |= faults_by(CHECKS_OF_SPECTRA, channels)
    against_body, disagreement = rigid_body_faults(channels.spectra, window.structure)
    for fault in against_body:
        faults.setdefault(fault.channel, fault)
    return SensorCheck(tuple(faults.values()), 0.0 if faults else disagreement)


def refuse_wrong_sensors(windows: Iterable[Window]) -> tuple[str, ...]:
    """Refuse windows with inverted or swapped sensors, whose fit would be that of another vehicle.

    Other faults are returned as notes, one sentence each.

    Parameters
    ----------
    windows
        Windows before a fit; those of less than eight seconds have no spectra to check.

    Raises
    ------
    DataError
        If a sensor is inverted, or two are swapped.
    """
    faults = [fault for window in windows for fault in check_sensors(window).faults]
    wrong = [fault for fault in faults if fault.kind in CONTRADICTIONS]
    if wrong:
        raise DataError(describe_contradictions(wrong))
    return tuple(dict.fromkeys(f"{fault.statement}: {fault.detail}; its samples were used" for fault in faults))


def describe_contradictions(faults: Sequence[SensorFault]) -> str:
    """Return one sentence about inverted or swapped sensors, and what to do."""
    words = dict.fromkeys(
        f"sensors are swapped, {fault.detail}" if fault.kind == "swapped" else fault.statement for fault in faults
    )
    return f"{'; '.join(words)}: correct the names, places or directions of the vehicle file"
