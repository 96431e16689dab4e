"""Passes of one or several vehicles over the same road, averaged; surveys of roads as maps and tables."""

import csv
import json
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from sprung._checks import check_type
from sprung.errors import DataError, ParameterError
from sprung.recording import Recording
from sprung.road.level import TrackLevel
from sprung.road.survey import (
    RoadEvent,
    RoadSurvey,
    Stretch,
    TrackRoughness,
    default_stretch,
    road_class_of,
    survey_road,
)
from sprung.road.tracks import Ways, track_of
from sprung.vehicles import Vehicle
from sprung.vehicles.window import window_of

#: Distance between two events that are taken for one [m]: what satellite positions of two passes differ by.
_SAME_EVENT = 8.0


def survey_passes(
    drives: Iterable[Sequence[Recording]],
    vehicle: Vehicle,
    *,
    stretch: float | None = None,
    allow_missing: bool = False,
    on_progress: Callable[[str, float], None] = lambda step, share: None,
) -> RoadSurvey:
    """Return the mean of several passes of a vehicle over the same road.

    Parameters
    ----------
    drives
        Recordings of each drive, with the speed. Where all have latitude and longitude, they are compared by place,
        else by the distance from where each drive begins.
    vehicle, stretch, allow_missing
        As for `survey_road`.
    on_progress
        Callback that receives the current step and the share that is done (0 to 1).

    Raises
    ------
    DataError
        As for `survey_road`, if no drive is long and fast enough.

    Notes
    -----
    Each drive is surveyed by itself, with a vehicle fitted to it alone, and `averaged` takes the means.
    """
    stretch = default_stretch(vehicle) if stretch is None else stretch
    passes = [list(drive) for drive in drives]
    ways: Ways | None = None
    if len(passes) > 1:
        tracks = [track_of([window_of(each, vehicle, allow_missing=allow_missing) for each in own]) for own in passes]
        if all(track.places is not None for track in tracks):
            ways = Ways(stretch=stretch)
            for track in tracks:
                ways.add(track)
    surveys, reasons = [], []
    for number, drive in enumerate(passes):
        on_progress("fitting the vehicle", number / len(passes))
        try:
            surveys.append(survey_road(drive, vehicle, stretch=stretch, ways=ways, allow_missing=allow_missing))
        except DataError as error:
            is_named = any(record.source and record.source in str(error) for record in drive)
            name = drive[0].source or f"drive {number + 1}" * (len(passes) > 1)
            reasons.append(str(error) if is_named or not name else f"{name}: {error}")
    if not surveys:
        raise DataError("; ".join(reasons))
    mean = surveys[0] if len(passes) == 1 else averaged(surveys)
    return replace(mean, notes=(*mean.notes, *reasons))


def averaged(surveys: Sequence[RoadSurvey], *, vehicles: Sequence[Hashable] | None = None) -> RoadSurvey:
    """Return the mean of several passes over the same road.

    Parameters
    ----------
    surveys
        Surveys with stretches of the same length whose beginnings mean the same place: of drives that begin at one
        place, or with the same `Ways`.
    vehicles
        Vehicle of each survey; None: all are of one.

    Returns
    -------
    RoadSurvey
        Means of the indices, weighted by their variances; standard deviations of these means; scatter between passes;
        events, with the number of passes that found them.

    Notes
    -----
    What is uncertain about a vehicle is the same in all its passes: its mean is no more precise than they are, and only
    means of several vehicles are. No standard deviation is below that of a mean of passes that scatter as these do.
    """
    of_vehicle = [0] * len(surveys) if vehicles is None else vehicles
    passes: dict[float, list[tuple[Hashable, Stretch]]] = {}
    for vehicle, survey in zip(of_vehicle, surveys, strict=True):
        for stretch in survey.stretches:
            passes.setdefault(round(stretch.begin, 3), []).append((vehicle, stretch))
    stretches = []
    for _, own in sorted(passes.items(), key=lambda item: item[0]):
        lines: dict[str, Any] = {}
        for name in dict.fromkeys(name for _, each in own for name in each.lines):
            measured = [(each.lines[name], vehicle) for vehicle, each in own if name in each.lines]
            lines[name] = _mean(*zip(*measured, strict=True))
        stretches.append(replace(own[0][1], **lines, n_passes=sum(each.n_passes for _, each in own)))
    events = _merged([event for survey in surveys for event in survey.events])
    return RoadSurvey(tuple(stretches), events, tuple(dict.fromkeys(note for each in surveys for note in each.notes)))


def _mean(tracks: Sequence[TrackRoughness | TrackLevel], vehicles: Sequence[Hashable]) -> TrackRoughness | TrackLevel:
    """Return the mean of a track over passes."""
    rough = [track for track in tracks if isinstance(track, TrackRoughness)]
    if rough:
        roughness = float(np.exp(np.mean([np.log(track.roughness) for track in rough])))
        waviness = float(np.mean([track.waviness for track in rough]))
        mean, std, scatter = _mean_of([(track.iri, track.iri_std) for track in rough], vehicles)
        return TrackRoughness(mean, std, roughness, waviness, road_class_of(roughness), scatter)
    levels = [track for track in tracks if isinstance(track, TrackLevel)]
    d1, d1_std, scatter = _mean_of([(track.d1, track.d1_std) for track in levels], vehicles)
    fast = [row for row, track in enumerate(levels) if track.d2 is not None]
    long = [(levels[row].d2 or 0.0, levels[row].d2_std or 0.0) for row in fast]
    d2, d2_std, _ = _mean_of(long, [vehicles[row] for row in fast]) if fast else (None, None, None)
    return TrackLevel(d1, d1_std, d2, d2_std, scatter)


def _mean_of(
    values_and_stds: Sequence[tuple[float, float]], vehicles: Sequence[Hashable]
) -> tuple[float, float, float | None]:
    """Return the mean of values over passes, its standard deviation, and their scatter."""
    values, stds = np.array(values_and_stds).T
    means = []
    for vehicle in dict.fromkeys(vehicles):
        own = np.array([other == vehicle for other in vehicles])
        means.append((np.average(values[own], weights=stds[own] ** -2), np.sqrt(np.mean(stds[own] ** 2))))
    weights = np.array([std**-2 for _, std in means])
    mean, std = float(np.average([value for value, _ in means], weights=weights)), float(weights.sum() ** -0.5)
    scatter = float(np.std(values, ddof=1)) if len(values) > 1 else None
    at_least = 0.0 if scatter is None else scatter / float(np.sqrt(len(values)))
    return mean, max(std, at_least), scatter


def _merged(events: Sequence[RoadEvent]) -> tuple[RoadEvent, ...]:
    """Return events in the order of the way, those that several passes found at one place as one."""
    groups: list[list[RoadEvent]] = []
    for event in sorted(events, key=lambda event: (event.kind, event.side, event.at)):
        last = groups[-1][0] if groups else None
        if last and (last.kind, last.side) == (event.kind, event.side) and event.at - last.at < _SAME_EVENT:
            groups[-1].append(event)
        else:
            groups.append([event])
    merged = [
        replace(
            own[0],
            at=float(np.mean([event.at for event in own])),
            depth=float(np.mean([event.depth for event in own])),
            length=float(np.mean([event.length for event in own])),
            n_passes=sum(event.n_passes for event in own),
        )
        for own in groups
    ]
    return tuple(sorted(merged, key=lambda event: event.at))


#: Columns of a table of stretches of a road, and of a track, for either side.
_OF_ROAD = ("iri", "iri_std", "iri_scatter", "class", "roughness_m3", "waviness")
_OF_TRACK = ("d1_mm", "d1_std_mm", "d1_scatter_mm", "d2_mm", "d2_std_mm")
#: Colours of the classes A to H on a map, from green to violet.
_COLOURS = ("#1A9850", "#91CF60", "#F2D43D", "#FC8D59", "#D73027", "#A50026", "#7A0177", "#49006A")


def write_survey(survey: RoadSurvey, path: str | Path) -> None:
    """Write a survey for maps or tables, by the ending of the file.

    Parameters
    ----------
    survey
        Road under a vehicle.
    path
        `.geojson`: a line for each stretch with index and class, in the colour of the class of the rougher track (of a
        track with its levels, a colour for each half of a millimetre in D1), a point for each event (RFC 7946; colours
        as simplestyle has them). `.gpx`: events as way-points (GPX 1.1).
        `.csv`: a row for each stretch.

    Raises
    ------
    DataError
        If a map is asked for and the recordings have no latitude and longitude.
    ParameterError
        If the ending is another one.
    """
    check_type("survey", survey, RoadSurvey, advice="sprung.survey_road(recording, vehicle)")
    target = Path(path)
    ending = check_survey_file(target, are_placed=any(stretch.begin_place for stretch in survey.stretches))
    if ending == ".csv":
        with target.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_columns(survey))
            writer.writerows(_rows(survey))
    elif ending == ".geojson":
        collection = {"type": "FeatureCollection", "features": list(_features(survey))}
        target.write_text(json.dumps(collection, indent=1), encoding="utf-8")
    else:
        target.write_text(_way_points(survey), encoding="utf-8")


def check_survey_file(path: Path, *, are_placed: bool) -> str:
    """Return the ending of the file of a survey, where it can be written.

    Raises
    ------
    DataError, ParameterError
        As `write_survey`, before there is a survey.
    """
    ending = path.suffix.lower()
    if ending not in {".geojson", ".gpx", ".csv"}:
        raise ParameterError(f"{path.name} ends in {ending!r}: give a file that ends in .geojson, .gpx or .csv")
    if ending != ".csv" and not are_placed:
        raise DataError(
            "the recordings have no latitude and longitude for a map: write .csv, or record them in channels of these "
            "names [degrees]"
        )
    return ending


def _rows(survey: RoadSurvey) -> Iterator[tuple[Any, ...]]:
    for stretch in survey.stretches:
        yield (
            round(stretch.begin, 1),
            round(stretch.end, 1),
            stretch.n_passes,
            *(cell for line in _lines(survey) for cell in _cells(stretch.lines.get(line))),
        )


def _columns(survey: RoadSurvey) -> tuple[str, ...]:
    names = _OF_TRACK if survey.is_of_track else _OF_ROAD
    return ("from_m", "to_m", "passes", *(f"{line}_{name}" for line in _lines(survey) for name in names))


def _lines(survey: RoadSurvey) -> list[str]:
    """Return the names of what was measured along any stretch."""
    return list(dict.fromkeys(name for stretch in survey.stretches for name in stretch.lines))


def _cells(track: TrackRoughness | TrackLevel | None) -> tuple[Any, ...]:
    if track is None:
        return (None,) * len(_OF_TRACK)  # the alignment of a track
    if isinstance(track, TrackRoughness):
        scatter = None if track.iri_scatter is None else round(track.iri_scatter, 3)
        level = float(f"{track.roughness:.3g}"), round(track.waviness, 2)
        return (round(track.iri, 3), round(track.iri_std, 3), scatter, track.road_class, *level)
    lengths = track.d1, track.d1_std, track.d1_scatter, track.d2, track.d2_std
    return tuple(None if length is None else round(1000 * length, 3) for length in lengths)


def _colour(stretch: Stretch) -> str:
    """Return the colour of the class of the rougher track, or of each half of a millimetre of the level in D1."""
    steps = [
        ord(track.road_class) - ord("A") if isinstance(track, TrackRoughness) else int(2000 * track.d1)
        for track in (stretch.left, stretch.right)
    ]
    return _COLOURS[min(max(steps), len(_COLOURS) - 1)]


def _features(survey: RoadSurvey) -> Iterator[dict[str, Any]]:
    """Yield the features of a map; coordinates are longitude and latitude."""
    for stretch, row in zip(survey.stretches, _rows(survey), strict=True):
        ends = [list(reversed(place)) for place in (stretch.begin_place, stretch.end_place) if place]
        if len(ends) < 2:
            continue
        line = {"type": "LineString", "coordinates": ends}
        properties = {**dict(zip(_columns(survey), row, strict=True)), "stroke": _colour(stretch), "stroke-width": 4}
        yield {"type": "Feature", "geometry": line, "properties": properties}
    for event in survey.events:
        if event.place is not None:
            point = {"type": "Point", "coordinates": list(reversed(event.place))}
            properties = {"kind": event.kind, "side": event.side, "depth_m": event.depth, "length_m": event.length}
            yield {"type": "Feature", "geometry": point, "properties": properties}


def _way_points(survey: RoadSurvey) -> str:
    """Return the events as a GPX file."""
    points = [
        f"<wpt lat={quoteattr(f'{event.place[0]:.7f}')} lon={quoteattr(f'{event.place[1]:.7f}')}>"
        f"<name>{event.kind}, {event.side}, {1000 * event.depth:.0f} mm</name></wpt>"
        for event in survey.events
        if event.place is not None
    ]
    head = '<gpx version="1.1" creator="sprung" xmlns="http://www.topografix.com/GPX/1/1">'
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', head, *points, "</gpx>", ""])
