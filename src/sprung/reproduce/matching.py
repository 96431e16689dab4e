"""Assignment of identified modes to the true ones."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from sprung._arrays import Real
from sprung.modal import Modes, mac
from sprung.vehicles import Structure

# Cost of an unmatched mode; a match costs 1 - MAC plus its relative distance over the reach.
_UNMATCHED = 2.0


@dataclass(frozen=True, eq=False, slots=True)
class Match:
    """Identified modes of each true mode.

    Parameters
    ----------
    natural_frequency, damping_ratio, mac
        Values of the identified modes, shape (true modes,); NaN where a mode was not found.
    n_others
        Number of identified modes that match no true one.
    """

    natural_frequency: Real
    damping_ratio: Real
    mac: Real
    n_others: int


def matched(modes: Modes, truth: Modes, *, reach: float = 0.12) -> Match:
    """Return for each true mode the identified one that is nearest in shape and frequency.

    Parameters
    ----------
    modes
        Identified modes.
    truth
        True modes of the same channels.
    reach
        Largest relative difference of frequency; the MAC must also be above 0.5.
    """
    values = np.full((3, len(truth)), np.nan)
    if len(modes):
        apart = np.abs(modes.natural_frequency / truth.natural_frequency[:, None] - 1)
        alike = mac(truth.mode_shapes, modes.mode_shapes)
        is_possible = (apart <= reach) & (alike > 0.5)
        cost = np.where(is_possible, 1 - alike + apart / reach, _UNMATCHED)
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            if is_possible[row, column]:
                values[:, row] = modes.natural_frequency[column], modes.damping_ratio[column], alike[row, column]
    return Match(values[0], values[1], values[2], len(modes) - int(np.isfinite(values[0]).sum()))


def theoretical(structure: Structure, *, labels: tuple[str, ...] = ()) -> Modes:
    """Return the exact modes of a structure in the form of identified ones.

    Parameters
    ----------
    structure
        Structure with sensors.
    labels
        Labels of the modes to return; none: all modes.
    """
    exact = structure.modes()
    n = exact.poles.size
    modes = Modes(
        poles=exact.poles,
        mode_shapes=exact.mode_shapes,
        channels=exact.channels,
        natural_frequency_std=np.zeros(n),
        damping_ratio_std=np.zeros(n),
        stable_rate=np.ones(n),
        labels=exact.labels,
    )
    return modes.take(np.flatnonzero([not labels or label in labels for label in exact.labels]))
