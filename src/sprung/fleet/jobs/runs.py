"""Runs over the archive of a fleet: every window analysed once, then baselines, types, diagnoses and discoveries."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

import pyarrow as pa

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.fleet.jobs.analysis import WindowSettings
from sprung.fleet.jobs.assessing import assess_vehicles
from sprung.fleet.jobs.assessment import AssessmentSettings
from sprung.fleet.jobs.plan import CHUNK, Plan, Planner
from sprung.fleet.jobs.results import OF_STEP, SCHEMAS, Results
from sprung.fleet.jobs.summaries import Cost, measured_cost
from sprung.fleet.jobs.tasks import REPORT_COLUMNS, Task
from sprung.fleet.jobs.vehicles import vehicles_of
from sprung.fleet.lake import AddedFile, Lake

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Steps of a run, in their order.
STEPS = ("identify", "corners", "baseline", "diagnose")
#: Number of windows in a task: a few dozen seconds of work, which is what a lost worker costs.
WINDOWS_IN_TASK = 16
#: Receives the step and the share of it that is done (0 to 1).
Report = Callable[[str, float], None]


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
        Expected share of sound vehicles among those said to have changed, above 0 and up to 1.
    since, until
        Period of the windows to analyse, UTC ns, its ends included; None: open. Diagnoses are of all windows with
        results.
    windows_in_task, windows_in_commit
        Number of windows that a task analyses, and that are committed together.

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
    windows_in_task: int = WINDOWS_IN_TASK
    windows_in_commit: int = CHUNK

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
    seconds
        Time of the analysis of all windows together, by table of results [s].
    elapsed
        Time from start to end [s].
    """

    run: str
    n_windows: dict[str, int]
    n_vehicles: int
    seconds: dict[str, float]
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
        Vehicle files, as for `sprung.fleet.jobs.vehicles.vehicles_of`.
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
        planner = _planner(session, lake, results, fleet, chosen)
        n_windows: dict[str, int] = {}
        seconds: dict[str, float] = {}
        chunks = list(planner.chunks(chosen.windows_in_commit))
        for number, files in enumerate(chunks):
            share = partial(_part_of, report, f"analysing part {number + 1} of {len(chunks)}")
            for table, (rows, spent) in analyse_windows(session, planner.work(files), results, chosen, share).items():
                n_windows[table] = n_windows.get(table, 0) + rows
                seconds[table] = seconds.get(table, 0.0) + spent
        assessed = 0
        if "observe" in chosen.of_windows:
            assessed = assess_vehicles(
                session, fleet, results, settings=chosen.assessment, rate=chosen.false_discoveries, report=report
            )
    finally:
        fleet.unpersist()
    outcome = FleetRun(uuid4().hex[:12], n_windows, assessed, seconds, time.monotonic() - begin)
    if sum(n_windows.values()) or assessed:
        report("compacting the results", 0.0)
        results["runs"].append(_row_of(outcome))
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
        planner = _planner(session, lake, results, fleet, chosen)
        plan = planner.plan()
        return plan, measured_cost(planner, results, chosen.of_windows, chosen.windows)
    finally:
        fleet.unpersist()


def _planner(
    session: "SparkSession", lake: Lake, results: Results, fleet: "DataFrame", settings: FleetSettings
) -> Planner:
    """Return what finds the windows without results."""
    return Planner(
        session,
        lake,
        results,
        fleet,
        steps=settings.of_windows,
        learning_windows=settings.assessment.learning_windows,
        since=settings.since,
        until=settings.until,
    )


def analyse_windows(
    session: "SparkSession",
    work: "DataFrame",
    results: Results,
    settings: FleetSettings,
    report: Report,
    *,
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
        Callback that receives the share of the windows that is done.
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
        with _watched(session, n_tasks, report):
            reports = spread.mapInArrow(task.analysed, REPORT_COLUMNS).collect()
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
def _watched(session: "SparkSession", n_tasks: int, report: Report) -> Iterator[None]:
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
            report("", done / n_tasks)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


def _part_of(report: Report, step: str, _: str, share: float) -> None:
    """Report the share of a part."""
    report(step, share)


def _row_of(outcome: FleetRun) -> pa.Table:
    """Return a run as a row of the table of runs."""
    seconds = {f"{table}_seconds": outcome.seconds.get(table, 0.0) for table in OF_STEP.values()}
    row = {
        "run": outcome.run,
        "finished": time.time_ns(),
        "n_windows": max(outcome.n_windows.values(), default=0),
        "n_vehicles": outcome.n_vehicles,
        "seconds": outcome.elapsed,
        **seconds,
    }
    return pa.Table.from_pylist([row], schema=SCHEMAS["runs"])
