"""The commands `sprung fleet run` and `sprung fleet explain`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sprung.cli.checks import check_file, names
from sprung.cli.options import INPUT, AllowMissing, Json, Since, Until, option
from sprung.cli.output import show, write_result, written
from sprung.cli.progress import progress_bar

if TYPE_CHECKING:
    from sprung.fleet.jobs import FleetSettings

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
Steps = Annotated[
    str,
    option(
        "A,B,..",
        "What to do: identify (modes), corners (springs, dampers and tyres of each window), baseline, diagnose.",
        "--steps",
    ),
]
Master = Annotated[
    str,
    option(
        "MASTER",
        "local[N] for N cores of this machine, spark://HOST:PORT, or empty under spark-submit.",
        "--master",
        panel=SPARK,
    ),
]
Learn = Annotated[
    int, option("N", "Number of sound windows from which a baseline is learnt.", "--learn", min=2, panel=INPUT)
]
_ALL = "identify,corners,baseline,diagnose"


def run(
    lake: LakePlace,
    *,
    vehicles: Vehicles,
    out: Out,
    steps: Steps = _ALL,
    since: Since = None,
    until: Until = None,
    learn: Learn = 12,
    method: Annotated[
        Literal["cov", "acs", "coss", "plscf", "fdd"],
        typer.Option(help="Method of identification.", rich_help_panel=INPUT),
    ] = "cov",
    allow_missing: AllowMissing = False,
    false_alarms: Annotated[float, option("RATE", "False alarms per vehicle and day of driving.", panel=INPUT)] = 1e-3,
    false_discoveries: Annotated[
        float, option("SHARE", "Expected share of sound vehicles among those reported as changed.", panel=INPUT)
    ] = 0.05,
    hours_per_day: Annotated[float, option("H", "Hours of driving per day.", panel=INPUT)] = 8.0,
    minutes: Annotated[float, option("MINUTES", "Length of the windows in the lake.", "--window", panel=INPUT)] = 10.0,
    master: Master = "local[*]",
    json: Json = None,
) -> None:
    """Analyse the windows of a fleet that have no results yet, and test the vehicles for changes."""
    from sprung.fleet import jobs
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import fleet_run_document

    check_file("--json", json)
    chosen = run_settings(
        steps=steps,
        since=since,
        until=until,
        learn=learn,
        method=method,
        allow_missing=allow_missing,
        false_alarms=false_alarms,
        false_discoveries=false_discoveries,
        windows_per_day=hours_per_day * 60 / minutes,
    )
    results = jobs.Results(out)
    with progress_bar() as report:
        report("starting Spark", 0.0)
        session = jobs.spark_session(master)
        try:
            done = jobs.run(session, Lake(lake), vehicles, results, settings=chosen, report=report)
            report("counting the results", 0.0)
            summary = jobs.summarise(session, results)
        finally:
            session.stop()
    document = fleet_run_document(
        counts={
            "results": out,
            "steps": chosen.steps,
            "analysed": done.n_windows,
            "vehicles_assessed": done.n_vehicles,
            "seconds": done.elapsed,
            "windows": summary.windows,
            "without_result": summary.failed,
            "verdicts": summary.verdicts,
            "discoveries": summary.n_discoveries,
        },
        reasons=summary.reasons,
        findings=summary.findings,
    )
    if write_result(document, json):
        plain = document.as_json()
        show(*tables.fleet_run_tables(plain), [*tables.fleet_run_in_words(plain), *written([Path(out)], json)])


def explain(
    lake: LakePlace,
    *,
    vehicles: Vehicles,
    out: Out,
    steps: Steps = _ALL,
    since: Since = None,
    until: Until = None,
    learn: Learn = 12,
    allow_missing: AllowMissing = False,
    master: Master = "local[*]",
    json: Json = None,
) -> None:
    """Show what sprung fleet run would do, and estimate its cost."""
    from sprung.fleet import jobs
    from sprung.fleet.lake import Lake
    from sprung.results import tables
    from sprung.results.documents import fleet_plan_document

    check_file("--json", json)
    chosen = run_settings(steps=steps, since=since, until=until, learn=learn, allow_missing=allow_missing)
    with progress_bar() as report:
        report("starting Spark", 0.0)
        session = jobs.spark_session(master)
        try:
            report("comparing lake and results", 0.0)
            plan, cost = jobs.explain(session, Lake(lake), vehicles, jobs.Results(out), settings=chosen)
            cores = session.sparkContext.defaultParallelism
        finally:
            session.stop()
    document = fleet_plan_document(
        {
            "windows": plan.n_windows,
            "new": plan.n_new,
            "vehicles": plan.n_vehicles,
            "without_vehicle_file": plan.n_without_file,
            "seconds_per_window": cost.seconds,
            "measured_on": cost.source,
            "core_hours": cost.of(plan.n_new) / 3600,
            "cores": cores,
        }
    )
    if write_result(document, json):
        plain = document.as_json()
        show(tables.fleet_plan_table(plain), [*tables.fleet_plan_in_words(plain), *written([], json)])


def run_settings(
    *,
    steps: str,
    since: str | None,
    until: str | None,
    learn: int,
    allow_missing: bool,
    method: str = "cov",
    false_alarms: float = 1e-3,
    false_discoveries: float = 0.05,
    windows_per_day: float = 48.0,
) -> "FleetSettings":
    """Return the settings that the options give."""
    from sprung.fleet.jobs import FleetSettings
    from sprung.fleet.jobs.analysis import WindowSettings
    from sprung.fleet.jobs.assessment import AssessmentSettings
    from sprung.results.periods import parse_period

    period = parse_period(since, until)
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
