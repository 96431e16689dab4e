"""Surveys of roads as maps and tables."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from sprung._checks import check_type
from sprung.errors import DataError, ParameterError
from sprung.road.survey import RoadSurvey, TrackRoughness

#: Columns of a table of stretches.
_OF_TRACK = ("iri", "iri_std", "iri_scatter", "class")
_COLUMNS = ("from_m", "to_m", "passes", *(f"{side}_{name}" for side in ("left", "right") for name in _OF_TRACK))
#: Colours of the classes A to H on a map, from green to violet.
_COLOURS = ("#1A9850", "#91CF60", "#F2D43D", "#FC8D59", "#D73027", "#A50026", "#7A0177", "#49006A")


def write_survey(survey: RoadSurvey, path: str | Path) -> None:
    """Write a survey for maps or tables, by the ending of the file.

    Parameters
    ----------
    survey
        Road under a vehicle.
    path
        `.geojson`: a line for each stretch with index and class, in the colour of the class of the rougher track, a
        point for each event (RFC 7946; colours as simplestyle has them). `.gpx`: events as way-points (GPX 1.1).
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
    ending = target.suffix.lower()
    if ending not in {".geojson", ".gpx", ".csv"}:
        raise ParameterError(f"{target.name} ends in {ending!r}: give a file that ends in .geojson, .gpx or .csv")
    if ending != ".csv" and not all(stretch.begin_place and stretch.end_place for stretch in survey.stretches):
        raise DataError("the recordings have no latitude and longitude for a map: write .csv, or record them [degrees]")
    if ending == ".csv":
        with target.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(_COLUMNS)
            writer.writerows(_rows(survey))
    elif ending == ".geojson":
        collection = {"type": "FeatureCollection", "features": list(_features(survey))}
        target.write_text(json.dumps(collection, indent=1), encoding="utf-8")
    else:
        target.write_text(_way_points(survey), encoding="utf-8")


def _rows(survey: RoadSurvey) -> Iterator[tuple[Any, ...]]:
    for stretch in survey.stretches:
        yield (
            round(stretch.begin, 1),
            round(stretch.end, 1),
            stretch.n_passes,
            *(cell for track in (stretch.left, stretch.right) for cell in _cells(track)),
        )


def _cells(track: TrackRoughness) -> tuple[Any, ...]:
    scatter = None if track.iri_scatter is None else round(track.iri_scatter, 3)
    return (round(track.iri, 3), round(track.iri_std, 3), scatter, track.road_class)


def _features(survey: RoadSurvey) -> Iterator[dict[str, Any]]:
    """Yield the features of a map; coordinates are longitude and latitude."""
    for stretch, row in zip(survey.stretches, _rows(survey), strict=True):
        ends = [list(reversed(place)) for place in (stretch.begin_place, stretch.end_place) if place]
        line = {"type": "LineString", "coordinates": ends}
        colour = _COLOURS[ord(max(stretch.left.road_class, stretch.right.road_class)) - ord("A")]
        properties = {**dict(zip(_COLUMNS, row, strict=True)), "stroke": colour, "stroke-width": 4}
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
