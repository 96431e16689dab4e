"""Coordinates of a vehicle's motion that its sensors observe."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung.errors import ParameterError
from sprung.vehicles import Structure

#: Usual noise of sensors by the order of the time derivative that they measure [m or rad, per s, per s^2].
TYPICAL_NOISE = (1e-4, 1e-3, 1e-2)


@dataclass(frozen=True, slots=True)
class LayoutLimits:
    """Limits of what sensors observe."""

    #: Smallest vertical direction cosine of an accelerometer that is used: others also measure braking and gravity.
    vertical: float = 0.7
    #: Directions whose singular value is less than this share of the largest are left out.
    weakest: float = 1e-3


LIMITS = LayoutLimits()


@dataclass(frozen=True, eq=False, slots=True)
class RigidLayout:
    """Combinations of channels that the model explains.

    Parameters
    ----------
    names
        Names of the channels.
    coordinates
        Names of the coordinates: "bounce", "pitch", "roll" if the sensors observe these alone; numbers otherwise.
    orders
        Order of the time derivative that each channel measures (acceleration 2, angular velocity 1), shape (channels,).
    reduction
        Coordinates for one unit of each channel, differentiated to an acceleration, shape (coordinates, channels).
    motion
        Reading of the channels, differentiated to accelerations, for one unit of acceleration of each coordinate of the
        structure, shape (channels, n).
    noise
        Covariance of the coordinates for noise of the usual size on one channel, shape
        (channels, coordinates, coordinates).
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
        """Coordinates for one unit of acceleration of each coordinate of the structure, shape (coordinates, n)."""
        return self.reduction @ self.motion

    def differenced(self, samples: Real, sampling_rate: float) -> Real:
        """Return each channel differenced forwards 2 - order times, shape (channels, samples).

        Before a window: its side lobes would otherwise be those of the steeper spectrum of a velocity or displacement.
        """
        rows = [
            np.diff(row, n=times, append=np.repeat(row[-1], times)) * sampling_rate**times
            for row, times in zip(samples, 2 - self.orders, strict=True)
        ]
        return np.asarray(rows, dtype=np.float64)

    def differentiator(self, frequencies: Real, sampling_rate: float) -> Complex:
        """Return the factors that make differences accelerations, i w over (e^(i w / rate) - 1) rate, to 2 - order.

        Shape (frequencies, channels).
        """
        z = 2j * np.pi * frequencies[:, None] / sampling_rate
        return np.asarray((z / np.expm1(z)) ** (2 - self.orders), dtype=np.complex128)


def rigid_layout(structure: Structure) -> RigidLayout:
    """Return the independent coordinates that the sensors of a structure observe.

    Parameters
    ----------
    structure
        Vehicle with its motion sensors.

    Returns
    -------
    RigidLayout

    Raises
    ------
    ParameterError
        If no sensor observes a motion of the structure.

    Notes
    -----
    With channels y = T q'' (after differentiation) weighted by the inverse of the usual noise, W T = U S V^T: the
    coordinates are U_r^T W y, which leaves out what the rigid vehicle cannot explain. Where these are combinations of
    as many motions of the body they are transformed to them, which changes no likelihood.

    References
    ----------
    G. H. Golub and C. F. Van Loan, Matrix Computations, 4th edition, Johns Hopkins University Press, 2013, section 5.5
    (rank-deficient least squares by the singular value decomposition).

    Examples
    --------
    Four accelerometers on a rigid body observe three motions:

    >>> import numpy as np
    >>> from sprung.vehicles import read_vehicle, structure
    >>> layout = rigid_layout(structure(read_vehicle("zafira")))
    >>> layout.coordinates, layout.names
    (('bounce', 'pitch', 'roll'), ('acc_fl', 'acc_fr', 'acc_rl', 'acc_rr'))
    >>> bool(np.allclose(layout.reduction @ np.ones(4), [1, 0, 0]))
    True
    """
    outputs = structure.outputs
    orders, motion = outputs.orders, outputs.motion
    directions = [channel.direction or (0.0, 0.0, 1.0) for channel in outputs.channels]
    upright = np.abs(np.reshape(directions, (-1, 3))[:, 2]) >= LIMITS.vertical
    observed = np.flatnonzero(motion.any(axis=1) & (upright | (orders < 2)))
    if not observed.size:
        raise ParameterError(
            "no sensor observes a motion of the vehicle: add [[sensor]] tables with position and direction"
        )
    orders, T = orders[observed], motion[observed]
    weights = 1 / np.array(TYPICAL_NOISE)[orders]
    U, S, _ = np.linalg.svd(weights[:, None] * T, full_matrices=False)
    kept = U[:, S / S[0] > LIMITS.weakest]
    mix, names = _as_motions(kept.T @ (weights[:, None] * T), structure.coordinates)
    noise = np.einsum("ic,jc->cij", mix @ kept.T, mix @ kept.T)
    reduction = mix @ (kept.T * weights)
    channels = tuple(outputs.names[row] for row in observed)
    return RigidLayout(channels, names, orders, reduction, T, noise)


def _as_motions(rows: Real, coordinates: tuple[str, ...]) -> tuple[Real, tuple[str, ...]]:
    """Matrix that transforms coordinates to motions of the structure, and their names; identity and numbers if none."""
    columns = np.flatnonzero(np.abs(rows).max(axis=0) > 0)
    if len(rows) == len(columns):
        return np.asarray(np.linalg.inv(rows[:, columns]), dtype=np.float64), tuple(
            coordinates[column] for column in columns
        )
    return np.eye(len(rows)), tuple(str(number) for number in range(1, len(rows) + 1))
