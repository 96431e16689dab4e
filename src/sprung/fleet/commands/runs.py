"""The commands `sprung fleet run`, `explain` and `stream`."""

import inspect
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.options import INPUT, AllowMissing, Figures, Json, Since, Until, check_file, names, option
from sprung.cli.output import LogFormat, Output, log_to, progress_bar, show, stop_on_signals, write_result, written
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from pyspark.sql import SparkSession

    from sprung.fleet.jobs import FleetSettings
    from sprung.fleet.streams import StreamBatch

LOG = logging.getLogger("sprung")
SPARK = "Spark"
LakePlace = Annotated[
    str, typer.Argument(metavar="LAKE", help="Lake, from sprung fleet import or a monitor.", show_default=False)
]
Vehicles = Annotated[
    str,
    option(
        "DIR|TABLE",
        "Folder with VEHICLE.toml for each vehicle, or a table (.csv, .parquet) with the columns vehicle and file.",
        "--vehicles",
    ),
]
Out = Annotated[str, option("RESULTS", "Folder or URL of the tables of results; created if missing.", "--out")]
Master = Annotated[
    str,
    option(
        "MASTER",
        "local[N] for N cores of this machine, spark://HOST:PORT, or empty under spark-submit.",
        "--master",
        panel=SPARK,
    ),
]
WindowLength = Annotated[
    float,
    option(
        "MINUTES",
        "Length of the windows in the lake, or of those into which frames are joined.",
        "--window",
        panel=INPUT,
        min=1,
        max=120,
    ),
]


def _settings(
    *,
    steps: Annotated[
        str,
        option(
            "A,B,..",
            "What to do: identify (modes), corners (springs, dampers and tyres of each window), baseline, diagnose.",
            "--steps",
        ),
    ] = "identify,corners,baseline,diagnose",
    since: Since = None,
    until: Until = None,
    learn: Annotated[
        int, option("N", "Number of valid windows from which a baseline is learnt.", "--learn", min=2, panel=INPUT)
    ] = 12,
    method: Annotated[
        Literal["cov", "acs", "coss", "plscf", "fdd"],
        typer.Option(help="Method of identification.", rich_help_panel=INPUT),
    ] = "cov",
    allow_missing: AllowMissing = False,
    false_alarms: Annotated[float, option("RATE", "False alarms per vehicle and day of driving.", panel=INPUT)] = 1e-3,
    false_discoveries: Annotated[
        float, option("SHARE", "Expected share of healthy vehicles among those reported as changed.", panel=INPUT)
    ] = 0.05,
    hours_per_day: Annotated[float, option("H", "Hours of driving per day.", panel=INPUT)] = 8.0,
    **others: Any,
) -> "FleetSettings":
    """Return the settings that the options of a command give; `others` are its own, such as the length of a window."""
    from sprung.fleet.jobs import FleetSettings
    from sprung.fleet.jobs.analysis import WindowSettings
    from sprung.fleet.jobs.assessment import AssessmentSettings
    from sprung.results.tables.wording import parse_period

    period = parse_period(since, until)
    windows_per_day = hours_per_day * 60 / others.get("minutes", 10.0)
    return FleetSettings(
        steps=tuple(names(steps) or ()),
        windows=WindowSettings(method=method, allow_missing=allow_missing),
        assessment=AssessmentSettings(
            learning_windows=learn, false_alarms=false_alarms, windows_per_day=windows_per_day
        ),
        false_discoveries=false_discoveries,
        since=period.since,
        until=period.until,
    )


def takes_settings(*left_out: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of `_settings` but some, in place of its argument `settings`."""

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(command)
        options = inspect.signature(_settings).parameters
        added = [options[name] for name in options if name not in {*left_out, "others"}]
        every = [each for own in signature.parameters.values() for each in (added if own.name == "settings" else [own])]

        @wraps(command)
        def run_command(**arguments: Any) -> None:
            settings = _settings(**arguments)
            command(**{name: arguments[name] for name in arguments.keys() & signature.parameters}, settings=settings)

        vars(run_command)["__signature__"] = signature.replace(parameters=every)
        run_command.__annotations__ = {parameter.name: parameter.annotation for parameter in every}
        return run_command

    return with_options


@contextmanager
def _spark(master: str) -> "Iterator[tuple[SparkSession, Callable[[str, float], None]]]":
    """Yield a session of Spark, and what reports progress, until the work is done."""
    from sprung.fleet.jobs import spark_session

    with progress_bar() as report:
        report("starting Spark", 0.0)
        session = spark_session(master)
        try:
            yield session, report
        finally:
            session.stop()


@takes_settings()
def run(
    lake: LakePlace,
    *,
    vehicles: Vehicles,
    out: Out,
    settings: "FleetSettings",
    minutes: WindowLength = 10.0,
    master: Master = "local[*]",
    json: Json = None,
) -> None:
    """Analyse the windows of a fleet that have no results yet. Tests the vehicles for changes."""
    from sprung.fleet import jobs
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import FleetRunDocument

    check_file("--json", json)
    results = jobs.Results(out)
    Lake(lake).table.open()  # refused before Spark starts where there is none
    with _spark(master) as (session, report):
        done = jobs.run(session, Lake(lake), vehicles, results, settings=settings, report=report)
        report("counting the results", 0.0)
        summary = jobs.summarise(session, results)
    document = FleetRunDocument.of(
        summary,
        results=out,
        steps=settings.steps,
        analysed=done.n_windows,
        vehicles_assessed=done.n_vehicles,
        analysis_time=done.elapsed,
        without_result=summary.failed,
        reasons=[{"reason": reason, "windows": count} for reason, count in summary.reasons],
        discoveries=summary.n_discoveries,
    )
    if write_result(document, json):
        plain = document.as_json()
        show(*tables.fleet_run_tables(plain), [*tables.describe_fleet_run(plain), *written([Path(out)], json)])


@takes_settings("method", "false_alarms", "false_discoveries", "hours_per_day")
def explain(
    lake: LakePlace,
    *,
    vehicles: Vehicles,
    out: Out,
    settings: "FleetSettings",
    master: Master = "local[*]",
    json: Json = None,
) -> None:
    """Show what sprung fleet run would do, and estimate its cost."""
    from sprung.fleet import jobs
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import FleetPlanDocument

    check_file("--json", json)
    Lake(lake).table.open()  # refused before Spark starts where there is none
    with _spark(master) as (session, report):
        report("comparing lake and results", 0.0)
        plan, cost = jobs.explain(session, Lake(lake), vehicles, jobs.Results(out), settings=settings)
        cores = session.sparkContext.defaultParallelism
    document = FleetPlanDocument.of(
        windows=plan.n_windows,
        new=plan.n_new,
        vehicles=plan.n_vehicles,
        without_vehicle_file=plan.n_without_file,
        seconds_per_window=cost.seconds,
        measured_on=cost.source,
        core_hours=cost.of(plan.n_new) / 3600,
        cores=cores,
    )
    if write_result(document, json):
        plain = document.as_json()
        show(tables.fleet_plan_table(plain), [*tables.describe_fleet_plan(plain), *written([], json)])


def road(
    lake: LakePlace,
    *,
    vehicles: Vehicles,
    out: Out,
    stretch: Annotated[float, option("METRES", "Length of a stretch.", panel=INPUT)] = 100.0,
    by: Annotated[
        Literal["place", "distance"],
        option(
            None, "Compare drives by latitude and longitude, or by the distance from where each begins.", panel=INPUT
        ),
    ] = "place",
    since: Since = None,
    until: Until = None,
    allow_missing: AllowMissing = False,
    map_file: Annotated[
        Path | None, option("F.geojson|F.gpx|F.csv", "Write stretches and events for maps or tables.", "--map")
    ] = None,
    master: Master = "local[*]",
    figures: Figures = None,
    json: Json = None,
) -> None:
    """Measure the roads under a fleet. Passes of all vehicles over each stretch, averaged, with their scatter."""
    from sprung.fleet import jobs
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import road_document
    from sprung.results.tables.wording import parse_period
    from sprung.road import write_survey

    output = Output(figures, json=json)
    output.check()
    output.paths.append(Path(out))
    check_file("--map", map_file)
    period = parse_period(since, until)
    settings = jobs.RoadSettings(stretch, by, period.since, period.until, allow_missing)
    Lake(lake).table.open()  # refused before Spark starts where there is none
    with _spark(master) as (session, report):
        survey = jobs.survey_fleet(session, Lake(lake), vehicles, jobs.Results(out), settings=settings, report=report)
    if map_file is not None:
        write_survey(survey, map_file)
        output.paths.append(map_file)
    output.draw(lambda drawn: {"road": drawn.road_figure(survey, source=out)})
    output.show(road_document(survey), *tables.road_tables(survey), notes=tables.describe_road(survey))


@takes_settings("since", "until", "false_discoveries")
def stream(
    lake: Annotated[
        str | None,
        typer.Argument(metavar="LAKE", help="Lake whose windows are analysed as they arrive.", show_default=False),
    ] = None,
    *,
    vehicles: Vehicles,
    out: Out,
    checkpoint: Annotated[
        str, option("DIR", "Folder or URL for the progress of the stream, from which it continues.", "--checkpoint")
    ],
    kafka: Annotated[
        str | None, option("SERVERS", "Analyse frames from Kafka at HOST:PORT,.. instead.", "--kafka", panel=INPUT)
    ] = None,
    topic: Annotated[str, option("TOPIC", "Topic of the frames in Kafka; keys are vehicles.", panel=INPUT)] = "frames",
    frames: Annotated[
        str | None,
        option("FOLDER", "Analyse frames in Parquet files with the columns key and value instead.", panel=INPUT),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="End once the present data are analysed.")] = False,
    every: Annotated[float, option("SECONDS", "Time between the starts of two batches.", min=1)] = 60.0,
    settings: "FleetSettings",
    minutes: WindowLength = 10.0,
    packages: Annotated[
        str | None, option("NAMES", "Packages of Spark to load, such as the one for Kafka.", "--packages", panel=SPARK)
    ] = None,
    master: Master = "local[*]",
    log_format: LogFormat = "text",
) -> None:
    """Analyse windows as they arrive in a lake, or frames from Kafka. Each window is analysed once.

    Runs until it is stopped, then finishes the current batch. After a restart it continues where it stopped.
    """
    from sprung.fleet import jobs, streams
    from sprung.fleet.lake import Lake

    if sum(source is not None for source in (lake, kafka, frames)) != 1:
        raise ParameterError("a stream needs one source: give a LAKE, --kafka or --frames")
    if lake is not None:
        Lake(lake).table.open()
    log_to(log_format)
    logging.getLogger("py4j").setLevel(logging.CRITICAL)  # an error is reported once, in one sentence
    more = {} if packages is None else {"spark.jars.packages": packages}
    session = jobs.spark_session(master, settings={**streams.STREAM_SETTINGS, **more})
    stopping = stop_on_signals()  # after the session, which listens to signals itself
    LOG.info("Spark is ready")
    try:
        if lake is not None:
            source = streams.windows_of_lake(session, Lake(lake))
        else:
            messages = (
                streams.messages_in_folder(session, str(frames))
                if kafka is None
                else streams.messages_in_kafka(session, kafka, topic)
            )
            source = streams.windows_of_messages(messages, duration=60 * minutes)
        chosen = streams.StreamSettings(settings, every=every, is_once=once)
        results = jobs.Results(out)
        streams.stream(
            session, source, vehicles, results, checkpoint, settings=chosen, stopping=stopping, report=_log_batch
        )
    finally:
        session.stop()
    LOG.info("the stream has ended; its progress is saved")


def _log_batch(batch: "StreamBatch") -> None:
    windows = max(batch.n_windows.values(), default=0)
    LOG.info(
        f"batch {batch.number}: {windows} windows, {batch.n_vehicles} vehicles assessed",
        extra={"seconds": round(batch.elapsed, 1)},
    )
    if batch.n_refused:
        LOG.warning(f"{batch.n_refused} messages were refused, such as: {batch.refusal}")
