"""A vehicle file as a likelihood: what is free, what drives the wheels, which frequencies count."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sprung._checks import check_number, check_one_of
from sprung.errors import ParameterError
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.inputs import InputModel, RailInputs, RigInputs, RoadInputs
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.whittle import MassChange, Model, SensorChange
from sprung.vehicles import Component, Outputs, Structure, Vehicle, corner_names, structure, wheel_hop_frequencies
from sprung.vehicles.labels import MOTIONS

Kind = Literal["road", "rail", "rig"]

#: Band over the lowest and highest natural frequency of the nominal vehicle, and its upper end over its lower.
_BELOW, _ABOVE, _WIDEST = 0.4, 1.7, 33.0
#: Highest frequency over the sampling rate.
_HIGHEST = 0.4
#: Periods of the nominal vehicle's slowest mode in a segment.
_PERIODS = 7.5
#: Usual error of a sensor's place [m] and of its time [s].
_PLACE, _LAG = 0.1, 2e-3


@dataclass(frozen=True, slots=True)
class CornerSettings:
    """How to fit; None means chosen from the vehicle.

    Parameters
    ----------
    band
        Lowest and highest frequency [Hz].
    segment
        Length of a segment [s].
    width
        Standard deviation of ln(value / nominal value) before any data.
    free
        Components to fit, such as ("spring", "rear_left.damper"); the others keep the vehicle file's values. None: all.
    has_payload
        Fit the body's mass, moments and inertias too: without, a payload is taken for soft springs. None: not on a
        rig.
    has_free_sensors
        Fit places and lags of the sensors too.
    has_lines_masked
        Leave frequencies out where lines of wheels, engine or mains stand out of a first fit.
    kind
        What drives the wheels: "road", "rail" (both repeat the front wheels' input at the rear ones and need the speed)
        or "rig" (rollers); None: as the vehicle file says.
    """

    band: tuple[float, float] | None = None
    segment: float | None = None
    width: float = 0.7
    free: tuple[str, ...] | None = None
    has_payload: bool | None = None
    has_free_sensors: bool = False
    has_lines_masked: bool = True
    kind: Kind | None = None

    def __post_init__(self) -> None:
        check_number("width", self.width, above=0)
        if self.kind is not None:
            check_one_of("kind", self.kind, ("road", "rail", "rig"))
        if self.segment is not None:
            check_number("segment", self.segment, above=0)
        if self.band is not None and not 0 < self.band[0] < self.band[1]:
            raise ParameterError(f"band {self.band[0]:g} to {self.band[1]:g} Hz must rise from above 0: correct it")


def vehicle_model(
    spectra: ClassSpectra, layout: RigidLayout, vehicle: Vehicle, settings: CornerSettings, kind: Kind
) -> Model:
    """Return the model of a vehicle with the components, masses and sensors free that the settings name."""
    nominal = structure(vehicle)
    has_payload = kind != "rig" if settings.has_payload is None else settings.has_payload
    inputs: InputModel
    if kind == "rig":
        inputs = RigInputs(spectra, nominal.inputs)
    else:
        positions, sides = np.repeat([axle.x for axle in vehicle.axle], 2), np.tile([1.0, -1.0], len(vehicle.axle))
        inputs = (
            RoadInputs(spectra, positions, sides)
            if kind == "road"
            else RailInputs(spectra, positions, sides, contact_length=0.01)
        )
    return Model(
        nominal,
        layout,
        spectra,
        inputs,
        free_components(nominal, vehicle, settings.free),
        masses=_payload(nominal) if has_payload else (),
        sensors=_sensors(nominal, layout) if settings.has_free_sensors else (),
        width=settings.width,
    )


def free_components(nominal: Structure, vehicle: Vehicle, names: tuple[str, ...] | None) -> tuple[Component, ...]:
    """Return the free components of the corners."""
    corners = corner_names(len(vehicle.axle))
    every = tuple(
        component for component, value in nominal.components().items() if component.corner in corners and value > 0
    )
    if names is None:
        return every
    for name in names:
        if not any(name in {one.kind, str(one)} for one in every):
            known = ", ".join(map(str, every))
            raise ParameterError(f"free component {name!r} is none of spring, damper, tyre, {known}")
    return tuple(one for one in every if {one.kind, str(one)} & set(names))


def _payload(nominal: Structure) -> tuple[MassChange, ...]:
    """Return mass, moments and inertias of a payload on the body, each with a width of a fifth of the body's."""
    n = len(nominal.coordinates)
    names = MOTIONS
    rows = [nominal.coordinates.index(name) for name in names]
    sizes = np.sqrt(np.diag(nominal.mass)[rows])
    found = []
    for first, second, name in (
        (0, 0, "payload_mass"),
        (0, 1, "payload_x_moment"),
        (0, 2, "payload_y_moment"),
        (1, 1, "payload_pitch_inertia"),
        (2, 2, "payload_roll_inertia"),
    ):
        matrix = np.zeros((n, n))
        matrix[rows[first], rows[second]] = matrix[rows[second], rows[first]] = 1.0
        size = float(sizes[first] * sizes[second])
        found.append(MassChange(name, matrix * size, 0.2 if first == second else 0.1, unit=size))
    return tuple(found)


def _sensors(nominal: Structure, layout: RigidLayout) -> tuple[SensorChange, ...]:
    """Return places of accelerometers on the body and lags of all channels, each with its width."""
    found = []
    shape = layout.motion.shape
    known = {channel.name: channel for channel in nominal.outputs.channels}
    for row, name in enumerate(layout.names):
        channel = known[name]
        found.append(SensorChange(f"{name}_lag", _LAG, channel=row))
        if layout.orders[row] < 2 or channel.position is None or channel.direction is None:
            continue
        for axis, motion, sign in (("x", "pitch", -1.0), ("y", "roll", 1.0)):
            change = np.zeros(shape)
            change[row, nominal.coordinates.index(motion)] = sign * channel.direction[2]
            found.append(SensorChange(f"{name}_{axis}", _PLACE, motion=change))
    return tuple(found)


def usual_choices(
    vehicle: Vehicle, nominal: Structure, settings: CornerSettings, sampling_rate: float
) -> tuple[tuple[float, float], float]:
    """Return band and segment length."""
    slowest = float(nominal.modes().natural_frequency[0])
    low = _BELOW * slowest
    high = min(_ABOVE * float(np.nanmax(wheel_hop_frequencies(vehicle))), _WIDEST * low, _HIGHEST * sampling_rate)
    return settings.band or (low, high), settings.segment or _PERIODS / slowest


def with_sensors(nominal: Structure, names: tuple[str, ...]) -> Structure:
    """Return the structure with only those sensors that were recorded."""
    outputs = nominal.outputs
    rows = [row for row, name in enumerate(outputs.names) if name in names]
    kept = Outputs(
        tuple(outputs.channels[row] for row in rows),
        outputs.acceleration[rows],
        outputs.velocity[rows],
        outputs.displacement[rows],
    )
    return replace(nominal, outputs=kept)


def highest_of_body(nominal: Structure) -> float:
    """Return the highest natural frequency of bounce, pitch and roll [Hz]."""
    modes = nominal.modes()
    body = [f for f, label in zip(modes.natural_frequency, modes.labels, strict=True) if label in MOTIONS]
    return float(max(body, default=0.0))
