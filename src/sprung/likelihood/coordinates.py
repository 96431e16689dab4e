"""Sensors on a vehicle as the coordinates that its motion can be seen in."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung.errors import ParameterError
from sprung.vehicles import Structure

#: Typical noise of sensors by order of the time derivative they measure [m or rad, per s, per s^2].
_NOISE = (1e-4, 1e-3, 1e-2)
# Least share of its reading that an accelerometer must take from vertical motion: others see braking and gravity.
_LEAST_VERTICAL = 0.7
# Directions that the sensors tell less of than this, relative to the best one, are left out.
_WEAKEST = 1e-3


@dataclass(frozen=True, eq=False, slots=True)
class RigidLayout:
    """The combinations of channels that the model explains.

    Parameters
    ----------
    names
        Channels, shape (channels,).
    coordinates
        Names of the coordinates: "bounce", "pitch", "roll" where these are what the sensors see; numbers otherwise.
    orders
        Order of the time derivative that each channel measures (acceleration 2, angular velocity 1).
    reduction
        Shape (coordinates, channels): coordinates = reduction times the channels, differentiated to accelerations.
    motion
        Shape (channels, n): the channels, differentiated to accelerations, for one unit of acceleration of each
        coordinate of the structure.
    noise
        Shape (channels, coordinates, coordinates): covariance of the coordinates for noise of the usual size on one
        channel.
    """

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    orders: Indices
    reduction: Real
    motion: Real
    noise: Real

    def __post_init__(self) -> None:
        freeze(self, orders=1, dtype=np.intp)
        freeze(self, reduction=2, motion=2, noise=3)

    @property
    def rows(self) -> Real:
        """The coordinates for one unit of acceleration of each coordinate of the structure, (coordinates, n)."""
        return self.reduction @ self.motion

    def differentiator(self, frequencies: Real) -> Complex:
        """Return factors that make each channel's spectrum that of an acceleration, shape (frequencies, channels)."""
        return np.asarray((2j * np.pi * frequencies[:, None]) ** (2 - self.orders), dtype=np.complex128)


def rigid_layout(structure: Structure) -> RigidLayout:
    """Return the coordinates that the sensors of a structure see, as many as there are independent ones.

    Parameters
    ----------
    structure
        With its motion sensors.

    Raises
    ------
    ParameterError
        Where no sensor sees a motion of the structure.

    Notes
    -----
    With channels y = T q'' (after differentiation) weighted by the usual noise, W T = U S V^T: the coordinates are
    U_r^T W y, so that what the rigid vehicle cannot explain is left out. Where these are bounce, pitch and roll of the
    body they are turned into them, which changes no likelihood.
    """
    outputs = structure.outputs
    matrices = (outputs.displacement, outputs.velocity, outputs.acceleration)
    sizes = np.array([np.abs(matrix).sum(axis=1) for matrix in matrices])
    orders = np.argmax(sizes, axis=0)
    upright = [
        channel.direction is None or abs(channel.direction[2]) >= _LEAST_VERTICAL for channel in outputs.channels
    ]
    seen = np.flatnonzero((sizes.max(axis=0, initial=0.0) > 0) & (upright | (orders < 2)))
    if not seen.size:
        raise ParameterError(
            "no sensor sees a motion of the vehicle: add [[sensor]] tables with position and direction"
        )
    orders = orders[seen]
    T = np.sum(matrices, axis=0)[seen]
    weights = 1 / np.array(_NOISE)[orders]
    U, S, _ = np.linalg.svd(weights[:, None] * T, full_matrices=False)
    kept = U[:, S / S[0] > _WEAKEST]
    mix, names = _as_motions(kept.T @ (weights[:, None] * T), structure.coordinates)
    noise = np.einsum("ic,jc->cij", mix @ kept.T, mix @ kept.T)
    reduction = mix @ (kept.T * weights)
    channels = tuple(outputs.names[row] for row in seen)
    return RigidLayout(channels, names, orders, reduction, T, noise)


def _as_motions(rows: Real, coordinates: tuple[str, ...]) -> tuple[Real, tuple[str, ...]]:
    """Return what turns coordinates into the body's motions, and their names; nothing where they see anything else."""
    columns = np.flatnonzero(np.abs(rows).max(axis=0) > 0)
    if len(rows) == len(columns):
        return np.asarray(np.linalg.inv(rows[:, columns]), dtype=np.float64), tuple(
            coordinates[column] for column in columns
        )
    return np.eye(len(rows)), tuple(str(number) for number in range(1, len(rows) + 1))
