"""Directions in which components change together: left against right, front against rear, all of a kind."""

from functools import lru_cache

import numpy as np

from sprung._arrays import Real
from sprung._checks import frozen_array
from sprung.vehicles import Component

#: Usual common change of all components of a kind from window to window (payload, temperature, road), where the
#: temperature is unknown; that which is left where it is known; and that of front against rear, in ln values.
COMMON = {"spring": 0.08, "damper": 0.25, "tyre": 0.06}
COMMON_AT_A_TEMPERATURE = {"spring": 0.04, "damper": 0.06, "tyre": 0.03}
USUAL_ENDS = {"spring": 0.008, "damper": 0.012, "tyre": 0.005}


def usual_nuisance(
    components: tuple[Component, ...], ends: dict[str, float], together: dict[str, float] | None = None
) -> Real:
    """Return the covariance of the common changes of components from window to window.

    Parameters
    ----------
    components
        Springs, dampers and tyres.
    ends
        Standard deviation between front and rear of each kind, ln values.
    together
        Standard deviation of all components of each kind together, ln values; None: `COMMON`.

    Returns
    -------
    numpy.ndarray
        Covariance, shape (components, components): all components of a kind by the same factor, and the axles against
        each other.
    """
    _, between, alike = directions(components)
    stds = COMMON if together is None else together
    of_ends = np.array([ends.get(kind, max(ends.values())) for kind in kinds_of(between, components)])
    of_all = np.array([stds.get(kind, 0.2) for kind in kinds_of(alike, components)])
    return np.asarray((between.T * of_ends**2) @ between + (alike.T * of_all**2) @ alike, dtype=np.float64)


@lru_cache(maxsize=64)
def directions(components: tuple[Component, ...]) -> tuple[Real, Real, Real]:
    """Return directions as rows, each of shape (rows, components).

    Parameters
    ----------
    components
        Springs, dampers and tyres of corners.

    Returns
    -------
    tuple
        Left against right for each axle and kind; each axle against the next one; all components of a kind together.
    """
    kinds = sorted({component.kind for component in components})
    left = np.array([1.0 if component.side == "left" else -1.0 for component in components])
    pairs, ends, together = [], [], []
    for kind in kinds:
        axles = sorted({component.axle for component in components if component.kind == kind})
        of_axle = [np.array([float((c.axle, c.kind) == (axle, kind)) for c in components]) for axle in axles]
        pairs += [row * left for row in of_axle]
        ends += [of_axle[k] / 2 - of_axle[k + 1] / 2 for k in range(len(axles) - 1)]
        together.append(np.sum(of_axle, axis=0))
    size = len(components)
    first, second, third = (
        frozen_array("rows", np.array(rows).reshape(-1, size), ndim=2) for rows in (pairs, ends, together)
    )
    return first, second, third


def kinds_of(rows: Real, components: tuple[Component, ...]) -> list[str]:
    """Return the kind of components that each direction moves, of rows from `directions`."""
    return [components[int(np.flatnonzero(row)[0])].kind for row in rows]
