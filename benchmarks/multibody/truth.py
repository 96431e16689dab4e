"""What is true of a multibody vehicle: modes by the engine's own linearisation, rates at the wheels by energy."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from benchmarks.multibody.design import SIDES, Design, Effects, Faults, Rider
from benchmarks.multibody.drive import STEP, Car, Prepared, ratios_at_wheels, tendon_jacobian

#: Coordinates of the body by which a mode is known.
MOTIONS = ("bounce", "pitch", "roll")


@dataclass(frozen=True)
class Mode:
    """A mode of the vehicle."""

    frequency: float  # [Hz]
    damping_ratio: float
    shares: dict[str, float]  # of bounce, pitch and roll in the motion at the sensors


@dataclass(frozen=True)
class Rates:
    """Values of a corner at the wheel."""

    spring: float  # [N/m]
    damper: float  # [N s/m]
    tyre: float  # [N/m]


def standing(n: int, speed: float, corners: int) -> Prepared:
    """Return a drive on a flat road."""
    zero = np.zeros((n, corners))
    return Prepared(np.full(n, speed), zero, zero, np.zeros(n), np.zeros((n, 2)))


def modes(
    design: Design,
    effects: Effects,
    *,
    speed: float,
    riders: tuple[Rider, ...] = (),
    faults: Faults | None = None,
    highest: float = 6.0,
) -> list[Mode]:
    """Return the modes of the body below a frequency: one step of the engine, differentiated at the rest position.

    Dampers have their slope at small velocity, and friction is off.
    """
    car = Car(design, replace(effects, valves=False, friction=0.0), riders, faults)
    matrix, _ = one_step(car, speed)
    values, vectors = np.linalg.eig(matrix)
    with np.errstate(divide="ignore"):
        poles = np.log(values) / STEP
    found = []
    for pole, vector in zip(poles, vectors.T, strict=True):
        frequency = abs(pole) / (2 * np.pi)
        if pole.imag > 1e-6 and 0.3 < frequency < highest:
            body = np.abs(vector[[2, 4, 5]]) * [1.0, 0.5 * np.ptp(car.places), design.axles[0].half_track]
            wheels = max(abs(vector[6 : car.model.nq]))
            if body.max() > 0.02 * wheels:
                shares = dict(zip(MOTIONS, body / body.sum(), strict=True))
                found.append(Mode(frequency, -pole.real / abs(pole), shares))
    return sorted(found, key=lambda mode: mode.frequency)


def one_step(car: Car, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what a step of the engine makes of its state and of the roads under the tyres, about the rest position."""
    model, data, corners = car.model, car.data, len(car.corners)
    car.steps(standing(20_000, speed, corners), 20_000)
    sizes = (model.nq, model.nv, model.na)
    start, level = np.concatenate([data.qpos, data.qvel, data.act]), np.zeros(corners)

    def after(state: np.ndarray, road: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:], data.act[:] = np.split(state, np.cumsum(sizes)[:2])
        mujoco.mj_forward(model, data)
        car.steps(standing(1, speed, corners)._replace(road=road[None]), 1)
        return np.concatenate([data.qpos, data.qvel, data.act])

    states, roads = 1e-6 * np.eye(start.size), 1e-6 * np.eye(corners)
    by_state = np.array([(after(start + step, level) - after(start - step, level)) / 2e-6 for step in states]).T
    by_road = np.array([(after(start, step) - after(start, -step)) / 2e-6 for step in roads]).T
    return by_state, by_road


def roll_centre(design: Design, effects: Effects, axle: str) -> float:
    """Return the height of the roll centre of an axle: how far its patch moves aside as its wheel moves up."""
    model = Car(design, effects).model
    corners = tuple(f"{each.name}_{side}" for each in design.axles for side in SIDES)
    _, travel, data = ratios_at_wheels(model, corners)
    patch, jacobian = model.site(f"{axle}_left.patch").id, np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, patch)
    _, aside, up = jacobian @ travel[:, corners.index(f"{axle}_left")]
    own = next(each for each in design.axles if each.name == axle)
    lever = 2.0 if own.linkage == "rigid" else 1.0  # a rigid axle turns about the other wheel
    return float(lever * own.half_track * aside / up)


def rates(design: Design, effects: Effects, faults: Faults | None = None) -> dict[str, Rates]:
    """Return spring, damper and tyre at each wheel: the work of the parts when the wheel moves beside a resting body.

    The spring has the second derivative of its energy along the travel of the wheel (at constant tyre force), the
    damper the power at unit velocity with its slope at small velocity.
    """
    car = Car(design, replace(effects, valves=False), (), faults)
    corners = tuple(car.corners)
    ratios, travel, data = ratios_at_wheels(car.model, corners)
    tension = np.array(
        [
            axle.spring * (data.ten_length[k] - car.model.tendon_lengthspring[k, 0])
            for axle, k in zip(car.corners.values(), _springs(car.model, corners), strict=True)
        ]
    )
    bend = _curvature(car.model, corners, travel)
    jacobian = tendon_jacobian(car.model, data)
    result = {}
    for k, (corner, axle) in enumerate(car.corners.items()):
        spring = float(sum(car.corners[each].spring * ratios[j, k] ** 2 for j, each in enumerate(corners)))
        if axle.linkage == "macpherson":
            moved = travel[car.model.joint(f"{corner}.damper").dofadr[0], k]
        else:
            moved = jacobian[car.model.tendon(f"{corner}.damper").id] @ travel[:, k]
        result[corner] = Rates(spring + float(tension @ bend[:, k]), float(axle.damper * moved**2), axle.tyre)
    return result


def _springs(model: mujoco.MjModel, corners: tuple[str, ...]) -> list[int]:
    return [model.tendon(f"{corner}.spring").id for corner in corners]


def _curvature(model: mujoco.MjModel, corners: tuple[str, ...], travel: np.ndarray) -> np.ndarray:
    """Return the second derivatives of the springs' lengths by the height of each wheel."""
    second = np.empty((len(corners), len(corners)))
    for k in range(len(corners)):
        slopes = []
        for sign in (-1.0, 1.0):
            data = mujoco.MjData(model)
            data.qpos[:] += sign * 1e-3 * travel[:, k]
            slopes.append(ratios_at_wheels(model, corners, data)[0][:, k])
        second[:, k] = (slopes[1] - slopes[0]) / 2e-3
    return second
