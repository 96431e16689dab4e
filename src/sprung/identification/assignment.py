"""Modes of successive windows assigned to tracks: the filter behind `tracking.track_modes`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment

from sprung._arrays import Complex, Real
from sprung.identification.tracks import MEDIAN_NORMAL, TrackingSettings
from sprung.modal import Modes

#: Cost above which a mode is not that of a track, and difference 1 - MAC that costs as much as one standard deviation.
_GATE, _SHAPE = 16.0, 0.05
#: Further cost of a track that is not yet confirmed: established tracks choose first.
_TENTATIVE = 8.0
#: Cost of a shape in the plane of those of two tracks whose half-power bands overlap (within which the shapes of close
#: modes turn), least share of the shape in that plane, and relative distance at which bands overlap in any case.
_IN_PLANE, _PLANE_MAC, _CLOSE = 8.0, 0.9, 0.005
#: Modes whose shapes are the recent shape of a track.
_RECENT = 10
#: Largest standard deviation of an estimate over the reach, and share of its damping ratio in place of an unknown one.
_LARGEST_STD, _UNKNOWN_STD = 0.25, 0.2
#: Least MAC of modes of neighbouring windows whose difference shows how modes scatter, pairs needed for that, and
#: bounds of the scatter over the stated deviations.
_PAIR_MAC, _FEWEST_PAIRS, _SCATTER_BOUNDS = 0.9, 10, (0.2, 5.0)


#: Numbers of the windows of a track, and of its mode in each.
Members = list[tuple[int, int]]


@dataclass(frozen=True, slots=True)
class Estimates:
    """Modes of one window: ln of their frequencies, the variance of that, and shapes of norm 1."""

    position: Real
    variance: Real
    damping: Real
    shapes: Complex

    def __len__(self) -> int:
        return len(self.position)


class Tracker:
    """State of one track: ln frequency with its variance, and shape, as of the last mode."""

    def __init__(self, estimates: Estimates, member: int, window: int) -> None:
        self.position, self.variance = float(estimates.position[member]), float(estimates.variance[member])
        self.dampings = [float(estimates.damping[member])]
        self.damping = self.dampings[0]
        self.recent = [estimates.shapes[member]]
        self.shape = estimates.shapes[member]
        self.members: Members = [(window, member)]

    @property
    def last(self) -> int:
        """Number of the last window with the mode."""
        return self.members[-1][0]

    def update(self, estimates: Estimates, member: int, window: int, predicted: float) -> None:
        """Take the next mode, given the variance predicted for its window."""
        gain = predicted / (predicted + estimates.variance[member])
        self.position += gain * float(estimates.position[member] - self.position)
        self.variance = (1 - gain) * predicted
        self.members.append((window, member))
        self.dampings = [*self.dampings[1 - _RECENT :], float(estimates.damping[member])]
        self.recent = [*self.recent[1 - _RECENT :], estimates.shapes[member]]
        self.damping = float(np.median(self.dampings))
        self.shape = _main_directions(self.recent, 1)[0]


def estimates_of(modes: Modes, settings: TrackingSettings) -> Estimates:
    """Return the modes of a window for comparisons."""
    frequency = modes.natural_frequency
    relative = modes.natural_frequency_std / frequency
    relative = np.where(np.isfinite(relative) & (relative > 0), relative, _UNKNOWN_STD * np.abs(modes.damping_ratio))
    norms = np.linalg.norm(modes.mode_shapes, axis=1, keepdims=True)
    shapes = modes.mode_shapes / np.maximum(norms, np.finfo(float).tiny)
    variance = np.minimum(relative, _LARGEST_STD * settings.reach) ** 2
    return Estimates(np.log(frequency), variance, modes.damping_ratio, shapes)


def with_scatter(estimates: Sequence[Estimates | None], settings: TrackingSettings) -> list[Estimates | None]:
    """Return the estimates with variances as modes of one shape scatter between neighbouring windows."""
    present = [part for part in estimates if part is not None]
    deviations = [z for before, after in pairwise(present) for z in _differences(before, after, settings)]
    if len(deviations) < _FEWEST_PAIRS:
        return list(estimates)
    scale = float(np.clip(np.median(deviations) / MEDIAN_NORMAL, *_SCATTER_BOUNDS))
    largest = (_LARGEST_STD * settings.reach) ** 2
    return [
        None if part is None else replace(part, variance=np.minimum(scale**2 * part.variance, largest))
        for part in estimates
    ]


def _differences(before: Estimates, after: Estimates, settings: TrackingSettings) -> list[float]:
    """Return the differences of modes that are nearest to each other and of one shape, in standard deviations."""
    distance = np.abs(before.position[:, None] - after.position)
    likeness = np.abs(np.conj(before.shapes) @ after.shapes.T) ** 2
    cost = np.where(likeness >= _PAIR_MAC, distance, np.inf)
    rows, columns = np.arange(len(before)), np.argmin(cost, axis=1)
    is_mutual = (np.argmin(cost, axis=0)[columns] == rows) & (cost[rows, columns] <= settings.reach)
    rows, columns = rows[is_mutual], columns[is_mutual]
    deviations: list[float] = (
        distance[rows, columns] / np.sqrt(before.variance[rows] + after.variance[columns])
    ).tolist()
    return deviations


def follow(estimates: Sequence[Estimates | None], times: Real, gap: float, settings: TrackingSettings) -> list[Tracker]:
    """Assign the modes of each window to the tracks, and start tracks; times and gap in distances of the windows."""
    ended: list[Tracker] = []
    alive: list[Tracker] = []
    for window, part in enumerate(estimates):
        if part is None:
            continue
        is_alive = [times[window] - times[tracker.last] <= gap for tracker in alive]
        ended += [tracker for tracker, yes in zip(alive, is_alive, strict=True) if not yes]
        alive = [tracker for tracker, yes in zip(alive, is_alive, strict=True) if yes]
        predicted = np.array([t.variance + settings.drift**2 * (times[window] - times[t.last]) for t in alive])
        predicted = np.minimum(predicted, (settings.reach / np.sqrt(_GATE)) ** 2)
        taken = assigned(_costs(alive, part, predicted, settings))
        for row, member in taken:
            alive[row].update(part, member, window, float(predicted[row]))
        new = set(range(len(part))) - {member for _, member in taken}
        alive += [Tracker(part, member, window) for member in sorted(new)]
    return sorted([*ended, *alive], key=lambda tracker: tracker.members[0])


def _costs(trackers: Sequence[Tracker], part: Estimates, predicted: Real, settings: TrackingSettings) -> Real:
    """Return the cost of each mode for each track, infinite where it is not the same mode; shape (tracks, modes)."""
    if not trackers:
        return np.zeros((0, len(part)))
    positions = np.array([tracker.position for tracker in trackers])
    likeness = np.abs(np.conj(np.array([tracker.shape for tracker in trackers])) @ part.shapes.T) ** 2
    unlike = np.where(likeness >= settings.least_mac, (1 - likeness) / _SHAPE, np.inf)
    is_established = np.array([len(tracker.members) >= settings.least_count for tracker in trackers])
    dampings = np.array([tracker.damping for tracker in trackers])
    is_close = np.abs(positions[:, None] - positions) <= _CLOSE + dampings[:, None] + dampings
    is_close &= is_established & is_established[:, None]
    for row in np.flatnonzero(is_close.sum(axis=1) > 1).tolist():
        near = [shape for other in np.flatnonzero(is_close[row]).tolist() for shape in trackers[other].recent]
        in_plane = np.sum(np.abs(np.conj(_main_directions(near, 2)) @ part.shapes.T) ** 2, axis=0)
        turned = np.where(in_plane >= _PLANE_MAC, _IN_PLANE + (1 - in_plane) / _SHAPE, np.inf)
        unlike[row] = np.minimum(unlike[row], turned)
    variance = predicted[:, None] + part.variance
    cost = (positions[:, None] - part.position) ** 2 / variance + np.log1p(variance / settings.drift**2) + unlike
    cost += np.where(is_established, 0.0, _TENTATIVE)[:, None]
    return np.where(cost <= _GATE, cost, np.inf)


def _main_directions(shapes: Sequence[Complex], rank: int) -> Complex:
    """Return the orthonormal shapes that explain most of some shapes, shape (rank, channels) or fewer."""
    directions: Complex = np.linalg.svd(np.array(shapes), full_matrices=False)[2][:rank]
    return directions


def assigned(costs: Real) -> list[tuple[int, int]]:
    """Return the pairs of least total cost, in which a track or mode without a partner costs half the gate."""
    rows, columns = linear_sum_assignment(np.minimum(costs, _GATE))
    return [(int(row), int(column)) for row, column in zip(rows, columns, strict=True) if costs[row, column] < _GATE]
