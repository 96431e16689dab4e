"""Drives on a road or a track and runs on a roller rig, put together from the parts of this package."""

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from sprung._checks import check_number, check_one_of
from sprung.excitation import (
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
from sprung.simulation.force_laws import REALISTIC_FORCE_LAWS, damping_factor
from sprung.simulation.linear import settling_time, simulate
from sprung.simulation.nonlinear import TimeHistory, simulate_nonlinear
from sprung.simulation.sensors import with_noise
from sprung.simulation.truth import truth
from sprung.vehicles import Component, Fault, Structure, Vehicle, structure, with_faults

Kind = Literal["road", "rail", "rig"]
#: Steady speeds [m/s] and sampling rate [Hz] of each kind where none are given.
USUAL_SPEEDS = {"road": (5.5, 20.0), "rail": (15.0, 30.0), "rig": (5.5, 5.9)}
USUAL_RATES = {"road": 200.0, "rail": 500.0, "rig": 1000.0}
#: Radius of a rig's rollers [m], and what they do to a wheel: roughness, four joints, harmonics [m].
_ROLLER, _ROUGHNESS, _HARMONICS = 1.0, 1e-5, (2e-5, 1e-5, 5e-6)
_POTHOLES = Potholes(per_kilometre=3.0)


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """How a drive is simulated.

    Parameters
    ----------
    kind
        "road", "rail" or "rig".
    duration
        In s.
    sampling_rate
        In Hz; None: 200 on a road, 500 on rails, 1000 on a rig.
    speed
        Range of the steady speeds [m/s]; None: as usual for the kind. On a rig that of the rollers' surface.
    road
        Class A to H of a road.
    n_stops
        Stops on the way.
    faults
        Of springs, dampers, tyres.
    payload, payload_x
        Mass on the body [kg], and its place ahead of the centre of gravity [m].
    temperature
        Of the dampers [degrees Celsius]; they are nominal at 20.
    is_nonlinear
        Suspensions with asymmetric dampers, friction, progressive springs and bump stops; potholes on the road.
    driven
        Wheelsets that stand on driven rollers of a rig: "all" or "front".
    snr
        RMS of the signal over that of white sensor noise; None: no noise.
    """

    kind: Kind
    duration: float = 600.0
    sampling_rate: float | None = None
    speed: tuple[float, float] | None = None
    road: str = "C"
    n_stops: int = 0
    faults: tuple[Fault, ...] = ()
    payload: float = 0.0
    payload_x: float = 0.0
    temperature: float = 20.0
    is_nonlinear: bool = False
    driven: str = "all"
    snr: float | None = None

    def __post_init__(self) -> None:
        check_one_of("kind", self.kind, USUAL_RATES)
        check_one_of("driven", self.driven, ("all", "front"))
        check_number("duration", self.duration, above=0)
        if self.sampling_rate is not None:
            check_number("sampling_rate", self.sampling_rate, above=0)
        check_number("payload", self.payload, at_least=0)

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return USUAL_RATES[self.kind] if self.sampling_rate is None else self.sampling_rate

    @property
    def speeds(self) -> tuple[float, float]:
        """Range of the steady speeds [m/s]."""
        return self.speed or USUAL_SPEEDS[self.kind]


@dataclass(frozen=True, eq=False, slots=True)
class Drive:
    """A simulated drive: what was recorded, and what is true.

    Parameters
    ----------
    recording
        The vehicle's sensors and the channel of its speed.
    truth
        The JSON object `sprung.truth/1`.
    speed
        Of the drive [m/s].
    """

    recording: Recording
    truth: dict[str, Any]
    speed: SpeedProfile


def simulate_drive(vehicle: Vehicle, settings: DriveSettings, *, seed: int | list[int] = 0) -> Drive:
    """Simulate a drive.

    Parameters
    ----------
    vehicle
        With motion sensors.
    settings
        How.
    seed
        Of the speed, the way and the noise.

    Raises
    ------
    ParameterError
        Where the vehicle has no such component, or no wheels for a road.
    MissingPackageError
        Nonlinear drives and faults that begin later or grow need numba.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> drive = simulate_drive(read_vehicle("zafira"), DriveSettings("road", duration=5.0))
    >>> drive.recording.names
    ('acc_fl', 'acc_fr', 'acc_rl', 'acc_rr', 'speed')
    """
    generator = np.random.default_rng(seed)
    healthy = _prepared(vehicle, settings)
    low, high = settings.speeds
    speed = random_speed(settings.duration, low=low, high=high, n_stops=settings.n_stops, generator=generator)
    if low == high and settings.n_stops == 0:
        speed = constant_speed(low)
    excitation = _excitation(vehicle, settings, speed)
    constant = [fault for fault in settings.faults if fault.is_constant]
    changing = [fault for fault in settings.faults if not fault.is_constant]
    faulty = with_faults(healthy, constant)
    options: dict[str, Any] = {
        "duration": settings.duration,
        "sampling_rate": settings.rate,
        "lead_in": settling_time(healthy),  # the same way, whatever the faults
        "seed": generator,
    }
    if settings.is_nonlinear or changing:
        force_laws = REALISTIC_FORCE_LAWS if settings.is_nonlinear else {}
        recording = simulate_nonlinear(
            faulty, excitation, force_laws=force_laws, time_histories=_time_histories(changing, healthy), **options
        )
    else:
        recording = simulate(faulty, excitation, **options)
    if settings.snr is not None:
        recording = with_noise(recording, snr=settings.snr, generator=generator)
    number = seed if isinstance(seed, int) else seed[0]
    document = truth(healthy, seed=number, speed=speed, duration=settings.duration, faults=settings.faults)
    return Drive(_with_speed(recording, speed, vehicle.speed_channel), document, speed)


def _prepared(vehicle: Vehicle, settings: DriveSettings) -> Structure:
    """Return the healthy vehicle with its payload and its dampers at their temperature."""
    loaded = structure(vehicle).with_payload(settings.payload, x=settings.payload_x)
    factor = damping_factor(settings.temperature)
    dampers = [component for component in loaded.components() if component.kind == "damper" and component.side]
    return loaded.changed(dict.fromkeys(dampers, factor))


def _excitation(vehicle: Vehicle, settings: DriveSettings, speed: SpeedProfile) -> Excitation:
    """Return what drives the wheels."""
    if settings.kind == "rig":
        rotation = SpeedProfile(speed.times, speed.speeds / (2 * math.pi * _ROLLER))
        is_driven = tuple(settings.driven == "all" or number == 0 for number in range(len(vehicle.axle)))
        return RollerRig(is_driven, rotation, random=_ROUGHNESS, joints=4, joint=10 * _ROUGHNESS, harmonics=_HARMONICS)
    positions = tuple(axle.x for axle in vehicle.axle)
    if settings.kind == "rail":
        return SurfaceMotion(rail_quality("good"), positions, speed, contact_length=0.01, obstacles=(Joints(),))
    obstacles = (_POTHOLES,) if settings.is_nonlinear else ()
    return SurfaceMotion(road_class(settings.road), positions, speed, obstacles=obstacles)


def _time_histories(faults: list[Fault], vehicle: Structure) -> dict[Component, TimeHistory]:
    """Return faults as histories of their components; a step lasts a millisecond."""
    with_faults(vehicle, faults)  # refuses unknown components
    histories: dict[Component, TimeHistory] = {}
    for component in {fault.component for fault in faults}:
        same = [fault for fault in faults if fault.component == component]
        times = np.unique([time for fault in same for time in (0.0, fault.onset - 1e-3, *fault.knots)])
        histories[component] = (times, np.prod([fault.factor(times) for fault in same], axis=0))
    return histories


def _with_speed(recording: Recording, speed: SpeedProfile, name: str) -> Recording:
    """Add the channel of the speed."""
    values = speed.speed(np.arange(recording.n_samples) / recording.sampling_rate)
    return replace(
        recording,
        samples=np.vstack([recording.samples, values]),
        channels=(*recording.channels, Channel(name, "speed")),
    )
