"""Assessments of all vehicles on Spark: baselines, types, diagnoses and discoveries from the windows with results."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from hashlib import blake2b
from typing import TYPE_CHECKING
from uuid import uuid4

import numpy as np
import pyarrow as pa

from sprung.fleet.assessment import (
    SCHEMA,
    AssessmentSettings,
    assessed_vehicles,
    discoveries,
    findings_of,
    learnt_types,
)
from sprung.fleet.files import filesystem, read, read_files, spark_schema, write, write_files
from sprung.fleet.results import KEY, SCHEMAS, Results

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Largest number of vehicles that the baseline of a type is learnt from.
_MOST_OF_TYPE = 50
#: Computes rows of a schema, once, and returns them.
Keep = Callable[["DataFrame", pa.Schema], "DataFrame"]


def assess_vehicles(
    session: "SparkSession",
    fleet: "DataFrame",
    results: Results,
    *,
    settings: AssessmentSettings,
    rate: float,
    report: Callable[[str, float], None] = lambda step, share: None,
) -> int:
    """Assess the vehicles whose windows have changed, replace the tables of vehicles, and return their number.

    Parameters
    ----------
    session
        Session of Spark.
    fleet
        Vehicles of the fleet, from `sprung.fleet.vehicles.vehicles_of`.
    results
        Tables of results.
    settings
        Settings of baselines and diagnoses.
    rate
        Expected share of sound vehicles among the discoveries.
    report
        Callback that receives the step and the share that is done.

    Notes
    -----
    What changed is found by a digest of the windows of each vehicle, so that it does not matter which run or stream
    analysed them, or where one was interrupted. The table of diagnoses has these digests and is replaced last.
    """
    from pyspark.sql import functions as f

    report("learning baselines", 0.0)
    windows = _current(session, fleet, results)
    states = _states(windows, settings).cache()
    try:
        known = read(session, results["diagnoses"]).select("vehicle", f.col("state").alias("known"))
        touched = states.join(known, "vehicle", "left").where(f.coalesce("known", f.lit("")) != f.col("state"))
        count = touched.count()
        if not count and not known.join(states, "vehicle", "left_anti").count():
            return 0
        with _kept_files(session, results) as keep:
            own = _needed(windows.join(touched.select("vehicle", "state"), "vehicle"), settings)
            assessed = keep(_assessed(own.withColumn("type_baseline", f.lit("")), settings), SCHEMA)
            every = _kept(session, results, states, touched).unionByName(assessed)
            types = keep(_types(windows, every, settings), SCHEMAS["types"])
            report("comparing vehicles with their type", 0.0)
            every = keep(_with_types(windows, states, every, types, settings), SCHEMA)
            report("writing baselines and diagnoses", 0.0)
            _replace(results, every, states, types, found=_discoveries(every, rate))
        return count
    finally:
        states.unpersist()


def _current(session: "SparkSession", fleet: "DataFrame", results: Results) -> "DataFrame":
    """Return the rows of windows that are of the present vehicle files, once each."""
    from pyspark.sql import functions as f

    columns = (*KEY, "duration", "reason", "is_sound", "document", "residuals")
    # By vehicle first, so that what follows finds the rows where they are and they move once.
    rows = read(session, results["windows"]).select(*columns).repartition("vehicle").dropDuplicates(list(KEY))
    present = fleet.select("vehicle", f.col("vehicle_file").alias("present"), "vehicle_text", "type", "type_name")
    joined = rows.join(present, "vehicle", "left").where(f.coalesce("present", f.lit("")) == f.col("vehicle_file"))
    blank = {name: f.coalesce(name, f.lit("")) for name in ("vehicle_text", "type", "type_name", "document")}
    return joined.drop("present").withColumns(blank)


def _states(windows: "DataFrame", settings: AssessmentSettings) -> "DataFrame":
    """Return the numbers of windows of each vehicle, and a digest of all that its assessment depends on."""
    from pyspark.sql import functions as f

    of_settings = blake2b(repr(sorted(asdict(settings).items())).encode(), digest_size=6).hexdigest()
    of_windows = f.bit_xor(f.xxhash64("start", "digest", "vehicle_file"))
    state = f.concat_ws("-", f.lit(of_settings), f.count(f.lit(1)).cast("string"), f.hex(of_windows))
    return windows.groupBy("vehicle").agg(
        state.alias("state"), f.count(f.lit(1)).alias("n_windows"), f.count_if("is_sound").alias("n_sound")
    )


def _needed(windows: "DataFrame", settings: AssessmentSettings) -> "DataFrame":
    """Return the windows that an assessment needs: the first sound ones, and the last ones."""
    from pyspark.sql import Window
    from pyspark.sql import functions as f

    forward = Window.partitionBy("vehicle").orderBy("start", "digest").rowsBetween(Window.unboundedPreceding, 0)
    backward = Window.partitionBy("vehicle").orderBy(f.desc("start"), f.desc("digest"))
    # Windows that overlap others do not count: enough remain of twice or three times as many.
    first = f.col("is_sound") & (f.count_if("is_sound").over(forward) <= 3 * settings.learning_windows)
    last = f.row_number().over(backward) <= 2 * settings.most_windows
    return windows.withColumn("is_needed", first | last).where("is_needed").drop("is_needed")


def _assessed(windows: "DataFrame", settings: AssessmentSettings) -> "DataFrame":
    """Return the assessments of vehicles."""
    assess = partial(assessed_vehicles, settings=settings)
    return windows.groupBy("vehicle").applyInArrow(_of_one_argument(assess), spark_schema(SCHEMA))


def _kept(session: "SparkSession", results: Results, states: "DataFrame", touched: "DataFrame") -> "DataFrame":
    """Return the assessments of vehicles whose windows have not changed."""
    from pyspark.sql import functions as f

    rest = states.join(touched, "vehicle", "left_anti").select("vehicle")
    of_baseline = (f.col("n_windows").alias("n_learnt"), f.col("until").alias("learnt_until"))
    baselines = read(session, results["baselines"]).select("vehicle", *of_baseline, f.col("document").alias("baseline"))
    diagnoses = read(session, results["diagnoses"]).join(rest, "vehicle")
    return diagnoses.join(baselines, "vehicle", "left").select(*SCHEMA.names)


def _types(windows: "DataFrame", every: "DataFrame", settings: AssessmentSettings) -> "DataFrame":
    """Return the baselines of types, each learnt from a limited number of its vehicles."""
    from pyspark.sql import Window
    from pyspark.sql import functions as f

    order = Window.partitionBy("type").orderBy(f.xxhash64("vehicle"), "vehicle")
    with_baseline = every.where("baseline IS NOT NULL").select("vehicle", "type", "learnt_until")
    sample = with_baseline.withColumn("rank", f.row_number().over(order)).where(f.col("rank") <= _MOST_OF_TYPE)
    learning = windows.join(sample.select("vehicle", "learnt_until"), "vehicle").where("start <= learnt_until")
    learn = partial(learnt_types, settings=settings)
    of_types = learning.drop("learnt_until").groupBy("type")
    return of_types.applyInArrow(_of_one_argument(learn), spark_schema(SCHEMAS["types"]))


def _with_types(
    windows: "DataFrame",
    states: "DataFrame",
    every: "DataFrame",
    types: "DataFrame",
    settings: AssessmentSettings,
) -> "DataFrame":
    """Return the assessments of all vehicles, those without a baseline compared with their type."""
    from pyspark.sql import functions as f

    documents = types.select("type", f.col("document").alias("type_baseline"))
    alone = every.where("baseline IS NULL").select("vehicle", "type").join(documents, "type").drop("type")
    again = windows.join(alone, "vehicle").join(states.select("vehicle", "state"), "vehicle")
    compared = _assessed(_needed(again, settings), settings)
    return every.join(alone, "vehicle", "left_anti").unionByName(compared)


def _discoveries(every: "DataFrame", rate: float) -> "DataFrame":
    """Return the vehicles that have changed at a rate of false discoveries."""
    from pyspark.sql import functions as f

    n_vehicles = every.where("e_value IS NOT NULL").count()
    candidates = every.where(f.col("e_value") >= -float(np.log(rate))).select("vehicle", "e_value")
    find = partial(discoveries, rate=rate, n_vehicles=n_vehicles)
    # The tail of the fleet alone: vehicles whose e-value could be among the discoveries at all.
    return candidates.withColumn("all", f.lit("")).groupBy("all").applyInArrow(_of_one_argument(find), "vehicle string")


def _replace(
    results: Results, every: "DataFrame", states: "DataFrame", types: "DataFrame", *, found: "DataFrame"
) -> None:
    """Replace the tables of vehicles; that which says what is done comes last."""
    from pyspark.sql import functions as f

    is_found = found.withColumn("is_discovery", f.lit(True))
    whole = every.join(states.select("vehicle", "n_windows", "n_sound"), "vehicle").join(is_found, "vehicle", "left")
    diagnoses = whole.withColumn("is_discovery", f.coalesce("is_discovery", f.lit(False)))
    baselines = every.where("baseline IS NOT NULL").select(
        *("vehicle", "type", "vehicle_file"),
        f.col("n_learnt").alias("n_windows"),
        f.col("learnt_until").alias("until"),
        f.col("baseline").alias("document"),
    )
    names = SCHEMAS["diagnoses"].names
    findings = diagnoses.select(*names).mapInArrow(findings_of, spark_schema(SCHEMAS["findings"]))
    n_vehicles = every.count()
    tables = {"types": types, "baselines": baselines, "findings": findings, "diagnoses": diagnoses}
    for name, frame in tables.items():
        results[name].commit(write(frame, results[name], n_rows=n_vehicles), replaces=True)


@contextmanager
def _kept_files(session: "SparkSession", results: Results) -> Iterator[Keep]:
    """Yield what computes a data frame once and keeps its rows in files, which no lost machine takes with it."""
    place = f"{results.location}/passing-{uuid4().hex}"

    def keep(frame: "DataFrame", schema: pa.Schema) -> "DataFrame":
        folder = f"{place}/{uuid4().hex}"
        return read_files(session, schema, [f"{folder}/{file.path}" for file in write_files(frame, folder, schema)])

    try:
        yield keep
    finally:
        system, folder = filesystem(place)
        if system.get_file_info(folder).type.name == "Directory":
            system.delete_dir(folder)


def _of_one_argument(function: Callable[..., pa.Table]) -> Callable[[pa.Table], pa.Table]:
    """Return a function of one argument without defaults, by which Spark knows what it takes."""

    def of_group(group: pa.Table) -> pa.Table:
        return function(group)

    return of_group
