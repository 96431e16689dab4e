"""Roving sensors: which records are different set-ups, and which of their channels are the same points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from sprung._arrays import Complex, Indices
from sprung.errors import ParameterError
from sprung.identification.correlation import SegmentCorrelations
from sprung.modal import mac
from sprung.recording import Channel, Recording
from sprung.vehicles.sensor_layout import AnyVehicle, output_channels, speed_channel


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules by which places and shapes of sensors are the same."""

    #: Positions [m] and directions are the same up to this difference.
    same_place: float = 1e-6
    #: Most peaks of a spectrum at which shapes are compared: the highest stand out of noise.
    max_resonances: int = 4
    #: Fewest of them: one may be an accident.
    min_resonances: int = 2
    #: Lines of that spectrum for each lag.
    padding: int = 4
    #: MAC of the halves of a record from which its shape is known.
    clear: float = 0.8
    #: Sensors have moved where the MAC between records is lower than within them by this.
    moved: float = 0.2
    #: MAC of two channels that have stayed in place.
    steady: float = 0.97


_RULES = _Rules()


@dataclass(frozen=True, eq=False, slots=True)
class Points:
    """Points of a structure, measured by the channels of several set-ups.

    Parameters
    ----------
    channels
        One channel for each point. Channels of one name that were moved between set-ups carry the number of the set-up:
        "acc (2)".
    rows
        Index into `channels` of each channel of each set-up.
    references
        Names of the points that every set-up measures; if there are none, of those that several set-ups measure.
    """

    channels: tuple[Channel, ...]
    rows: tuple[tuple[int, ...], ...]
    references: tuple[str, ...]


def group_by_setup(records: Sequence[Recording], *, vehicle: AnyVehicle | None = None) -> tuple[list[Recording], ...]:
    """Group the records that measure the same points.

    Parameters
    ----------
    records
        Records of one structure.
    vehicle
        Vehicle whose sensors are the outputs; None: every channel of motion is one.

    Returns
    -------
    tuple of list
        Records of each set-up, in their order. Two records belong to one set-up if their outputs have the same names,
        and no output of one name has another position or direction.
    """
    groups: list[list[Recording]] = []
    layouts: list[dict[str, Channel]] = []
    for record in records:
        layout = {name: record.channels[record.index(name)] for name in output_channels(record, vehicle)}
        same = [
            k
            for k, known in enumerate(layouts)
            if layout.keys() == known.keys() and all(_is_same_place(layout[name], known[name]) for name in layout)
        ]
        if same:
            groups[same[0]].append(record)
        else:
            groups.append([record])
            layouts.append(layout)
    return tuple(groups)


def _is_same_place(channel: Channel, other: Channel) -> bool:
    """Whether two channels may measure the same point: no known position or direction differs."""
    pairs = ((channel.position, other.position), (channel.direction, other.direction))
    return all(
        one is None or two is None or all(abs(a - b) <= _RULES.same_place for a, b in zip(one, two, strict=True))
        for one, two in pairs
    )


def common_points(layouts: Sequence[Sequence[Channel]], *, references: Sequence[str] | None = None) -> Points:
    """Return the points that the channels of several set-ups measure.

    Parameters
    ----------
    layouts
        Channels of each set-up.
    references
        Names of the channels that stay in place in all set-ups; all others have moved, also where names repeat. None:
        channels of one name are one point unless their positions or directions differ.

    Returns
    -------
    Points

    Raises
    ------
    ParameterError
        If a set-up lacks a reference, all set-ups have the same channels at the same places, or a set-up shares no
        point with the others.
    """
    points: list[tuple[Channel, list[int]]] = []
    rows: list[tuple[int, ...]] = []
    for number, layout in enumerate(layouts):
        own = []
        for channel in layout:
            same = [
                k
                for k, (point, _) in enumerate(points)
                if point.name == channel.name
                and (channel.name in references if references is not None else _is_same_place(channel, point))
            ]
            if same:
                points[same[0]][1].append(number)
            else:
                points.append((channel, [number]))
            own.append(same[0] if same else len(points) - 1)
        rows.append(tuple(own))
    _check_references(layouts, references)
    if all(len(numbers) == len(layouts) for _, numbers in points):
        raise ParameterError(
            f"the {len(layouts)} set-ups have the same channels {', '.join(point.name for point, _ in points)}: name"
            " those that stayed in place as references (--references)"
        )
    _check_connected(rows, layouts)
    shared = [point.name for point, numbers in points if len(numbers) == len(layouts)]
    names = [point.name for point, _ in points]
    channels = tuple(
        replace(point, name=f"{point.name} ({numbers[0] + 1})") if names.count(point.name) > 1 else point
        for point, numbers in points
    )
    several = [channel.name for channel, (_, numbers) in zip(channels, points, strict=True) if len(numbers) > 1]
    return Points(channels, tuple(rows), tuple(shared or several))


def _check_references(layouts: Sequence[Sequence[Channel]], references: Sequence[str] | None) -> None:
    """Reject references that are not channels of every set-up."""
    for number, layout in enumerate(layouts, start=1):
        names = [channel.name for channel in layout]
        missing = [name for name in references or () if name not in names]
        if missing:
            raise ParameterError(
                f"reference {missing[0]!r} is not a channel of set-up {number}, which has {', '.join(names)}:"
                " name channels that all set-ups have"
            )


def _check_connected(rows: Sequence[Sequence[int]], layouts: Sequence[Sequence[Channel]]) -> None:
    """Reject set-ups that share no point with the first one, directly or through others."""
    joined, waiting = set(rows[0]), set(range(1, len(rows)))
    while waiting:
        linked = [number for number in waiting if joined & set(rows[number])]
        if not linked:
            number = min(waiting)
            names = ", ".join(channel.name for channel in layouts[number])
            raise ParameterError(
                f"set-up {number + 1} ({names}) shares no channel with the others, so that its mode shapes have no"
                " common scale: keep at least one sensor in place, or identify it by itself"
            )
        for number in linked:
            joined |= set(rows[number])
            waiting.remove(number)


def note_on_moved_sensors(
    records: Sequence[Recording], segments: SegmentCorrelations, counts: Sequence[int], *, vehicle: AnyVehicle | None
) -> tuple[str, ...]:
    """Return a note if records of equal channel names look like set-ups of roving sensors.

    Parameters
    ----------
    records
        Records of one condition. If they have a speed or known positions nothing is tested: the shape in which a
        vehicle moves depends on its speed, and known positions are the same.
    segments, counts
        Correlations of the segments of all usable records, and the number of segments of each record.
    vehicle
        Vehicle file, if any; nothing is tested then.

    Returns
    -------
    tuple of str
        One note; none where the shapes of the records are alike, or those of their halves are not.

    Notes
    -----
    A shape is the first singular vector of the half spectrum (the transform of the correlations at positive lags, which
    hold no sensor noise) at the highest peaks of the first singular value. It does not depend on the level of the
    excitation. Sensors have moved where the MAC between records is lower than that within records by more than chance
    or a lack of data makes it.
    """
    is_placed = any(channel.position is not None for record in records for channel in record.channels)
    if vehicle is not None or is_placed or any(speed_channel(record) for record in records):
        return ()
    starts = np.cumsum([0, *counts])
    halves = [
        (np.arange(first, first + count // 2), np.arange(first + count // 2, first + count))
        for first, count in zip(starts, counts, strict=False)
        if count > 1
    ]
    if len(halves) < 2 or len(segments.channels) < 2:
        return ()
    whole = [_half_spectrum(segments, np.concatenate(own)) for own in halves]
    lines = _highest_peaks(whole)
    shapes = [_first_vectors(spectrum[lines]) for spectrum in whole]
    of_halves = [[_first_vectors(_half_spectrum(segments, side)[lines]) for side in own] for own in halves]
    within = np.mean([np.diag(mac(*pair)) for pair in of_halves], axis=0)
    between = np.mean([np.diag(mac(one, two)) for one, two in combinations(shapes, 2)], axis=0)
    is_clear = within >= _RULES.clear
    n_clear = np.count_nonzero(is_clear)
    if n_clear < _RULES.min_resonances or np.median((within - between)[is_clear]) < _RULES.moved:
        return ()
    spacing = segments.sampling_rate / (_RULES.padding * segments.n_lags)
    frequencies = ", ".join(f"{line * spacing:.3g}" for line in sorted(lines[is_clear].tolist()))
    steady = _steady_channels(segments.channels, [shape[is_clear] for shape in shapes])
    named = f", such as {', '.join(steady)}," if steady else ""
    return (
        "the channels move differently from record to record"
        f" (MAC {np.median(between[is_clear]):.2f} between records, {np.median(within[is_clear]):.2f} within them, at"
        f" {frequencies} Hz): if sensors were moved, identify each record as a set-up (--setups) and name the channels"
        f" that stayed{named} as references (--references)",
    )


def _half_spectrum(segments: SegmentCorrelations, chosen: Indices) -> Complex:
    """Return the tapered transform of the correlations at positive lags, shape (frequencies, channels, references)."""
    lags = np.arange(1, segments.n_lags)
    sums, n_products = segments.sums[chosen].sum(axis=0), segments.n_products[chosen].sum(axis=0)
    values = sums[..., 1:] / np.maximum(n_products[1:], 1.0)
    taper = 0.5 + 0.5 * np.cos(np.pi * lags / segments.n_lags)
    return np.fft.rfft(values * taper, _RULES.padding * segments.n_lags).transpose(2, 0, 1)


def _highest_peaks(spectra: Sequence[Complex]) -> Indices:
    """Return the lines of the highest peaks of the first singular value, on average over the records."""
    level = np.mean([np.log(np.linalg.norm(s, ord=2, axis=(1, 2)) + np.finfo(float).tiny) for s in spectra], axis=0)
    reach = 2 * _RULES.padding
    inner = np.arange(reach, len(level) - reach)
    is_peak = np.array(
        [level[k] == level[k - _RULES.padding : k + _RULES.padding + 1].max() for k in inner], dtype=np.bool_
    )
    peaks = inner[is_peak]
    return peaks[np.argsort(-level[peaks], kind="stable")][: _RULES.max_resonances]


def _first_vectors(matrices: Complex) -> Complex:
    """Return the first left singular vector of each matrix, shape (matrices, channels)."""
    return np.asarray(np.linalg.svd(matrices, full_matrices=False)[0][:, :, 0])


def _steady_channels(names: Sequence[str], shapes: Sequence[Complex]) -> tuple[str, ...]:
    """Return the channels, two or more, whose motion relative to each other is the same in all records."""
    n = len(names)
    likeness = np.zeros((n, n))
    for i, j in combinations(range(n), 2):
        own = [shape[:, [i, j]] for shape in shapes]
        likeness[i, j] = likeness[j, i] = np.mean([np.diag(mac(a, b)).mean() for a, b in combinations(own, 2)])
    best = np.unravel_index(np.argmax(likeness), likeness.shape)
    if likeness[best] < _RULES.steady:
        return ()
    chosen = sorted(int(k) for k in best)
    for k in np.argsort(-likeness[chosen].min(axis=0)):
        if k not in chosen and likeness[k, chosen].min() >= _RULES.steady:
            chosen.append(int(k))
    return tuple(names[k] for k in sorted(chosen))
