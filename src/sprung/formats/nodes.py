"""Channels as the nodes of a structure: where they are, how they move in each mode, and lines between neighbours."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import freeze
from sprung.modal import Modes
from sprung.recording import Channel

#: Positions closer than this [m] are one node.
_SAME_NODE = 1e-6
#: Quantities of translation, by the power of the pole that makes them accelerations.
_POWERS = {"acceleration": 0, "velocity": 1, "displacement": 2, "unknown": 0}


@dataclass(frozen=True, eq=False, slots=True)
class Nodes:
    """Nodes of a structure and their motion in each mode.

    Parameters
    ----------
    positions
        Positions [m], shape (nodes, 3).
    motions
        Motion in each mode, relative to the channel of modulus 1, as accelerations; shape (modes, nodes, 3), complex.
    lines
        Pairs of neighbouring nodes, shape (lines, 2).
    channels
        Names of the channels at each node.
    left_out
        Names of channels that are not drawn: of rotations, or without position or direction.
    is_placed
        Whether the positions are known; otherwise the nodes stand side by side, one for each channel, and move up.
    """

    positions: Real
    motions: Complex
    lines: Indices
    channels: tuple[tuple[str, ...], ...]
    left_out: tuple[str, ...]
    is_placed: bool

    def __post_init__(self) -> None:
        freeze(self, positions=2)
        freeze(self, motions=3, dtype=np.complex128)
        freeze(self, lines=2, dtype=np.intp)


def nodes_of(modes: Modes, channels: Sequence[Channel]) -> Nodes:
    """Return the nodes that channels measure, and their motion in each mode.

    Parameters
    ----------
    modes
        Modes of `channels`.
    channels
        Channels in the order of the mode shapes. If no channel of translation has a position and a direction, the
        channels stand side by side, 1 m apart.

    Returns
    -------
    Nodes

    Notes
    -----
    Velocities and displacements become accelerations by powers of the pole. The motion m of a node is the smallest that
    its channels agree with best: D m = v with the directions in the rows of D (least squares of least norm), so that a
    node with one channel moves along its direction.
    """
    moving = [k for k, channel in enumerate(channels) if channel.quantity in _POWERS]
    placed = [k for k in moving if channels[k].position is not None and channels[k].direction is not None]
    is_placed = bool(placed)
    used = placed or moving
    if is_placed:
        places = np.array([channels[k].position for k in used], dtype=np.float64)
        directions = np.array([channels[k].direction for k in used], dtype=np.float64)
    else:
        places = np.column_stack([np.arange(len(used)), np.zeros((len(used), 2))]).astype(np.float64)
        directions = np.tile([0.0, 0.0, 1.0], (len(used), 1))
    owner = _owners(places)
    n_nodes = int(owner.max(initial=-1)) + 1
    powers = np.array([_POWERS[channels[k].quantity] for k in used])
    values = modes.mode_shapes[:, used] * modes.poles[:, None] ** powers
    motions = np.zeros((len(modes), n_nodes, 3), dtype=np.complex128)
    positions = np.zeros((n_nodes, 3))
    for node in range(n_nodes):
        own = owner == node
        positions[node] = places[own][0]
        motions[:, node] = values[:, own] @ np.linalg.pinv(directions[own]).T
    return Nodes(
        positions=positions,
        motions=motions,
        lines=neighbours(positions),
        channels=tuple(
            tuple(channels[k].name for k, node in zip(used, owner, strict=True) if node == number)
            for number in range(n_nodes)
        ),
        left_out=tuple(channel.name for k, channel in enumerate(channels) if k not in used),
        is_placed=is_placed,
    )


def _owners(places: Real) -> Indices:
    """Return the number of the node of each position, nodes in the order of their first position."""
    owners: list[int] = []
    firsts: list[Real] = []
    for place in places:
        same = [k for k, first in enumerate(firsts) if np.abs(place - first).max() <= _SAME_NODE]
        owners.append(same[0] if same else len(firsts))
        if not same:
            firsts.append(place)
    return np.array(owners, dtype=np.intp)


def neighbours(positions: Real) -> Indices:
    """Return the pairs of neighbouring points: the relative neighbourhood graph.

    Parameters
    ----------
    positions
        Positions, shape (points, 3).

    Returns
    -------
    numpy.ndarray
        Pairs of indices, shape (lines, 2), the smaller one first. Two points are neighbours if no third one is nearer
        to both of them than they are to each other: the sides of a rectangle, the edges of a frame. The graph
        is connected.

    References
    ----------
    G. T. Toussaint (1980), The relative neighbourhood graph of a finite planar set, Pattern Recognition 12, 261-268.
    """
    distance = np.linalg.norm(positions[:, None] - positions, axis=-1)
    pairs = [
        (i, j)
        for i in range(len(positions))
        for j in range(i + 1, len(positions))
        if not np.any(np.maximum(distance[i], distance[j]) < distance[i, j] * (1 - 1e-9))
    ]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)
