"""A small symmetric car as the fields of a vehicle file."""

from typing import Any

CORNER = {"unsprung_mass": 40.0, "spring_stiffness": 30e3, "damping": 1500.0, "tyre_stiffness": 200e3}


def car(**changes: Any) -> dict[str, Any]:
    """Return its fields with some of them changed."""
    return {
        "name": "car",
        "kind": "road",
        "body": {"mass": 1400.0, "pitch_inertia": 2000.0, "roll_inertia": 400.0},
        "axle": [{"x": x, "half_track": 0.7, **CORNER} for x in (1.3, -1.3)],
        **changes,
    }
