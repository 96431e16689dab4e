"""Geometry and modes as universal files (UFF, UNV), for programs of modal analysis."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from sprung._checks import check_one_of, required
from sprung.formats.nodes import Nodes, nodes_of
from sprung.modal import Modes
from sprung.recording import Channel

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
