"""Streams of a fleet: windows analysed as they arrive, each once, whatever interruptions occur."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sprung._checks import check_number
from sprung.errors import DataError, SprungError
from sprung.fleet.jobs.assessing import assess_vehicles
from sprung.fleet.jobs.files import read
from sprung.fleet.jobs.plan import CANDIDATES, lacking
from sprung.fleet.jobs.results import Results
from sprung.fleet.jobs.runs import FleetSettings, analyse_windows
from sprung.fleet.jobs.vehicles import vehicles_of
from sprung.fleet.lake import absolute_location

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
#: Property by which Spark names the stream that a batch is of, whatever its restarts.
_QUERY = "sql.streaming.queryId"


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
        Stream of windows, from `sprung.fleet.streams.sources`.
    vehicles
        Vehicle files, as for `sprung.fleet.jobs.vehicles.vehicles_of`; read again for every batch.
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
        self._session, self._vehicles, self._results = session, vehicles, results
        self._settings, self._report = settings, report
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
        name = str(self._session.sparkContext.getLocalProperty(_QUERY))
        work = self._work(batch, fleet, dates)
        done = analyse_windows(
            *(self._session, work, self._results, self._settings, _unreported), application=(name, number)
        )
        return {table: n_rows for table, (n_rows, _) in done.items()}

    def _assess(self, fleet: "DataFrame") -> int:
        """Assess the vehicles whose windows have changed, and return their number."""
        if "observe" not in self._settings.of_windows or not self._results["windows"].exists:
            return 0
        return assess_vehicles(
            self._session,
            fleet,
            self._results,
            settings=self._settings.assessment,
            rate=self._settings.false_discoveries,
        )

    def _work(self, batch: "DataFrame", fleet: "DataFrame", dates: set[str]) -> "DataFrame":
        """Return the windows of a batch that lack results."""
        from pyspark.sql import functions as f

        windows = batch.where(f.col("digest").isNotNull()).drop("n_refused", "refusal")
        return lacking(
            self._session,
            windows.dropDuplicates(["vehicle", "start", "digest"]),
            fleet,
            self._learning_limits(windows),
            self._results,
            steps=self._settings.of_windows,
            dates=dates,
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


def _unreported(step: str, share: float) -> None:
    """Leave the share of a batch that is done aside: batches are short."""


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
        raise DataError(
            f"the stream has ended: {_first_line(batches.error or error)}: remove the cause and start it again, "
            f"with the checkpoint {checkpoint}"
        ) from error


def _first_line(error: Any) -> str:
    """Return the first line of an error."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return lines[0][:300].rstrip(".")
