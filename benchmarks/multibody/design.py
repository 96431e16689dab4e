"""Vehicles for the multibody engine: masses, linkages, springs, dampers, tyres, and the text of the engine's model.

Frame of a vehicle: x forward, y left, z up from the centre of gravity of the empty body (ISO 8855). The engine's world
travels along the road with the vehicle: the road passes below, and braking and cornering are uniform accelerations.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

SIDES = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True)
class Axle:
    """An axle, named as in vehicle files; rates of spring and damper act along the part itself, not at the wheel."""

    name: str
    linkage: str  # "macpherson", "trailing", "wishbone" or "rigid"
    x: float  # from the centre of gravity [m]
    half_track: float  # [m]
    spring: float  # [N/m]
    damper: float  # slope at small velocity [N s/m]
    tyre: float  # [N/m]
    wheel_mass: float  # of one corner; of a rigid axle half of it [kg]
    cornering: float  # side force by slip angle of one corner [N/rad]
    bar: float = 0.0  # anti-roll bar, force by difference of the wheels' travel [N/m]
    radius: float = 0.31  # of the loaded tyre [m]
    tyre_damping: float = 120.0  # [N s/m]
    mount: float = 4e5  # top mount that carries the damper alone (MacPherson) [N/m]
    steers: bool = False


@dataclass(frozen=True)
class Rider:
    """A person on a seat, an engine on its mounts, or (without a frequency) a load that is fixed to the body."""

    mass: float
    x: float
    y: float
    z: float = 0.0
    frequency: float | None = None  # of the mass on its seat or mounts [Hz]
    damping_ratio: float = 0.3


@dataclass(frozen=True)
class Design:
    """A vehicle without load."""

    name: str
    mass: float  # of the body [kg]
    height: float  # of the centre of gravity [m]
    inertia: tuple[float, float, float]  # roll, pitch, yaw [kg m^2]
    axles: tuple[Axle, ...]
    sensor_height: float = 0.1  # above the centre of gravity [m]


@dataclass(frozen=True)
class Effects:
    """What happens on real vehicles and not in a linear model with fixed contact patches; each can be off."""

    side_forces: bool = True
    valves: bool = True  # dampers with a knee, harder in rebound
    friction: float = 40.0  # of each strut, Coulomb [N]
    top_mounts: bool = True
    bump_stops: bool = True
    tilt: float = 2.0  # standard deviation of the accelerometers' tilt [degrees]
    noise: float = 0.02  # [m/s^2]
    offset: float = 0.1  # [m/s^2]
    quantum: float = 0.0024  # 16 bit of 8 g [m/s^2]
    runout: float = 2e-4  # of the wheels [m]
    gps_delay: float = 0.6  # speed once a second, so much late [s]; None would be exact
    cornering: float = 2.0  # standard deviation of lateral acceleration in curves [m/s^2]
    braking: float = 1.5  # [m/s^2]


QUIET = Effects(
    side_forces=False,
    valves=False,
    friction=0.0,
    top_mounts=False,
    bump_stops=False,
    tilt=0.0,
    noise=0.005,
    offset=0.0,
    quantum=0.0,
    runout=0.0,
    gps_delay=0.0,
    cornering=0.0,
    braking=0.0,
)


@dataclass(frozen=True)
class Faults:
    """Factors on parts, by `corner.part`: spring, rate, damper, tyre, wheel, friction, mount, stop; and `axle.bar`.

    That of a bump stop is on the travel to it. A corner sinks on a weak spring; with another rate it stands as high as
    before.
    """

    factors: dict[str, float] = field(default_factory=dict)

    def __call__(self, name: str) -> float:
        return self.factors.get(name, 1.0)


def with_faults(design: Design, faults: Faults) -> Iterator[tuple[str, Axle]]:
    """Yield the corners of a vehicle, each with the values of its axle that faults have changed."""
    for axle in design.axles:
        for side in SIDES:
            corner = f"{axle.name}_{side}"
            yield (
                corner,
                replace(
                    axle,
                    spring=axle.spring * faults(f"{corner}.spring") * faults(f"{corner}.rate"),
                    damper=axle.damper * faults(f"{corner}.damper"),
                    tyre=axle.tyre * faults(f"{corner}.tyre"),
                    wheel_mass=axle.wheel_mass * faults(f"{corner}.wheel"),
                    mount=axle.mount * faults(f"{corner}.mount"),
                    bar=axle.bar * faults(f"{axle.name}.bar"),
                ),
            )


CAR = Design(
    "car",
    mass=1240.0,
    height=0.56,
    inertia=(470.0, 2050.0, 2300.0),
    axles=(
        Axle(
            "front",
            "macpherson",
            1.08,
            0.76,
            spring=26.5e3,
            damper=1.9e3,
            tyre=205e3,
            wheel_mass=38.0,
            cornering=75e3,
            bar=11e3,
            steers=True,
        ),
        Axle(
            "rear",
            "trailing",
            -1.50,
            0.75,
            spring=52e3,
            damper=1.9e3,
            tyre=205e3,
            wheel_mass=34.0,
            cornering=65e3,
            bar=4e3,
        ),
    ),
)
VAN = Design(
    "van",
    mass=1950.0,
    height=0.78,
    inertia=(1150.0, 5600.0, 6100.0),
    axles=(
        Axle(
            "front",
            "wishbone",
            1.45,
            0.86,
            spring=110e3,
            damper=5.2e3,
            tyre=290e3,
            wheel_mass=55.0,
            cornering=85e3,
            bar=18e3,
            radius=0.33,
            steers=True,
        ),
        Axle(
            "rear",
            "rigid",
            -1.85,
            0.85,
            spring=52e3,
            damper=3.4e3,
            tyre=290e3,
            wheel_mass=85.0,
            cornering=80e3,
            bar=6e3,
            radius=0.33,
        ),
    ),
)
BUS = Design(
    "bus",
    mass=13_800.0,
    height=1.25,
    inertia=(14_500.0, 165_000.0, 168_000.0),
    axles=(
        Axle(
            "front",
            "rigid",
            4.9,
            1.03,
            spring=190e3,
            damper=15e3,
            tyre=950e3,
            wheel_mass=330.0,
            cornering=260e3,
            bar=60e3,
            radius=0.48,
            steers=True,
        ),
        Axle(
            "axle2",
            "rigid",
            -1.9,
            0.93,
            spring=330e3,
            damper=26e3,
            tyre=1900e3,
            wheel_mass=600.0,
            cornering=480e3,
            bar=60e3,
            radius=0.48,
        ),
        Axle(
            "rear",
            "rigid",
            -3.3,
            1.03,
            spring=170e3,
            damper=14e3,
            tyre=950e3,
            wheel_mass=310.0,
            cornering=260e3,
            bar=40e3,
            radius=0.48,
        ),
    ),
    sensor_height=0.0,
)
DESIGNS = {design.name: design for design in (CAR, VAN, BUS)}


def sensor_places(design: Design) -> dict[str, tuple[float, float, float]]:
    """Return the places of the accelerometers: on the body above the wheels of the first and the last axle."""
    letters = {"left": "l", "right": "r"}
    first, last = design.axles[0], design.axles[-1]
    return {
        f"acc_{end}{letters[side]}": (axle.x, s * 0.8 * axle.half_track, design.sensor_height)
        for end, axle in (("f", first), ("r", last))
        for side, s in SIDES.items()
    }


def _axis(tilt: np.ndarray) -> tuple[float, float, float]:
    return (float(tilt[0]), float(tilt[1]), 0.0) if np.any(tilt) else (1.0, 0.0, 0.0)


def numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def part(parent: Element, tag: str, **attributes: object) -> Element:
    """Add an element; numbers and tuples of numbers become the engine's text, names keep theirs."""
    texts = {}
    for key, value in attributes.items():
        if isinstance(value, str):
            texts[key.rstrip("_")] = value
        else:
            texts[key.rstrip("_")] = numbers(*np.atleast_1d(np.asarray(value, dtype=float)))
    return SubElement(parent, tag, texts)


def inertial(body: Element, mass: float, place: tuple[float, ...] = (0, 0, 0), inertia: object = None) -> None:
    part(body, "inertial", pos=place, mass=mass, diaginertia=(0.01 * mass,) * 3 if inertia is None else inertia)


def tendon(tendons: Element, name: str, sites: tuple[str, str], **attributes: object) -> None:
    spatial = part(tendons, "spatial", name=name, **attributes)
    for site in sites:
        part(spatial, "site", site=site)


@dataclass
class Tree:
    """The parts of the engine's model while it is written."""

    design: Design
    effects: Effects
    chassis: Element
    tendons: Element
    equalities: Element
    actuators: Element


def model_text(
    design: Design,
    effects: Effects,
    riders: tuple[Rider, ...] = (),
    faults: Faults = Faults(),
    tilts: np.ndarray | None = None,
) -> str:
    """Return a vehicle in the engine's format (MJCF); `tilts` are turns of each accelerometer about x and y [rad]."""
    root = Element("mujoco", model=design.name)
    part(root, "option", timestep=0.001, integrator="implicitfast", gravity=(0, 0, -9.81), iterations=20)
    part(root[0], "flag", contact="disable")
    world = part(root, "worldbody")
    part(world, "site", name="world")
    chassis = part(world, "body", name="chassis", pos=(0, 0, design.height))
    for name, kind, axis in (
        ("x", "slide", (1, 0, 0)),
        ("y", "slide", (0, 1, 0)),
        ("z", "slide", (0, 0, 1)),
        ("yaw", "hinge", (0, 0, 1)),
        ("pitch", "hinge", (0, 1, 0)),
        ("roll", "hinge", (1, 0, 0)),
    ):
        held = {"x": 0.4, "y": 0.0 if effects.side_forces else 3.6, "yaw": 0.0 if effects.side_forces else 3.6}.get(
            name
        )
        weight = design.inertia[2] if name == "yaw" else design.mass
        hold = {"stiffness": held * weight, "damping": 1.4 * held**0.5 * weight} if held else {}
        part(chassis, "joint", name=name, type=kind, axis=axis, **hold)
    inertial(chassis, design.mass, inertia=design.inertia)
    tree = Tree(design, effects, chassis, part(root, "tendon"), part(root, "equality"), part(root, "actuator"))
    linkages = {"macpherson": macpherson, "trailing": trailing, "wishbone": wishbone}
    corners = dict(with_faults(design, faults))
    for axle in design.axles:
        pair = {side: corners[f"{axle.name}_{side}"] for side in SIDES}
        frictions = {side: effects.friction * faults(f"{axle.name}_{side}.friction") for side in SIDES}
        if axle.linkage == "rigid":
            rigid(tree, pair, frictions)
        else:
            for side, each in pair.items():
                linkages[axle.linkage](tree, each, side, frictions[side])
            anti_roll_bar(tree, pair["left"])
        for side, each in pair.items():
            tyre(tree, f"{axle.name}_{side}", each)
    for number, rider in enumerate(riders):
        mounted(tree, number, rider)
    sensors = part(root, "sensor")
    places = sensor_places(design)
    for (name, place), tilt in zip(places.items(), np.zeros((len(places), 2)) if tilts is None else tilts, strict=True):
        part(chassis, "site", name=name, pos=place, axisangle=(*_axis(tilt), np.degrees(np.hypot(*tilt))))
        part(sensors, "accelerometer", name=name, site=name)
    return ElementTree.tostring(root, encoding="unicode")


def spring_and_damper(tree: Tree, corner: str, axle: Axle, friction: float, ends: dict[str, tuple[str, str]]) -> None:
    """Add spring, damper and bump stop between sites; the damper of a MacPherson strut is its joint."""
    tendon(tree.tendons, f"{corner}.spring", ends["spring"], stiffness=axle.spring, damping=0.002 * axle.spring / 10)
    if tree.effects.bump_stops:
        tendon(tree.tendons, f"{corner}.stop", ends["spring"], stiffness=4 * axle.spring, springlength=(0, 1))
    if "damper" in ends:
        tendon(tree.tendons, f"{corner}.damper", ends["damper"], damping=axle.damper, frictionloss=friction)
        part(tree.actuators, "general", name=f"{corner}.valve", tendon=f"{corner}.damper")


def macpherson(tree: Tree, axle: Axle, side: str, friction: float) -> None:
    """Add lower arm, strut and knuckle: a closed loop."""
    corner, s = f"{axle.name}_{side}", SIDES[side]
    wheel = np.array([axle.x, s * axle.half_track, axle.radius - tree.design.height])
    top = wheel + np.array([-0.03, -0.17 * s, 0.52])
    ball = wheel + np.array([0.0, -0.07 * s, -0.09])
    inner = wheel + np.array([0.0, -0.40 * s, -0.06])
    arm = part(tree.chassis, "body", name=f"{corner}.arm", pos=inner)
    part(arm, "joint", name=f"{corner}.arm", axis=(1, 0, 0), damping=1.0)
    inertial(arm, 4.0, tuple(0.5 * (ball - inner)))
    part(arm, "site", name=f"{corner}.tip", pos=ball - inner)
    mount = part(tree.chassis, "body", name=f"{corner}.mount", pos=top)
    if tree.effects.top_mounts:
        stiffness = axle.mount
        part(mount, "joint", name=f"{corner}.mount", type="slide", axis=(0, 0, 1), stiffness=stiffness, damping=150.0)
    part(mount, "joint", name=f"{corner}.rod_x", axis=(1, 0, 0), damping=0.5)
    part(mount, "joint", name=f"{corner}.rod_y", axis=(0, 1, 0), damping=0.5)
    inertial(mount, 2.5, (0, 0, -0.1))
    knuckle = part(mount, "body", name=f"{corner}.knuckle", pos=wheel - top)
    along = top - (wheel + np.array([0.0, -0.10 * s, 0.08]))
    part(
        knuckle,
        "joint",
        name=f"{corner}.damper",
        type="slide",
        axis=along / np.linalg.norm(along),
        damping=axle.damper,
        frictionloss=friction,
    )
    inertial(knuckle, axle.wheel_mass - 3.0, inertia=(0.9, 1.3, 0.9))
    part(knuckle, "site", name=f"{corner}.ball", pos=ball - wheel)
    part(knuckle, "site", name=f"{corner}.hub")
    part(knuckle, "site", name=f"{corner}.patch", pos=(0, 0, -axle.radius))
    part(knuckle, "site", name=f"{corner}.seat", pos=(top - wheel) * 0.35 + np.array([0, -0.03 * s, 0]))
    part(tree.chassis, "site", name=f"{corner}.top", pos=top)
    part(tree.equalities, "connect", site1=f"{corner}.tip", site2=f"{corner}.ball", solref=(0.004, 1))
    spring_and_damper(tree, corner, axle, friction, {"spring": (f"{corner}.top", f"{corner}.seat")})
    part(tree.actuators, "general", name=f"{corner}.valve", joint=f"{corner}.damper")


def trailing(tree: Tree, axle: Axle, side: str, friction: float) -> None:
    """Add a trailing arm with its spring before the wheel and an inclined damper."""
    corner, s = f"{axle.name}_{side}", SIDES[side]
    wheel = np.array([axle.x, s * axle.half_track, axle.radius - tree.design.height])
    pivot = wheel + np.array([0.42, -0.08 * s, 0.03])
    arm = part(tree.chassis, "body", name=f"{corner}.arm", pos=pivot)
    part(arm, "joint", name=f"{corner}.arm", axis=(0, 1, 0), damping=1.0)
    hub = wheel - pivot
    inertial(arm, axle.wheel_mass, tuple(0.93 * hub), inertia=(0.9, 1.5, 1.2))
    part(arm, "site", name=f"{corner}.hub", pos=hub)
    part(arm, "site", name=f"{corner}.patch", pos=hub - np.array([0, 0, axle.radius]))
    for name, below, above in (
        ("seat", np.array([-0.29, 0, -0.03]), np.array([0.0, 0.0, 0.28])),
        ("eye", np.array([-0.44, 0, -0.03]), np.array([0.10, -0.04 * s, 0.46])),
    ):
        part(arm, "site", name=f"{corner}.{name}", pos=below)
        part(tree.chassis, "site", name=f"{corner}.{name}_top", pos=pivot + below + above)
    ends = {"spring": (f"{corner}.seat", f"{corner}.seat_top"), "damper": (f"{corner}.eye", f"{corner}.eye_top")}
    spring_and_damper(tree, corner, axle, friction, ends)


def wishbone(tree: Tree, axle: Axle, side: str, friction: float) -> None:
    """Add two transverse arms and a knuckle; spring and damper stand on the lower arm."""
    corner, s = f"{axle.name}_{side}", SIDES[side]
    wheel = np.array([axle.x, s * axle.half_track, axle.radius - tree.design.height])
    low_ball, low_inner = wheel + np.array([0, -0.08 * s, -0.12]), wheel + np.array([0, -0.50 * s, -0.09])
    high_ball, high_inner = wheel + np.array([0, -0.12 * s, 0.20]), wheel + np.array([0, -0.42 * s, 0.17])
    arm = part(tree.chassis, "body", name=f"{corner}.arm", pos=low_inner)
    part(arm, "joint", name=f"{corner}.arm", axis=(1, 0, 0), damping=1.0)
    inertial(arm, 8.0, tuple(0.6 * (low_ball - low_inner)))
    knuckle = part(arm, "body", name=f"{corner}.knuckle", pos=low_ball - low_inner)
    part(knuckle, "joint", name=f"{corner}.knuckle", axis=(1, 0, 0), damping=0.5)
    inertial(knuckle, axle.wheel_mass - 8.0, tuple(wheel - low_ball), inertia=(1.4, 2.0, 1.4))
    part(knuckle, "site", name=f"{corner}.hub", pos=wheel - low_ball)
    part(knuckle, "site", name=f"{corner}.patch", pos=wheel - low_ball - np.array([0, 0, axle.radius]))
    part(knuckle, "site", name=f"{corner}.ball", pos=high_ball - low_ball)
    upper = part(tree.chassis, "body", name=f"{corner}.upper", pos=high_inner)
    part(upper, "joint", name=f"{corner}.upper", axis=(1, 0, 0), damping=0.5)
    inertial(upper, 3.0, tuple(0.5 * (high_ball - high_inner)))
    part(upper, "site", name=f"{corner}.tip", pos=high_ball - high_inner)
    part(tree.equalities, "connect", site1=f"{corner}.tip", site2=f"{corner}.ball", solref=(0.004, 1))
    for name, share, above in (("seat", 0.62, (0, -0.03, 0.34)), ("eye", 0.66, (0, -0.08, 0.42))):
        below = share * (low_ball - low_inner)
        part(arm, "site", name=f"{corner}.{name}", pos=below)
        part(tree.chassis, "site", name=f"{corner}.{name}_top", pos=low_inner + below + np.array(above) * (1, s, 1))
    ends = {"spring": (f"{corner}.seat", f"{corner}.seat_top"), "damper": (f"{corner}.eye", f"{corner}.eye_top")}
    spring_and_damper(tree, corner, axle, friction, ends)


def rigid(tree: Tree, pair: dict[str, Axle], frictions: dict[str, float]) -> None:
    """Add a rigid axle: up and down, rolling about the height of its Panhard rod, which gives a little sideways."""
    axle = pair["left"]
    centre = np.array([axle.x, 0.0, axle.radius + 0.02 - tree.design.height])
    body = part(tree.chassis, "body", name=f"{axle.name}.axle", pos=centre)
    mass = sum(each.wheel_mass for each in pair.values())
    part(body, "joint", name=f"{axle.name}.travel", type="slide", axis=(0, 0, 1))
    part(
        body, "joint", name=f"{axle.name}.rod", type="slide", axis=(0, 1, 0), stiffness=3e4 * mass, damping=60.0 * mass
    )
    roll = 2 * axle.bar * axle.half_track**2 * 2
    part(body, "joint", name=f"{axle.name}.roll", axis=(1, 0, 0), stiffness=roll, damping=1.0)
    shift = axle.half_track * 0.8 * (pair["left"].wheel_mass - pair["right"].wheel_mass) / mass
    about = mass * (0.75 * axle.half_track) ** 2
    inertial(body, mass, (0, shift, -0.02), inertia=(about, 0.05 * mass, about))
    for side, each in pair.items():
        corner, s = f"{axle.name}_{side}", SIDES[side]
        hub = np.array([0, s * axle.half_track, -0.02])
        part(body, "site", name=f"{corner}.hub", pos=hub)
        part(body, "site", name=f"{corner}.patch", pos=hub - np.array([0, 0, axle.radius]))
        for name, share, height, lean in (("seat", 0.66, 0.30, 0.0), ("eye", 0.60, 0.42, 0.10)):
            below = np.array([0.05, s * share * axle.half_track, 0.02])
            above = np.array([0.03 if name == "eye" else 0.0, -s * lean, height])
            part(body, "site", name=f"{corner}.{name}", pos=below)
            part(tree.chassis, "site", name=f"{corner}.{name}_top", pos=centre + below + above)
        ends = {"spring": (f"{corner}.seat", f"{corner}.seat_top"), "damper": (f"{corner}.eye", f"{corner}.eye_top")}
        spring_and_damper(tree, corner, each, frictions[side], ends)


def anti_roll_bar(tree: Tree, axle: Axle) -> None:
    """Couple the arms of an axle, by the sum of turns of transverse arms, by the difference of trailing ones."""
    if axle.bar:
        length, sign = {"macpherson": (0.33, 1), "trailing": (0.42, -1), "wishbone": (0.42, 1)}[axle.linkage]
        bar = part(tree.tendons, "fixed", name=f"{axle.name}.bar", stiffness=axle.bar * length**2, springlength=0)
        part(bar, "joint", joint=f"{axle.name}_left.arm", coef=1)
        part(bar, "joint", joint=f"{axle.name}_right.arm", coef=sign)


def tyre(tree: Tree, corner: str, axle: Axle) -> None:
    """Add the forces of a tyre: spring and damper to the road below the hub, side force and drive or brake force."""
    common = {"refsite": "world", "biastype": "affine"}
    part(
        tree.actuators,
        "general",
        name=f"{corner}.tyre",
        site=f"{corner}.hub",
        gear=(0, 0, 1, 0, 0, 0),
        gainprm=axle.tyre,
        biasprm=(0, -axle.tyre, -axle.tyre_damping),
        ctrllimited="false",
        forcerange=(0, 1e7),
        **common,
    )
    part(tree.actuators, "general", name=f"{corner}.along", site=f"{corner}.patch", gear=(1, 0, 0, 0, 0, 0), **common)
    part(
        tree.actuators,
        "general",
        name=f"{corner}.side",
        site=f"{corner}.patch",
        gear=(0, 1, 0, 0, 0, 0),
        dyntype="filter",
        dynprm=0.02,  # [s]; each step of a drive has that of its speed
        **common,
    )


def mounted(tree: Tree, number: int, rider: Rider) -> None:
    """Add a load, on a seat or mounts if it has a frequency."""
    body = part(tree.chassis, "body", name=f"rider{number}", pos=(rider.x, rider.y, rider.z))
    inertial(body, rider.mass, inertia=(0.03 * rider.mass,) * 3)
    if rider.frequency is not None:
        rate = rider.mass * (2 * np.pi * rider.frequency) ** 2
        damping = 2 * rider.damping_ratio * np.sqrt(rate * rider.mass)
        part(
            body,
            "joint",
            name=f"rider{number}",
            type="slide",
            axis=(0, 0, 1),
            stiffness=rate,
            damping=damping,
            springref=rider.mass * 9.81 / rate,
        )
