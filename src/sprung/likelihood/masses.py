"""Entries of the mass matrix as parameters: payload on the body, unsprung masses."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import freeze
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Seat, Structure, body_row
from sprung.vehicles.labels import MOTIONS


@dataclass(frozen=True, eq=False, slots=True)
class MassParameter:
    """Parameter of the mass matrix.

    Parameters
    ----------
    name
        Name of the parameter.
    matrix
        Change of the mass matrix for one unit of the parameter, in kg and kg m^2, shape (n, n), symmetric.
    std
        Standard deviation of the parameter about 0 before any data.
    unit
        One unit of the parameter in kg, kg m or kg m^2.
    """

    name: str
    matrix: Real
    std: float
    unit: float = 1.0

    def __post_init__(self) -> None:
        freeze(self, matrix=2)


@dataclass(frozen=True, eq=False, slots=True)
class AddedMass(ParameterBlock):
    """Additions to the mass matrix: M = M_nominal + sum p_k M_k.

    Parameters
    ----------
    parts
        Parameters of the mass matrix.
    """

    parts: tuple[MassParameter, ...]

    group: ClassVar[str] = "payload"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parts."""
        return tuple(part.name for part in self.parts)

    @property
    def prior_std(self) -> Real:
        """Standard deviations of the parts."""
        return np.array([part.std for part in self.parts])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the mass added."""
        return replace(terms, mass=terms.mass + self._mass(parameters))

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        by_mass = gradients.mass.real
        return np.array([np.sum(by_mass * part.matrix) for part in self.parts])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        return [response.change_by_mass(part.matrix) for part in self.parts]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return masses [kg], moments [kg m] and inertias [kg m^2]."""
        return {part.name: part.unit * float(value) for part, value in zip(self.parts, parameters, strict=True)}

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the mass added."""
        return replace(structure, mass=structure.mass + self._mass(parameters))

    def _mass(self, parameters: Real) -> Real:
        """Added mass matrix."""
        return np.einsum("p,pij->ij", parameters, np.array([part.matrix for part in self.parts]))


class UnsprungMass(AddedMass):
    """Unsprung masses of the axles beyond the vehicle file."""

    __slots__ = ()

    group: ClassVar[str] = "unsprung"


@dataclass(frozen=True, eq=False, slots=True)
class SeatLoads(ParameterBlock):
    """People on seats: dynamic masses at places of the body, in units of the usual load of each seat.

    Parameters
    ----------
    structure
        Vehicle with bounce, pitch and roll of a body.
    seats
        Seats of the vehicle file.

    Notes
    -----
    A mass m on a seat of natural frequency w0 and damping ratio z loads the body vertically as m T(s), with
    T = (2 z w0 s + w0^2) / (s^2 + 2 z w0 s + w0^2), and moves with it sideways. It has no coordinate of its own: the
    dynamic stiffness m s^2 T of an element at the seat is linear in m, which may be 0. In the fitted structure the mass
    is fixed to the body, as it is far below w0.

    References
    ----------
    J. P. Den Hartog, Mechanical Vibrations, 4th edition, McGraw-Hill, 1956, section 3.3 (vibration absorber).
    ISO 5982:2019, Mechanical vibration and shock - Range of idealized values to characterize human biodynamic response
    (apparent mass of seated people).

    Examples
    --------
    75 kg on a seat half a metre ahead and to the left of the centre of gravity:

    >>> import numpy as np
    >>> from sprung.vehicles import Seat, read_vehicle, structure
    >>> seats = SeatLoads(structure(read_vehicle("zafira")), (Seat(x=0.5, y=0.5, load=75.0),))
    >>> values = seats.values(np.array([1.0]))
    >>> values["seat_1"], values["payload_mass"], values["payload_x_moment"], values["payload_y_moment"]
    (75.0, 75.0, -37.5, 37.5)
    """

    structure: Structure
    seats: tuple[Seat, ...]

    group: ClassVar[str] = "payload"

    @property
    def names(self) -> tuple[str, ...]:
        """Seats by number."""
        return tuple(f"seat_{number}" for number in range(1, len(self.seats) + 1))

    @property
    def prior_std(self) -> Real:
        """The usual loads."""
        return np.ones(len(self.seats))

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with an element at each seat, after those of the vehicle."""
        own = parameters[:, None] * self._units(terms)
        return replace(
            terms,
            elongations=np.vstack([terms.elongations, self._rows()]),
            feet=np.vstack([terms.feet, np.zeros((len(own), terms.feet.shape[1]))]),
            stiffness=np.vstack([terms.stiffness, own]),
            mass=terms.mass + self._sideways(parameters),
        )

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        upward = gradients.stiffness(range(-len(self.seats), 0)) * self._units(gradients.transfer.terms)
        sideways = [np.sum(gradients.mass.real * self._sideways(unit)) for unit in np.eye(len(self.seats))]
        return np.asarray(upward.real.sum(axis=1) + sideways, dtype=np.float64)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        first = len(response.terms.elongations) - len(self.seats)
        units = self._units(response.terms)
        return [
            response.change_by_element(first + number, units[number]) + response.change_by_mass(self._sideways(unit))
            for number, unit in enumerate(np.eye(len(self.seats)))
        ]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the load of each seat [kg], and what they add to the entries of a payload."""
        loads = parameters * [seat.load for seat in self.seats]
        x, y = (np.array([getattr(seat, axis) for seat in self.seats]) for axis in ("x", "y"))
        entries = {
            "mass": np.ones(loads.size),
            "x_moment": -x,
            "y_moment": y,
            "pitch_inertia": x**2,
            "roll_inertia": y**2,
            "product": -x * y,
        }
        totals = {f"payload_{name}": float(loads @ entry) for name, entry in entries.items()}
        return totals | dict(zip(self.names, loads.tolist(), strict=True))

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the loads fixed to the body."""
        loads, rows = parameters * [seat.load for seat in self.seats], self._rows()
        return replace(structure, mass=structure.mass + (rows.T * loads) @ rows + self._sideways(parameters))

    def _rows(self) -> Real:
        """Vertical motion of the body at each seat for one unit of each coordinate, shape (seats, n)."""
        vehicle = self.structure
        return np.array([body_row(vehicle.coordinates, x=at.x, y=at.y, shapes=vehicle.shapes) for at in self.seats])

    def _units(self, terms: Terms) -> Complex:
        """Dynamic stiffness of the usual load of each seat [N/m], shape (seats, grid)."""
        s, units = terms.s, []
        for seat in self.seats:
            w = 2 * np.pi * seat.frequency
            held = 2 * seat.damping_ratio * w * s + w**2
            units.append(seat.load * s**2 * held / (s**2 + held))
        return np.array(units)

    def _sideways(self, parameters: Real) -> Real:
        """Mass matrix of the loads for sway and yaw; 0 where the body has none."""
        n, places = len(self.structure.coordinates), [self.structure.coordinates.index(name) for name in self._plane]
        mass = np.zeros((n, n))
        for parameter, seat in zip(parameters.tolist(), self.seats, strict=True):
            row = np.array([1.0, seat.x])[: len(places)]
            mass[np.ix_(places, places)] += parameter * seat.load * np.outer(row, row)
        return mass

    @property
    def _plane(self) -> tuple[str, ...]:
        """Sway and yaw, where the body has them."""
        return tuple(name for name in ("sway", "yaw") if name in self.structure.coordinates)


def payload(nominal: Structure, *, std: float = 0.2, moment_std: float = 0.1) -> AddedMass:
    """Return mass, moments and inertias of a payload on the body.

    Parameters
    ----------
    nominal
        Vehicle with bounce, pitch and roll of a body.
    std
        Standard deviation of mass and inertias over the body's own.
    moment_std
        Standard deviation of the moments m x and m y over the root of mass times inertia, and of the product of
        inertia -m x y over the root of the pitch inertia times the roll inertia.

    Notes
    -----
    Each is relative to the body's own. A mass m at (x, y) adds m r r^T with r = [1, -x, y] for bounce, pitch and
    roll. A load off both axes of the body couples pitch with roll: without the product it would appear as springs
    that differ from corner to corner. Where the body sways and yaws, too, a mass at the height z above its centre of
    gravity adds m q q^T with q = [1, x, -z] for sway, yaw and roll; its moment m z has the deviation of m y.

    References
    ----------
    ISO 8855:2011, Road vehicles - Vehicle dynamics and road-holding ability - Vocabulary (axes).

    Examples
    --------
    A load of 74 kg is 5 % of the body of 1480 kg:

    >>> import numpy as np
    >>> from sprung.vehicles import read_vehicle, structure
    >>> nominal = structure(read_vehicle("zafira"))
    >>> added = payload(nominal)
    >>> parameters = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0])
    >>> round(added.values(parameters)["payload_mass"], 6)
    74.0
    >>> np.diag(added.fitted(parameters, nominal).mass - nominal.mass)[:3].round(6).tolist()
    [74.0, 0.0, 0.0]
    """
    n = len(nominal.coordinates)
    rows = [nominal.coordinates.index(name) for name in MOTIONS]
    sizes = np.sqrt(np.diag(nominal.mass)[rows])
    plane = [nominal.coordinates.index(name) for name in ("sway", "yaw") if name in nominal.coordinates]
    has_plane = len(plane) == 2
    parts = []
    for first, second, name in (
        (0, 0, "payload_mass"),
        (0, 1, "payload_x_moment"),
        (0, 2, "payload_y_moment"),
        (1, 1, "payload_pitch_inertia"),
        (2, 2, "payload_roll_inertia"),
        (1, 2, "payload_product"),
    ):
        matrix, size = np.zeros((n, n)), float(sizes[first] * sizes[second])
        matrix[rows[first], rows[second]] = matrix[rows[second], rows[first]] = size
        if has_plane and max(first, second) < 2:  # a mass sways as it bounces, and its moments of x yaw as they pitch
            sign = 1.0 if first == second else -1.0
            matrix[plane[first], plane[second]] = matrix[plane[second], plane[first]] = sign * size
        parts.append(MassParameter(name, matrix, std if first == second else moment_std, unit=size))
    if has_plane:
        matrix, size = np.zeros((n, n)), float(sizes[0] * sizes[2])
        matrix[plane[0], rows[2]] = matrix[rows[2], plane[0]] = -size
        parts.append(MassParameter("payload_z_moment", matrix, moment_std, unit=size))
    return AddedMass(tuple(parts))


def unsprung_masses(nominal: Structure, *, std: float = 0.07) -> UnsprungMass:
    """Return the unsprung masses of each axle, equal on both sides, as parameters.

    Parameters
    ----------
    nominal
        Vehicle with wheels or wheelsets.
    std
        Standard deviation of the unsprung masses of an axle over nominal.

    Notes
    -----
    One unit is the nominal mass of one wheel, or of a wheelset, whose roll inertia grows with it.

    Accelerations are the same if all masses, stiffnesses and dampings are scaled together. If the unsprung masses were
    known exactly, they alone would fix that scale, through the shape of the wheel hop, which friction and rubber change
    by several per cent: the scale would be wrong and stated as certain. The prior is the uncertainty of an unsprung
    mass in a data sheet: which share of links, springs and drive shafts moves with the wheel.

    Examples
    --------
    A parameter of 0.1 is a tenth of the 40.5 kg of a front wheel:

    >>> import numpy as np
    >>> from sprung.vehicles import read_vehicle, structure
    >>> masses = unsprung_masses(structure(read_vehicle("zafira")))
    >>> masses.values(np.array([0.1, 0.0]))
    {'front_unsprung_mass': 4.05, 'rear_unsprung_mass': 0.0}
    """
    axles: dict[str, list[int]] = {}
    for row, name in enumerate(nominal.coordinates):
        kind, _, place = name.partition("_")
        if kind in {"wheel", "wheelset"}:
            axles.setdefault(place.rpartition("_")[0] or place, []).append(row)
    parts = []
    for axle, rows in axles.items():
        matrix = np.zeros(nominal.mass.shape)
        matrix[rows, rows] = nominal.mass[rows, rows]
        parts.append(MassParameter(f"{axle}_unsprung_mass", matrix, std, unit=float(matrix[rows[0], rows[0]])))
    return UnsprungMass(tuple(parts))
