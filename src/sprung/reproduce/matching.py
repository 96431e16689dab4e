"""Found modes beside the true ones."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from sprung._arrays import Real
from sprung.modal import Modes, mac
from sprung.vehicles import Structure

# Cost of leaving a mode out; a match costs 1 - MAC plus its distance over the reach.
_UNMATCHED = 2.0


@dataclass(frozen=True, eq=False, slots=True)
class Match:
    """What was found of each true mode.

    Parameters
    ----------
    natural_frequency, damping_ratio, mac
        Shape (true modes,); NaN where the mode was not found.
    n_others
        Found modes that are none of the true ones.
    """

    natural_frequency: Real
    damping_ratio: Real
    mac: Real
    n_others: int


def matched(modes: Modes, truth: Modes, *, reach: float = 0.12) -> Match:
    """Return for each true mode the found one that is nearest in shape and frequency.

    Parameters
    ----------
    modes
        Found.
    truth
        Of the same channels.
    reach
        Largest relative difference of frequency; with several channels the MAC must also be above 0.5.
    """
    found = np.full((3, len(truth)), np.nan)
    if len(modes):
        apart = np.abs(modes.natural_frequency / truth.natural_frequency[:, None] - 1)
        alike = mac(truth.mode_shapes, modes.mode_shapes)
        is_possible = (apart <= reach) & (alike > 0.5)
        cost = np.where(is_possible, 1 - alike + apart / reach, _UNMATCHED)
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            if is_possible[row, column]:
                found[:, row] = modes.natural_frequency[column], modes.damping_ratio[column], alike[row, column]
    return Match(found[0], found[1], found[2], len(modes) - int(np.isfinite(found[0]).sum()))


def theoretical(structure: Structure, *, labels: tuple[str, ...] = ()) -> Modes:
    """Return the exact modes of a structure in the form of found ones.

    Parameters
    ----------
    structure
        With sensors.
    labels
        Only modes of these labels; none given: all.
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
