"""Results as JSON."""

import json
import math
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sprung._arrays import Real

if TYPE_CHECKING:
    import numpy as np

    from sprung.identification import Identification, SubsetModes
    from sprung.modal import Modes
    from sprung.vehicles.usable import AnyVehicle


def write_json(document: Mapping[str, Any], path: str) -> None:
    """Write a document to a file, or to standard output where `path` is "-"."""
    text = json.dumps(plain(document), indent=2, allow_nan=False) + "\n"
    if path == "-":
        sys.stdout.write(text)
        sys.stdout.flush()
    else:
        Path(path).write_text(text, encoding="utf-8")


def plain(value: Any) -> Any:
    """Return values as JSON has them; a number that is not finite, which JSON has not, becomes null."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [plain(member) for member in value]
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    return value


def identification_document(identification: "Identification", *, vehicle: "AnyVehicle | None") -> dict[str, Any]:
    """Return an identification as `sprung.identification/1`.

    Parameters
    ----------
    identification
        Of any method.
    vehicle
        That of the identification: gives the participation its mass matrix.
    """
    settings = identification.effective_settings
    lifter = settings.lifter
    return {
        "schema": "sprung.identification/1",
        "method": identification.method,
        "channels": [channel.name for channel in identification.channels],
        "sampling_rate": identification.sampling_rate,
        "band": identification.band,
        "modes": _modes(identification, vehicle),
        "subsets": [
            {"n_segments": subset.n_segments, "level": subset.level, "modes": _modes_alone(subset.modes)}
            for subset in identification.subsets
        ],
        "harmonics": [
            {**plain(line), "unit": "Hz" if line.kind == "constant" else "1/m"} for line in identification.harmonics
        ],
        "settings": {**plain(settings), "lifter": lifter and {"kind": type(lifter).__name__, **plain(lifter)}},
        "notes": identification.notes,
    }


def _modes(identification: "Identification", vehicle: "AnyVehicle | None") -> list[dict[str, Any]]:
    """Return the merged modes, each with what the subsets say about it."""
    modes = _modes_alone(identification.modes)
    for mode, participation, members in zip(
        modes, _participations(identification, vehicle), identification.members, strict=True
    ):
        mode["participation"] = participation
        mode["subsets"] = [
            _value(subset, int(member)) if member >= 0 else None
            for subset, member in zip(identification.subsets, members, strict=True)
        ]
    return modes


def _modes_alone(modes: "Modes") -> list[dict[str, Any]]:
    """Return modes without their context."""
    return [
        {
            **_numbers(modes, k),
            "mode_shape": {"real": modes.mode_shapes[k].real, "imag": modes.mode_shapes[k].imag},
            "mpc": modes.mpc[k],
            "label": modes.labels[k],
            "stable_rate": modes.stable_rate[k],
        }
        for k in range(len(modes))
    ]


def _numbers(modes: "Modes", k: int) -> dict[str, float]:
    """Return frequency and damping of a mode."""
    return {
        name: getattr(modes, name)[k]
        for name in ("natural_frequency", "natural_frequency_std", "damping_ratio", "damping_ratio_std")
    }


def _value(subset: "SubsetModes", member: int) -> dict[str, Any]:
    """Return what a subset says about a merged mode."""
    return {**_numbers(subset.modes, member), "stable_rate": subset.modes.stable_rate[member]}


def _participations(
    identification: "Identification", vehicle: "AnyVehicle | None"
) -> list[dict[str, "np.float64"] | None]:
    """Return the shares of the rigid-body motions in each mode; None where the layout does not tell."""
    from sprung.vehicles.labels import MOTIONS, rigid_body_participation

    shares, explained = rigid_body_participation(
        identification.modes, identification.channels, mass=_body_mass(vehicle)
    )
    return [
        None if math.isnan(share[0]) else {**dict(zip(MOTIONS, share, strict=True)), "explained": fit}
        for share, fit in zip(shares, explained, strict=True)
    ]


def _body_mass(vehicle: "AnyVehicle | None") -> "Real | None":
    """Return the mass matrix of a vehicle's body in bounce, pitch and roll."""
    from sprung.vehicles import Vehicle, structure

    return structure(vehicle).mass[:3, :3] if isinstance(vehicle, Vehicle) else None
