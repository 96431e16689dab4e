"""Drives on a road or a track and runs on a roller rig, put together from the parts of this package."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from sprung._checks import check_number, check_one_of
from sprung.excitation import (
    ROAD_CLASSES,
    Excitation,
    Joints,
    Potholes,
    RollerRig,
    SpeedProfile,
    SurfaceMotion,
    constant_speed,
    rail_quality,
    random_speed,
    road_class,
)
from sprung.recording import Channel, Recording
from sprung.simulation.force_laws import REALISTIC_FORCE_LAWS, ForceLaw, damping_factor
from sprung.simulation.linear import settling_time, simulate
from sprung.simulation.nonlinear import TimeHistory, simulate_nonlinear
from sprung.simulation.sensors import with_noise
from sprung.simulation.truth import truth
from sprung.vehicles import Component, Fault, Structure, Vehicle, structure, with_faults

#: Radius of a rig's rollers [m], and their roughness and harmonics [m].
_ROLLER, _ROUGHNESS, _HARMONICS = 1.0, 1e-5, (2e-5, 1e-5, 5e-6)


@dataclass(frozen=True, slots=True)
class Payload:
    """Mass fixed to the body.

    Parameters
    ----------
    mass
        Mass [kg], at least 0.
    x, y
        Position ahead and to the left of the body's centre of gravity [m].

    Raises
    ------
    ParameterError
        If the mass is negative or not finite.
    """

    mass: float = 0.0
    x: float = 0.0
    y: float = 0.0

    def __post_init__(self) -> None:
        check_number("mass of the payload", self.mass, at_least=0)


@dataclass(frozen=True, slots=True)
class SuspensionConditions:
    """Departures of the suspension on a drive from the linear one of the vehicle file.

    Parameters
    ----------
    temperature
        Temperature of the dampers [°C]; damping is nominal at 20 °C.
    force_laws
        Nonlinear force laws by part or by owner and part, see `simulate_nonlinear`; empty: a linear suspension.
    """

    temperature: float = 20.0
    force_laws: Mapping[str, ForceLaw] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "force_laws", dict(self.force_laws))


@dataclass(frozen=True, slots=True)
class RoadConditions:
    """Road that a vehicle drives on.

    Parameters
    ----------
    road_class
        Roughness class of ISO 8608, "A" to "H".
    potholes
        Potholes and bumps on the way; None: none.

    Raises
    ------
    ParameterError
        If the class does not exist.
    """

    road_class: str = "C"
    potholes: Potholes | None = None

    def __post_init__(self) -> None:
        check_one_of("road class", self.road_class.upper(), ROAD_CLASSES)


#: A car's suspension with asymmetric dampers, friction, progressive springs and bump stops, at 20 degrees Celsius.
REALISTIC_SUSPENSION = SuspensionConditions(force_laws=REALISTIC_FORCE_LAWS)
#: Three potholes per kilometre.
FEW_POTHOLES = Potholes(per_kilometre=3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSettings(ABC):
    """Common settings of drives on a road or a track and runs on a rig.

    Parameters
    ----------
    sampling_rate
        Sampling rate [Hz].
    speed
        Range of the steady speeds [m/s]; on a rig, of the rollers' surface.
    duration
        Duration of the recording [s].
    n_stops
        Number of stops on the way.
    faults
        Changes of springs, dampers and tyres.
    payload
        Mass on the body.
    suspension
        Temperature and force laws of the suspension.
    snr
        RMS of the signal over that of white sensor noise, an amplitude ratio; None: no noise.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    sampling_rate: float
    speed: tuple[float, float]
    duration: float = 600.0
    n_stops: int = 0
    faults: tuple[Fault, ...] = ()
    payload: Payload = Payload()
    suspension: SuspensionConditions = SuspensionConditions()
    snr: float | None = None

    def __post_init__(self) -> None:
        check_number("sampling_rate", self.sampling_rate, above=0)
        check_number("duration", self.duration, above=0)

    @abstractmethod
    def excitation(self, vehicle: Vehicle, speed: SpeedProfile) -> Excitation:
        """Return the height of the ground under the wheels of a vehicle at a speed over time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadDrive(DriveSettings):
    """Settings of a drive on a road; for the common ones see `DriveSettings`.

    Parameters
    ----------
    road
        Roughness class of the road, and its potholes.
    """

    sampling_rate: float = 200.0
    speed: tuple[float, float] = (5.5, 20.0)
    road: RoadConditions = RoadConditions()

    def excitation(self, vehicle: Vehicle, speed: SpeedProfile) -> Excitation:
        """Return the height of the road under the wheels."""
        obstacles = () if self.road.potholes is None else (self.road.potholes,)
        return SurfaceMotion(road_class(self.road.road_class), _axle_positions(vehicle), speed, obstacles=obstacles)


@dataclass(frozen=True, slots=True, kw_only=True)
class RailDrive(DriveSettings):
    """Settings of a drive on a good track with dipped joints, see `DriveSettings`."""

    sampling_rate: float = 500.0
    speed: tuple[float, float] = (15.0, 30.0)

    def excitation(self, vehicle: Vehicle, speed: SpeedProfile) -> Excitation:
        """Return the height of the rails under the wheels."""
        track = rail_quality("good")
        return SurfaceMotion(track, _axle_positions(vehicle), speed, contact_length=0.01, obstacles=(Joints(),))


@dataclass(frozen=True, slots=True, kw_only=True)
class RigRun(DriveSettings):
    """Settings of a run on a roller rig; for the common ones see `DriveSettings`.

    Parameters
    ----------
    driven
        Wheelsets that stand on driven rollers: "all" or "front".

    Raises
    ------
    ParameterError
        If a number is out of range, or `driven` is neither "all" nor "front".
    """

    sampling_rate: float = 1000.0
    speed: tuple[float, float] = (5.5, 5.9)
    driven: Literal["all", "front"] = "all"

    def __post_init__(self) -> None:
        DriveSettings.__post_init__(self)
        check_one_of("driven", self.driven, ("all", "front"))

    def excitation(self, vehicle: Vehicle, speed: SpeedProfile) -> Excitation:
        """Return the height of the rollers under the wheels."""
        rotation = SpeedProfile(speed.times, speed.speeds / (2 * math.pi * _ROLLER))
        is_driven = tuple(self.driven == "all" or number == 0 for number in range(len(vehicle.axle)))
        return RollerRig(is_driven, rotation, random=_ROUGHNESS, joints=4, joint=10 * _ROUGHNESS, harmonics=_HARMONICS)


@dataclass(frozen=True, eq=False, slots=True)
class SimulatedDrive:
    """Recording of a simulated drive, and the truth about it.

    Parameters
    ----------
    recording
        Signals of the vehicle's sensors, and the channel of its speed.
    truth
        Truth of the recording, fields of `sprung.truth/1`.
    speed
        Speed over time [m/s].
    """

    recording: Recording
    truth: dict[str, Any]
    speed: SpeedProfile


def simulate_drive(vehicle: Vehicle, settings: DriveSettings, *, seed: int | list[int] = 0) -> SimulatedDrive:
    """Simulate a drive on a road or a track, or a run on a rig.

    Parameters
    ----------
    vehicle
        Vehicle with motion sensors.
    settings
        A `RoadDrive`, `RailDrive` or `RigRun`.
    seed
        Seed of the speed, the road and the noise.

    Returns
    -------
    SimulatedDrive
        Recording in SI units, with its truth.

    Raises
    ------
    ParameterError
        If the vehicle lacks a component that a fault names, or has no motion sensors.
    MissingPackageError
        If force laws, or faults that begin later or grow, need numba and it is not installed.

    Notes
    -----
    The lead-in is the settling time of the healthy vehicle, so that the same seed gives the same road with any faults.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> drive = simulate_drive(read_vehicle("zafira"), RoadDrive(duration=5.0))
    >>> drive.recording.names
    ('acc_fl', 'acc_fr', 'acc_rl', 'acc_rr', 'speed')
    """
    generator = np.random.default_rng(seed)
    healthy = _healthy(vehicle, settings)
    low, high = settings.speed
    speed = random_speed(settings.duration, low=low, high=high, n_stops=settings.n_stops, generator=generator)
    if low == high and settings.n_stops == 0:
        speed = constant_speed(low)
    excitation = settings.excitation(vehicle, speed)
    constant = [fault for fault in settings.faults if fault.is_constant]
    changing = [fault for fault in settings.faults if not fault.is_constant]
    faulty = with_faults(healthy, constant)
    options: dict[str, Any] = {
        "duration": settings.duration,
        "sampling_rate": settings.sampling_rate,
        "lead_in": settling_time(healthy),
        "seed": generator,
    }
    force_laws = settings.suspension.force_laws
    if force_laws or changing:
        histories = _time_histories(changing, healthy)
        recording = simulate_nonlinear(faulty, excitation, force_laws=force_laws, time_histories=histories, **options)
    else:
        recording = simulate(faulty, excitation, **options)
    if settings.snr is not None:
        recording = with_noise(recording, snr=settings.snr, generator=generator)
    number = seed if isinstance(seed, int) else seed[0]
    document = truth(healthy, seed=number, speed=speed, duration=settings.duration, faults=settings.faults)
    return SimulatedDrive(_with_speed(recording, speed, vehicle.speed_channel), document, speed)


def _healthy(vehicle: Vehicle, settings: DriveSettings) -> Structure:
    """Return the healthy vehicle with its payload and its dampers at their temperature."""
    payload = settings.payload
    loaded = structure(vehicle).with_payload(payload.mass, x=payload.x, y=payload.y)
    factor = damping_factor(settings.suspension.temperature)
    dampers = [component for component in loaded.components() if component.kind == "damper" and component.side]
    return loaded.changed(dict.fromkeys(dampers, factor))


def _axle_positions(vehicle: Vehicle) -> tuple[float, ...]:
    """Return the distances of the axles ahead of the centre of gravity [m]."""
    return tuple(axle.x for axle in vehicle.axle)


def _time_histories(faults: list[Fault], vehicle: Structure) -> dict[Component, TimeHistory]:
    """Return faults as time histories of their components; a step lasts a millisecond."""
    with_faults(vehicle, faults)  # refuses unknown components
    histories: dict[Component, TimeHistory] = {}
    for component in {fault.component for fault in faults}:
        same = [fault for fault in faults if fault.component == component]
        times = np.unique([time for fault in same for time in (0.0, fault.onset - 1e-3, *fault.knots)])
        histories[component] = (times, np.prod([fault.factor(times) for fault in same], axis=0))
    return histories


def _with_speed(recording: Recording, speed: SpeedProfile, name: str) -> Recording:
    """Return the recording with the channel of the speed."""
    values = speed.speed(np.arange(recording.n_samples) / recording.sampling_rate)
    return replace(
        recording,
        samples=np.vstack([recording.samples, values]),
        channels=(*recording.channels, Channel(name, "speed")),
    )
