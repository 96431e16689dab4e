"""Where vehicles were: distance along a drive, and the ways that drives have in common."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sprung._arrays import Booleans, Real
from sprung._checks import freeze
from sprung.errors import DataError
from sprung.likelihood.spectra import between_updates
from sprung.recording import PLACES, Recording, naming
from sprung.vehicles.window import Window

_EARTH = 6_371_000.0  # radius [m]


@dataclass(frozen=True, slots=True)
class WaySettings:
    """When two vehicles are on one way."""

    #: Distance between the points of a way [m].
    spacing: float = 10.0
    #: Largest distance to the side [m]: two errors of satellite positions and the width of a carriageway.
    aside: float = 20.0
    #: Smallest cosine of the angle between the directions of travel.
    along: float = 0.7
    #: Length of the part of a drive that is compared with the earlier parts of the same drive at once [m].
    block: float = 500.0
    #: Time for which places stand still [s], and the distance gone meanwhile [m], from which they are lost.
    still: float = 10.0
    lost: float = 50.0
    #: Time between two recordings of one drive [s].
    pause: float = 1.0


WAYS = WaySettings()


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """Distance and place of a vehicle over time.

    Parameters
    ----------
    times
        Time from the start of the first recording, without gaps [s], shape (points,).
    distances
        Distance from there by the speed, gaps included [m], shape (points,).
    places
        Latitude and longitude [degrees], shape (2, points), NaN without satellites; None where the recordings lack
        them.
    """

    times: Real
    distances: Real
    places: Real | None

    def __post_init__(self) -> None:
        freeze(self, times=1, distances=1)
        if self.places is not None:
            freeze(self, places=2)

    def thinned(self) -> "Track":
        """Return the points at equal distances, as `Ways` compare them."""
        length = self.distances[-1] - self.distances[0]
        at = self.distances[0] + WAYS.spacing * np.arange(np.floor(length / WAYS.spacing + 1e-6) + 1)
        rising = self.distances + 1e-9 * np.arange(self.distances.size)  # also while the vehicle stands
        times = np.interp(at, rising, self.times)
        places = None if self.places is None else np.array([np.interp(at, rising, row) for row in self.places])
        return Track(times, at, places)

    def place(self, time: float) -> tuple[float, float] | None:
        """Return latitude and longitude [degrees] at a time; None where the recordings lack them."""
        if self.places is None:
            return None
        latitude, longitude = (float(np.interp(time, self.times, row)) for row in self.places)
        return None if np.isnan(latitude + longitude) else (latitude, longitude)


def track_of(windows: Sequence[Window]) -> Track:
    """Return where a vehicle was during the windows of a drive.

    Raises
    ------
    DataError
        If the speed was not recorded.
    """
    times, distances, places = [], [], []
    clock = travelled = 0.0
    for window in windows:
        recording, rate = window.recording, window.recording.sampling_rate
        if window.speed is None:
            with naming(recording):
                raise DataError("the road needs the speed of the vehicle: give recordings with the speed channel")
        held = filled(recording.samples[recording.index(window.speed)])
        speed = np.concatenate([between_updates(held[stretch], rate) for stretch in recording.stretches()])
        steps = np.diff(speed, prepend=speed[0])
        steps = (speed - steps / 2) / rate
        steps[0] = 0.0
        for gap in recording.gaps:
            steps[gap.index] = speed[gap.index - 1 : gap.index + 1].mean() * gap.duration
        distances.append(travelled + np.cumsum(np.maximum(steps, 0.0)))
        times.append(clock + np.arange(recording.n_samples) / rate)
        places.append(_places(recording, distances[-1]))
        travelled, clock = float(distances[-1][-1] + speed[-1] / rate), clock + recording.duration
    known = [each for each in places if each is not None]
    where = np.concatenate(known, axis=1) if len(known) == len(places) else None
    return Track(np.concatenate(times), np.concatenate(distances), where)


def filled(values: Real) -> Real:
    """Return values with missing ones interpolated linearly."""
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    at = np.arange(values.size)
    return np.interp(at, at[known], values[known])


def _places(recording: Recording, distances: Real) -> Real | None:
    """Return the latitude and longitude of each sample, NaN while they stood still and the vehicle did not.

    None where the recording lacks them.
    """
    lower = {name.lower(): name for name in recording.names}
    names = [next((lower[name] for name in alike if name in lower), None) for alike in PLACES]
    found = [recording.index(name) for name in names if name is not None]
    factors = [np.degrees(1.0) if recording.channels[row].quantity == "angle" else 1.0 for row in found]
    rows = [factor * filled(recording.samples[row]) for row, factor in zip(found, factors, strict=True)]
    if len(rows) < len(PLACES) or not all(np.isfinite(row).any() for row in rows):
        return None
    rate = recording.sampling_rate
    places = np.array([filled(between_updates(row, rate)) for row in rows])
    fixes = np.flatnonzero(np.any(np.diff(rows, prepend=np.nan, append=np.nan) != 0, axis=0))
    for k in np.flatnonzero(np.diff(fixes) > WAYS.still * rate):
        if distances[fixes[k + 1] - 1] - distances[fixes[k]] > WAYS.lost:
            places[:, fixes[k] + 1 : fixes[k + 1]] = np.nan
    return places


def has_places(recording: Recording) -> bool:
    """Whether a recording has channels of latitude and longitude."""
    return all({name.lower() for name in recording.names} & set(alike) for alike in PLACES)


def drives_of(files: Iterable[Iterable[Recording]]) -> Iterator[list[Recording]]:
    """Yield the recordings of each drive.

    Parameters
    ----------
    files
        Recordings of each file, which are of one drive. A file that begins when the one before it ends continues its
        drive; one without a start time begins another.
    """
    drive: list[Recording] = []
    for file in files:
        recordings = list(file)
        if drive and recordings and not _continues(drive[-1], recordings[0]):
            yield drive
            drive = []
        drive += recordings
    if drive:
        yield drive


def _continues(earlier: Recording, later: Recording) -> bool:
    if earlier.start is None or later.start is None:
        return False
    lost = sum(gap.duration for gap in earlier.gaps)
    return abs((later.start - earlier.start) / 1e9 - earlier.duration - lost) < WAYS.pause


@dataclass(frozen=True, slots=True)
class Section:
    """A stretch of a way, and the part of a drive on it.

    Parameters
    ----------
    begin
        Address of its beginning [m].
    first, last
        Distances between which the drive was on it [m].
    """

    begin: float
    first: float
    last: float


class Ways:
    """Ways that drives have in common, with an address in metres for each place.

    Parameters
    ----------
    stretch
        Length of a stretch [m]. The address of each way begins with a stretch.

    Notes
    -----
    The first drive on a way gives it its addresses, by the distance that its speed states. A later drive is on the way
    where it is within 20 m and goes in the same direction: both directions of a road are ways of their own.
    """

    def __init__(self, *, stretch: float) -> None:
        self._stretch = stretch
        self._points: Real = np.empty((0, 7))
        self._near: _Near | None = None

    def add(self, track: Track) -> None:
        """Add the parts of a drive that are on no way yet."""
        thin = track.thinned()
        if thin.places is None or thin.distances.size < 3:
            return
        points = _directed(thin.places)
        is_new = ~np.isfinite(self._addresses(points)) & np.isfinite(points).all(axis=1)
        n_block = round(WAYS.block / WAYS.spacing)
        own: list[Real] = []
        for first in range(0, len(points), n_block):  # a drive may come back to where it was
            block = slice(first, first + n_block)
            if len(own) > n_block:
                earlier = _Near(np.array(own[:-n_block]))
                is_new[block] &= ~np.isfinite(earlier.addresses(points[block]))
            for run in runs_of(is_new[block]):
                own += self._continued(points, thin.distances, range(first + run.start, first + run.stop), own)
        if own:
            self._points = np.concatenate([self._points, own])
            self._near = _Near(self._points)

    def _continued(self, points: Real, distances: Real, rows: range, own: Sequence[Real]) -> list[Real]:
        """Return points with addresses, which go on from the last ones where the drive does."""
        last = own[-1] if own else None
        at = distances[rows.start : rows.stop]
        if last is not None and np.array_equal(last[:6], points[rows.start - 1]):
            addresses = last[6] + WAYS.spacing + at - at[0]
        elif at[-1] - at[0] < self._stretch:
            return []
        else:
            highest = own[-1][6] if own else self._points[:, 6].max(initial=-1.0)
            addresses = self._stretch * (np.floor(highest / self._stretch) + 1) + at - at[0]
        return list(np.column_stack([points[rows.start : rows.stop], addresses]))

    def sections(self, track: Track) -> list[Section]:
        """Return the whole stretches of the ways that a drive was on, in the order of the drive."""
        thin = track.thinned()
        if thin.places is None:
            return []
        addresses, at = self._addresses(_directed(thin.places)), thin.distances
        jumps = np.abs(np.diff(addresses, prepend=addresses[:1]) - WAYS.spacing) > WAYS.aside
        found: list[Section] = []
        for run in runs_of(np.isfinite(addresses)):
            starts = [run.start, *(run.start + 1 + np.flatnonzero(jumps[run][1:])), run.stop]
            for first, last in pairwise(starts):
                found += whole_sections(addresses[first:last], at[first:last], self._stretch)
        return found

    def _addresses(self, points: Real) -> Real:
        return np.full(len(points), np.nan) if self._near is None else self._near.addresses(points)


class _Near:
    """The nearest points of ways, in place and direction."""

    def __init__(self, points: Real) -> None:
        from scipy.spatial import cKDTree

        self._points, self._tree = points, cKDTree(points[:, :6])

    def addresses(self, points: Real) -> Real:
        """Return the address of each directed point [m]; NaN where it is on no way."""
        is_known = np.isfinite(points).all(axis=1, keepdims=True)
        _, nearest = self._tree.query(np.where(is_known, points, 0.0))
        other = self._points[nearest]
        offset, direction = points[:, :3] - other[:, :3], other[:, 3:6] / WAYS.aside
        along = np.sum(offset * direction, axis=1)
        aside = np.linalg.norm(offset - along[:, None] * direction, axis=1)
        cosine = np.sum(points[:, 3:] / WAYS.aside * direction, axis=1)
        is_there = (np.abs(along) < 0.75 * WAYS.spacing) & (aside < WAYS.aside) & (cosine > WAYS.along)
        return np.asarray(np.where(is_there, other[:, 6] + along, np.nan))


def _directed(places: Real) -> Real:
    """Return place [m] and direction of travel, times the largest distance aside, in space, shape (points, 6)."""
    latitude, longitude = np.radians(places)
    across = np.cos(latitude)
    at = _EARTH * np.column_stack([across * np.cos(longitude), across * np.sin(longitude), np.sin(latitude)])
    steps = np.gradient(at, axis=0)
    lengths = np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-9)
    return np.hstack([at, WAYS.aside * steps / lengths])


def runs_of(values: Booleans) -> list[slice]:
    """Return the ranges in which values are true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], values, [False]]).astype(np.int8)))
    return [slice(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def whole_sections(addresses: Real, distances: Real, stretch: float) -> list[Section]:
    """Return the whole stretches between the first and the last of rising addresses."""
    rising = np.maximum.accumulate(addresses) + 1e-9 * np.arange(addresses.size)
    numbers = np.arange(np.ceil(rising[0] / stretch - 1e-6), np.floor(rising[-1] / stretch) + 1)
    at = np.interp(stretch * numbers, rising, distances)
    return [
        Section(float(stretch * number) + 0.0, float(first), float(last))
        for number, first, last in zip(numbers[:-1], at[:-1], at[1:], strict=True)
    ]
