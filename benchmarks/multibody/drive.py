"""Drives of the multibody vehicles on random roads, as recordings with their truth."""

import ctypes
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from benchmarks.multibody.design import Design, Effects, Faults, Rider, model_text, with_faults
from numba import njit
from scipy.signal import resample_poly
from scipy.special import k1

STEP = 1e-3  # of the engine [s]
RATE = 200.0  # of the recording [Hz]
SETTLE = 15.0  # seconds before the recording
ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}  # at 0.1 cycles per metre [m^3] (ISO 8608)
SPACING = 0.02  # of the road's profile [m]
GRAVITY = 9.81
#: Relaxation length of a tyre over its radius.
RELAXATION = 1.2

engine = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
mj_step = engine.mj_step
mj_step.argtypes, mj_step.restype = (ctypes.c_void_p, ctypes.c_void_p), None


@dataclass(frozen=True)
class Drive:
    """Conditions of ten minutes on a road."""

    duration: float = 600.0
    road: str = "C"
    speed: tuple[float, float] = (8.0, 22.0)  # mean is between these [m/s]
    riders: tuple[Rider, ...] = ()
    faults: Faults = field(default_factory=Faults)


def tracks(road: str, length: float, width: float, generator: np.random.Generator) -> np.ndarray:
    """Return heights of the left and right track of an isotropic road, shape (2, points)."""
    n = int(length / SPACING) + 1
    wavenumbers = np.fft.rfftfreq(n, SPACING)
    density = np.zeros_like(wavenumbers)
    inside = wavenumbers > 0.008
    density[inside] = ROUGHNESS[road] * (wavenumbers[inside] / 0.1) ** -2.0
    argument = 2 * np.pi * wavenumbers * width
    coherence = np.ones_like(wavenumbers)
    coherence[1:] = argument[1:] * k1(argument[1:])
    noise = generator.standard_normal((2, wavenumbers.size, 2)) @ np.array([1, 1j]) / np.sqrt(2)
    amplitude = np.sqrt(density * n / (2 * SPACING))
    common, difference = np.sqrt((1 + coherence) / 2) * noise[0], np.sqrt((1 - coherence) / 2) * noise[1]
    heights = np.fft.irfft(amplitude * np.array([common + difference, common - difference]), n)
    contact = np.ones(int(0.10 / SPACING)) / int(0.10 / SPACING)
    return np.array([np.convolve(track, contact, mode="same") for track in heights])


def slow(n: int, frequency: float, generator: np.random.Generator) -> np.ndarray:
    """Return Gaussian noise below a frequency, unit variance."""
    frequencies = np.fft.rfftfreq(n, STEP)
    spectrum = np.exp(-((frequencies / frequency) ** 2)) * (generator.standard_normal((frequencies.size, 2)) @ [1, 1j])
    noise = np.fft.irfft(spectrum, n)
    return noise / noise.std()


class Car:
    """A vehicle in the engine, standing at rest in its design position."""

    def __init__(
        self,
        design: Design,
        effects: Effects,
        riders: tuple[Rider, ...] = (),
        faults: Faults | None = None,
        tilts: np.ndarray | None = None,
    ) -> None:
        faults = faults or Faults()
        self.design, self.effects = design, effects
        self.corners = dict(with_faults(design, faults))
        healthy = mujoco.MjModel.from_xml_string(model_text(design, effects))
        self.model = mujoco.MjModel.from_xml_string(model_text(design, effects, riders, faults, tilts))
        self.data = mujoco.MjData(self.model)
        self._preload(healthy, faults)
        ids = {self.model.actuator(k).name: k for k in range(self.model.nu)}
        tyres, sides, along, valves = (
            np.array([ids[f"{corner}.{kind}"] for corner in self.corners])
            for kind in ("tyre", "side", "along", "valve")
        )
        self.tyre_ratio = np.array([axle.tyre_damping / axle.tyre for axle in self.corners.values()])
        self.places = np.array([axle.x for axle in self.corners.values()])
        joint = mujoco.mjtTrn.mjTRN_JOINT
        self.controls = Controls(
            tyres,
            sides,
            along,
            valves,
            dampers=np.array([axle.damper for axle in self.corners.values()]) * effects.valves,
            extends=np.where(self.model.actuator_trntype[valves] == joint, -1.0, 1.0),
            cornering=np.array([axle.cornering for axle in self.corners.values()]) * effects.side_forces,
            steers=np.array([float(axle.steers) for axle in self.corners.values()]),
            relaxation=np.array([RELAXATION * axle.radius for axle in self.corners.values()]),
        )
        self.mass = float(self.model.body_mass.sum())
        if effects.valves:
            for corner in self.corners:
                self._damping(corner, 0.35 * self.corners[corner].damper)

    def _damping(self, corner: str, value: float) -> None:
        if self.corners[corner].linkage == "macpherson":
            self.model.dof_damping[self.model.joint(f"{corner}.damper").dofadr[0]] = value
        else:
            self.model.tendon_damping[self.model.tendon(f"{corner}.damper").id] = value

    def _preload(self, healthy: mujoco.MjModel, faults: Faults) -> None:
        """Make the springs as long and the tyres as loaded as the vehicle without load and faults needs them."""
        ratios, travel, data = ratios_at_wheels(healthy, tuple(self.corners))
        loads = wheel_loads(self.design)
        carried = loads - travel.T @ data.qfrc_bias
        tension = np.linalg.solve(ratios.T, carried)
        for k, corner in enumerate(self.corners):
            spring = healthy.tendon(f"{corner}.spring").id
            length = data.ten_length[spring]
            free = length - tension[k] / (healthy.tendon_stiffness[spring] * faults(f"{corner}.rate"))
            self.model.tendon_lengthspring[self.model.tendon(f"{corner}.spring").id] = free
            if self.effects.bump_stops:
                stop = length - 0.06 * faults(f"{corner}.stop") * abs(ratios[k, k])
                self.model.tendon_lengthspring[self.model.tendon(f"{corner}.stop").id] = (stop, 10.0)
            tyre = self.model.actuator(f"{corner}.tyre").id
            stiffness = healthy.actuator(f"{corner}.tyre").gainprm[0]
            hub = data.site(f"{corner}.hub").xpos[2]
            now = self.model.actuator_gainprm[tyre, 0]
            self.model.actuator_biasprm[tyre, 0] = now * (hub + loads[k] / stiffness)

    def steps(self, prepared: "Prepared", n: int) -> np.ndarray:
        """Take the first steps of a drive; return what the sensors feel, shape (n, sensor values)."""
        felt = np.empty((n, self.data.sensordata.size))
        state = State(
            self.model._address,
            self.data._address,
            self.data.ctrl,
            self.data.actuator_velocity,
            self.data.qpos,
            self.model.opt.gravity,
            self.model.actuator_dynprm,
            self.data.sensordata,
        )
        _take(state, self.controls, prepared, felt)
        return felt


class Controls(NamedTuple):
    """Actuators of a vehicle by wheel, and what their forces follow; 0 for what a vehicle lacks."""

    tyres: np.ndarray
    sides: np.ndarray
    along: np.ndarray
    valves: np.ndarray
    dampers: np.ndarray  # [N s/m]
    extends: np.ndarray  # sign of the length of a damper
    cornering: np.ndarray  # [N/rad]
    steers: np.ndarray  # 1 for a wheel that does
    relaxation: np.ndarray  # distance rolled until a side force has grown to all but 1/e [m]


class State(NamedTuple):
    """Addresses of a model and its data in the engine, and views of their values."""

    model: int
    data: int
    ctrl: np.ndarray
    velocity: np.ndarray
    qpos: np.ndarray
    gravity: np.ndarray
    lags: np.ndarray  # of actuators, the first of each row is a time [s]
    sensors: np.ndarray


class Prepared(NamedTuple):
    """What a drive does to a vehicle at each step of the engine."""

    speed: np.ndarray  # [m/s]
    road: np.ndarray  # of the tyres' springs and dampers [m]
    along: np.ndarray  # drive and brake forces [N]
    steering: np.ndarray  # [rad]
    pull: np.ndarray  # apparent acceleration along and across [m/s^2]


@njit
def _take(state: State, of: Controls, way: Prepared, felt: np.ndarray) -> None:
    """Take steps of the engine, each with the side forces and the valves of its dampers for the state before."""
    ctrl, velocity = state.ctrl, state.velocity
    for k in range(len(felt)):
        yaw = state.qpos[3]
        steering = way.steering[k] - 0.01 * state.qpos[1] - 0.25 * yaw
        for wheel in range(of.tyres.size):
            ctrl[of.tyres[wheel]] = way.road[k, wheel]
            ctrl[of.along[wheel]] = way.along[k, wheel]
            slip = yaw + steering * of.steers[wheel] - velocity[of.sides[wheel]] / way.speed[k]
            ctrl[of.sides[wheel]] = of.cornering[wheel] * slip
            state.lags[of.sides[wheel], 0] = of.relaxation[wheel] / way.speed[k]
            u = of.extends[wheel] * velocity[of.valves[wheel]]
            ctrl[of.valves[wheel]] = -of.extends[wheel] * of.dampers[wheel] * (law(u) - 0.35 * u)
        state.gravity[:2] = way.pull[k]
        mj_step(state.model, state.data)
        felt[k] = state.sensors


@njit
def law(velocity: float) -> float:
    """Return the force of a damper by its slope: harder in rebound, a knee at 0.15 m/s."""
    size = abs(velocity)
    bent = min(size, 0.15) + 0.5 * max(size - 0.15, 0.0)
    return (1.3 if velocity > 0 else 0.7) * np.sign(velocity) * bent


def ratios_at_wheels(
    model: mujoco.MjModel, corners: tuple[str, ...], data: mujoco.MjData | None = None
) -> tuple[np.ndarray, np.ndarray, mujoco.MjData]:
    """Return the springs' change of length by the wheels' travel, the travel's velocities, and the data at rest.

    Each wheel in turn moves up beside a body at rest; joints of loops close, mounts do not give.
    """
    data = data or mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    free = [k for k in range(6, model.nv) if not model.joint(int(model.dof_jntid[k])).name.endswith((".mount", ".rod"))]
    rows, jacobian = [], np.zeros((3, model.nv))
    for corner in corners:
        mujoco.mj_jacSite(model, data, jacobian, None, model.site(f"{corner}.hub").id)
        rows.append(jacobian[2].copy())
    for k in range(model.neq):
        first, second = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, first, None, model.eq_obj1id[k])
        mujoco.mj_jacSite(model, data, second, None, model.eq_obj2id[k])
        rows.extend(first - second)
    system = np.array(rows)[:, free]
    travel = np.zeros((model.nv, len(corners)))
    travel[free] = np.linalg.lstsq(system, np.eye(len(rows))[:, : len(corners)], rcond=1e-9)[0]
    springs = [model.tendon(f"{corner}.spring").id for corner in corners]
    return tendon_jacobian(model, data)[springs] @ travel, travel, data


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the dense Jacobian of the tendons' lengths."""
    jacobian = np.zeros((model.ntendon, model.nv))
    for k in range(model.ntendon):
        start, count = model.ten_J_rowadr[k], model.ten_J_rownnz[k]
        jacobian[k, model.ten_J_colind[start : start + count]] = data.ten_J.ravel()[start : start + count]
    return jacobian


def wheel_loads(design: Design) -> np.ndarray:
    """Return the loads of the wheels at rest, without riders [N]; three axles share by their springs."""
    x = np.array([axle.x for axle in design.axles])
    unsprung = np.array([2 * axle.wheel_mass for axle in design.axles])
    springs = np.diag([axle.spring for axle in design.axles])
    moments = np.array([np.ones(x.size), x])
    sprung = springs @ moments.T @ np.linalg.solve(moments @ springs @ moments.T, [design.mass, 0.0])
    return np.repeat(0.5 * (sprung + unsprung) * GRAVITY, 2)


def prepared(car: Car, drive: Drive, generator: np.random.Generator) -> Prepared:
    """Return road, speed and curves of a drive."""
    n = round((drive.duration + SETTLE) / STEP)
    low, high = drive.speed
    mean = generator.uniform(low + 0.3 * (high - low), high - 0.3 * (high - low))
    speed = np.clip(mean + 0.3 * (high - low) * slow(n, 0.02, generator), 0.7 * low, 1.2 * high)
    distance = np.cumsum(speed) * STEP + 20.0
    profile = tracks(drive.road, float(distance[-1]) + 30.0, 1.5, generator)
    sides = np.tile([0, 1], len(car.corners) // 2)
    along = np.arange(profile.shape[1]) * SPACING
    heights = np.stack(
        [np.interp(distance + x, along, profile[side]) for x, side in zip(car.places, sides, strict=True)], axis=1
    )
    if car.effects.runout:
        radii = np.array([axle.radius for axle in car.corners.values()])
        start = generator.uniform(0, 2 * np.pi, radii.size)
        slip = 1 + generator.uniform(-2e-3, 2e-3, radii.size)
        heights += car.effects.runout * np.sin(distance[:, None] * slip / radii + start)
    ramp = np.minimum(np.arange(n) * STEP / 3.0, 1.0)
    heights *= ramp[:, None]
    road = heights + car.tyre_ratio * np.gradient(heights, STEP, axis=0)
    forward = np.gradient(speed, STEP) if car.effects.braking else np.zeros(n)
    sideways = ramp * car.effects.cornering * slow(n, 0.06, generator) if car.effects.side_forces else np.zeros(n)
    sideways = np.clip(sideways, -4.0, 4.0)
    share = np.where(car.places > 0, 0.6, 0.4)
    force = car.mass * (ramp * forward)[:, None] * share / share.sum()
    base = car.design.axles[0].x - car.design.axles[-1].x
    return Prepared(speed, road, force, sideways * base / speed**2, -np.stack([ramp * forward, sideways], axis=1))


def driven(
    design: Design, effects: Effects, drive: Drive, *, individual: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Drive; return the accelerations, shape (n, sensors), and the speed as recorded at 200 Hz.

    Tilt and offset of the sensors belong to the individual, everything else to the drive.
    """
    mounting, generator = np.random.default_rng([individual, 7]), np.random.default_rng([individual, seed, 8])
    tilts = np.radians(effects.tilt) * mounting.standard_normal((4, 2))
    offsets = effects.offset * mounting.standard_normal(4)
    car = Car(design, effects, drive.riders, drive.faults, tilts)
    way = prepared(car, drive, generator)
    felt = car.steps(way, way.speed.size)
    down = round(1 / STEP / RATE)
    begin = round(SETTLE / STEP)
    vertical = resample_poly(felt[:, 2::3], 1, down)[begin // down :]
    samples = vertical + offsets + effects.noise * generator.standard_normal(vertical.shape)
    if effects.quantum:
        samples = effects.quantum * np.round(samples / effects.quantum)
    return samples, measured_speed(way.speed[begin::down], effects, begin // down, way.speed[::down])


def measured_speed(speed: np.ndarray, effects: Effects, skipped: int, whole: np.ndarray) -> np.ndarray:
    """Return the speed as a receiver gives it: once a second and late."""
    if not effects.gps_delay:
        return speed
    times = skipped + np.arange(speed.size)
    seen = (times // RATE) * RATE - effects.gps_delay * RATE
    return np.interp(seen, np.arange(whole.size), whole)
