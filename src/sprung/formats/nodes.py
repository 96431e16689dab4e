"""Channels as the nodes of a structure: their motion in each mode, lines between neighbours, and universal files."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_one_of, freeze, required
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


_ENDINGS = (".unv", ".uff")
#: Numbers of the format: complex eigenvalues, vectors of three directions, acceleration, a structure.
_COMPLEX_MODE, _VECTOR, _ACCELERATION, _STRUCTURAL = 3, 2, 12, 1
#: Most lines in one trace line: programs take 250 nodes.
_MOST_LINES = 80
_WIDTH = 80


def write_universal(modes: Modes, channels: Sequence[Channel], path: str | PathLike[str]) -> None:
    """Write geometry and modes as a universal file: datasets 164 (SI units), 15 (nodes), 82 (lines) and 55 (modes).

    Parameters
    ----------
    modes
        Modes of `channels`.
    channels
        Channels with positions and directions; without any, nodes stand side by side, 1 m apart, and move along z.
    path
        Path of the file, ending in .unv or .uff; an existing one is replaced.

    Raises
    ------
    ParameterError
        If the file has another ending.
    MissingPackageError
        If pyuff is not installed.

    Notes
    -----
    Nodes are numbered from 1. Modes are complex eigenvalues (analysis type 3) with their pole [rad/s]; the motion of a
    node is that of its channels along x, y, z, as accelerations (`nodes_of`); angular channels are left out. The format
    holds six significant digits.

    References
    ----------
    Structural Dynamics Research Laboratory, University of Cincinnati, Universal File Formats: datasets 15, 55, 82 and
    164.
    """
    path = Path(path)
    check_one_of("ending", path.suffix.lower(), _ENDINGS, advice="universal files end in .unv or .uff")
    package = required("pyuff", purpose="writing universal files", extra="uff")
    nodes = nodes_of(modes, channels)
    sets = [_units(), _geometry(nodes), *_lines(nodes), *(_mode(modes, nodes, k) for k in range(len(modes)))]
    package.UFF(str(path)).write_sets(sets, "overwrite")


def _units() -> dict[str, Any]:
    """Return dataset 164: SI units."""
    return {
        "type": 164,
        "units_code": 1,
        "units_description": "SI",
        "temp_mode": 1,
        "length": 1.0,
        "force": 1.0,
        "temp": 1.0,
        "temp_offset": 273.15,
    }


def _geometry(nodes: Nodes) -> dict[str, Any]:
    """Return dataset 15: the nodes."""
    x, y, z = nodes.positions.T
    return {"type": 15, "node_nums": _numbers(nodes), "x": x, "y": y, "z": z}


def _numbers(nodes: Nodes) -> list[int]:
    return list(range(1, len(nodes.positions) + 1))


def _lines(nodes: Nodes) -> list[dict[str, Any]]:
    """Return datasets 82: lines between neighbours; 0 lifts the pen."""
    sets: list[dict[str, Any]] = []
    for first in range(0, len(nodes.lines), _MOST_LINES):
        pairs = nodes.lines[first : first + _MOST_LINES] + 1
        path = np.column_stack([pairs, np.zeros(len(pairs), dtype=np.intp)]).ravel()[:-1]
        sets.append({"type": 82, "trace_num": len(sets) + 1, "color": 1, "id": "neighbours", "nodes": path})
    return sets


def _mode(modes: Modes, nodes: Nodes, index: int) -> dict[str, Any]:
    """Return dataset 55: one mode."""
    r1, r2, r3 = nodes.motions[index].T
    label = modes.labels[index]
    names = " ".join("+".join(own) for own in nodes.channels)
    return {
        "type": 55,
        "id1": f"mode {index + 1}{f' {label}' if label else ''}",
        "id2": f"{modes.natural_frequency[index]:.6g} Hz, damping {100 * modes.damping_ratio[index]:.4g} %",
        "id3": "NONE" if nodes.is_placed else "positions unknown: channels side by side",
        "id4": _line(f"channels of the nodes: {names}"),
        "id5": "NONE",
        "model_type": _STRUCTURAL,
        "analysis_type": _COMPLEX_MODE,
        "data_ch": _VECTOR,
        "spec_data_type": _ACCELERATION,
        "load_case": 0,
        "mode_n": index + 1,
        "eig": complex(modes.poles[index]),
        "node_nums": _numbers(nodes),
        "r1": r1,
        "r2": r2,
        "r3": r3,
    }


def _line(text: str) -> str:
    """Return a text as one line of ASCII of at most 80 characters."""
    plain = " ".join(text.encode("ascii", "replace").decode("ascii").split())
    return plain if len(plain) <= _WIDTH else plain[: _WIDTH - 4] + " ..."
