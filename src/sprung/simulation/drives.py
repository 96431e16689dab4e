"""Drives on a road or a track and runs on a roller rig, put together from the parts of this package."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number, check_one_of, check_type
from sprung._display import in_short
from sprung._threads import one_thread
from sprung.errors import ParameterError
from sprung.excitation import (
    GRAVITY,
    BodyAccelerations,
    Corrugation,
    Crossings,
    CrossSlope,
    Excitation,
    Joints,
    Lines,
    MeasuredSurface,
    RailQuality,
    RollerRig,
    Route,
    SpeedProfile,
    Stack,
    Sum,
    SurfaceMotion,
    constant_speed,
    rail_quality,
    random_speed,
    road_class,
)
from sprung.recording import Channel, Recording
from sprung.simulation.conditions import (
    FASTEST,
    TYRE_PRESSURE,
    Driving,
    Payload,
    RoadConditions,
    SuspensionConditions,
    WheelOrders,
    damping_factor,
    pressure_of,
    tyre_factor,
    wheel_order_facts,
)
from sprung.simulation.deviations import WHEELS, Deviations, true_vehicle
from sprung.simulation.fmu import Fmu, simulate_fmu
from sprung.simulation.lateral import lateral_signals
from sprung.simulation.linear import settling_time, simulate
from sprung.simulation.nonlinear import TimeHistory, nonlinear_drive
from sprung.simulation.sensors import Imperfection, with_imperfections, with_noise
from sprung.simulation.truth import plain, true_conditions, truth
from sprung.vehicles import Component, Fault, Sensor, Structure, Vehicle, check_on_axles, structure, with_faults
from sprung.vehicles.lateral import has_lateral_sensors, lateral_parts, with_load
from sprung.vehicles.sections import SENSOR_QUANTITIES
from sprung.vehicles.structure import DAMPERS, motions_of

#: Names of the inputs that `with_body_accelerations` adds.
INPUTS = ("longitudinal_acceleration", "lateral_acceleration")


def with_conditions(
    recording: Recording,
    vehicle: Vehicle,
    *,
    route: Route,
    suspension: SuspensionConditions,
    tyre_factors: Mapping[Component, float],
) -> Recording:
    """Return the recording with the speed channel and the channels of conditions that the vehicle file lists.

    Parameters
    ----------
    recording
        Signals of the motion sensors.
    vehicle
        Vehicle with its sensors.
    route
        Speed and curves of the drive.
    suspension
        Temperatures of dampers and tyres.
    tyre_factors
        True over nominal stiffness of each tyre, from which its pressure follows; tyres that are left out are nominal.

    Notes
    -----
    A wheel at y [m] runs at the speed less y times the yaw rate. A temperature without a place is that of the dampers.
    """
    time = np.arange(recording.n_samples) / recording.sampling_rate
    speed, yaw_rate = route.speed.speed(time), route.yaw_rate(time)
    rows, channels = [speed], [Channel(vehicle.speed_channel, "speed")]
    for sensor in vehicle.sensor:
        if not sensor.is_condition or sensor.channel == vehicle.speed_channel:
            continue
        if SENSOR_QUANTITIES[sensor.quantity] in {"speed", "angular_velocity"}:
            values = _wheel_speed(sensor, vehicle, speed, yaw_rate)
        elif sensor.quantity == "temperature":
            is_tyre = sensor.between is None and sensor.on != "body"
            values = np.full(time.size, suspension.tyre_temperature if is_tyre else suspension.temperature)
        else:
            factor = tyre_factors.get(Component(sensor.on.removeprefix("wheel_"), "tyre"), 1.0)
            values = np.full(time.size, TYRE_PRESSURE if sensor.on == "body" else pressure_of(factor))
        rows.append(values)
        channels.append(Channel(sensor.channel, SENSOR_QUANTITIES[sensor.quantity]))
    samples = np.vstack([recording.samples, *rows])
    return replace(recording, samples=samples, channels=(*recording.channels, *channels))


def _wheel_speed(sensor: Sensor, vehicle: Vehicle, speed: Real, yaw_rate: Real) -> Real:
    """Return the circumferential speed [m/s] or the angular velocity [rad/s] of a wheel, or the speed of the body."""
    wheel = {wheel.corner: wheel for wheel in vehicle.wheels}.get(sensor.on.removeprefix("wheel_"))
    if wheel is None:
        return speed
    circumferential = speed - wheel.y * yaw_rate
    if sensor.quantity == "speed" or wheel.rolling_radius is None:
        return circumferential
    return circumferential / wheel.rolling_radius


#: Height of a body's centre of gravity above the ground where nothing states it [m].
_HEIGHT = 0.55
#: Streams of random numbers of the conditions of a drive.
_ROUTE, _SENSORS, _LATERAL = 1001, 1002, 1003


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
        Mass on the body, or several masses at different places.
    suspension
        Temperatures and force laws of the suspension.
    snr
        RMS of the signal over that of white sensor noise, an amplitude ratio; None: no noise.
    deviations
        Deviations of the vehicle and its sensors from the vehicle file.
    imperfections
        Imperfections of sensors and recorder, see `with_imperfections`, in the order in which they act.
    fmu
        Functional Mock-up Unit that is driven in place of the vehicle, and is the truth; None: the vehicle of the file.
    wheel_orders
        Unbalance and run-out of the wheels on a road or track; None: round and balanced wheels.

    Raises
    ------
    ParameterError
        If a number is out of range, or the settings change the vehicle although an FMU takes its place.
    """

    sampling_rate: float
    speed: tuple[float, float]
    duration: float = 600.0
    n_stops: int = 0
    faults: tuple[Fault, ...] = ()
    payload: Payload | tuple[Payload, ...] = field(default_factory=Payload)
    suspension: SuspensionConditions = field(default_factory=SuspensionConditions)
    snr: float | None = None
    deviations: Deviations = field(default_factory=Deviations)
    imperfections: tuple[Imperfection, ...] = ()
    fmu: Fmu | None = None
    wheel_orders: WheelOrders | None = None

    def __post_init__(self) -> None:
        check_number("sampling_rate", self.sampling_rate, above=0)
        check_number("duration", self.duration, above=0)
        changed = {
            "faults": bool(self.faults),
            "payload": any(payload.mass for payload in self.payloads),
            "suspension": self.suspension != SuspensionConditions(),
            "deviations": self.deviations != Deviations(),
        }
        if self.fmu is not None and any(changed.values()):
            given = ", ".join(name for name, is_given in changed.items() if is_given)
            raise ParameterError(f"{given}: the FMU takes the place of the vehicle, so change the FMU instead")

    @property
    def payloads(self) -> tuple[Payload, ...]:
        """Masses on the body."""
        return (self.payload,) if isinstance(self.payload, Payload) else self.payload

    @property
    def driving(self) -> Driving:
        """Braking, curves and cross slope; none but on a road."""
        return Driving()

    @abstractmethod
    def excitation(self, vehicle: Vehicle, route: Route) -> Excitation:
        """Return the height of the ground under the wheels of a vehicle on its route."""

    def _lines(self, vehicle: Vehicle, route: Route) -> tuple[Lines, ...]:
        if self.wheel_orders is None:
            return ()
        return self.wheel_orders.lines(vehicle, route.speed, self.deviations.generator(WHEELS))

    def own_conditions(self, vehicle: Vehicle, route: Route) -> dict[str, Any]:
        """Return the conditions that only this kind of drive has, by name."""
        del vehicle, route
        return {}


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadDrive(DriveSettings):
    """Settings of a drive on a road; for the common ones see `DriveSettings`.

    Parameters
    ----------
    road
        Roughness of the road, and its potholes.
    driving
        Braking, curves and cross slope.
    surface
        Measured surface that takes the place of the random one, such as `read_surface` gives; None: a random one.
    """

    sampling_rate: float = 200.0
    speed: tuple[float, float] = (5.5, 20.0)
    road: RoadConditions = field(default_factory=RoadConditions)
    driving: Driving = field(default_factory=Driving)
    surface: MeasuredSurface | None = None

    def excitation(self, vehicle: Vehicle, route: Route) -> Excitation:
        """Return the height of the road under the wheels, and what equals their unbalance and run-out."""
        surface = SurfaceMotion(
            self.surface or road_class(self.road.road_class),
            _axle_positions(vehicle),
            route.speed,
            obstacles=() if self.road.potholes is None else (self.road.potholes,),
            right_over_left=self.road.right_over_left,
        )
        others: tuple[Excitation, ...] = self._lines(vehicle, route)
        if self.driving.cross_slope:
            half_tracks = tuple(axle.half_track for axle in vehicle.axle)
            others = (*others, CrossSlope(route, _axle_positions(vehicle), half_tracks))
        return Sum((surface, *others)) if others else surface

    def own_conditions(self, vehicle: Vehicle, route: Route) -> dict[str, Any]:
        """Return road, driving and wheel orders."""
        return {
            "road": plain(self.road) if self.surface is None else {"surface": self.surface.name},
            "driving": plain(self.driving) | {"height": _height(vehicle, self.driving)},
            "wheel_orders": wheel_order_facts(self._lines(vehicle, route), vehicle),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class RailDrive(DriveSettings):
    """Settings of a drive on a track; for the common ones see `DriveSettings`.

    Parameters
    ----------
    quality
        Level of the track's irregularity: "good" (low) or "bad" (high) by ERRI B176; "fra1" to "fra6" by class of the
        FRA.
    welded
        Whether the rails are welded; otherwise they have joints.
    joints
        Distance, depth and length of the dipped joints.
    crossings
        Crossings and single bad joints; None: there are none.
    corrugation
        Corrugation of the rails; None: there is none.

    Raises
    ------
    ParameterError
        If a number is out of range, or the corrugation is passed faster than motion is simulated.
    """

    sampling_rate: float = 500.0
    speed: tuple[float, float] = (15.0, 30.0)
    quality: RailQuality = "good"
    welded: bool = False
    joints: Joints = field(default_factory=Joints)
    crossings: Crossings | None = None
    corrugation: Corrugation | None = None

    def __post_init__(self) -> None:
        DriveSettings.__post_init__(self)
        rail_quality(self.quality)
        if self.corrugation is not None:
            passed = max(self.speed) / self.corrugation.wavelength
            check_number("waves of the corrugation in a second", passed, at_most=FASTEST, advice="drive slower")

    def excitation(self, vehicle: Vehicle, route: Route) -> Excitation:
        """Return the height of the rails under the wheels."""
        obstacles = (None if self.welded else self.joints, self.crossings, self.corrugation)
        track = SurfaceMotion(
            rail_quality(self.quality),
            _axle_positions(vehicle),
            route.speed,
            contact_length=0.01,
            obstacles=tuple(one for one in obstacles if one is not None),
        )
        lines = self._lines(vehicle, route)
        return Sum((track, *lines)) if lines else track

    def own_conditions(self, vehicle: Vehicle, route: Route) -> dict[str, Any]:
        """Return track and wheel orders."""
        track: dict[str, Any] = {"quality": self.quality, "welded": self.welded}
        if not self.welded and self.joints != Joints():
            track["joints"] = plain(self.joints)
        for name in ("crossings", "corrugation"):
            if getattr(self, name) is not None:
                track[name] = plain(getattr(self, name))
        lines = self._lines(vehicle, route)
        return {"track": track} | ({"wheel_orders": wheel_order_facts(lines, vehicle)} if lines else {})


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
        If a number is out of range, `driven` is neither "all" nor "front", or wheels are not round.
    """

    sampling_rate: float = 1000.0
    speed: tuple[float, float] = (5.5, 5.9)
    driven: Literal["all", "front"] = "all"

    def __post_init__(self) -> None:
        DriveSettings.__post_init__(self)
        check_one_of("driven", self.driven, ("all", "front"))
        if self.wheel_orders is not None:
            raise ParameterError("wheel_orders are for drives on a road or a track: leave them out of runs on a rig")

    def excitation(self, vehicle: Vehicle, route: Route) -> Excitation:
        """Return the height of the rollers under the wheels."""
        radius, roughness = 1.0, 1e-5  # of the rollers [m]
        rotation = SpeedProfile(route.speed.times, route.speed.speeds / (2 * math.pi * radius))
        is_driven = tuple(self.driven == "all" or number == 0 for number in range(len(vehicle.axle)))
        harmonics = 2 * roughness, roughness, roughness / 2
        return RollerRig(is_driven, rotation, random=roughness, joints=4, joint=10 * roughness, harmonics=harmonics)


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

    def __repr__(self) -> str:
        """Return the recording and the faults in words."""
        faults = ", ".join(f"{part} {100 * change:+.3g} %" for part, change in self.truth["faults"].items())
        return in_short("SimulatedDrive: " + repr(self.recording), f"faults: {faults or 'none'}")


@one_thread
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
    check_type("vehicle", vehicle, Vehicle)
    check_type("settings", settings, DriveSettings)
    if vehicle.bogie and not isinstance(settings, RailDrive):
        raise ParameterError(f"vehicle {vehicle.name!r} stands on bogies, which run on a track only: use RailDrive")
    generator = np.random.default_rng(seed)
    true = true_vehicle(vehicle, settings.deviations)
    healthy = _healthy(true, settings)
    route = _route(settings, seed, generator)
    sideways = lateral_parts(vehicle) if has_lateral_sensors(vehicle) else {}
    faults = tuple(f for f in (*settings.faults, *settings.deviations.worn) if f.component not in sideways)
    ideal, equivalents = _signals(true, healthy, settings, route, faults=faults, generator=generator)
    lateral_faults = tuple(fault for fault in settings.faults if fault.component in sideways)
    if sideways and isinstance(settings, RailDrive):
        track = _stream(seed, _LATERAL)
        for fault in lateral_faults:
            if not fault.is_constant:
                raise ParameterError(
                    f"fault {fault.component} begins later or grows, but lateral motion is simulated with constant "
                    "faults: give its size alone"
                )
        changes = {sideways[fault.component]: float(np.log(fault.factor(math.inf))) for fault in lateral_faults}
        laden = with_load(true, math.fsum(payload.mass for payload in settings.payloads))
        ideal = lateral_signals(
            ideal, laden, log_ratios=changes, quality=settings.quality, speed=route.speed, generator=track
        )
    if settings.snr is not None:
        ideal = with_noise(ideal, snr=settings.snr, generator=generator)
    recording = with_conditions(
        replace(ideal, channels=structure(vehicle).outputs.channels),  # places and axes as in the file
        vehicle,
        route=route,
        suspension=settings.suspension,
        tyre_factors=_tyre_factors(vehicle, with_faults(healthy, faults)),
    )
    imperfections = (*settings.deviations.sensor_imperfections(vehicle), *settings.imperfections)
    recording = with_imperfections(recording, imperfections, seed=_stream(seed, _SENSORS))
    number = seed if isinstance(seed, int) else seed[0]
    document = truth(healthy, seed=number, speed=route.speed, duration=settings.duration, faults=faults)
    document["faults"] |= {str(fault.component): fault.factor(math.inf) - 1 for fault in lateral_faults}
    document["conditions"] = true_conditions(
        true,
        healthy,
        payloads=settings.payloads,
        suspension=settings.suspension,
        deviations=settings.deviations,
        imperfections=imperfections,
    ) | settings.own_conditions(true, route)
    if equivalents:
        document["conditions"]["suspension"]["equivalents"] = equivalents
    if settings.fmu is not None:  # what its parts and modes are is not known here
        document |= {"modes": [], "components": {}, "fmu": settings.fmu.path.name}
    return SimulatedDrive(recording, document, route.speed)


def _route(settings: DriveSettings, seed: int | list[int], generator: np.random.Generator) -> Route:
    """Return the route of a drive; its speed comes from `generator`, so that it stays the same without curves."""
    low, high = settings.speed
    speed = random_speed(
        settings.duration,
        low=low,
        high=high,
        n_stops=settings.n_stops,
        generator=generator,
        changes=settings.driving.speed_changes,
    )
    if low == high and settings.n_stops == 0:
        speed = constant_speed(low)
    return settings.driving.route(speed, duration=settings.duration, generator=_stream(seed, _ROUTE))


def _stream(seed: int | list[int], stream: int) -> np.random.Generator:
    """Return the generator of one condition, so that switching it on leaves the others as they are."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stream,)))


def _healthy(vehicle: Vehicle, settings: DriveSettings) -> Structure:
    """Return the healthy vehicle with its payload, its production scatter, and its parts at their temperatures."""
    loaded = structure(vehicle, speed=sum(settings.speed) / 2)
    for payload in settings.payloads:
        loaded = loaded.with_payload(payload.mass, x=payload.x, y=payload.y)
    by_kind = {
        **dict.fromkeys(DAMPERS, damping_factor(settings.suspension.temperature)),
        "tyre": tyre_factor(settings.suspension.tyre_temperature),
    }
    warm = {part: by_kind[part.kind] for part in loaded.components() if part.side and part.kind in by_kind}
    return loaded.changed(warm).changed(settings.deviations.factors(loaded))


def _signals(
    vehicle: Vehicle,
    healthy: Structure,
    settings: DriveSettings,
    route: Route,
    *,
    faults: tuple[Fault, ...],
    generator: np.random.Generator,
) -> tuple[Recording, dict[str, float]]:
    """Return the signals of ideal sensors with their true places and axes, and the parts nearest to force laws."""
    excitation = settings.excitation(vehicle, route)
    driven = with_gravity(healthy, vehicle)
    if not settings.driving.is_steady:
        driven = with_body_accelerations(driven, height=_height(vehicle, settings.driving))
        excitation = Stack((excitation, BodyAccelerations(route)))
    changing = [fault for fault in faults if not fault.is_constant]
    faulty = with_faults(driven, [fault for fault in faults if fault.is_constant])
    options: dict[str, Any] = {
        "duration": settings.duration,
        "sampling_rate": settings.sampling_rate,
        "lead_in": settling_time(healthy),
    }
    force_laws, equivalents = settings.suspension.force_laws, dict[str, float]()
    if settings.fmu is not None:
        recording = simulate_fmu(settings.fmu, driven, excitation, **options, seed=generator)
    elif force_laws or changing:
        suspension = force_laws, _time_histories(changing, healthy)
        recording, equivalents = nonlinear_drive(
            faulty, excitation, suspension=suspension, **options, generator=generator
        )
    else:
        recording = simulate(faulty, excitation, **options, seed=generator)
    return with_driving_readings(recording, route), equivalents


def _height(vehicle: Vehicle, driving: Driving) -> float:
    """Return the height of the body's centre of gravity above the ground [m]."""
    return driving.height or vehicle.body.height or _HEIGHT


def _tyre_factors(vehicle: Vehicle, true: Structure) -> dict[Component, float]:
    """Return the true over the nominal stiffness of each tyre."""
    nominal, actual = structure(vehicle).components(), true.components()
    return {part: actual[part] / value for part, value in nominal.items() if part.kind == "tyre"}


def _axle_positions(vehicle: Vehicle) -> tuple[float, ...]:
    """Return the distances of the axles or wheelsets ahead of the centre of gravity [m]."""
    return tuple(wheel.x for wheel in vehicle.wheels[::2])


def _time_histories(faults: list[Fault], vehicle: Structure) -> dict[Component, TimeHistory]:
    """Return faults as time histories of their components; a step lasts a millisecond."""
    with_faults(vehicle, faults)  # refuses unknown components
    histories: dict[Component, TimeHistory] = {}
    for component in {fault.component for fault in faults}:
        same = [fault for fault in faults if fault.component == component]
        times = np.unique([time for fault in same for time in (0.0, fault.onset - 1e-3, *fault.knots)])
        histories[component] = (times, np.prod([fault.factor(times) for fault in same], axis=0))
    return histories


def driven_structure(vehicle: Vehicle, *, faults: Sequence[Fault] = ()) -> Structure:
    """Return a vehicle as drives simulate it: accelerometers read gravity, braking and curves are inputs too.

    Parameters
    ----------
    vehicle
        Vehicle with motion sensors.
    faults
        Changes of springs, dampers and tyres, at their full size.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> driven_structure(read_vehicle("zafira")).inputs[-3:]
    ('road_rear_right', 'longitudinal_acceleration', 'lateral_acceleration')
    """
    check_on_axles(vehicle, "a vehicle that brakes and corners")
    still = with_gravity(with_faults(structure(vehicle), faults), vehicle)
    return with_body_accelerations(still, height=_height(vehicle, Driving()))


def with_body_accelerations(vehicle: Structure, *, height: float) -> Structure:
    """Return the structure with the longitudinal and the lateral acceleration of the body as inputs.

    Parameters
    ----------
    vehicle
        Structure with a body on axles.
    height
        Height of the body's centre of gravity above the ground, where tyres push [m], above 0.

    Raises
    ------
    ParameterError
        If the height is not above 0, or the structure has no body on axles.

    Notes
    -----
    In ISO 8855 axes, with the mass m of the body and all that it carries: pitch moment -m h a_x (braking lowers the
    nose) and roll moment m h a_y (a curve to the left raises the left side). All of it passes through springs and
    dampers: the suspension has neither anti-dive nor a roll axis above the ground. The mass of wheels does not count.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle, structure
    >>> driven = with_body_accelerations(structure(read_vehicle("zafira")), height=0.5)
    >>> pitch = driven.coordinates.index("pitch")
    >>> driven.forces[pitch, -2:].tolist()  # N m per m/s^2 along and across; the body has 1480 kg
    [-740.0, 0.0]
    """
    check_number("height of the centre of gravity", height, above=0)
    if not {"bounce", "pitch", "roll"} <= set(vehicle.coordinates):
        raise ParameterError("the structure has no bounce, pitch and roll: only a body on axles can brake and corner")
    carried = [name for name in vehicle.coordinates if name == "bounce" or name.startswith("mounted_mass_")]
    mass = sum(vehicle.mass[row, row] for row in map(vehicle.coordinates.index, carried))
    forces = np.zeros((len(vehicle.coordinates), 2))
    forces[vehicle.coordinates.index("pitch"), 0] = -mass * height
    forces[vehicle.coordinates.index("roll"), 1] = mass * height
    return replace(vehicle, inputs=(*vehicle.inputs, *INPUTS), forces=np.hstack([vehicle.forces, forces]))


def with_gravity(vehicle: Structure, description: Vehicle) -> Structure:
    """Return the structure whose accelerometers on body and frames read gravity as they pitch and roll with them.

    Parameters
    ----------
    vehicle
        Structure of `description`, in any condition.
    description
        Vehicle with its sensors.

    Notes
    -----
    An accelerometer with the axis (d_x, d_y, d_z) reads the specific force, whose share of gravity changes by
    g (d_y roll - d_x pitch); what changes with the square of the angles is left out, and so is the constant g d_z.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle, structure
    >>> zafira = read_vehicle("zafira")
    >>> lateral = zafira.sensor[0].model_copy(update={"direction": (0.0, 1.0, 0.0)})
    >>> turned = zafira.model_copy(update={"sensor": (lateral,)})
    >>> car = with_gravity(structure(turned), turned)
    >>> round(float(car.outputs.displacement[0, car.coordinates.index("roll")]), 3)  # m/s^2 per rad
    9.81
    """
    carriers = {sensor.channel: motions_of(sensor.on)[1:] for sensor in description.sensor}
    displacement = vehicle.outputs.displacement.copy()
    for row, channel in enumerate(vehicle.outputs.channels):
        pitch, roll = carriers.get(channel.name, ("", ""))
        if channel.quantity == "acceleration" and pitch in vehicle.coordinates and channel.direction is not None:
            displacement[row, vehicle.coordinates.index(pitch)] -= GRAVITY * channel.direction[0]
            displacement[row, vehicle.coordinates.index(roll)] += GRAVITY * channel.direction[1]
    return replace(vehicle, outputs=replace(vehicle.outputs, displacement=displacement))


def with_driving_readings(recording: Recording, route: Route) -> Recording:
    """Return the recording plus what its accelerometers and yaw-rate sensors read because of driving itself.

    Parameters
    ----------
    recording
        Signals of sensors with their true axes, without the horizontal motion of the vehicle.
    route
        Speed and curves.

    Notes
    -----
    d_x a_x + d_y a_y of accelerometers, on body and wheels, and d_z times the yaw rate of gyroscopes.

    Examples
    --------
    >>> from sprung.excitation import SpeedProfile
    >>> from sprung.recording import Channel
    >>> forward = Channel("acc_x", "acceleration", direction=(1.0, 0.0, 0.0))
    >>> braking = Route(SpeedProfile([0.0, 10.0], [20.0, 0.0]), has_longitudinal=True)
    >>> run = with_driving_readings(Recording(np.zeros((1, 1000)), 100.0, (forward,)), braking)
    >>> round(float(run.samples[0, 500]), 6)
    -2.0
    """
    time = np.arange(recording.n_samples) / recording.sampling_rate
    longitudinal, lateral, yaw_rate = route.longitudinal(time), route.lateral(time), route.yaw_rate(time)
    samples = recording.samples.copy()
    for row, channel in enumerate(recording.channels):
        if channel.direction is None:
            continue
        dx, dy, dz = channel.direction
        if channel.quantity == "acceleration":
            samples[row] += dx * longitudinal + dy * lateral
        elif channel.quantity == "angular_velocity":
            samples[row] += dz * yaw_rate
    return replace(recording, samples=samples)
