"""Pieces of tracks put together: one mode that was followed in several pieces, and modes that jump."""

from collections.abc import Sequence

import numpy as np

from sprung._arrays import Booleans, Complex, Real
from sprung.identification.assignment import Estimates, Members, Tracker, assigned
from sprung.identification.tracks import FEWEST_FOR_SCATTER, TrackingSettings, mean_shape, scatter
from sprung.modal import mac

#: Least MAC of shapes that are certainly of one mode, how many times their scatter its frequencies may differ, and
#: which share of the half-power half-bandwidth.
_SAME_MAC, _SAME, _SAME_BANDWIDTH = 0.9, 2.0, 0.5
#: Smallest MAC of the shapes on both sides of a jump, and windows on each side that are compared.
_JUMP_MAC, JUMP_WINDOWS = 0.8, 10


def united(
    trackers: Sequence[Tracker], estimates: Sequence[Estimates | None], times: Real, gap: float
) -> list[Members]:
    """Return the members of tracks, those of one frequency and shape united; what they have twice is left apart.

    A shape that turns between windows, as those of two nearly equal natural frequencies do, leaves one mode in several
    tracks whose mean shapes are alike.
    """
    whole: list[Members] = []
    left: list[Members] = []
    for tracker in sorted(trackers, key=lambda tracker: -len(tracker.members)):
        for number, members in enumerate(whole):
            if _is_same(members, tracker.members, estimates, times, gap):
                taken = {window for window, _ in members}
                whole[number] = sorted([*members, *(pair for pair in tracker.members if pair[0] not in taken)])
                left += [[pair] for pair in tracker.members if pair[0] in taken]
                break
        else:
            whole.append(tracker.members)
    return sorted([*whole, *left])


def _is_same(members: Members, fewer: Members, estimates: Sequence[Estimates | None], times: Real, gap: float) -> bool:
    """Whether a track of fewer modes is the same mode as another: near it in time and frequency, and of one shape."""
    positions, others = (_positions(part, estimates) for part in (members, fewer))
    if len(positions) < FEWEST_FOR_SCATTER:
        return False
    when, then = (times[[window for window, _ in part]] for part in (members, fewer))
    after = np.clip(np.searchsorted(when, then), 1, len(when) - 1)
    wait = np.min(np.minimum(np.abs(then - when[after]), np.abs(then - when[after - 1])))
    apart = abs(float(np.median(others - np.interp(then, when, positions))))
    if wait > gap or apart > max(_SAME * scatter(positions), _SAME_BANDWIDTH * _damping(fewer, estimates)):
        return False
    return float(mac(_shape(members, estimates)[None], _shape(fewer, estimates)[None])[0, 0]) >= _SAME_MAC


def _positions(members: Members, estimates: Sequence[Estimates | None]) -> Real:
    """Return ln f of the modes of a track."""
    return np.array([part.position[member] for window, member in members if (part := estimates[window]) is not None])


def _damping(members: Members, estimates: Sequence[Estimates | None]) -> float:
    """Return the median damping ratio of the modes of a track."""
    return float(
        np.median([part.damping[member] for window, member in members if (part := estimates[window]) is not None])
    )


def _shape(members: Members, estimates: Sequence[Estimates | None]) -> Complex:
    """Return the mean shape of modes of a track."""
    parts = [part.shapes[member] for window, member in members if (part := estimates[window]) is not None]
    return mean_shape(np.array(parts))


def continued(
    tracks: Sequence[Members],
    estimates: Sequence[Estimates | None],
    times: Real,
    has_result: Booleans,
    *,
    gap: float,
    settings: TrackingSettings,
) -> list[list[Members]]:
    """Return the parts of each track: confirmed ones that end are continued by confirmed ones that start later."""
    confirmed = [k for k, members in enumerate(tracks) if is_confirmed(members, has_result, settings)]
    ends, starts = ([tracks[k][part] for k in confirmed] for part in (slice(-JUMP_WINDOWS, None), slice(JUMP_WINDOWS)))
    costs = np.full((len(confirmed), len(confirmed)), np.inf)
    for row, end in enumerate(ends):
        for column, start in enumerate(starts):
            wait = times[start[0][0]] - times[end[-1][0]]
            apart = abs(float(np.median(_positions(start, estimates)) - np.median(_positions(end, estimates))))
            if not 0 < wait <= gap or apart > settings.reach:
                continue
            unlike = 1 - float(mac(_shape(start, estimates)[None], _shape(end, estimates)[None])[0, 0])
            if unlike <= 1 - _JUMP_MAC:
                costs[row, column] = apart / settings.reach + unlike / (1 - _JUMP_MAC) + wait / gap
    successors = {confirmed[row]: confirmed[column] for row, column in assigned(costs)}
    chains = []
    for head in sorted(set(range(len(tracks))) - set(successors.values())):
        chain, k = [tracks[head]], head
        while k in successors:
            k = successors[k]
            chain.append(tracks[k])
        chains.append(chain)
    return chains


def is_confirmed(members: Members, has_result: Booleans, settings: TrackingSettings) -> bool:
    """Whether a track has enough modes in windows that follow each other, of those with results."""
    counts = np.cumsum(has_result)
    least = min(settings.least_count, int(counts[-1]))
    places = [int(counts[window]) for window, _ in members]
    return any(last - first < settings.out_of for first, last in zip(places, places[least - 1 :], strict=False))
