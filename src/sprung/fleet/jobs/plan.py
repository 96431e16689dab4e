"""What a run has to do: its settings, the vehicles of the fleet, and the windows of a lake without results."""

import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from sprung._checks import check_number
from sprung.errors import ParameterError, SprungError
from sprung.fleet.jobs.analysis import WindowSettings, Work, analyse, rows_of
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.jobs.results import KEY, OF_STEP, Results
from sprung.fleet.jobs.spark import filesystem, read, spark_schema
from sprung.fleet.lake import AddedFile, Lake, absolute_location
from sprung.fleet.lake.lake import in_parts
from sprung.vehicles import vehicle_from_text, vehicle_text

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Steps of a run, in their order.
STEPS = ("identify", "corners", "baseline", "diagnose")
#: Number of a vehicle's first windows that its baseline may be learnt from, relative to the number it is learnt from.
CANDIDATES = 3
#: Reason of windows without a vehicle file.
WITHOUT_FILE = "the vehicle has no vehicle file: add one"
#: Number of windows that are analysed to estimate a cost.
_MEASURED = 3
#: Columns of the vehicles; `type` and `vehicle_file` are digests.
VEHICLES = pa.schema(
    [(name, pa.string()) for name in ("vehicle", "vehicle_text", "vehicle_file", "type", "type_name", "reason")]
)


@dataclass(frozen=True, slots=True)
class FleetSettings:
    """Settings of a run.

    Parameters
    ----------
    steps
        Steps to take, of `STEPS`.
    windows, assessment
        Settings of the analysis of windows, and of baselines and diagnoses.
    false_discoveries
        Expected share of healthy vehicles among those said to have changed, above 0 and up to 1.
    since, until
        Period of the windows to analyse, UTC ns, its ends included; None: open. Diagnoses are of all windows with
        results.
    windows_in_task, windows_in_commit
        Number of windows that a task analyses: a few dozen seconds of work, which is what a lost worker costs; and of
        those that are committed together: what an interrupted run has to repeat at most.

    Raises
    ------
    ParameterError
        If a step is unknown, or a number is out of range.
    """

    steps: tuple[str, ...] = STEPS
    windows: WindowSettings = field(default_factory=WindowSettings)
    assessment: AssessmentSettings = field(default_factory=AssessmentSettings)
    false_discoveries: float = 0.05
    since: int | None = None
    until: int | None = None
    windows_in_task: int = 16
    windows_in_commit: int = 20_000

    def __post_init__(self) -> None:
        unknown = [step for step in self.steps if step not in STEPS]
        if unknown or not self.steps:
            raise ParameterError(f"step {', '.join(unknown) or 'none'!r} must be of {', '.join(STEPS)}")
        check_number("false_discoveries", self.false_discoveries, above=0, at_most=1)
        check_number("learning_windows", self.assessment.learning_windows, at_least=2)
        check_number("windows_in_task", self.windows_in_task, at_least=1)
        check_number("windows_in_commit", self.windows_in_commit, at_least=1)

    @property
    def of_windows(self) -> tuple[str, ...]:
        """Steps that each window goes through, keys of `OF_STEP`."""
        steps = [step for step in ("identify", "corners") if step in self.steps]
        return (*steps, *(["observe"] if {"baseline", "diagnose"} & set(self.steps) else []))


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


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost of the analysis of windows.

    Parameters
    ----------
    seconds
        Processor time of a window, by step [s].
    source
        Where the figures are from.
    """

    seconds: dict[str, float]
    source: str

    def of(self, n_new: dict[str, int]) -> float:
        """Return the processor time of numbers of windows by step [s]."""
        return sum(n_new[step] * self.seconds.get(step, 0.0) for step in n_new)


def vehicles_of(session: "SparkSession", place: str | Path) -> "DataFrame":
    """Return the vehicles of a fleet as a data frame with `VEHICLES`.

    Parameters
    ----------
    session
        Session of Spark.
    place
        Folder with one vehicle file for each vehicle, named VEHICLE.toml; or a table as CSV or Parquet with the columns
        `vehicle` and `file` (relative to the table's folder). All machines of a cluster must reach it.

    Raises
    ------
    ParameterError
        If the place does not exist, or the table lacks a column.

    Notes
    -----
    Vehicles are of one type if their files say the same, apart from the name. A file that cannot be used is a reason,
    in every row of its vehicle.
    """
    from pyarrow import fs
    from pyspark.sql import functions as f

    text = absolute_location(place)
    if text.endswith((".csv", ".parquet")):
        table = session.read.csv(text, header=True) if text.endswith(".csv") else session.read.parquet(text)
        lacking = sorted({"vehicle", "file"} - set(table.columns))
        if lacking:
            raise ParameterError(f"{place} lacks the column {lacking[0]!r}: give a table with vehicle and file")
        folder = text.rpartition("/")[0]
        paths = f.when(f.col("file").rlike("^(/|[a-z0-9]+://)"), f.col("file")).otherwise(
            f.concat(f.lit(f"{folder}/"), f.col("file"))
        )
        listed = table.groupBy("vehicle").agg(f.min(paths).alias("path"))
    else:
        system, folder = filesystem(text)
        is_file = system.get_file_info(folder).is_file
        entries = [] if is_file else system.get_file_info(fs.FileSelector(folder, allow_not_found=True))
        names = [entry.base_name for entry in entries if entry.base_name.endswith(".toml")]
        if not names:
            raise ParameterError(f"{place} has no vehicle files: give a folder with VEHICLE.toml for each, or a table")
        rows = [(name.removesuffix(".toml"), f"{text}/{name}") for name in names]
        listed = session.createDataFrame(rows, "vehicle string, path string")
    return listed.mapInArrow(_read_vehicles, spark_schema(VEHICLES))


def _read_vehicles(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """Yield the vehicles of the paths of their files."""
    for batch in batches:
        rows = []
        for vehicle, path in zip(*batch.to_pydict().values(), strict=True):
            try:
                system, place = filesystem(path)
                with system.open_input_stream(place) as stream:
                    rows.append(described(vehicle, stream.read().decode()))
            except (OSError, UnicodeDecodeError) as error:
                rows.append(_unusable(vehicle, f"{path} cannot be read: {error}"))
        yield pa.RecordBatch.from_pylist(rows, schema=VEHICLES)


def described(vehicle: str, text: str) -> dict[str, str]:
    """Return a vehicle with its file as a row of `VEHICLES`.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    text
        Text of its vehicle file.
    """
    try:
        description = vehicle_from_text(text, source=f"{vehicle}.toml")
    except SprungError as error:
        return {**_unusable(vehicle, str(error)), "vehicle_file": _digest(text)}
    of_type = vehicle_text(description.model_copy(update={"name": "type"}))
    return {
        "vehicle": vehicle,
        "vehicle_text": text,
        "vehicle_file": _digest(text),
        "type": _digest(of_type),
        "type_name": description.name,
        "reason": "",
    }


def _unusable(vehicle: str, reason: str) -> dict[str, str]:
    """Return a vehicle whose file cannot be used."""
    empty = dict.fromkeys(("vehicle_text", "vehicle_file", "type", "type_name"), "")
    return {"vehicle": vehicle, **empty, "reason": reason}


def _digest(text: str) -> str:
    return blake2b(text.encode(), digest_size=8).hexdigest()


class Planner:
    """Finds the windows of a lake that have no results.

    Parameters
    ----------
    vehicles
        Vehicles of the fleet, from `vehicles_of`.

    Notes
    -----
    Only keys are compared and moved between machines, never samples: tasks read the samples of their windows from the
    lake themselves. A window that the lake holds twice is analysed once.
    """

    def __init__(
        self, session: "SparkSession", lake: Lake, results: Results, vehicles: "DataFrame", settings: FleetSettings
    ) -> None:
        self._session = session
        self._lake = lake
        self._results = results
        self._vehicles = vehicles
        self._settings = settings
        self._files = lake.files(since=settings.since, until=settings.until)
        self._limits = self._learning_limits(settings.assessment.learning_windows).cache()

    def keys(self) -> "DataFrame":
        """Return the keys of all windows of the period, once each, and where they are."""
        return self._keys(self._files).dropDuplicates(["vehicle", "start", "digest"])

    def chunks(self) -> Iterator[Sequence[AddedFile]]:
        """Yield the files of the lake in chunks of dates, with about as many windows each as are committed together."""
        return in_parts(self._files, size=lambda file: file.n_rows, limit=self._settings.windows_in_commit)

    def work(self, files: Sequence[AddedFile]) -> "DataFrame":
        """Return the windows of files that lack results."""
        from pyspark.sql import functions as f

        first = f.min(f.struct("path", "row", "duration", "date"))
        keys = self._keys(files).groupBy("vehicle", "start", "digest").agg(first.alias("place"))
        return lacking(
            self._session,
            keys.select("place.*", "vehicle", "start", "digest"),
            self._vehicles,
            self._limits,
            self._results,
            steps=self._settings.of_windows,
            dates={str(file.partition["date"]) for file in files},
        )

    def plan(self) -> Plan:
        """Return numbers of windows and vehicles."""
        from pyspark.sql import functions as f

        steps = self._settings.of_windows
        work = self.work(self._files)
        counts = [
            f.coalesce(f.sum(f.array_contains("steps", step).cast("long")), f.lit(0)).alias(step) for step in steps
        ]
        row = work.agg(
            *counts,
            f.countDistinct("vehicle").alias("vehicles"),
            f.coalesce(f.sum((f.col("reason") != "").cast("long")), f.lit(0)).alias("without"),
        ).collect()[0]
        n_windows = sum(file.n_rows for file in self._files)
        return Plan(n_windows, {step: row[step] for step in steps}, row["vehicles"], row["without"])

    def cost(self) -> Cost:
        """Return the cost of a window: that of the last run, or of a few windows that are analysed for this."""
        steps = self._settings.of_windows
        runs = self._results["runs"].rows().to_pylist()
        of_tables = {table: f"{table}_seconds" for table in OF_STEP.values()}
        for row in sorted(runs, key=lambda row: -row["finished"]):
            known = {step: row[of_tables[OF_STEP[step]]] / max(1, row["n_windows"]) for step in steps}
            if row["n_windows"] and all(known.values()):
                return Cost(known, f"{row['n_windows']} windows of the run {row['run']}")
        files = next(iter(self.chunks()), [])
        items = [item.asDict() for item in self.work(files).limit(_MEASURED).collect()]
        seconds = dict.fromkeys(steps, 0.0)
        count = 0
        for item, row in rows_of(items):
            if row is not None and not item["reason"]:
                count += 1
                for step in seconds:
                    begin = time.process_time()
                    analyse(row, Work(item["vehicle_text"], steps=(step,)), self._settings.windows)
                    seconds[step] += time.process_time() - begin
        of_window = {step: spent / max(1, count) for step, spent in seconds.items()}
        return Cost(of_window, f"{count} windows analysed for this")

    def _keys(self, files: Sequence[AddedFile]) -> "DataFrame":
        """Return the keys of the windows of files, and where they are."""
        from pyspark.sql import functions as f

        rows = read(self._session, self._lake.table, files=files)
        if self._settings.since is not None:
            rows = rows.where(f.col("start") >= self._settings.since)
        if self._settings.until is not None:
            rows = rows.where(f.col("start") <= self._settings.until)
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
    """Return the windows that lack results, with their place or samples, their vehicle file and their steps.

    Parameters
    ----------
    windows
        Windows, once each, with the columns `vehicle`, `start` and `digest`.
    vehicles
        Vehicles of the fleet, from `vehicles_of`.
    limits
        Start of the last window that a baseline may be learnt from, as columns `vehicle` and `limit`.
    steps
        Steps that are wanted, keys of `OF_STEP`.
    dates
        Dates of the windows, as YYYY-mm-dd.
    """
    from pyspark.sql import functions as f

    known = (
        windows.join(vehicles, "vehicle", "left")
        .withColumn("reason", f.coalesce("reason", f.lit(WITHOUT_FILE)))
        .withColumn("vehicle_file", f.coalesce("vehicle_file", f.lit("")))
        .join(limits, "vehicle", "left")
        .withColumn("has_segments", f.col("start") <= f.col("limit"))
    )
    for step in steps:
        table = results[OF_STEP[step]]
        files = [file for file in table.files() if file.partition["date"] in dates]
        done = read(session, table, files=files).select(*KEY).distinct().withColumn(f"{step}_done", f.lit(1))
        known = known.join(done, list(KEY), "left")
    wanted = [f.when(f.col(f"{step}_done").isNull(), f.lit(step)) for step in steps]
    with_steps = known.withColumn("steps", f.array_compact(f.array(*wanted))).where(f.size("steps") > 0)
    return with_steps.drop("limit", "type", "type_name", *(f"{step}_done" for step in steps))
