"""Surveys of roads as files for maps and tables."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from sprung._checks import check_type
from sprung.errors import DataError, ParameterError
from sprung.road.survey import RoadSurvey

#: Columns of a table of stretches.
_COLUMNS = ("from_m", "to_m", "left_iri", "left_iri_std", "left_class", "right_iri", "right_iri_std", "right_class")


def write_survey(survey: RoadSurvey, path: str | Path) -> None:
    """Write a survey for maps or tables, by the ending of the file.

    Parameters
    ----------
    survey
        Road under a vehicle.
    path
        `.geojson`: a line for each stretch with index and class, a point for each event (RFC 7946). `.gpx`: events as
        way-points (GPX 1.1). `.csv`: a row for each stretch.

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
        tracks = [(round(t.iri, 3), round(t.iri_std, 3), t.road_class) for t in (stretch.left, stretch.right)]
        yield (round(stretch.begin, 1), round(stretch.end, 1), *tracks[0], *tracks[1])


def _features(survey: RoadSurvey) -> Iterator[dict[str, Any]]:
    """Yield the features of a map; coordinates are longitude and latitude."""
    for stretch, row in zip(survey.stretches, _rows(survey), strict=True):
        ends = [list(reversed(place)) for place in (stretch.begin_place, stretch.end_place) if place]
        line = {"type": "LineString", "coordinates": ends}
        yield {"type": "Feature", "geometry": line, "properties": dict(zip(_COLUMNS, row, strict=True))}
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
