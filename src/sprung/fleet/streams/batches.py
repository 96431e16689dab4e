"""Streams of a fleet: windows analysed as they arrive, each once, whatever interruptions occur."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sprung._checks import check_number
from sprung.errors import DataError, ParameterError, SprungError
from sprung.fleet.jobs.plan import CANDIDATES, FleetSettings, lacking, vehicles_of
from sprung.fleet.jobs.results import Results
from sprung.fleet.jobs.runs import analyse_windows
from sprung.fleet.jobs.spark import read, spark_schema
from sprung.fleet.lake import SCHEMA, Lake, absolute_location

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession
    from pyspark.sql.streaming.query import StreamingQuery

#: Settings of Spark for a stream: the state of a batch is kept as what changed, and its memory is limited.
STREAM_SETTINGS = {
    "spark.sql.streaming.stateStore.rocksdb.changelogCheckpointing.enabled": "true",
    "spark.sql.streaming.stateStore.rocksdb.boundedMemoryUsage": "true",
    "spark.sql.streaming.minBatchesToRetain": "10",
}
#: Number of batches after which small files of the results are rewritten as large ones.
_COMPACTED_EVERY = 64
#: Time between looks at whether a stream shall end [s].
_LOOK_EVERY = 1
#: Largest size of the files in a batch [bytes].
_MAX_BYTES = 1 << 30
#: Largest number of the messages of Kafka in a batch.
_MAX_MESSAGES = 1_000_000
#: Columns of messages: the vehicle, and a frame v1, report or state of its box.
_MESSAGES = "key string, value binary"
#: Property by which Spark names the stream that a batch is of, whatever its restarts.
_QUERY = "sql.streaming.queryId"


def windows_of_lake(session: "SparkSession", lake: Lake) -> "DataFrame":
    """Return the stream of the windows that a lake holds and receives: where they are, without samples.

    Parameters
    ----------
    session
        Session of Spark.
    lake
        Windows of samples.

    Raises
    ------
    DataError
        If there is no lake.

    Notes
    -----
    Spark lists the files of the lake, also those of interrupted commits and rewritten ones; a window counts once, by
    its key.

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> from sprung.fleet.lake import Lake
    >>> windows = windows_of_lake(spark_session("local[2]"), Lake("lake"))  # doctest: +SKIP
    >>> windows.isStreaming, windows.columns[:3]  # doctest: +SKIP
    (True, ['vehicle', 'start', 'digest'])
    """
    lake.table.open()
    files = session.readStream.schema(spark_schema(SCHEMA)).option("pathGlobFilter", "*.parquet")
    files = files.option("ignoreMissingFiles", True).option("maxBytesPerTrigger", _MAX_BYTES)
    keys = (
        "vehicle",
        "start",
        "digest",
        "duration",
        "date",
        "_metadata.file_path AS path",
        "_metadata.row_index AS row",
    )
    return files.parquet(lake.location).selectExpr(*keys, "0L AS n_refused", "'' AS refusal")


def messages_in_folder(session: "SparkSession", folder: str | Path) -> "DataFrame":
    """Return the stream of messages in Parquet files with the columns `key` (vehicle) and `value` in a folder.

    Parameters
    ----------
    session
        Session of Spark.
    folder
        Folder, or URL of an object store; files must appear in it whole.

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> messages = messages_in_folder(spark_session("local[2]"), "messages")  # doctest: +SKIP
    >>> messages.isStreaming, messages.columns  # doctest: +SKIP
    (True, ['key', 'value'])
    """
    files = session.readStream.schema(_MESSAGES).option("pathGlobFilter", "*.parquet")
    return files.option("maxBytesPerTrigger", _MAX_BYTES).parquet(absolute_location(folder))


def messages_in_kafka(session: "SparkSession", servers: str, topic: str) -> "DataFrame":
    """Return the stream of messages of a topic of Kafka from its beginning, whose keys are vehicles.

    Parameters
    ----------
    session
        Session of Spark, with the connector for Kafka among its packages.
    servers
        Addresses of the brokers, such as "kafka-1:9092,kafka-2:9092".
    topic
        Name of the topic.

    Raises
    ------
    ParameterError
        If Spark has no connector for Kafka.

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> settings = {"spark.jars.packages": "org.apache.spark:spark-sql-kafka-0-10_2.13:4.3.0"}
    >>> session = spark_session("local[2]", settings=settings)  # doctest: +SKIP
    >>> messages = messages_in_kafka(session, "kafka-1:9092,kafka-2:9092", "sprung")  # doctest: +SKIP
    >>> messages.isStreaming, messages.columns  # doctest: +SKIP
    (True, ['key', 'value'])
    """
    reader = session.readStream.format("kafka").option("kafka.bootstrap.servers", servers).option("subscribe", topic)
    reader = reader.option("startingOffsets", "earliest").option("maxOffsetsPerTrigger", _MAX_MESSAGES)
    try:
        return reader.load().selectExpr("CAST(key AS STRING) AS key", "value")
    except Exception as error:  # whatever Java makes of an absent connector
        first = str(error).strip().splitlines()[0]
        raise ParameterError(
            f"no stream from Kafka at {servers}: {first[:200]}: start Spark with the package "
            f"org.apache.spark:spark-sql-kafka-0-10_2.13:{session.version}"
        ) from None


def windows_of_messages(messages: "DataFrame", *, duration: float = 600.0) -> "DataFrame":
    """Return the stream of the windows that frames of vehicles complete, with their samples.

    Parameters
    ----------
    messages
        Messages from `messages_in_folder` or `messages_in_kafka`, in any order.
    duration
        Length of a window without its gaps [s].

    Raises
    ------
    ParameterError
        If the duration is out of range.

    Notes
    -----
    The state of a vehicle has the frames of its incomplete window and those that wait for earlier ones
    (`sprung.link.windows.WindowAssembly`).

    Examples
    --------
    >>> from sprung.fleet.jobs import spark_session
    >>> from sprung.fleet.streams import STREAM_SETTINGS
    >>> session = spark_session("local[2]", settings=STREAM_SETTINGS)  # doctest: +SKIP
    >>> windows = windows_of_messages(messages_in_folder(session, "messages"), duration=300.0)  # doctest: +SKIP
    >>> windows.isStreaming, windows.columns[:3]  # doctest: +SKIP
    (True, ['date', 'vehicle', 'start'])
    """
    from pyspark.sql.types import LongType, StringType

    from sprung.fleet.streams.frame_state import FrameState

    check_number("duration", duration, at_least=60, at_most=7200)
    columns = spark_schema(SCHEMA).add("n_refused", LongType()).add("refusal", StringType())
    by_vehicle = messages.where("key IS NOT NULL").groupBy("key")
    windows = by_vehicle.transformWithState(FrameState(duration), columns, "Append", "None")
    return windows.selectExpr("*", "CAST(NULL AS string) AS path", "0L AS row")


@dataclass(frozen=True, slots=True)
class StreamSettings:
    """Settings of a stream.

    Parameters
    ----------
    run
        Settings of the analysis, as for runs over an archive; the period is left aside.
    every
        Time from the start of a batch to that of the next one [s].
    is_once
        Whether to end once all windows present at the start have been analysed.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    run: FleetSettings = field(default_factory=FleetSettings)
    every: float = 60.0
    is_once: bool = False

    def __post_init__(self) -> None:
        check_number("every", self.every, at_least=1)


@dataclass(frozen=True, slots=True)
class StreamBatch:
    """What a batch of a stream has done.

    Parameters
    ----------
    number
        Number of the batch, from 0.
    n_windows
        Number of windows that were analysed, by table of results.
    n_vehicles
        Number of vehicles that were assessed again.
    n_refused, refusal
        Number of messages that are no frames of their vehicle, and the reason for one of them.
    elapsed
        Time of the batch [s].
    """

    number: int
    n_windows: dict[str, int]
    n_vehicles: int
    n_refused: int
    refusal: str
    elapsed: float


def stream(
    session: "SparkSession",
    windows: "DataFrame",
    vehicles: str | Path,
    results: Results,
    checkpoint: str | Path,
    *,
    settings: StreamSettings | None = None,
    stopping: threading.Event | None = None,
    report: Callable[[StreamBatch], None] = lambda batch: None,
) -> None:
    """Analyse the windows of a stream as they arrive, and assess the vehicles that they are from.

    Parameters
    ----------
    session
        Session of Spark, from `spark_session` with `STREAM_SETTINGS`.
    windows
        Stream of windows, from `sprung.fleet.streams`.
    vehicles
        Vehicle files, as for `sprung.fleet.jobs.plan.vehicles_of`; read again for every batch.
    results
        Tables of results; a run over an archive may have begun them.
    checkpoint
        Folder or URL of the progress and state of the stream, from where it continues.
    settings
        Settings of the stream.
    stopping
        Event after which the stream ends with the current batch.
    report
        Callback that receives what each batch has done.

    Raises
    ------
    ParameterError
        If the vehicle files cannot be used.
    DataError
        If the stream ends with an error.

    Notes
    -----
    Every window counts once: windows that have results are not analysed again, and the files of a batch are committed
    under the name of the stream and the number of the batch, which a table takes once. Vehicles are assessed by their
    windows in the tables, so that a batch interrupted anywhere is completed when it is repeated.

    Examples
    --------
    >>> from sprung.fleet.jobs import Results, spark_session
    >>> from sprung.fleet.streams import windows_of_lake
    >>> from sprung.fleet.lake import Lake
    >>> batches = []
    >>> options = {"settings": StreamSettings(is_once=True), "report": batches.append}
    >>> session = spark_session("local[2]", settings=STREAM_SETTINGS)  # doctest: +SKIP
    >>> windows = windows_of_lake(session, Lake("lake"))  # doctest: +SKIP
    >>> stream(session, windows, "vehicles", Results("results"), "checkpoint", **options)  # doctest: +SKIP
    >>> [(batch.number, batch.n_windows, batch.n_vehicles) for batch in batches]  # doctest: +SKIP
    [(0, {'identifications': 288, 'corners': 288, 'windows': 288}, 12)]
    """
    chosen = settings or StreamSettings()
    batches = _Batches(session, vehicles, results, settings=chosen.run, stopping=stopping, report=report)
    writer = windows.writeStream.foreachBatch(batches).option("checkpointLocation", absolute_location(checkpoint))
    if chosen.is_once:
        query = writer.trigger(availableNow=True).start()
    else:
        query = writer.trigger(processingTime=f"{round(1000 * chosen.every)} milliseconds").start()
    _wait(query, batches, str(checkpoint))


class _StoppedError(Exception):
    """No further batch is wanted."""


class _Batches:
    """Analyses batches of windows."""

    def __init__(
        self,
        session: "SparkSession",
        vehicles: str | Path,
        results: Results,
        *,
        settings: FleetSettings,
        stopping: threading.Event | None,
        report: Callable[[StreamBatch], None],
    ) -> None:
        self._session = session
        self._vehicles = vehicles
        self._results = results
        self._settings = settings
        self._report = report
        self._is_first = True
        self.stopping = stopping or threading.Event()
        self.error: Exception | None = None

    def __call__(self, batch: "DataFrame", number: int) -> None:
        """Analyse the windows of a batch, and assess their vehicles."""
        try:
            if self.stopping.is_set():
                raise _StoppedError
            self._report(self._analysed(batch.persist(), number))
        except Exception as error:
            self.error = error
            raise
        finally:
            batch.unpersist()

    def _analysed(self, batch: "DataFrame", number: int) -> StreamBatch:
        """Analyse the windows of a batch; the batch is computed once."""
        from pyspark.sql import functions as f

        begin = time.monotonic()
        refusals = f.coalesce(f.sum("n_refused"), f.lit(0)).alias("n"), f.max("refusal").alias("reason")
        facts = batch.agg(f.collect_set(f.col("date").cast("string")).alias("dates"), *refusals).collect()[0]
        fleet = vehicles_of(self._session, self._vehicles).cache()
        try:
            n_windows = self._commit(batch, number, fleet, set(facts["dates"])) if facts["dates"] else {}
            # The first batch may repeat one that was interrupted between the commit and the assessment.
            n_vehicles = self._assess(fleet) if n_windows or self._is_first else 0
        finally:
            fleet.unpersist()
        self._is_first = False
        if number % _COMPACTED_EVERY == _COMPACTED_EVERY - 1:
            self._results.compact()
            self._results.vacuum()
        elapsed = time.monotonic() - begin
        return StreamBatch(number, n_windows, n_vehicles, facts["n"], facts["reason"] or "", elapsed)

    def _commit(self, batch: "DataFrame", number: int, fleet: "DataFrame", dates: set[str]) -> dict[str, int]:
        """Analyse the windows of a batch that lack results, and return the number of rows by table."""
        from pyspark.sql import functions as f

        windows = batch.where(f.col("digest").isNotNull()).drop("n_refused", "refusal")
        work = lacking(
            self._session,
            windows.dropDuplicates(["vehicle", "start", "digest"]),
            fleet,
            self._learning_limits(windows),
            self._results,
            steps=self._settings.of_windows,
            dates=dates,
        )
        stream = str(self._session.sparkContext.getLocalProperty(_QUERY))
        done = analyse_windows(
            self._session, work, self._results, self._settings, lambda step, share: None, application=(stream, number)
        )
        return {table: n_rows for table, (n_rows, _) in done.items()}

    def _assess(self, fleet: "DataFrame") -> int:
        """Assess the vehicles whose windows have changed, and return their number."""
        if "observe" not in self._settings.of_windows or not self._results["windows"].exists:
            return 0
        settings = self._settings
        from sprung.fleet.jobs.assessing import assess_vehicles  # asks for PySpark

        return assess_vehicles(
            self._session, fleet, self._results, settings=settings.assessment, rate=settings.false_discoveries
        )

    def _learning_limits(self, windows: "DataFrame") -> "DataFrame":
        """Return the start of the last window of each vehicle that a baseline may be learnt from.

        Every window among the first ones of its vehicle is among the first ones when it arrives.
        """
        from pyspark.sql import Window
        from pyspark.sql import functions as f

        known = read(self._session, self._results["diagnoses"])
        known = known.select("vehicle", (f.col("n_windows") + f.col("n_left_out")).alias("n_known"))
        learnt = read(self._session, self._results["baselines"]).select("vehicle", "until")
        order = Window.partitionBy("vehicle").orderBy("start")
        ranked = windows.select("vehicle", "start").distinct().withColumn("rank", f.row_number().over(order))
        number = f.col("rank") + f.coalesce("n_known", f.lit(0))
        is_early = number <= CANDIDATES * self._settings.assessment.learning_windows
        early = (
            ranked.join(known, "vehicle", "left")
            .groupBy("vehicle")
            .agg(f.max(f.when(is_early, f.col("start"))).alias("last"))
        )
        return early.join(learnt, "vehicle", "left").select("vehicle", f.greatest("last", "until").alias("limit"))


def _wait(query: "StreamingQuery", batches: _Batches, checkpoint: str) -> None:
    """Wait until a stream ends, or end it after the present batch."""
    try:
        while not query.awaitTermination(_LOOK_EVERY):
            if batches.stopping.is_set() and not query.status["isTriggerActive"]:
                query.stop()
    except Exception as error:  # what Spark makes of the error of a batch
        if isinstance(batches.error, _StoppedError):
            return
        if isinstance(batches.error, SprungError):
            raise batches.error from None
        reason = (str(batches.error or error).strip().splitlines() or [type(error).__name__])[0][:300].rstrip(".")
        raise DataError(
            f"the stream has ended: {reason}: remove the cause and start it again, with the checkpoint {checkpoint}"
        ) from error
