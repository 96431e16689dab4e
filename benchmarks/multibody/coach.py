"""A coach on rails in a general multibody engine: modes, responses and diagnoses of lateral and vertical parts.

    python -m benchmarks.multibody.coach modes        eigenvalues and responses beside those of `sprung.vehicles`
    python -m benchmarks.multibody.coach diagnose     baseline, healthy drives never met, faults; `--help` for more
    python -m benchmarks.multibody.coach track        alignment and level from these drives beside those of the rails
    python -m benchmarks.multibody.coach wheels       run-out of wheels that are not round beside the truth

Body, frames and wheelsets are free bodies with six degrees of freedom each; springs, dampers, traction rods and
anti-roll bars act between points at their places. Wheels are cones on rails, with the creep forces of Kalker, limited
by friction (Shen, Hedrick and Elkins), growing with the load to the power 2/3. The vehicle file states what a
maintainer knows; the mountings of sensors and the coupler are not in it.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import mujoco
import numpy as np
from benchmarks.multibody.design import part
from scipy.signal import resample_poly

from sprung.excitation import (
    Joints,
    SpeedChanges,
    SpeedProfile,
    SurfaceMotion,
    rail_alignment,
    rail_quality,
    random_speed,
)
from sprung.formats import read, write
from sprung.likelihood import fit_corners, run_out
from sprung.likelihood.fitting import fit_windows
from sprung.likelihood.lateral import fit_lateral_under
from sprung.modal import INTERVAL_95
from sprung.recording import Channel, Recording
from sprung.road import road_profile, track_of
from sprung.road.level import RANGES, Levels, in_range
from sprung.vehicles import Sensor, Vehicle, read_vehicle, state_space, structure, write_vehicle
from sprung.vehicles.lateral import lateral_outputs, lateral_parts, lateral_system
from sprung.vehicles.window import window_of

GRAVITY = 9.80665
STEP = 5e-4  # of the engine [s]
RATE = 100.0  # of a recording [Hz]
SETTLE = 10.0  # seconds before a recording
FRICTION = 0.35  # of wheel and rail
SPIN_INERTIA = 112.0  # of a wheelset about its axle [kg m^2]
ROD = (5e6, 2.5e4, 0.6)  # stiffness [N/m], damping [N s/m] and height [m] of a traction rod
YAW_DAMPERS = (1.3, 0.65)  # lateral place and height of yaw dampers [m]
CONTACT_DAMPING = 1e6  # of a wheel on its rail [N s/m]: that of the ballast, without which wheels leave stiff rails
JOINT = 0.7e-3  # depth of a dipped joint of a track in order [m]
COUPLER = 1.05  # height of the coupler [m]
NOISE = 0.01  # of an accelerometer [m/s^2]
TILT = 0.5  # standard deviation of the mounting of an accelerometer [degrees]


def described() -> Vehicle:
    """Return the vehicle file of the shipped coach with yaw dampers and lateral sensors on frames and body."""
    vehicle = read_vehicle("coach")
    common = {"quantity": "acceleration", "unit": "m/s^2", "direction": (0.0, 1.0, 0.0)}
    sensors = [
        Sensor(channel=f"bogie{number}_{end}y", position=(x, 0.0, 0.1), on=f"bogie{number}", **common)
        for number in (1, 2)
        for end, x in (("f", 1.28), ("r", -1.28))
    ]
    sensors += [
        Sensor(channel=f"body_{end}y", position=(x, 0.0, -0.7), **common) for end, x in (("f", 9.5), ("r", -9.5))
    ]
    bogies = []
    for bogie in vehicle.bogie:
        lateral = bogie.lateral
        damping = 2.5e5 / YAW_DAMPERS[0] ** 2, lateral.secondary_damping[1]
        places = {"secondary_damping": damping, "traction_rod": ROD, "yaw_damper_place": YAW_DAMPERS}
        changed = lateral.model_copy(update=places)
        bogies.append(bogie.model_copy(update={"lateral": changed}))
    return vehicle.model_copy(update={"sensor": (*vehicle.sensor, *sensors), "bogie": tuple(bogies)})


@dataclass(frozen=True)
class Drive:
    """Conditions of a drive: track of ERRI B176, range of speed [m/s], load [kg], values over those of the file.

    `run_out` are amplitudes of each wheel [m] once in a turn; twice in a turn it has four tenths of that.
    """

    duration: float = 300.0
    track: str = "good"
    speed: tuple[float, float] = (30.0, 36.0)
    load: float = 0.0
    has_joints: bool = False
    factors: Mapping[str, float] = field(default_factory=dict)
    run_out: tuple[float, ...] = ()

    def __call__(self, name: str) -> float:
        """Return the value of a part over that of the file."""
        return self.factors.get(name, 1.0)


class Coach:
    """The coach in the engine, on its wheels in its design position, seen from a frame that travels along the track."""

    def __init__(
        self, vehicle: Vehicle, drive: Drive, speed: float, *, step: float = STEP, tilts: np.ndarray | None = None
    ):
        self.vehicle, self.drive, self.speed = vehicle, drive, speed
        self.root = Element("mujoco")
        part(self.root, "option", timestep=step, integrator="implicitfast", gravity=(0, 0, -GRAVITY))
        part(self.root[0], "flag", contact="disable", constraint="disable")
        self.world = part(self.root, "worldbody")
        part(self.world, "site", name="world")
        self.tendons, self.actuators, self.sensors = (part(self.root, tag) for tag in ("tendon", "actuator", "sensor"))
        self.bodies: dict[str, tuple[Element, np.ndarray]] = {}
        self._bodies()
        self._suspension()
        self._contacts()
        for sensor, tilt in zip(
            vehicle.sensor, np.zeros((len(vehicle.sensor), 3)) if tilts is None else tilts, strict=True
        ):
            part(self.bodies[sensor.on][0], "site", name=sensor.channel, pos=sensor.position, euler=np.degrees(tilt))
            part(self.sensors, "accelerometer", name=sensor.channel, site=sensor.channel)
        self.model = mujoco.MjModel.from_xml_string(ElementTree.tostring(self.root, encoding="unicode"))
        self.data = mujoco.MjData(self.model)
        self._index()

    def _bodies(self) -> None:
        vehicle, body = self.vehicle, self.vehicle.body
        pitch, roll = vehicle.inertias
        self._free("body", (0, 0, body.height), body.mass + self.drive.load, (roll, pitch, body.yaw_inertia or pitch))
        wheelset = 0
        for number, bogie in enumerate(vehicle.bogie, start=1):
            lateral = bogie.lateral
            inertias = bogie.roll_inertia, bogie.pitch_inertia, lateral.yaw_inertia
            self._free(f"bogie{number}", (bogie.x, 0, lateral.frame_height), bogie.mass, inertias)
            for along in (1, -1):
                wheelset += 1
                place = (bogie.x + along * bogie.half_wheelbase, 0, lateral.wheel_radius)
                carrier = self._free(f"wheelset{wheelset}", place, 1.0, (1.0, 1.0, 1.0))
                wheels = part(carrier, "body", name=f"wheels{wheelset}")
                part(wheels, "joint", name=f"wheelset{wheelset}.spin", axis=(0, 1, 0))
                about = (bogie.wheelset_roll_inertia - 1, SPIN_INERTIA, lateral.wheelset_yaw_inertia - 1)
                part(wheels, "inertial", pos=(0, 0, 0), mass=bogie.wheelset_mass - 1, diaginertia=about)

    def _free(self, name: str, place: tuple, mass: float, inertia: tuple) -> Element:
        """Add a rigid body that moves freely; a wheelset pitches by the spin of its wheels alone."""
        body = part(self.world, "body", name=name, pos=place)
        axes = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "yaw": (0, 0, 1), "pitch": (0, 1, 0), "roll": (1, 0, 0)}
        for motion, axis in axes.items():
            if motion == "pitch" and name.startswith("wheelset"):
                continue
            kind = "slide" if len(motion) == 1 else "hinge"
            held = {"stiffness": 3e3, "damping": 3e4} if (name, motion) == ("body", "x") else {}  # by its coupler
            part(body, "joint", name=f"{name}.{motion}", type=kind, axis=axis, **held)
        part(body, "inertial", pos=(0, 0, 0), mass=mass, diaginertia=inertia)
        self.bodies[name] = body, np.array(place, dtype=float)
        return body

    def _element(
        self, name: str, ends: tuple[str, str], place: tuple, *, k: tuple, c: tuple, load: float = 0.0
    ) -> None:
        """Add springs and dampers along three axes between one point of two bodies, which carry a load."""
        sites = tuple(f"{name}@{body}" for body in ends)
        for body, site in zip(ends, sites, strict=True):
            part(self.bodies[body][0], "site", name=site, pos=np.array(place) - self.bodies[body][1])
        for axis in range(3):
            if k[axis] or c[axis]:
                self._force(f"{name}.{'xyz'[axis]}", sites, axis, (load if axis == 2 else 0.0, -k[axis], -c[axis]))

    def _force(self, name: str, sites: tuple[str, ...], axis: int, law: tuple, **more: object) -> None:
        """Add a force between two sites: constant, by their distance along an axis, and by its rate."""
        site, refsite = sites
        law_of_engine = {"biastype": "affine", "biasprm": law}
        place = {"site": site, "refsite": refsite, "gear": np.eye(6)[axis]}
        part(self.actuators, "general", name=name, **place, **law_of_engine, **({"gainprm": 1} | more))

    def _suspension(self) -> None:
        drive, body = self.drive, self.vehicle.body
        on_spring = GRAVITY * body.mass / (2 * len(self.vehicle.bogie))
        for number, bogie in enumerate(self.vehicle.bogie, start=1):
            frame, lateral, (primary, secondary) = f"bogie{number}", bogie.lateral, bogie.half_spacing
            for side, y in (("left", 1), ("right", -1)):
                owner = f"{frame}_{side}"
                k = (*lateral.secondary_stiffness, bogie.secondary_stiffness * drive(f"{owner}.secondary_spring"))
                k = (k[0], k[1] * drive(f"{frame}.lateral_spring"), k[2])
                c = (
                    0,
                    lateral.secondary_damping[1] * drive(f"{frame}.lateral_damper"),
                    bogie.secondary_damping * drive(f"{owner}.secondary_damper"),
                )
                place = (bogie.x, y * secondary, lateral.secondary_height)
                self._element(owner, ("body", frame), place, k=k, c=c, load=on_spring)
                place = (bogie.x, y * YAW_DAMPERS[0], YAW_DAMPERS[1])
                yaw = lateral.secondary_damping[0] * drive(f"{frame}.yaw_damper")
                self._element(f"{owner}_yaw", ("body", frame), place, k=(0, 0, 0), c=(yaw, 0, 0))
                for end, along in (("front", 1), ("rear", -1)):
                    owner = f"{frame}_{end}_{side}"
                    k = (
                        lateral.primary_stiffness[0] * drive(f"{frame}.primary_longitudinal_spring"),
                        lateral.primary_stiffness[1] * drive(f"{frame}.primary_lateral_spring"),
                        bogie.primary_stiffness * drive(f"{owner}.primary_spring"),
                    )
                    c = (*lateral.primary_damping, bogie.primary_damping * drive(f"{owner}.primary_damper"))
                    place = (bogie.x + along * bogie.half_wheelbase, y * primary, lateral.wheel_radius)
                    box = on_spring / 2 + GRAVITY * bogie.mass / 4
                    wheelset = f"wheelset{2 * number - (along > 0)}"
                    self._element(owner, (frame, wheelset), place, k=k, c=c, load=box)
            rod, ends, place = f"{frame}_rod", ("body", frame), (bogie.x, 0, ROD[2])
            self._element(rod, ends, place, k=(ROD[0], 0, 0), c=(ROD[1], 0, 0))
            self._force(f"{frame}_bar", (f"{rod}@body", f"{rod}@{frame}"), 3, (0, -bogie.anti_roll_stiffness, 0))

    def _contacts(self) -> None:
        bogies = [bogie for bogie in self.vehicle.bogie for _ in range(2)]
        for number, bogie in enumerate(bogies, start=1):
            radius, half, k = bogie.lateral.wheel_radius, bogie.contact_half_spacing, bogie.contact_stiffness
            for side, y in (("left", half), ("right", -half)):
                site = f"wheelset{number}_{side}"
                part(self.bodies[f"wheelset{number}"][0], "site", name=site, pos=(0, y, -radius))
                load = GRAVITY * (bogie.wheelset_mass / 2 + bogie.mass / 4 + self.vehicle.body.mass / 8)
                law = load, -k, -CONTACT_DAMPING
                self._force(f"{site}.z", (site, "world"), 2, law, gainprm=k, forcerange=(0, 1e7))
                self._force(f"{site}.y", (site, "world"), 1, (0, 0, -1))
                slip = part(self.tendons, "fixed", name=site)
                for motion, share in (("x", 1), ("yaw", -y), ("spin", -radius)):
                    part(slip, "joint", joint=f"wheelset{number}.{motion}", coef=share)
                law_of_engine = {"gainprm": 1, "biastype": "affine", "biasprm": (0, 0, -1)}
                part(self.actuators, "general", name=f"{site}.x", tendon=site, **law_of_engine)

    def _index(self) -> None:
        names = [
            f"wheelset{number}_{side}"
            for number in range(1, 1 + 2 * len(self.vehicle.bogie))
            for side in ("left", "right")
        ]
        self.along, self.across, self.upright = (
            np.array([self.model.actuator(f"{name}.{axis}").id for name in names]) for axis in "xyz"
        )
        dof = {
            axis: np.array([self.model.joint(f"{name.split('_')[0]}.{axis}").dofadr[0] for name in names])
            for axis in ("yaw", "roll", "spin")
        }
        self.yaw, self.roll, self.spin = dof["yaw"], dof["roll"], dof["spin"]
        self.side, bogie = np.tile([1.0, -1.0], len(names) // 2), self.vehicle.bogie[0]
        self.across_rest = self.side * bogie.contact_half_spacing
        self.radius, self.cone = bogie.lateral.wheel_radius, bogie.lateral.conicity * self.drive("wheelsets.conicity")
        self.creep, self.stiffness = np.array(bogie.lateral.creep), bogie.contact_stiffness
        self.load = float(self.model.actuator_biasprm[self.upright[0], 0])
        springs = [
            name.removesuffix(".z")
            for name in (self.model.actuator(k).name for k in range(self.model.nu))
            if name.startswith("bogie") and name.endswith(".z")
        ]
        ids = {axis: np.array([self.model.actuator(f"{name}.{axis}").id for name in springs]) for axis in "xyz"}
        self.sheared = np.array([ids["x"], ids["y"]])
        below = self.model.site_bodyid[self.model.actuator_trnid[ids["z"], 1]]
        self.carried = np.zeros((self.model.nbody, below.size))
        self.carried[below, np.arange(below.size)] = self.model.actuator_biasprm[ids["z"], 0]
        self.mass = float(self.model.body_mass.sum()) + len(names) / 2 * SPIN_INERTIA / self.radius**2
        self.data.qvel[self.spin] = self.speed / self.radius

    def step(self, track: np.ndarray, speed: float, acceleration: float = 0.0) -> None:
        """Take one step of the engine.

        Rows of the track: alignment and height of the rail below each wheel [m], and the rates of both [m/s].
        """
        model, data, ctrl = self.model, self.data, self.data.ctrl
        model.opt.gravity[0] = -acceleration
        data.xfrc_applied[1, 0] = self.mass * acceleration
        mujoco.mj_step1(model, data)
        along, across = data.actuator_length[self.sheared]  # springs lean on what is below them
        data.xfrc_applied[:, 3], data.xfrc_applied[:, 4] = -self.carried @ across, self.carried @ along
        data.xfrc_applied[1, 4] += (COUPLER - self.vehicle.body.height) * self.mass * acceleration
        aside = self.side * self.cone * (data.actuator_length[self.across] - self.across_rest - track[0])
        lengths, velocities = data.actuator_length, data.actuator_velocity
        rising = track[3] + self.side * self.cone * (velocities[self.across] - track[2])
        ctrl[self.upright] = heights = track[1] + aside + rising * CONTACT_DAMPING / self.stiffness
        normal = (
            self.load + self.stiffness * (heights - lengths[self.upright]) - CONTACT_DAMPING * velocities[self.upright]
        )
        normal = np.maximum(normal, 1.0)
        yaw, lean = data.qpos[self.yaw], data.qpos[self.roll] + self.side * self.cone
        rolled = speed * (1 - aside / self.radius)
        creep = self.creep[:, None] * (normal / self.load) ** (2 / 3) / speed
        forces = creep * np.array([velocities[self.along] + rolled, velocities[self.across] - speed * yaw])
        wanted = np.maximum(np.hypot(*forces) / (FRICTION * normal), 1e-9)
        limited = np.minimum(wanted, 3.0)
        creep = creep * (1 - limited / 3 + limited**2 / 27) * limited / wanted
        model.actuator_biasprm[self.along, 2], model.actuator_biasprm[self.across, 2] = -creep
        ctrl[self.along] = -creep[0] * rolled
        ctrl[self.across] = creep[1] * speed * yaw - normal * lean
        mujoco.mj_step2(model, data)


def linearised(coach: Coach, speed: float) -> tuple[np.ndarray, ...]:
    """Return A, B, C and D of one step of the engine about its rest; inputs are those of `Coach.step`, row by row."""
    model, data = coach.model, coach.data
    spins = np.unique(coach.spin)
    rest = np.concatenate([data.qpos, data.qvel])

    def after(state: np.ndarray, track: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = np.split(state, 2)
        coach.step(track.reshape(4, -1), speed)
        return np.concatenate([data.qpos, data.qvel, data.sensordata])

    track, columns = np.zeros(4 * coach.side.size), []
    for size, steps in ((rest.size, np.eye(rest.size)), (track.size, np.eye(track.size))):
        for row in 1e-6 * steps:
            ends = [
                after(rest + s * row, track) if size == rest.size else after(rest, track + s * row) for s in (1, -1)
            ]
            columns.append((ends[0] - ends[1]) / 2e-6)
    whole = np.array(columns).T
    n = rest.size
    kept = np.setdiff1d(np.arange(n), spins)
    return whole[np.ix_(kept, kept)], whole[kept, n:], whole[n:, kept], whole[n:, n:]


def compared_modes(vehicle: Vehicle, speed: float, *, highest: float = 20.0) -> None:
    """Print the modes of the two models of the vehicle beside the most similar ones of the engine."""
    coach = Coach(vehicle, Drive(), speed, step=1e-5)
    state_matrix = linearised(coach, speed)[0]
    spins = np.unique(coach.spin)
    dofs = [coach.model.joint(int(joint)).name for joint in coach.model.dof_jntid]
    kept = [name for k, name in enumerate(dofs) if k not in spins]
    eigenvalues, vectors = np.linalg.eig(state_matrix)
    poles = np.log(eigenvalues.astype(complex)) / coach.model.opt.timestep
    ours = {"lateral": lateral_system(vehicle, speed=speed), "vertical": structure(vehicle, speed=speed).system}
    print("| at", f"{speed:.0f} m/s", "| ours [Hz] | engine [Hz] | deviation [%] | ours [%] | engine [%] | MAC |")
    print("|---|---|---|---|---|---|---|")
    for kind, system in ours.items():
        rows = [kept.index(engine_name(name)) for name in system.coordinates]
        own_poles, own = np.linalg.eig(system.state_matrix())
        for pole, shape in sorted(zip(own_poles, own[: len(rows)].T, strict=True), key=lambda mode: abs(mode[0])):
            if not (pole.imag > 1e-3 and 1.0 < abs(pole) < 2 * np.pi * highest):  # not that of the coupler
                continue
            candidates = vectors[rows]
            mac = np.abs(shape.conj() @ candidates) ** 2 / (
                np.sum(np.abs(candidates) ** 2, axis=0) * np.vdot(shape, shape).real
            )
            near = np.where((poles.imag > 1e-3) & (np.abs(np.abs(poles) / abs(pole) - 1) < 0.5), mac, 0.0)
            best = poles[np.argmax(near)]
            values = (
                abs(pole) / 2 / np.pi,
                abs(best) / 2 / np.pi,
                100 * (abs(pole / best) - 1),
                -100 * pole.real / abs(pole),
                -100 * best.real / abs(best),
                near.max(),
            )
            print(
                f"| {kind} | "
                + " | ".join(f"{value:.{digits}f}" for value, digits in zip(values, (3, 3, 1, 1, 1, 2), strict=True))
                + " |"
            )


def engine_name(coordinate: str) -> str:
    """Return the joint of the engine that moves as a coordinate; wheelsets of a frame roll along the track as one."""
    part, _, motion = coordinate.rpartition("_")
    if not part and motion not in ("bounce", "pitch", "roll", "sway", "yaw", "surge"):
        part, motion = motion, "bounce"
    if motion == "rolling":
        part, motion = f"wheelset{2 * int(part[-1])}", "surge"
    axes = {"bounce": "z", "sway": "y", "surge": "x"}
    return f"{part or 'body'}.{axes.get(motion, motion)}"


def compared_responses(vehicle: Vehicle, speed: float) -> None:
    """Print the RMS deviation of responses of lateral sensors to the track, over that of the engine's."""
    step, omega = 1e-4, 2 * np.pi * np.arange(0.5, 12.1, 0.5)
    a, b, c, d = linearised(Coach(vehicle, Drive(), speed, step=step), speed)
    b, d = (
        matrix[:, : len(matrix.T) // 2] + 1j * omega[:, None, None] * matrix[:, len(matrix.T) // 2 :]
        for matrix in (b, d)
    )
    engine = c @ np.linalg.solve(np.exp(1j * omega * step)[:, None, None] * np.eye(len(a)) - a, b) + d
    wheels, bogie, outputs = vehicle.wheels, vehicle.bogie[0], lateral_outputs(vehicle)
    delays = np.exp(-1j * np.outer(omega, [wheels[0].x - wheel.x for wheel in wheels]) / speed)
    rows = [3 * k + 1 for k, sensor in enumerate(vehicle.sensor) if sensor.channel in outputs.names]
    space = state_space(lateral_system(vehicle, speed=speed), outputs)
    states = np.linalg.solve(
        1j * omega[:, None, None] * np.eye(len(space.state_matrix)) - space.state_matrix,
        np.broadcast_to(space.input_matrix, (omega.size, *space.input_matrix.shape)),
    )
    ours = space.output_matrix @ states + space.feedthrough
    sides = bogie.contact_half_spacing * np.tile([1.0, -1.0], len(wheels) // 2)
    n, pair = len(wheels), slice(0, None, 2)
    for kind, track, columns in (
        ("alignment", np.hstack([delays, 0 * delays]), slice(0, n // 2)),
        ("cross level", np.hstack([0 * delays, delays * sides]), slice(n // 2, n)),
    ):
        exact = np.einsum("fsi,fi->fs", engine[:, rows], track)
        model = np.einsum("fsi,fi->fs", ours[..., columns], delays[:, pair])
        print(
            f"{kind} at {speed:.0f} m/s, 0.5 to 12 Hz:",
            *(
                f"{name} {100 * value:.1f} %"
                for name, value in zip(
                    outputs.names, np.linalg.norm(model - exact, axis=0) / np.linalg.norm(exact, axis=0), strict=True
                )
            ),
        )


def rails(
    vehicle: Vehicle, drive: Drive, seed: int
) -> tuple[SpeedProfile, np.ndarray, np.ndarray, np.random.Generator]:
    """Return the speed of a drive, the times of the steps, the track below, and the generator for what follows."""
    generator, n = np.random.default_rng([seed, 8]), round((drive.duration + SETTLE) / STEP)
    gentle = SpeedChanges((0.05, 0.2), (0.05, 0.2), (30.0, 90.0))
    low, high = drive.speed
    profile = random_speed(drive.duration + SETTLE, low=low, high=high, generator=generator, changes=gentle)
    time = STEP * np.arange(n)
    return profile, time, track_below(vehicle, drive, profile, time, generator), generator


def driven(vehicle: Vehicle, drive: Drive, seed: int) -> Recording:
    """Return the recording of a drive; the mountings of the accelerometers are the same in all."""
    profile, time, track, generator = rails(vehicle, drive, seed)
    n_sensors, n, mounted = len(vehicle.sensor), time.size, np.random.default_rng(7)
    tilts = np.radians(TILT) * mounted.standard_normal((n_sensors, 3))
    speed = profile.speed(time)
    coach = Coach(vehicle, drive, float(speed[0]), tilts=tilts)
    acceleration = np.gradient(speed, STEP)
    felt = np.empty((n, 3 * n_sensors))
    for k in range(n):
        coach.step(track[:, :, k], speed[k], acceleration[k])
        felt[k] = coach.data.sensordata
    axes = np.argmax([sensor.direction for sensor in vehicle.sensor], axis=1)
    readings = felt.reshape(n, n_sensors, 3)[:, np.arange(n_sensors), axes]
    down = round(1 / (STEP * RATE))
    samples = resample_poly(readings, 1, down)[round(SETTLE * RATE) :].T
    samples = samples + NOISE * generator.standard_normal(samples.shape)
    rolling = speed[round(SETTLE / STEP) :: down]
    channels = (*(sensor.as_channel() for sensor in vehicle.sensor), Channel("speed", "speed"))
    return Recording(np.vstack([samples, rolling]), RATE, channels)


def track_below(
    vehicle: Vehicle, drive: Drive, profile: SpeedProfile, time: np.ndarray, generator: np.random.Generator
) -> np.ndarray:
    """Return the track of `Coach.step` over time from rest, shape (4, wheels, times)."""
    places = tuple(wheel.x for wheel in vehicle.wheels[::2])
    motions = [
        SurfaceMotion(rail, places, profile, contact_length=0.01, obstacles=joints).at(time, generator)
        for rail, joints in (
            (rail_alignment(drive.track), ()),
            (rail_quality(drive.track), (Joints(depth=JOINT),) * drive.has_joints),
        )
    ]
    middle = motions[0].reshape(len(places), 2, -1).mean(axis=1)
    for wheel, amplitude in enumerate(drive.run_out):
        angle = profile.distance(time) / (
            vehicle.bogie[0].lateral.wheel_radius * (1 + RADII * generator.standard_normal())
        )
        first, second = generator.uniform(0, 2 * np.pi, 2)
        motions[1][wheel] += amplitude * (np.sin(angle + first) + SECOND * np.sin(2 * angle + second))
    values = np.minimum(time / 3.0, 1.0) * np.array([np.repeat(middle, 2, axis=0), motions[1]])
    return np.concatenate([values, np.gradient(values, STEP, axis=2)])


#: Uneven wheels: scatter of their radii, and what they have twice in a turn over what they have once.
RADII, SECOND = 1e-3, 0.4
#: The worst wheel of each drive by its number, and its amplitude [m]; the others have up to a quarter of that.
UNEVEN = ((5, 3e-4), (2, 3e-4), (0, 1e-4), (7, 1e-3))
#: Drives of the baseline, and those that are diagnosed together.
LEARNING, TOGETHER = 8, 2
#: Drives of the baseline from which the track is surveyed.
SURVEYED = 4
#: Production scatter of the parts of the coach.
SCATTER = 0.05
#: Sets of drives: their conditions where these differ from those of the baseline, and values over those of before.
ROWS: dict[str, tuple[dict[str, object], dict[str, float]]] = {
    "healthy, 4 t": ({"load": 4000.0}, {}),
    "healthy, fast": ({"speed": (48.0, 54.0), "track": "good"}, {}),
    "healthy, rails with joints": ({"has_joints": True}, {}),
    "healthy, 4 t, joints, bad track": ({"load": 4000.0, "has_joints": True, "track": "bad"}, {}),
    "lateral dampers": ({}, {"bogie1.lateral_damper": 0.6}),
    "secondary lateral springs": ({}, {"bogie2.lateral_spring": 0.75}),
    "primary spring": ({}, {"bogie2_rear_left.primary_spring": 0.8}),
    "primary damper": ({}, {"bogie1_front_right.primary_damper": 0.6}),
    "secondary damper": ({}, {"bogie1_left.secondary_damper": 0.6}),
    "yaw dampers": ({}, {"bogie2.yaw_damper": 0.0}),
    "conicity": ({}, {"wheelsets.conicity": 1.6}),
}


def any_drive(vehicle: Vehicle, number: int, conditions: dict[str, object], factors: Mapping[str, float]) -> Drive:
    """Return a drive at random conditions and speed, of the coach whose parts differ from its file."""
    own = np.random.default_rng(3)
    factors = {name: factors.get(name, 1.0) * float(np.exp(SCATTER * own.standard_normal())) for name in parts(vehicle)}
    generator = np.random.default_rng([number, 1])
    top = float(generator.uniform(31.0, 42.0))
    usual = {
        "track": str(generator.choice(["good", "bad"])),
        "speed": (top - 6, top),
        "load": float(generator.uniform(0, 2e3)),
    }
    return Drive(**(usual | conditions), factors=factors)


def parts(vehicle: Vehicle) -> list[str]:
    """Return the names of the parts that a diagnosis distinguishes."""
    names = [str(part) for part in lateral_parts(vehicle)]
    for number in range(1, 1 + len(vehicle.bogie)):
        for side in ("left", "right"):
            names += [f"bogie{number}_{side}.secondary_{kind}" for kind in ("spring", "damper")]
            names += [
                f"bogie{number}_{end}_{side}.primary_{kind}"
                for end in ("front", "rear")
                for kind in ("spring", "damper")
            ]
    return names


def recorded(vehicle: Vehicle, folder: Path, name: str, number: int, drive: Drive) -> Path:
    """Return the file of a drive, which is simulated unless it is there; the truth is beside it."""
    path = folder / f"{name}-{number}.npz"
    if not path.exists():
        write(driven(vehicle, drive, number), path)
        path.with_suffix(".truth.json").write_text(json.dumps(asdict(drive)))
    return path


def drives(vehicle: Vehicle, folder: Path, name: str) -> list[Path]:
    """Return the files of the drives of a row, or of the baseline."""
    folder.mkdir(parents=True, exist_ok=True)
    first, count = (0, LEARNING) if name == "baseline" else (100 * (1 + list(ROWS).index(name)), TOGETHER)
    conditions, factors = ROWS.get(name, ({}, {}))
    conditions = conditions | ({"duration": 200.0} if name in ROWS else {})
    short = name.replace(", ", "-").replace(" ", "-")
    return [
        recorded(vehicle, folder, short, number, any_drive(vehicle, number, conditions, factors))
        for number in range(first, first + count)
    ]


def diagnosed(vehicle: Vehicle, folder: Path) -> None:
    """Learn and diagnose by the commands, and print findings and the model's error beside the truth."""
    file, baseline = folder / "coach.toml", folder / "baseline.json"
    learning = drives(vehicle, folder, "baseline")
    write_vehicle(vehicle, file)
    sprung("baseline", *learning, "--vehicle", file, "--out", baseline)
    print("| drives | truth | verdict | findings | notes |\n|---|---|---|---|---|")
    for name, (_, factors) in ROWS.items():
        own = drives(vehicle, folder, name)
        sprung("diagnose", *own, "--vehicle", file, "--baseline", baseline, "--json", result := folder / "result.json")
        found = json.loads(result.read_text())
        truth = ", ".join(f"{part} {100 * factor - 100:+.0f} %" for part, factor in factors.items())
        sentences = "; ".join(finding["sentence"] for finding in found["findings"])
        print(
            f"| {name} | {truth} | {found['verdict']} | {sentences} | {'; '.join(found['notes'])[:200]} |", flush=True
        )


def surveyed(vehicle: Vehicle, folder: Path) -> None:
    """Print alignment and level of the track from drives of the baseline beside those of the rails.

    Columns: ratio of the standard deviation of a stretch of 200 m to that of the rails, mean and RMS about it; share of
    95 % intervals that hold; RMS of the difference of the lines themselves.
    """
    print("| drive | line | range | ratio | scatter | intervals that hold | difference [mm] |")
    print("|---|---|---|---|---|---|---|")
    for number, path in enumerate(drives(vehicle, folder, "baseline")[:SURVEYED]):
        drive = any_drive(vehicle, number, {}, {})
        _, time, track, _ = rails(vehicle, drive, number)
        low, high = drive.speed
        windows = [window_of(read(path), vehicle)]
        fit, where = fit_windows(windows), track_of(windows)
        for line, own, row in (("alignment", fit_lateral_under(fit, windows), 0), ("left level", fit, 1)):
            along = road_profile(windows, own, where)
            true, levels = np.interp(along.times + SETTLE, time, track[row, 0]), Levels(along, own.model_error)
            edges = np.arange(along.distances[0] + 300, along.distances[-1] - 300, 200.0)
            stretches = [slice(*np.searchsorted(along.distances, ends).tolist()) for ends in pairwise(edges)]
            measured = [levels.at(0, stretch) for stretch in stretches]
            for name, wavelengths in zip(("d1", "d2"), RANGES, strict=True):
                exact = in_range(true, wavelengths, spacing=along.spacing)
                wrong = in_range(along.heights[0], wavelengths, spacing=along.spacing) - exact
                inner = slice(*np.searchsorted(along.distances, edges[[0, -1]]))
                of_rails = np.array([exact[stretch].std() for stretch in stretches])
                found, stds = np.array([(getattr(one, name), getattr(one, f"{name}_std")) for one in measured]).T
                ratios, holds = found / of_rails, np.abs(found - of_rails) < 1.96 * stds
                figures = (
                    f"{ratios.mean():.2f} | {ratios.std():.2f} | {holds.mean():.0%} | {1e3 * wrong[inner].std():.2f}"
                )
                print(
                    f"| {drive.track}, {low:.0f} to {high:.0f} m/s | {line} | {name.upper()} | {figures} |", flush=True
                )


def uneven(vehicle: Vehicle) -> None:
    """Print the run-out of the wheels by the fit to a drive, beside the truth."""
    names = [wheel.corner for wheel in vehicle.wheels]
    heads = "drive", "model error", "worst wheel", "found", "largest error of the others [mm]", "95 % intervals"
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for number, (worst, amplitude) in enumerate(UNEVEN):
        sizes = amplitude * np.random.default_rng([number, 9]).uniform(0.05, 0.25, len(names))
        sizes[worst] = amplitude
        drive = replace(any_drive(vehicle, number, {}, {}), duration=200.0, run_out=tuple(sizes.tolist()))
        fit = fit_corners(driven(vehicle, drive, number), vehicle)
        found, true = run_out(fit), np.sqrt((1 + SECOND**2) / 2) * sizes
        errors = found.values - true
        held = np.mean(np.abs(errors) < INTERVAL_95 * found.stds)
        others = 1e3 * np.abs(np.delete(errors, worst)).max()
        value, std = 1e3 * found.values[worst], 1e3 * found.stds[worst]
        cells = (
            f"{number}, {drive.track}",
            f"{100 * fit.model_error:.0f} %",
            f"{names[worst]}, {1e3 * true[worst]:.3f} mm",
            f"{names[int(np.argmax(found.values))]}, {value:.3f} ± {std:.3f} mm",
            f"{others:.3f}",
            f"{100 * held:.0f} %",
        )
        print(f"| {' | '.join(cells)} |", flush=True)


def sprung(*arguments: object) -> None:
    """Run a command as a user does; one that finds a change returns 1."""
    done = subprocess.run(
        [sys.executable, "-m", "sprung", *map(str, arguments)], capture_output=True, text=True, check=False
    )
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)


def main() -> None:
    """Print modes and responses, diagnoses, the track, or the wheels."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("modes", "diagnose", "track", "wheels"))
    parser.add_argument("--folder", type=Path, default=Path("coach-drives"), help="where drives are kept")
    given = parser.parse_args()
    if given.what == "diagnose":
        diagnosed(described(), given.folder)
        return
    if given.what == "track":
        surveyed(described(), given.folder)
        return
    if given.what == "wheels":
        uneven(described())
        return
    for speed in (25.0, 45.0):
        compared_modes(described(), speed)
        compared_responses(described(), speed)


if __name__ == "__main__":
    main()
