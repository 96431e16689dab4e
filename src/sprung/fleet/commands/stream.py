"""The command `sprung fleet stream`."""

import logging
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sprung.cli.logs import LogFormat, log_to
from sprung.cli.options import INPUT, AllowMissing, option
from sprung.cli.stopping import stop_on_signals
from sprung.errors import ParameterError
from sprung.fleet.commands.runs import SPARK, Learn, Master, Out, Steps, Vehicles, run_settings

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

    from sprung.fleet.streams import StreamBatch

LOG = logging.getLogger("sprung")


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
    steps: Steps = "identify,corners,baseline,diagnose",
    learn: Learn = 12,
    method: Annotated[
        Literal["cov", "acs", "coss", "plscf", "fdd"],
        typer.Option(help="Method of identification.", rich_help_panel=INPUT),
    ] = "cov",
    allow_missing: AllowMissing = False,
    false_alarms: Annotated[float, option("RATE", "False alarms per vehicle and day of driving.", panel=INPUT)] = 1e-3,
    hours_per_day: Annotated[float, option("H", "Hours of driving per day.", panel=INPUT)] = 8.0,
    minutes: Annotated[
        float,
        option(
            "MINUTES",
            "Length of the windows in the lake, or of those into which frames are joined.",
            "--window",
            panel=INPUT,
            min=1,
            max=120,
        ),
    ] = 10.0,
    packages: Annotated[
        str | None, option("NAMES", "Packages of Spark to load, such as the one for Kafka.", "--packages", panel=SPARK)
    ] = None,
    master: Master = "local[*]",
    log_format: LogFormat = "text",
) -> None:
    """Analyse windows of a fleet as they arrive in a lake, or frames as they arrive from Kafka, each window once.

    Runs until it is stopped, then finishes the current batch. After a restart it continues where it stopped.
    """
    from sprung.fleet import jobs, streams

    _check_source(lake, kafka, frames)
    log_to(log_format)
    logging.getLogger("py4j").setLevel(logging.CRITICAL)  # an error is reported once, in one sentence
    settings = streams.StreamSettings(
        run_settings(
            steps=steps,
            since=None,
            until=None,
            learn=learn,
            method=method,
            allow_missing=allow_missing,
            false_alarms=false_alarms,
            windows_per_day=hours_per_day * 60 / minutes,
        ),
        every=every,
        is_once=once,
    )
    more = {} if packages is None else {"spark.jars.packages": packages}
    session = jobs.spark_session(master, settings={**streams.STREAM_SETTINGS, **more})
    stopping = stop_on_signals()  # after the session, which listens to signals itself
    LOG.info("Spark is ready")
    try:
        source = _source(session, lake, kafka=kafka, topic=topic, frames=frames, duration=60 * minutes)
        results = jobs.Results(out)
        streams.stream(
            session, source, vehicles, results, checkpoint, settings=settings, stopping=stopping, report=_log_batch
        )
    finally:
        session.stop()
    LOG.info("the stream has ended; its progress is saved")


def _check_source(lake: str | None, kafka: str | None, frames: str | None) -> None:
    """Require exactly one source."""
    if sum(source is not None for source in (lake, kafka, frames)) != 1:
        raise ParameterError("a stream needs one source: give a LAKE, --kafka or --frames")


def _source(
    session: "SparkSession", lake: str | None, *, kafka: str | None, topic: str, frames: str | None, duration: float
) -> "DataFrame":
    """Return the stream of windows of the source that was given."""
    from sprung.fleet import streams
    from sprung.fleet.lake import Lake

    if lake is not None:
        return streams.windows_of_lake(session, Lake(lake))
    if kafka is not None:
        messages = streams.messages_in_kafka(session, kafka, topic)
    else:
        messages = streams.messages_in_folder(session, str(frames))
    return streams.windows_of_messages(messages, duration=duration)


def _log_batch(batch: "StreamBatch") -> None:
    """Log the result of a batch."""
    windows = max(batch.n_windows.values(), default=0)
    LOG.info(
        f"batch {batch.number}: {windows} windows, {batch.n_vehicles} vehicles assessed",
        extra={"seconds": round(batch.elapsed, 1)},
    )
    if batch.n_refused:
        LOG.warning(f"{batch.n_refused} messages were refused, such as: {batch.refusal}")
