"""Roads under the vehicles of a fleet: drives surveyed in tasks, and averaged where they are on one way."""

import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any, Literal

import pyarrow as pa

from sprung._checks import check_number, check_one_of
from sprung._display import counted
from sprung.errors import DataError, SprungError
from sprung.fleet.jobs.analysis import rows_of
from sprung.fleet.jobs.plan import WITHOUT_FILE, FleetSettings, Planner, vehicles_of
from sprung.fleet.jobs.results import SCHEMAS, Results
from sprung.fleet.jobs.spark import spark_schema, write_rows
from sprung.fleet.lake import Lake, recording_of
from sprung.recording import Recording
from sprung.road import RoadSurvey, Track, Ways, averaged, survey_road, track_of
from sprung.vehicles import Vehicle, vehicle_from_text
from sprung.vehicles.window import window_of

if TYPE_CHECKING:
    from pathlib import Path

    from pyspark.sql import DataFrame, SparkSession


@dataclass(frozen=True, slots=True)
class RoadSettings:
    """Settings of a survey of roads.

    Parameters
    ----------
    stretch
        Length of a stretch [m], at least 20.
    by
        Whether drives are compared by "place" (latitude and longitude), or by the "distance" from where each begins.
    since, until
        Period of the windows, UTC ns, its ends included; None: open.
    allow_missing
        Whether windows may lack sensors of the vehicle file.
    max_windows
        Number of windows after which a drive counts as another one: what one task has in memory.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    stretch: float = 100.0
    by: Literal["place", "distance"] = "place"
    since: int | None = None
    until: int | None = None
    allow_missing: bool = False
    max_windows: int = 12

    def __post_init__(self) -> None:
        check_number("stretch", self.stretch, at_least=20)
        check_one_of("by", self.by, ("place", "distance"))
        check_number("max_windows", self.max_windows, at_least=1)


#: Pause between two windows of one drive, and by which they may overlap [s].
_PAUSE = 1.0
#: Length of the part of the ways whose stretches are averaged together [m].
_PART = 10_000.0
#: A drive: its number, vehicle, and windows with their places in the lake.
_WINDOW = pa.struct(
    [("path", pa.string()), ("row", pa.int64()), ("digest", pa.string()), ("date", pa.string()), ("start", pa.int64())]
)
_DRIVES = pa.schema(
    [
        ("drive", pa.int64()),
        ("vehicle", pa.string()),
        ("start", pa.int64()),
        ("windows", pa.list_(_WINDOW)),
        ("vehicle_text", pa.string()),
    ]
)
_TRACKS = pa.schema([("drive", pa.int64()), ("track", pa.binary())])
#: Surveys of parts of the ways; a drive without one has a reason.
_PARTS = pa.schema(
    [
        ("part", pa.int64()),
        ("vehicle", pa.string()),
        ("start", pa.int64()),
        ("n_windows", pa.int64()),
        ("survey", pa.binary()),
        ("reason", pa.string()),
    ]
)
_MEANS = pa.schema([("part", pa.int64()), ("survey", pa.binary())])


def survey_fleet(
    session: "SparkSession",
    lake: Lake,
    vehicles: "str | Path",
    results: Results,
    *,
    settings: RoadSettings | None = None,
    report: Callable[[str, float], None] = lambda step, share: None,
) -> RoadSurvey:
    """Survey the roads under the drives of a fleet, average the passes, and replace the tables of roads.

    Parameters
    ----------
    session
        Session of Spark, from `spark_session`.
    lake
        Windows of samples; windows of a vehicle that follow one another are a drive.
    vehicles
        Vehicle files, as for `sprung.fleet.jobs.plan.vehicles_of`.
    results
        Tables of results, of which `passes`, `roads` and `road_events` are replaced.
    settings
        Settings of the survey.
    report
        Callback that receives the step and the share that is done.

    Returns
    -------
    RoadSurvey
        Means over all passes, as `sprung.road.averaged` gives them.

    Raises
    ------
    DataError
        If there is no lake, or no drive has a survey.
    ParameterError
        If the vehicle files cannot be used.

    Notes
    -----
    Tracks alone (a point for each 10 m) come to the driver, which joins them to ways in the order of time; tasks then
    survey each drive along these ways (`sprung.road.survey_road`), and average parts of 10 km. The result does not
    depend on the order in which windows arrived.

    Examples
    --------
    >>> from sprung.fleet.jobs import Results, spark_session
    >>> from sprung.fleet.lake import Lake
    >>> session = spark_session("local[2]")  # doctest: +SKIP
    >>> survey = survey_fleet(session, Lake("lake"), "vehicles", Results("results"))  # doctest: +SKIP
    >>> survey.stretches[0].n_passes  # doctest: +SKIP
    12
    """
    chosen = settings or RoadSettings()
    report("reading the lake", 0.0)
    lake.table.open()
    fleet = vehicles_of(session, vehicles).cache()
    try:
        period = FleetSettings(since=chosen.since, until=chosen.until)
        planner = Planner(session, lake, results, fleet, period)
        drives, without_file = _drives(session, planner, fleet, chosen)
        ways = None
        if chosen.by == "place":
            report("joining the drives to ways", 0.1)
            ways = _ways(drives, chosen)
        report("surveying the drives", 0.2)
        known = session.sparkContext.broadcast(ways)
        surveying = partial(_surveyed, ways=lambda: known.value, settings=chosen)
        parts = drives.mapInArrow(surveying, spark_schema(_PARTS)).cache()
        try:
            passes = [row.asDict() for row in parts.where("part < 0").drop("survey").toLocalIterator()]
            report("averaging the passes", 0.9)
            means = parts.where("part >= 0").groupBy("part").applyInArrow(_averaged, spark_schema(_MEANS))
            found = [pickle.loads(row["survey"]) for row in means.orderBy("part").toLocalIterator()]
        finally:
            parts.unpersist()
            known.unpersist()
    finally:
        fleet.unpersist()
    passes += without_file
    survey = RoadSurvey(
        tuple(stretch for own in found for stretch in own.stretches),
        tuple(event for own in found for event in own.events),
        _notes(passes),
    )
    _replace(results, survey, passes)
    if not survey.stretches:
        raise DataError(f"no drive of {lake.location} has a survey: {'; '.join(survey.notes) or 'the lake is empty'}")
    return survey


def _drives(
    session: "SparkSession", planner: Planner, fleet: "DataFrame", settings: RoadSettings
) -> "tuple[DataFrame, list[dict[str, Any]]]":
    """Return the drives of the lake, and passes without a survey of the vehicles whose files cannot be used."""
    texts = {row["vehicle"]: row.asDict() for row in fleet.collect()}
    keys = sorted(
        (row["vehicle"], row["start"], row["digest"], row["duration"], row["path"], row["row"], str(row["date"]))
        for row in planner.keys().toLocalIterator()
    )
    rows, without = [], []
    by_time = sorted(_runs(keys, settings.max_windows), key=lambda windows: (windows[0][1], windows[0][0]))
    for number, windows in enumerate(by_time):
        vehicle, start = windows[0][:2]
        own = texts.get(vehicle, {"reason": WITHOUT_FILE})
        if own["reason"]:
            without.append({"vehicle": vehicle, "start": start, "n_windows": len(windows), "reason": own["reason"]})
            continue
        places = [
            {"path": path, "row": row, "digest": digest, "date": date, "start": begin}
            for _, begin, digest, _, path, row, date in windows
        ]
        rows.append(
            {
                "drive": number,
                "vehicle": vehicle,
                "start": start,
                "windows": places,
                "vehicle_text": own["vehicle_text"],
            }
        )
    schema = spark_schema(_DRIVES)
    frame = session.createDataFrame([tuple(row[name] for name in _DRIVES.names) for row in rows], schema)
    return frame.repartition(max(1, len(rows)), "drive"), without


def _runs(keys: Sequence[tuple[Any, ...]], most: int) -> Iterator[list[tuple[Any, ...]]]:
    """Yield the windows of each drive; those that overlap earlier ones of their vehicle are left out."""
    for _, own in groupby(keys, key=lambda key: key[0]):
        run: list[tuple[Any, ...]] = []
        end = float("-inf")
        for key in own:
            begin = key[1] / 1e9
            if begin < end - _PAUSE:
                continue
            if run and (begin > end + _PAUSE or len(run) >= most):
                yield run
                run = []
            run.append(key)
            end = begin + key[3]
        yield run


def _ways(drives: "DataFrame", settings: RoadSettings) -> Ways:
    """Return the ways of all drives, joined in the order of time."""
    ways = Ways(stretch=settings.stretch)
    tracks = drives.mapInArrow(partial(_tracks, settings=settings), spark_schema(_TRACKS))
    for row in tracks.orderBy("drive").toLocalIterator():
        ways.add(pickle.loads(row["track"]))
    return ways


def _recordings(drive: Mapping[str, Any]) -> list[Recording]:
    """Return the recordings of a drive from the lake."""
    found = {item["start"]: row for item, row in rows_of(drive["windows"]) if row is not None}
    if len(found) < len(drive["windows"]):
        raise DataError("a window cannot be read from the lake: import its file again")
    return [recording_of(found[start]) for start in sorted(found)]


def _tracks(batches: Iterator[pa.RecordBatch], *, settings: RoadSettings) -> Iterator[pa.RecordBatch]:
    """Yield the track of each drive that has places."""
    for batch in batches:
        rows = []
        for drive in batch.to_pylist():
            try:
                track = _track(drive, settings)
            except Exception:
                continue
            if track.places is not None:
                rows.append({"drive": drive["drive"], "track": pickle.dumps(track.thinned())})
        yield pa.RecordBatch.from_pylist(rows, schema=_TRACKS)


def _track(drive: Mapping[str, Any], settings: RoadSettings) -> Track:
    vehicle = _vehicle(drive)
    return track_of([window_of(own, vehicle, allow_missing=settings.allow_missing) for own in _recordings(drive)])


def _vehicle(drive: Mapping[str, Any]) -> Vehicle:
    return vehicle_from_text(drive["vehicle_text"], source="the vehicle file")


def _surveyed(
    batches: Iterator[pa.RecordBatch], *, ways: Callable[[], Ways | None], settings: RoadSettings
) -> Iterator[pa.RecordBatch]:
    """Yield the surveys of drives, cut into parts of the ways, each after a row that says how the drive went."""
    for batch in batches:
        rows: list[dict[str, Any]] = []
        for drive in batch.to_pylist():
            about = {"vehicle": drive["vehicle"], "start": drive["start"], "n_windows": len(drive["windows"])}
            parts: list[dict[str, Any]] = []
            reason = ""
            try:
                vehicle = _vehicle(drive)
                if vehicle.kind == "rail":
                    raise DataError(f"vehicle {vehicle.name!r} runs on a track: give its drives to sprung road")
                survey = survey_road(
                    _recordings(drive),
                    vehicle,
                    stretch=settings.stretch,
                    ways=ways(),
                    allow_missing=settings.allow_missing,
                )
                parts = [{**about, "part": part, "survey": pickle.dumps(own)} for part, own in _cut(survey)]
            except SprungError as error:
                reason = str(error)
            except Exception as error:
                reason = f"{type(error).__name__}: {error}"
            rows += [{**about, "part": -1, "reason": reason}, *parts]
        yield pa.RecordBatch.from_pylist(rows, schema=_PARTS)


def _cut(survey: RoadSurvey) -> Iterator[tuple[int, RoadSurvey]]:
    """Yield the parts of a survey, with their numbers."""
    for part in sorted({int(stretch.begin // _PART) for stretch in survey.stretches}):
        stretches = tuple(each for each in survey.stretches if each.begin // _PART == part)
        yield part, RoadSurvey(stretches, tuple(event for event in survey.events if event.at // _PART == part))


def _averaged(group: pa.Table) -> pa.Table:
    """Return the mean of the passes over a part of the ways."""
    rows = sorted(group.to_pylist(), key=lambda row: (row["start"], row["vehicle"]))
    surveys = [pickle.loads(row["survey"]) for row in rows]
    mean = averaged(surveys, vehicles=[row["vehicle"] for row in rows])
    return pa.Table.from_pylist([{"part": rows[0]["part"], "survey": pickle.dumps(mean)}], schema=_MEANS)


def _notes(passes: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return how many drives have no survey, and the commonest reasons."""
    reasons = [row["reason"] for row in passes if row["reason"]]
    common = sorted(dict.fromkeys(reasons), key=lambda reason: -reasons.count(reason))[:3]
    of_all = f"of {counted(len(passes), 'drive')}"
    return tuple(f"{reasons.count(reason)} {of_all} without a survey: {reason}" for reason in common)


def _replace(results: Results, survey: RoadSurvey, passes: Sequence[Mapping[str, Any]]) -> None:
    """Replace the tables of roads."""
    roads = []
    for stretch in survey.stretches:
        row: dict[str, Any] = {"begin": stretch.begin, "end": stretch.end, "n_passes": stretch.n_passes}
        for side, track in (("left", stretch.left), ("right", stretch.right)):
            row |= {f"{side}_{name}": getattr(track, name) for name in ("iri", "iri_std", "iri_scatter")}
            row |= {f"{side}_{name}": getattr(track, name) for name in ("road_class", "roughness", "waviness")}
        roads.append({**row, **_place("begin", stretch.begin_place), **_place("end", stretch.end_place)})
    names = ("at", "side", "kind", "depth", "length", "n_passes")
    events = [{**{name: getattr(each, name) for name in names}, **_place("", each.place)} for each in survey.events]
    for name, rows in (("passes", passes), ("road_events", events), ("roads", roads)):
        table = results[name]
        table.create()
        table.commit([write_rows(rows, location=table.location, schema=SCHEMAS[name], partition={})], replaces=True)


def _place(name: str, place: tuple[float, float] | None) -> dict[str, float]:
    prefix = f"{name}_" if name else ""
    return {} if place is None else {f"{prefix}latitude": place[0], f"{prefix}longitude": place[1]}
