"""Apparent masses as parameters: what loads the body by frequency, side forces of the tyres and people on seats."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Element, Structure, body_row
from sprung.vehicles.labels import MOTIONS

#: Usual height of the centre of gravity above the roll axis, over the wheelbase.
_HEIGHT = 0.17
#: Standard deviation of the squared height over the usual one, about 0: roll about the centre of gravity.
_HEIGHT_STD = 1.0
#: Usual cornering stiffness of all tyres over the mass [N/(rad kg)]: 15 times the load per radian; its standard
#: deviation, ln.
_GRIP, _GRIP_STD = 150.0, 0.4
#: Standard deviation of the mass about 0, over that of the body.
_MASS = 0.1
#: Standard deviations of their place ahead of the centre of gravity, over the wheelbase, and aside, over the track.
_AHEAD, _ASIDE = 0.2, 0.2
#: Natural frequency of a person on a seat [Hz] with the standard deviation of its ln, and damping ratio.
_FREQUENCY, _FREQUENCY_STD, _DAMPING = 4.5, 0.15, 0.3
#: Mass over that of the body below which the fitted structure has no mode of the seats.
_LEAST = 0.02
#: Lowest value of a mass or squared height, over its standard deviation.
_SOFT = 0.05


@dataclass(frozen=True, eq=False, slots=True)
class SideForces(ParameterBlock):
    """Squared height of the centre of gravity above the roll axis, and cornering stiffness of the tyres over the mass.

    Parameters
    ----------
    structure
        Nominal vehicle with roll of a body.
    height
        Usual height of the centre of gravity above the roll axis [m].
    speed
        Mean speed [m/s], above 0.

    Notes
    -----
    A tyre of cornering stiffness C that rolls at speed v resists sideways motion as a damper C / v. With the mass m of
    the body, its sway s, its roll r (positive left side up), the height h of its centre of gravity above the roll axis,
    and C of all tyres, m s'' + (C / v) (s + h r)' = 0. Without sway as a coordinate, what is left is an apparent
    inertia of roll,

        m h^2 / (1 + i w m v / C),

    mass and damper in series: at small speed the body rolls about the roll axis, its inertia larger by m h^2, at high
    speed about its centre of gravity. The parameters are h^2 over the usual one, which enters linearly, and ln of
    C / m over the usual one. The speed is the mean one of all classes.

    References
    ----------
    H. B. Pacejka, Tire and Vehicle Dynamics, 3rd edition, Butterworth-Heinemann, 2012, chapter 1 (side force of a
    rolling tyre, roll axis).
    """

    structure: Structure
    height: float
    speed: float

    group: ClassVar[str] = "side_forces"

    @property
    def names(self) -> tuple[str, ...]:
        """Height above the roll axis, and cornering stiffness."""
        return ("roll_height", "cornering_stiffness")

    @property
    def start(self) -> Real:
        """Roll about the centre of gravity."""
        return np.zeros(2)

    @property
    def prior_std(self) -> Real:
        """Wide for the height."""
        return np.array([_HEIGHT_STD, _GRIP_STD])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the inertia of roll larger."""
        inertia, _ = self._inertias(parameters, terms)
        return replace(terms, apparent_mass=terms.apparent_mass + inertia[:, None, None] * self._on_roll)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        _, changes = self._inertias(parameters, gradients.transfer.terms)
        by_inertia = np.einsum("fij,ij->f", gradients.apparent_mass, self._on_roll)
        return np.sum((by_inertia * changes).real, axis=1)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        _, changes = self._inertias(parameters, response.terms)
        return [response.change_by_mass(change[:, None, None] * self._on_roll) for change in changes]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the height above the roll axis [m], and the cornering stiffness over the mass [N/(rad kg)]."""
        height = self.height * float(np.sqrt(max(0.0, parameters[0])))
        return dict(zip(self.names, (height, _GRIP * float(np.exp(parameters[1]))), strict=True))

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with sway at the roll axis as a coordinate, if the centre of gravity is above it."""
        if parameters[0] <= 0:
            return replace(structure)
        mass = float(self.structure.mass[0, 0])
        on_roll = np.array([float(name == "roll") for name in structure.coordinates])
        motion = np.append(-self.height * np.sqrt(parameters[0]) * on_roll, 1.0)
        held = np.append(np.zeros(on_roll.size), 1.0)
        damper = Element("tyres", "lateral", held, 0.0, mass / self._time(parameters))
        return structure.with_coordinate("sway", damper, mass=mass, motion=motion)

    @property
    def _on_roll(self) -> Real:
        """1 for the inertia of roll in the mass matrix, 0 elsewhere, shape (n, n)."""
        return np.diag([float(name == "roll") for name in self.structure.coordinates])

    def _time(self, parameters: Real) -> float:
        """Time m v / C in which sideways motion dies out [s]."""
        return float(self.speed / _GRIP * np.exp(-parameters[1]))

    def _inertias(self, parameters: Real, terms: Terms) -> tuple[Complex, Complex]:
        """Inertia of roll, shape (grid,), and its derivatives with respect to both parameters, shape (2, grid)."""
        share, slope = _positive(parameters[0], _SOFT * _HEIGHT_STD)
        slow = 1 + 2j * np.pi * terms.frequencies * self._time(parameters)
        unit = self.structure.mass[0, 0] * self.height**2 / slow
        return share * unit, np.array([slope * unit, share * unit * (slow - 1) / slow])


@dataclass(frozen=True, eq=False, slots=True)
class Seats(ParameterBlock):
    """Mass, place and natural frequency of the load on seats, beyond the load that is fixed to the body.

    Parameters
    ----------
    structure
        Nominal vehicle with bounce, pitch and roll of a body.
    wheelbase, track
        Wheelbase and track width [m].

    Notes
    -----
    A mass m on a spring with a damper of natural frequency w0 / 2 pi and damping ratio d loads the body at its place as
    the apparent mass m T r r^T,

        T = (2 d w0 p + w0^2) / (p^2 + 2 d w0 p + w0^2),    p = i w,

    with r = [1, -x, y] for bounce, pitch and roll: rigid far below w0, hardly there above it. The parameters are m over
    the mass of the body, x over the wheelbase, y over the track width, and ln of the natural frequency over 4.5 Hz.

    References
    ----------
    J. P. Den Hartog, Mechanical Vibrations, 4th edition, McGraw-Hill, 1956, section 3.3 (vibration absorber).
    M. J. Griffin, Handbook of Human Vibration, Academic Press, 1990, chapters 8 and 9 (seated people: 4 to 6 Hz).
    """

    structure: Structure
    wheelbase: float
    track: float

    group: ClassVar[str] = "seats"

    @property
    def names(self) -> tuple[str, ...]:
        """Mass, place and natural frequency."""
        return ("seat_mass", "seat_x", "seat_y", "seat_frequency")

    @property
    def start(self) -> Real:
        """Nobody."""
        return np.zeros(4)

    @property
    def prior_std(self) -> Real:
        """Standard deviations, wide but for the natural frequency."""
        return np.array([_MASS, _AHEAD, _ASIDE, _FREQUENCY_STD])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the load."""
        amplification, _ = _amplification(parameters, terms)
        mass, _ = self._masses(parameters)
        return replace(terms, apparent_mass=terms.apparent_mass + amplification[:, None, None] * mass)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        amplification, change = _amplification(parameters, gradients.transfer.terms)
        mass, changes = self._masses(parameters)
        by_mass = gradients.apparent_mass
        of_place = np.einsum("f,fij->ij", amplification, by_mass).real
        own = np.einsum("f,fij,ij->", change, by_mass, mass).real
        return np.append(np.einsum("ij,pij->p", of_place, changes), own)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        amplification, change = _amplification(parameters, response.terms)
        mass, changes = self._masses(parameters)
        return [
            *(response.change_by_mass(amplification[:, None, None] * own) for own in changes),
            response.change_by_mass(change[:, None, None] * mass),
        ]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return mass [kg], place [m] and natural frequency [Hz]."""
        mass, x, y = (parameters[:3] * self._units).tolist()
        frequency = _FREQUENCY * float(np.exp(parameters[3]))
        return dict(zip(self.names, (max(0.0, mass), x, y, frequency), strict=True))

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the load as a mass of its own; less than half a person is fixed to the body."""
        mass, x, y, frequency = self.values(parameters).values()
        if parameters[0] < _LEAST:
            return structure.with_payload(mass, x=x, y=y)
        angular = 2 * np.pi * frequency
        own = np.append(np.zeros(len(structure.coordinates)), 1.0)
        elongation = own - np.append(body_row(structure.coordinates, x=x, y=y), 0.0)
        mount = Element("seats", "mount", elongation, mass * angular**2, 2 * _DAMPING * angular * mass)
        return structure.with_coordinate("seats", mount, mass=mass, motion=own)

    @property
    def _units(self) -> Real:
        """One unit of mass [kg] and place [m]."""
        return np.array([self.structure.mass[0, 0], self.wheelbase, self.track])

    def _masses(self, parameters: Real) -> tuple[Real, Real]:
        """Mass matrix of the load, shape (n, n), and its derivatives by mass and place, shape (3, n, n)."""
        share, slope = _positive(parameters[0], _SOFT * _MASS)
        unit, wheelbase, track = self._units.tolist()
        rows = np.eye(len(self.structure.coordinates))[[self.structure.coordinates.index(name) for name in MOTIONS]]
        ahead, aside = -wheelbase * rows[1], track * rows[2]
        place = rows[0] + parameters[1] * ahead + parameters[2] * aside
        whole = unit * np.outer(place, place)
        moved = [share * unit * (np.outer(move, place) + np.outer(place, move)) for move in (ahead, aside)]
        return share * whole, np.array([slope * whole, *moved])


def _amplification(parameters: Real, terms: Terms) -> tuple[Complex, Complex]:
    """Apparent over rigid mass of a load on its seat, and its derivative by ln of the natural frequency, (grid,)."""
    s, own = 2j * np.pi * terms.frequencies, 2 * np.pi * _FREQUENCY * np.exp(parameters[3])
    force = 2 * _DAMPING * own * s + own**2
    motion = s**2 + force
    return force / motion, (force + own**2) * s**2 / motion**2


def side_forces(structure: Structure, wheelbase: float, speed: float) -> SideForces:
    """Return the side forces of a vehicle whose roll axis is not known.

    Parameters
    ----------
    structure
        Nominal vehicle.
    wheelbase
        Wheelbase [m].
    speed
        Mean speed [m/s], above 0.
    """
    return SideForces(structure, _HEIGHT * wheelbase, speed)


def _positive(parameter: float, soft: float) -> tuple[float, float]:
    """Value of a parameter that is hardly below 0, at least -soft, and its derivative; the parameter itself above 0.

    A mass below 0 would imitate stiffness that the vehicle file lacks, such as an anti-roll bar.
    """
    if parameter >= 0:
        return float(parameter), 1.0
    slope = float(np.exp(parameter / soft))
    return soft * (slope - 1.0), slope
