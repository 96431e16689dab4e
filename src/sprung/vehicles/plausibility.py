"""Notes on unusual modes of a vehicle file: possible, but perhaps due to a wrong number."""

import numpy as np

from sprung.vehicles.description import Description, Vehicle
from sprung.vehicles.models import structure

#: Motions of a body on its suspension.
_MOTIONS = ("bounce", "pitch", "roll")
#: Usual natural frequencies of a body on its springs [Hz], of a vehicle with a wheelbase of that length [m] or more; a
#: model that is shorter vibrates faster, as the root of its scale (Froude).
_FREQUENCIES, _FULL_SIZE = (0.5, 20.0), 2.5
_SUSPENSION = ("spring_stiffness", "damping")
#: Usual damping ratios of a body on its springs.
_DAMPING = (0.02, 1.0)


def plausibility_notes(vehicle: Description) -> tuple[str, ...]:
    """Return notes on modes of the body with unusual frequency or damping, one sentence each.

    Parameters
    ----------
    vehicle
        Vehicle; a quarter vehicle or a chain may move in any way.

    Notes
    -----
    Usual are 0.5 to 20 Hz, more for models shorter than 2.5 m between the axles, and damping ratios of 2 to 100 %.
    Numbers out of all proportion are refused as the file is read (`description`).
    """
    if not isinstance(vehicle, Vehicle):
        return ()
    modes = structure(vehicle).modes()
    named = {label: k for k, label in enumerate(modes.labels) if label in _MOTIONS}
    wheelbase = vehicle.axle[0].x - vehicle.axle[-1].x
    highest = _FREQUENCIES[1] * float(np.sqrt(max(1.0, _FULL_SIZE / wheelbase)))
    frequencies = {label: float(modes.natural_frequency[k]) for label, k in named.items()}
    odd = [f"{label} {f:.2g} Hz" for label, f in frequencies.items() if not _FREQUENCIES[0] <= f <= highest]
    damping = {label: float(modes.damping_ratio[k]) for label, k in named.items()}
    damping["bounce"] = max(damping.get("bounce", 0.0), _damping_of_bounce(vehicle))
    undue = [
        f"{label} {_percent(x)} %" for label, x in damping.items() if not _DAMPING[0] <= round(x, 6) <= _DAMPING[1]
    ]
    notes = []
    if odd:
        notes.append(
            f"unusual frequencies of the vehicle file's body: {', '.join(odd)}; {_FREQUENCIES[0]:g} to {highest:.3g} Hz"
            " is usual: check masses, inertias and spring stiffness, and their units"
        )
    if undue:
        notes.append(
            f"unusual damping of the vehicle file's body: {', '.join(undue)}; {100 * _DAMPING[0]:g} to"
            f" {100 * _DAMPING[1]:g} % is usual: check damping, and its unit (N s/m)"
        )
    return tuple(notes)


def _percent(ratio: float) -> str:
    """Return a ratio in percent, to two digits."""
    return f"{float(f'{100 * round(ratio, 6):.2g}'):g}"


def _damping_of_bounce(vehicle: Vehicle) -> float:
    """Return the damping ratio of the body above a ground that does not move: strong dampers leave no mode."""
    stiffness, damping = (2 * sum(getattr(axle, name) for axle in vehicle.axle) for name in _SUSPENSION)
    return float(damping / (2 * np.sqrt(stiffness * vehicle.body.mass)))
