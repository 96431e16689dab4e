"""Runs over the archive of a fleet: every window analysed once, then baselines, types, diagnoses and discoveries."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import pyarrow as pa

from sprung.fleet.jobs.analysis import REPORT_COLUMNS, Task
from sprung.fleet.jobs.plan import Cost, FleetSettings, Plan, Planner, vehicles_of
from sprung.fleet.jobs.results import OF_STEP, SCHEMAS, Results
from sprung.fleet.jobs.spark import read, spark_schema
from sprung.fleet.lake import AddedFile, Lake

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Largest number of reasons in a summary.
_MAX_REASONS = 8
#: Largest number of vehicles in a summary.
_MAX_VEHICLES = 20
#: Receives the step and the share of it that is done (0 to 1).
Report = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class FleetRun:
    """What a run has done.

    Parameters
    ----------
    run
        Name of the run.
    n_windows
        Number of windows that were analysed, by table of results.
    n_vehicles
        Number of vehicles that were assessed again.
    analysis_time
        Processor time of the analysis of all windows together, by table of results [s].
    elapsed
        Time from start to end [s].
    """

    run: str
    n_windows: dict[str, int]
    n_vehicles: int
    analysis_time: dict[str, float]
    elapsed: float


def run(
    session: "SparkSession",
    lake: Lake,
    vehicles: str | Path,
    results: Results,
    *,
    settings: FleetSettings | None = None,
    report: Report = lambda step, share: None,
) -> FleetRun:
    """Analyse the windows of a lake that have no results yet, and assess the vehicles that they are from.

    Parameters
    ----------
    session
        Session of Spark, from `spark_session`.
    lake
        Windows of samples.
    vehicles
        Vehicle files, as for `sprung.fleet.jobs.plan.vehicles_of`.
    results
        Tables of results.
    settings
        Settings of the run.
    report
        Callback that receives the step and the share that is done.

    Returns
    -------
    FleetRun
        Numbers of windows and vehicles, and times.

    Raises
    ------
    DataError
        If there is no lake.
    ParameterError
        If the vehicle files cannot be used.

    Notes
    -----
    Results are a function of the windows and vehicle files alone: running again changes nothing, late windows are
    taken in, and an interrupted run is continued by the next one. Windows of other vehicle files than the present ones
    keep their rows and no longer count.

    Examples
    --------
    >>> from sprung.fleet.jobs import Results, spark_session
    >>> from sprung.fleet.lake import Lake
    >>> settings = FleetSettings(steps=("baseline", "diagnose"))
    >>> settings.of_windows
    ('observe',)
    >>> session = spark_session("local[2]")  # doctest: +SKIP
    >>> outcome = run(session, Lake("lake"), "vehicles", Results("results"), settings=settings)  # doctest: +SKIP
    >>> outcome.n_windows, outcome.n_vehicles  # doctest: +SKIP
    ({'windows': 288}, 12)
    """
    chosen = settings or FleetSettings()
    begin = time.monotonic()
    report("reading the lake", 0.0)
    lake.table.open()
    fleet = vehicles_of(session, vehicles).cache()
    try:
        planner = Planner(session, lake, results, fleet, chosen)
        n_windows: dict[str, int] = {}
        seconds: dict[str, float] = {}
        chunks = list(planner.chunks())
        for number, files in enumerate(chunks):
            step = f"analysing part {number + 1} of {len(chunks)}"
            done = analyse_windows(session, planner.work(files), results, chosen, report, step=step)
            for table, (rows, spent) in done.items():
                n_windows[table] = n_windows.get(table, 0) + rows
                seconds[table] = seconds.get(table, 0.0) + spent
        assessed = 0
        if "observe" in chosen.of_windows:
            from sprung.fleet.jobs.assessing import assess_vehicles  # asks for PySpark

            assessed = assess_vehicles(
                session, fleet, results, settings=chosen.assessment, rate=chosen.false_discoveries, report=report
            )
    finally:
        fleet.unpersist()
    outcome = FleetRun(uuid4().hex[:12], n_windows, assessed, seconds, time.monotonic() - begin)
    if sum(n_windows.values()) or assessed:
        report("compacting the results", 0.0)
        row = {
            "run": outcome.run,
            "finished": time.time_ns(),
            "n_windows": max(n_windows.values(), default=0),
            "n_vehicles": assessed,
            "seconds": outcome.elapsed,
            **{f"{table}_seconds": seconds.get(table, 0.0) for table in OF_STEP.values()},
        }
        results["runs"].append(pa.Table.from_pylist([row], schema=SCHEMAS["runs"]))
        results.compact()
    return outcome


def explain(
    session: "SparkSession",
    lake: Lake,
    vehicles: str | Path,
    results: Results,
    *,
    settings: FleetSettings | None = None,
) -> tuple[Plan, Cost]:
    """Return what a run would do, and what a window costs; parameters and errors as for `run`.

    Examples
    --------
    >>> from sprung.fleet.jobs import Results, spark_session
    >>> from sprung.fleet.lake import Lake
    >>> settings = FleetSettings(steps=("baseline", "diagnose"))
    >>> session = spark_session("local[2]")  # doctest: +SKIP
    >>> plan, cost = explain(session, Lake("lake"), "vehicles", Results("results"), settings=settings)  # doctest: +SKIP
    >>> plan.n_windows, plan.n_new, plan.n_vehicles  # doctest: +SKIP
    (288, {'observe': 24}, 12)
    """
    chosen = settings or FleetSettings()
    lake.table.open()
    fleet = vehicles_of(session, vehicles).cache()
    try:
        planner = Planner(session, lake, results, fleet, chosen)
        plan = planner.plan()
        return plan, planner.cost()
    finally:
        fleet.unpersist()


def analyse_windows(
    session: "SparkSession",
    work: "DataFrame",
    results: Results,
    settings: FleetSettings,
    report: Report,
    *,
    step: str = "",
    application: tuple[str, int] | None = None,
) -> dict[str, tuple[int, float]]:
    """Analyse windows and commit their results; return numbers of rows and seconds by table.

    Parameters
    ----------
    session
        Session of Spark.
    work
        Windows, from `sprung.fleet.jobs.plan.lacking`.
    results
        Tables of results.
    settings
        Settings of the run.
    report
        Callback that receives the step and the share of the windows that is done.
    step
        What the callback calls this.
    application
        Name of a stream and number of its batch, which counts once; None: a run.
    """
    work = work.cache()
    try:
        count = work.count()
        if not count:
            return {}
        n_tasks = -(-count // settings.windows_in_task)
        # Windows of one file next to each other, in tasks of equal size whatever the vehicle; frames have no file.
        spread = work.repartitionByRange(n_tasks, "path", "row", "vehicle", "start")
        task = Task({name: results[name].location for name in OF_STEP.values()}, settings.windows)
        with _watched(session, n_tasks, lambda share: report(step, share)):
            reports = spread.mapInArrow(task.analysed, spark_schema(REPORT_COLUMNS)).collect()
    finally:
        work.unpersist()
    done: dict[str, tuple[int, float]] = {}
    for table in OF_STEP.values():
        own = [row for row in reports if row["table"] == table]
        files = [AddedFile(row["path"], row["n_bytes"], row["n_rows"], {"date": row["date"]}) for row in own]
        if files and results[table].commit(files, application=application):
            done[table] = sum(file.n_rows for file in files), sum(row["seconds"] for row in own)
    return done


@contextmanager
def _watched(session: "SparkSession", n_tasks: int, report: Callable[[float], None]) -> Iterator[None]:
    """Report the share of tasks that are done."""
    group = uuid4().hex
    context = session.sparkContext
    context.setJobGroup(group, "windows of a fleet")
    ended = threading.Event()

    def watch() -> None:
        tracker = context.statusTracker()
        while not ended.wait(0.5):
            done = 0
            for job in tracker.getJobIdsForGroup(group):
                information = tracker.getJobInfo(job)
                for stage in information.stageIds if information else ():
                    facts = tracker.getStageInfo(stage)
                    done = max(done, facts.numCompletedTasks if facts and facts.numTasks == n_tasks else 0)
            report(done / n_tasks)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


@dataclass(frozen=True, slots=True)
class Summary:
    """Numbers of windows and vehicles by result.

    Parameters
    ----------
    windows, failed
        Number of windows with a row, and of those that state a reason in place of a result, by table.
    reasons
        Commonest reasons with their numbers of windows.
    verdicts
        Number of vehicles by verdict.
    n_discoveries
        Number of vehicles that have changed, at the rate of false discoveries.
    findings
        Findings of these vehicles, those with the greatest evidence first.
    """

    windows: dict[str, int]
    failed: dict[str, int]
    reasons: list[tuple[str, int]]
    verdicts: dict[str, int]
    n_discoveries: int
    findings: list[dict[str, Any]]


def summarise(session: "SparkSession", results: Results) -> Summary:
    """Return numbers of windows and vehicles by result, and the vehicles that have changed.

    Examples
    --------
    >>> from sprung.fleet.jobs import Results, spark_session
    >>> summary = summarise(spark_session("local[2]"), Results("results"))  # doctest: +SKIP
    >>> summary.verdicts, summary.n_discoveries  # doctest: +SKIP
    ({'no_change_detected': 11, 'change': 1}, 1)
    """
    from pyspark.sql import functions as f

    windows, failed = {}, {}
    reasons: dict[str, int] = {}
    for name in OF_STEP.values():
        windows[name] = sum(file.n_rows for file in results[name].files())
        rows = read(session, results[name]).where(f.col("reason") != "")
        counts = rows.groupBy("reason").count().orderBy(f.desc("count"), "reason").limit(_MAX_REASONS).collect()
        failed[name] = rows.count() if counts else 0
        for row in counts:
            reasons[row["reason"]] = max(row["count"], reasons.get(row["reason"], 0))
    diagnoses = read(session, results["diagnoses"])
    verdicts = {row["verdict"]: row["count"] for row in diagnoses.groupBy("verdict").count().collect()}
    found = diagnoses.where("is_discovery")
    worst = found.select("vehicle", "e_value").orderBy(f.desc("e_value"), "vehicle").limit(_MAX_VEHICLES)
    findings = read(session, results["findings"]).join(worst, "vehicle").orderBy(f.desc("e_value"), "vehicle", "corner")
    common = sorted(reasons.items(), key=lambda item: (-item[1], item[0]))[:_MAX_REASONS]
    rows_found = [row.asDict() for row in findings.collect()]
    return Summary(windows, failed, common, verdicts, found.count(), rows_found)
