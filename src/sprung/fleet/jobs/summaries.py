"""What the tables of results hold, in numbers that do not grow with the fleet, and what a run will cost."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sprung.fleet.jobs.analysis import WindowSettings, Work, analyse
from sprung.fleet.jobs.files import read
from sprung.fleet.jobs.plan import Planner
from sprung.fleet.jobs.results import OF_STEP, Results
from sprung.fleet.jobs.tasks import rows_of

if TYPE_CHECKING:
    from pyspark.sql import SparkSession


#: Largest number of reasons in a summary.
_MAX_REASONS = 8
#: Largest number of vehicles in a summary.
_MAX_VEHICLES = 20
#: Number of windows that are analysed to estimate a cost.
_MEASURED = 3


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


def measured_cost(planner: Planner, results: Results, steps: Sequence[str], settings: WindowSettings) -> Cost:
    """Return the cost of a window: that of the last run, or of a few windows that are analysed for this.

    Parameters
    ----------
    planner
        Finds the windows without results.
    results
        Tables of results.
    steps
        Steps that each window goes through, keys of `OF_STEP`.
    settings
        Settings of the analysis.
    """
    runs = results["runs"].rows().to_pylist()
    of_tables = {table: f"{table}_seconds" for table in OF_STEP.values()}
    for row in sorted(runs, key=lambda row: -row["finished"]):
        known = {step: row[of_tables[OF_STEP[step]]] / max(1, row["n_windows"]) for step in steps}
        if row["n_windows"] and all(known.values()):
            return Cost(known, f"{row['n_windows']} windows of the run {row['run']}")
    files = next(iter(planner.chunks()), [])
    items = [item.asDict() for item in planner.work(files).limit(_MEASURED).collect()]
    seconds = dict.fromkeys(steps, 0.0)
    count = 0
    for item, row in rows_of(items):
        if row is not None and not item["reason"]:
            count += 1
            for step in seconds:
                begin = time.process_time()
                analyse(row, Work(item["vehicle_text"], steps=(step,)), settings)
                seconds[step] += time.process_time() - begin
    return Cost({step: spent / max(1, count) for step, spent in seconds.items()}, f"{count} windows analysed for this")
