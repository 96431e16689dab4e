"""Numbers of a vehicle file as a block of parameters of its likelihood."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from sprung._arrays import Complex, Real
from sprung.calibration.draft import SENSORS, Draft, VehicleNumber, channel_responses, motion_of, moved
from sprung.likelihood import ParameterBlock, RigidLayout
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Structure

#: Step of the numerical derivatives over the standard deviation of the prior.
_STEP = 1e-4
#: Fields of a sensor that leave its reading of motion as it is.
_STILL = frozenset({"scale", "delay"})


class _Change(NamedTuple):
    """Change of dynamic stiffness, drive and readings per unit of a parameter; None where it is 0 throughout."""

    stiffness: Complex | None
    drive: Complex | None
    readings: Complex | None


@dataclass(frozen=True, eq=False, slots=True)
class FileNumbers(ParameterBlock):
    """Numbers of a vehicle file; the parameters are ln(value / given value), or value - given value.

    Parameters
    ----------
    draft
        Vehicle as given.
    numbers
        Numbers to learn.
    layout
        Channels of the data.

    Notes
    -----
    The vehicle is rebuilt from the file's numbers, so that whatever a file can state can be learnt. With dynamic
    stiffness D, drive B and readings R (see `Terms`), dD, dB and dR of each number are central differences of these
    smooth functions, exact to about 1e-8; what follows from them, dH = L (dB - dD X) - w^2 dR X, is not approximated.
    """

    draft: Draft
    numbers: tuple[VehicleNumber, ...]
    layout: RigidLayout

    group: ClassVar[str] = "vehicle"

    @property
    def names(self) -> tuple[str, ...]:
        """Places of the numbers in the file."""
        return tuple(number.name for number in self.numbers)

    @property
    def prior_std(self) -> Real:
        """Standard deviations of the numbers."""
        return np.array([number.std for number in self.numbers])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms of the vehicle with the numbers."""
        draft = moved(self.draft, self.numbers, parameters)
        vehicle = draft.structure()
        s = terms.s
        responses = channel_responses(draft, self.draft, self.layout.names, terms.frequencies)
        return replace(
            terms,
            elongations=vehicle.elongations,
            feet=vehicle.feet,
            stiffness=np.array([element.dynamic_stiffness(s) for element in vehicle.elements]),
            mass=vehicle.mass,
            forces=vehicle.forces,
            motion=motion_of(self.layout.names, vehicle),
            channel_response=terms.channel_response * responses,
        )

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient: 2 Re sum over frequencies of tr(E dB) - tr(G dD) - w^2 tr(dR X Q reduction)."""
        terms = gradients.transfer.terms
        sensed = gradients.transfer.displacements @ gradients.driven @ terms.reduction
        sensed = sensed * terms.squared[:, None, None]
        gradient = np.zeros(len(self.numbers))
        for row, change in enumerate(self._changes(parameters, terms)):
            if change.stiffness is not None:
                gradient[row] -= 2 * np.einsum("fij,fji->", gradients.fed_back, change.stiffness).real
            if change.drive is not None:
                wheels = gradients.forced[:, : change.drive.shape[-1]]
                gradient[row] += 2 * np.einsum("fun,fnu->", wheels, change.drive).real
            if change.readings is not None:
                gradient[row] -= 2 * np.einsum("fnk,fkn->", sensed, change.readings).real
        return gradient

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        X, L = response.displacements, response.force_response
        squared = response.terms.squared[:, None, None]
        derivatives = []
        for change in self._changes(parameters, response.terms):
            dH = np.zeros_like(response.matrix)
            if change.stiffness is not None:
                dH -= L @ change.stiffness @ X
            if change.drive is not None:
                dH[..., : change.drive.shape[-1]] += L @ change.drive
            if change.readings is not None:
                dH -= squared * (response.terms.reduction @ change.readings @ X)
            derivatives.append(response.change_by_transfer(dH))
        return derivatives

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the numbers in the units of the file."""
        given = [self.draft.value_at(number.place) for number in self.numbers]
        return {
            number.name: number.value(value, parameter)
            for number, value, parameter in zip(self.numbers, given, parameters.tolist(), strict=True)
        }

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the vehicle with the numbers."""
        return moved(self.draft, self.numbers, parameters).structure()

    def _changes(self, parameters: Real, terms: Terms) -> list[_Change]:
        """Derivatives of the matrices; those of the windows of one evaluation are computed once."""
        frequencies = np.ascontiguousarray(terms.frequencies).tobytes()
        return _changes(self.draft, self.numbers, self.layout.names, parameters.tobytes(), frequencies)


@lru_cache(maxsize=4)
def _changes(
    draft: Draft, numbers: tuple[VehicleNumber, ...], channels: tuple[str, ...], point: bytes, grid: bytes
) -> list[_Change]:
    """Derivatives of the matrices at the parameters of which `point` holds the bytes."""
    frequencies, base = np.frombuffer(grid), moved(draft, numbers, np.frombuffer(point))
    vehicle = base.structure()
    of_sensors = _sensor_changes(base, draft, numbers, channels, frequencies)
    return [
        of_sensors[number.name]
        if number.group == SENSORS
        else _component_change(vehicle, number, frequencies)
        if number.components
        else _structural_change(base, draft, number, channels, frequencies)
        for number in numbers
    ]


def _component_change(vehicle: Structure, number: VehicleNumber, frequencies: Real) -> _Change:
    """Derivatives with respect to ln of the components of a number: those of their elements alone."""
    s = _s(frequencies)
    size, n_inputs = vehicle.elongations.shape[1], vehicle.feet.shape[1]
    stiffness = np.zeros((s.size, size, size), dtype=np.complex128)
    drive = np.zeros((s.size, size, n_inputs), dtype=np.complex128)
    for element, foot in zip(vehicle.elements, vehicle.feet, strict=True):
        of_stiffness, of_damping = (component in number.components for component in element.components)
        if not (of_stiffness or of_damping):
            continue
        above, below = (
            replace(
                element,
                stiffness=element.stiffness * (1 + sign * _STEP * of_stiffness),
                damping=element.damping * (1 + sign * _STEP * of_damping),
            ).dynamic_stiffness(s)
            for sign in (1, -1)
        )
        pulled = ((above - below) / (2 * _STEP))[:, None, None] * element.elongation[:, None]
        stiffness += pulled * element.elongation
        drive += pulled * foot
    return _Change(stiffness, drive if drive.any() else None, None)


def _sensor_changes(
    base: Draft, given: Draft, numbers: Sequence[VehicleNumber], channels: tuple[str, ...], frequencies: Real
) -> dict[str, _Change]:
    """Central differences by name; a field of all sensors is moved at once, as each changes its own channel alone."""
    changes = {}
    of_sensors = [number for number in numbers if number.group == SENSORS]
    vehicle = base.structure()
    for field in sorted({number.field for number in of_sensors}):
        alike = [number for number in of_sensors if number.field == field]
        step = _STEP * np.array([number.std for number in alike])
        ends = [moved(base, alike, sign * step) for sign in (1, -1)]
        above, below = (
            _readings(end, given, vehicle if field in _STILL else end.structure(), channels, frequencies)
            for end in ends
        )
        for number in alike:
            row = channels.index(number.channel)
            change = np.zeros_like(above)
            change[:, row] = (above[:, row] - below[:, row]) / (2 * _STEP * number.std)
            changes[number.name] = _Change(None, None, change)
    return changes


def _structural_change(
    base: Draft, given: Draft, number: VehicleNumber, channels: tuple[str, ...], frequencies: Real
) -> _Change:
    """Central differences of a vehicle that is rebuilt."""
    step = _STEP * number.std
    ends = [number.moved(base, sign * step) for sign in (1, -1)]
    vehicles = [end.structure() for end in ends]
    readings = (
        _readings(end, given, vehicle, channels, frequencies) for end, vehicle in zip(ends, vehicles, strict=True)
    )
    (above, drive_above), (below, drive_below) = (_dynamics(vehicle, frequencies) for vehicle in vehicles)
    return _Change(
        _difference(above, below, step=2 * step),
        _difference(drive_above, drive_below, step=2 * step),
        _difference(*readings, step=2 * step),
    )


def _difference(above: Complex, below: Complex, *, step: float) -> Complex | None:
    """Return the slope between two matrices; None if it is 0 throughout."""
    if np.array_equal(above, below):
        return None
    return np.asarray((above - below) / step, dtype=np.complex128)


def _dynamics(vehicle: Structure, frequencies: Real) -> tuple[Complex, Complex]:
    """Dynamic stiffness (grid, n, n) and drive (grid, n, inputs) of a vehicle."""
    squared = ((2 * np.pi * frequencies) ** 2)[:, None, None]
    s, d = _s(frequencies), vehicle.elongations
    weighted = np.array([element.dynamic_stiffness(s) for element in vehicle.elements]).T[:, None, :] * d.T
    stiffness = weighted @ d - squared * vehicle.mass
    return np.asarray(stiffness, dtype=np.complex128), np.asarray(weighted @ vehicle.feet + vehicle.forces)


def _readings(draft: Draft, given: Draft, vehicle: Structure, channels: tuple[str, ...], frequencies: Real) -> Complex:
    """Readings (grid, channels, n) of a draft's sensors; `vehicle` is its structure."""
    responses = channel_responses(draft, given, channels, frequencies)
    return np.asarray(responses[:, :, None] * motion_of(channels, vehicle), dtype=np.complex128)


def _s(frequencies: Real) -> Complex:
    """Complex angular frequencies."""
    return np.asarray(2j * np.pi * frequencies, dtype=np.complex128)
