"""What a run has to do: the windows of a lake without results, in chunks."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sprung.fleet.jobs.files import read
from sprung.fleet.jobs.results import KEY, OF_STEP, Results
from sprung.fleet.lake import AddedFile, Lake

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Number of windows that are committed together: what an interrupted run has to repeat at most.
CHUNK = 20_000
#: Number of a vehicle's first windows that its baseline may be learnt from, relative to the number it is learnt from.
CANDIDATES = 3
#: Reason of windows without a vehicle file.
WITHOUT_FILE = "the vehicle has no vehicle file: add one"


@dataclass(frozen=True, slots=True)
class Plan:
    """Windows without results.

    Parameters
    ----------
    n_windows
        Number of windows in the lake, in the period.
    n_new
        Number of them that lack the result of each step, by step.
    n_vehicles
        Number of vehicles that these are of.
    n_without_file
        Number of windows whose vehicle has no vehicle file, or one that cannot be used.
    """

    n_windows: int
    n_new: dict[str, int]
    n_vehicles: int
    n_without_file: int


class Planner:
    """Finds the windows of a lake that have no results.

    Parameters
    ----------
    session
        Session of Spark.
    lake, results
        Windows and results.
    vehicles
        Vehicles of the fleet, from `sprung.fleet.jobs.vehicles.vehicles_of`.
    steps
        Steps that are wanted, keys of `OF_STEP`.
    learning_windows
        Number of windows that a baseline is learnt from.
    since, until
        Period of the starts of windows, UTC ns, its ends included; None: open.

    Notes
    -----
    Only keys are compared and moved between machines, never samples: tasks read the samples of their windows from the
    lake themselves. A window that the lake holds twice is analysed once.
    """

    def __init__(
        self,
        session: "SparkSession",
        lake: Lake,
        results: Results,
        vehicles: "DataFrame",
        *,
        steps: Collection[str],
        learning_windows: int,
        since: int | None = None,
        until: int | None = None,
    ) -> None:
        self._session, self._lake, self._results = session, lake, results
        self._vehicles, self._steps = vehicles, sorted(steps)
        self._since, self._until = since, until
        self._files = lake.files(since=since, until=until)
        self._limits = self._learning_limits(learning_windows).cache()

    def chunks(self, size: int = CHUNK) -> Iterator[Sequence[AddedFile]]:
        """Yield the files of the lake in chunks of dates, with about `size` windows each."""
        chunk: list[AddedFile] = []
        for file in self._files:
            chunk.append(file)
            if sum(each.n_rows for each in chunk) >= size:
                yield chunk
                chunk = []
        if chunk:
            yield chunk

    def work(self, files: Sequence[AddedFile]) -> "DataFrame":
        """Return the windows of files that lack results, with `sprung.fleet.jobs.tasks.WORK_COLUMNS`."""
        from pyspark.sql import functions as f

        first = f.min(f.struct("path", "row", "duration", "date"))
        keys = self._keys(files).groupBy("vehicle", "start", "digest").agg(first.alias("place"))
        dates = {str(file.partition["date"]) for file in files}
        return lacking(
            self._session,
            keys.select("place.*", "vehicle", "start", "digest"),
            self._vehicles,
            self._limits,
            self._results,
            steps=self._steps,
            dates=dates,
        )

    def plan(self) -> Plan:
        """Return numbers of windows and vehicles."""
        from pyspark.sql import functions as f

        work = self.work(self._files)
        counts = [
            f.coalesce(f.sum(f.array_contains("steps", step).cast("long")), f.lit(0)).alias(step)
            for step in self._steps
        ]
        row = work.agg(
            *counts,
            f.countDistinct("vehicle").alias("vehicles"),
            f.coalesce(f.sum((f.col("reason") != "").cast("long")), f.lit(0)).alias("without"),
        ).collect()[0]
        n_windows = sum(file.n_rows for file in self._files)
        return Plan(n_windows, {step: row[step] for step in self._steps}, row["vehicles"], row["without"])

    def _keys(self, files: Sequence[AddedFile]) -> "DataFrame":
        """Return the keys of the windows of files, and where they are."""
        from pyspark.sql import functions as f

        rows = read(self._session, self._lake.table, files=files)
        if self._since is not None:
            rows = rows.where(f.col("start") >= self._since)
        if self._until is not None:
            rows = rows.where(f.col("start") <= self._until)
        if not files:
            return rows.select("vehicle", "start", "digest", "duration", "date").selectExpr(
                "*", "'' AS path", "0L AS row"
            )
        place = ("_metadata.file_path AS path", "_metadata.row_index AS row")
        return rows.selectExpr("vehicle", "start", "digest", "duration", "date", *place)

    def _learning_limits(self, learning_windows: int) -> "DataFrame":
        """Return the start of the last window of each vehicle that a baseline may be learnt from."""
        from pyspark.sql import Window
        from pyspark.sql import functions as f

        order = Window.partitionBy("vehicle").orderBy("start")
        starts = self._keys(self._files).select("vehicle", "start").distinct()
        first = starts.withColumn("rank", f.row_number().over(order)).where(
            f.col("rank") <= CANDIDATES * learning_windows
        )
        return first.groupBy("vehicle").agg(f.max("start").alias("limit"))


def lacking(
    session: "SparkSession",
    windows: "DataFrame",
    vehicles: "DataFrame",
    limits: "DataFrame",
    results: Results,
    *,
    steps: Collection[str],
    dates: Collection[str],
) -> "DataFrame":
    """Return the windows that lack results, with `sprung.fleet.jobs.tasks.WORK_COLUMNS` and their own columns.

    Parameters
    ----------
    session
        Session of Spark.
    windows
        Windows, once each, with the columns `vehicle`, `start` and `digest`.
    vehicles
        Vehicles of the fleet, from `sprung.fleet.jobs.vehicles.vehicles_of`.
    limits
        Start of the last window that a baseline may be learnt from, as columns `vehicle` and `limit`.
    results
        Results.
    steps
        Steps that are wanted, keys of `OF_STEP`.
    dates
        Dates of the windows, as YYYY-mm-dd.
    """
    from pyspark.sql import functions as f

    described = (
        windows.join(vehicles, "vehicle", "left")
        .withColumn("reason", f.coalesce("reason", f.lit(WITHOUT_FILE)))
        .withColumn("vehicle_file", f.coalesce("vehicle_file", f.lit("")))
        .join(limits, "vehicle", "left")
        .withColumn("has_segments", f.col("start") <= f.col("limit"))
    )
    for step in steps:
        described = described.join(_done(session, results, step, dates), list(KEY), "left")
    wanted = [f.when(f.col(f"{step}_done").isNull(), f.lit(step)) for step in steps]
    marks = [f"{step}_done" for step in steps]
    with_steps = described.withColumn("steps", f.array_compact(f.array(*wanted))).where(f.size("steps") > 0)
    return with_steps.drop("limit", "type", "type_name", *marks)


def _done(session: "SparkSession", results: Results, step: str, dates: Collection[str]) -> "DataFrame":
    """Return the keys with a result of a step on some dates."""
    from pyspark.sql import functions as f

    table = results[OF_STEP[step]]
    files = [file for file in table.files() if file.partition["date"] in dates]
    return read(session, table, files=files).select(*KEY).distinct().withColumn(f"{step}_done", f.lit(1))
