"""Positions and delays of the sensors as parameters."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import freeze
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Structure


@dataclass(frozen=True, eq=False, slots=True)
class PositionParameter:
    """Coordinate of a sensor's position.

    Parameters
    ----------
    name
        Name of the parameter.
    motion
        Change of `RigidLayout.motion` for 1 m, shape (channels, n).
    """

    name: str
    motion: Real

    def __post_init__(self) -> None:
        freeze(self, motion=2)


@dataclass(frozen=True, eq=False, slots=True)
class SensorPositions(ParameterBlock):
    """Errors of the positions of sensors [m].

    Parameters
    ----------
    parts
        Coordinates of the positions to fit.
    std
        Standard deviation of each about 0 before any data [m].
    """

    parts: tuple[PositionParameter, ...]
    std: float = 0.1

    group: ClassVar[str] = "sensors"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates of the positions."""
        return tuple(part.name for part in self.parts)

    @property
    def prior_std(self) -> Real:
        """The same for all positions."""
        return np.full(len(self.parts), self.std)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the sensors moved."""
        moved = sum((p * part.motion for p, part in zip(parameters, self.parts, strict=True)), terms.motion)
        return replace(terms, motion=moved)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        by_motion = gradients.motion.real
        return np.array([np.sum(by_motion * part.motion) for part in self.parts])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        return [response.change_by_motion(part.motion) for part in self.parts]


@dataclass(frozen=True, eq=False, slots=True)
class SensorDelays(ParameterBlock):
    """Delays of the channels [s].

    Parameters
    ----------
    layout
        All channels.
    channels
        Names of the channels whose delay is fitted.
    std
        Standard deviation of each delay about 0 before any data [s].

    Notes
    -----
    A channel that is late by tau has the frequency response e^(-i w tau). A delay that all channels have in common
    changes no spectral matrix: the prior alone determines it.
    """

    layout: RigidLayout
    channels: tuple[str, ...]
    std: float = 2e-3

    group: ClassVar[str] = "sensors"

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each channel, and "_lag"."""
        return tuple(f"{channel}_lag" for channel in self.channels)

    @property
    def prior_std(self) -> Real:
        """The same for all channels."""
        return np.full(len(self.channels), self.std)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the channels delayed."""
        delays = np.zeros(len(self.layout.names))
        delays[_rows(self.layout, self.channels)] = parameters
        delayed = terms.channel_response * np.exp(-terms.s[:, None] * delays)
        return replace(terms, channel_response=delayed)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        by_channel = np.sum((gradients.channel_response * self._changes(gradients.transfer.terms)).real, axis=0)
        return np.asarray(by_channel[_rows(self.layout, self.channels)], dtype=np.float64)

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        changes = self._changes(response.terms)
        return [response.change_by_channel(row, changes[:, row]) for row in _rows(self.layout, self.channels)]

    def _changes(self, terms: Terms) -> Complex:
        """Derivative of each channel's frequency response with respect to its delay, shape (grid, channels)."""
        return np.asarray(-terms.s[:, None] * terms.channel_response, dtype=np.complex128)


def _rows(layout: RigidLayout, channels: tuple[str, ...]) -> list[int]:
    """Numbers of channels in the layout."""
    return [layout.names.index(channel) for channel in channels]


def sensor_positions(nominal: Structure, layout: RigidLayout) -> SensorPositions:
    """Return the positions of the accelerometers on the body, ahead (x) and to the left (y), as parameters.

    Parameters
    ----------
    nominal
        Vehicle with the sensors.
    layout
        Channels that are used.

    Notes
    -----
    An accelerometer at (x, y) with vertical direction cosine d_z reads d_z (z'' - x p'' + y r'') of bounce z, pitch p
    and roll r, so that its row changes by -d_z for pitch with x and by d_z for roll with y.

    References
    ----------
    ISO 8855:2011, Road vehicles - Vehicle dynamics and road-holding ability - Vocabulary (axes).

    Examples
    --------
    A sensor that is 0.1 m ahead of its place in the file reads 0.1 m less of the pitch acceleration:

    >>> import numpy as np
    >>> from sprung.likelihood import rigid_layout
    >>> from sprung.vehicles import read_vehicle, structure
    >>> nominal = structure(read_vehicle("zafira"))
    >>> positions = sensor_positions(nominal, rigid_layout(nominal))
    >>> positions.names[:3]
    ('acc_fl_x', 'acc_fl_y', 'acc_fr_x')
    >>> (0.1 * positions.parts[0].motion[0, :3] + 0).tolist()
    [0.0, -0.1, 0.0]
    """
    parts = []
    channels = {channel.name: channel for channel in nominal.outputs.channels}
    for row, name in enumerate(layout.names):
        channel = channels[name]
        is_upright = layout.orders[row] == 2 and layout.motion[row, nominal.coordinates.index("bounce")] != 0
        if channel.position is None or channel.direction is None or not is_upright:
            continue
        for axis, coordinate, sign in (("x", "pitch", -1.0), ("y", "roll", 1.0)):
            motion = np.zeros(layout.motion.shape)
            motion[row, nominal.coordinates.index(coordinate)] = sign * channel.direction[2]
            parts.append(PositionParameter(f"{name}_{axis}", motion))
    return SensorPositions(tuple(parts))
