"""Assessments of all vehicles on Spark: baselines, types, diagnoses and discoveries from the windows with results."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from hashlib import blake2b
from typing import Any
from uuid import uuid4

import numpy as np
import pyarrow as pa
from pyspark.sql import Column, DataFrame, SparkSession, Window
from pyspark.sql import functions as f

from sprung.diagnosis.type_baselines import MIN_VEHICLES
from sprung.fleet.jobs.assessment import (
    COMPARED,
    LEARNT,
    OUTLINE,
    SCATTER,
    SCHEMA,
    WEIGHTS,
    AssessmentSettings,
    Compared,
    Outline,
    WindowRow,
    assess,
    common_scatter,
    discoveries,
    findings_of,
    learnt,
    outline,
    type_of,
    weights_of,
)
from sprung.fleet.jobs.results import KEY, SCHEMAS, Results
from sprung.fleet.jobs.spark import filesystem, read, read_files, spark_schema, write, write_files

#: Largest number of vehicles that the baseline of a type is learnt from.
_MOST_OF_TYPE = 50
_TEXT = pa.string()
#: Vehicles, and the start of the first or last of their windows that is needed, UTC ns.
_BOUNDS = pa.schema([("vehicle", _TEXT), ("vehicle_file", _TEXT), ("type", _TEXT), ("bound", pa.int64())])
_FOUND = pa.schema([("vehicle", _TEXT)])
#: Computes rows of a schema, once, and returns them.
Keep = Callable[[DataFrame, pa.Schema], DataFrame]


def assess_vehicles(
    session: SparkSession,
    fleet: DataFrame,
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
        Vehicles of the fleet, from `sprung.fleet.jobs.plan.vehicles_of`.
    results
        Tables of results.
    settings
        Settings of baselines and diagnoses.
    rate
        Expected share of healthy vehicles among the discoveries.
    report
        Callback that receives the step and the share that is done.

    Notes
    -----
    What changed is found by a digest of the windows of each vehicle, so that it does not matter which run or stream
    analysed them, or where one was interrupted. The table of diagnoses has these digests and is replaced last.
    Of most windows the keys alone are read: a baseline is learnt once, and again where its windows are others; a
    diagnosis takes the last windows.
    """

    report("learning baselines", 0.0)
    with _kept_files(session, results) as keep:
        step = _Assessor(session, fleet, results, settings, keep)
        states = step.states().cache()
        try:
            touched = step.touched(states)
            count = touched.count()
            if not count and not step.known("diagnoses", "vehicle").join(states, "vehicle", "left_anti").count():
                return 0
            outlines = keep(step.outlines(states, touched), OUTLINE)
            learnt = keep(step.learnt(outlines), LEARNT)
            baselines = keep(step.baselines(states, outlines, learnt), SCHEMAS["baselines"])
            types = keep(step.types(baselines), SCHEMAS["types"])
            report("diagnosing", 0.0)
            scatter = keep(step.scatter(baselines), SCATTER)
            outlines = keep(outlines.unionByName(step.others(states, outlines, scatter)), OUTLINE)
            compared = keep(
                step.compared(outlines, learnt, baselines, types=types, scatter=scatter, touched=touched), COMPARED
            )
            every = keep(step.kept(states, compared).unionByName(step.assessed(compared)), SCHEMA)
            report("writing baselines and diagnoses", 0.0)
            found = keep(_discoveries(every, rate), _FOUND)
            _replace(results, every, baselines, types, found)
            return count
        finally:
            states.unpersist()


@dataclass(frozen=True, slots=True)
class _Assessor:
    """Steps of an assessment.

    Parameters
    ----------
    session, fleet, results, settings
        As for `assess_vehicles`.
    keep
        Computes a data frame once.
    """

    session: SparkSession
    fleet: DataFrame
    results: Results
    settings: AssessmentSettings
    keep: Keep

    def known(self, table: str, *columns: str | Column) -> DataFrame:
        """Return columns of a table of results."""
        return read(self.session, self.results[table]).select(*columns)

    def keys(self) -> DataFrame:
        """Return what is known of each window of the present vehicle files without its results, once each."""
        # A window without a result has no conditions; the documents, which are large, are left unread.
        has_result = f.col("conditions").isNotNull().alias("has_result")
        rows = self.known("windows", *KEY, "duration", "reason", "is_valid", has_result)
        # By vehicle first, so that what follows finds the rows where they are and they move once.
        once = rows.repartition("vehicle").dropDuplicates(list(KEY))
        present = self.fleet.select("vehicle", f.col("vehicle_file").alias("present"))
        joined = once.join(present, "vehicle", "left").where(f.coalesce("present", f.lit("")) == f.col("vehicle_file"))
        return joined.drop("present")

    def states(self) -> DataFrame:
        """Return a digest of all that the assessment of each vehicle depends on but its type."""
        of_settings = blake2b(repr(sorted(asdict(self.settings).items())).encode(), digest_size=6).hexdigest()
        of_windows = f.bit_xor(f.xxhash64("start", "digest", "vehicle_file"))
        state = f.concat_ws("-", f.lit(of_settings), f.count(f.lit(1)).cast("string"), f.hex(of_windows))
        return self.keys().groupBy("vehicle").agg(state.alias("state"))

    def touched(self, states: DataFrame) -> DataFrame:
        """Return the vehicles whose windows, or whose settings, are others than before."""
        before = self.known("diagnoses", "vehicle", f.col("state").alias("before"))
        changed = states.join(before, "vehicle", "left").where(f.coalesce("before", f.lit("")) != f.col("state"))
        return changed.select("vehicle")

    def outlines(self, states: DataFrame, touched: DataFrame) -> DataFrame:
        """Return outlines of the touched vehicles, and of those without a baseline, whose type may change."""
        settled = self.known("baselines", "vehicle").join(touched, "vehicle", "left_anti")
        return self._outlined(states.join(settled, "vehicle", "left_anti"))

    def others(self, states: DataFrame, outlines: DataFrame, scatter: DataFrame) -> DataFrame:
        """Return outlines of the other vehicles where the baselines of their type show another scatter than before."""
        before = self.known("diagnoses", "vehicle", "type", f.col("type_state").alias("before"))
        changed = before.join(scatter, "type").where(f.coalesce("before", f.lit("")) != f.col("scatter_state"))
        others = changed.select("vehicle").join(outlines, "vehicle", "left_anti")
        return self._outlined(states.join(others, "vehicle", "left_semi"))

    def _outlined(self, states: DataFrame) -> DataFrame:
        """Return outlines of vehicles."""
        open_ones = states.select("vehicle", "state")
        texts = ("type", "type_name", "vehicle_file", "vehicle_text")
        named = open_ones.join(self.fleet, "vehicle", "left")
        vehicles = named.select("vehicle", "state", *(f.coalesce(name, f.lit("")).alias(name) for name in texts))
        return self._per("vehicle", vehicles, self.keys().drop("vehicle_file"), OUTLINE, of=dict, function=outline)

    def learnt(self, outlines: DataFrame) -> DataFrame:
        """Return the baselines of vehicles whose first valid windows are new, or others than before."""
        before = self.known("baselines", "vehicle", f.col("state").alias("learning"))
        fresh = outlines.where("learning != ''").join(before, ["vehicle", "learning"], "left_anti")
        rows = self._rows(fresh, until="learn_until")
        return self._per("vehicle", fresh, rows, LEARNT, of=Outline, function=learnt)

    def baselines(self, states: DataFrame, outlines: DataFrame, learnt: DataFrame) -> DataFrame:
        """Return the baselines of all vehicles: those just learnt, and those whose windows are as before."""
        names = SCHEMAS["baselines"].names
        before = self.known("baselines", *names)
        others = states.join(outlines, "vehicle", "left_anti").select("vehicle")
        same = outlines.select("vehicle", f.col("learning").alias("state"))
        kept = before.join(others, "vehicle", "left_semi").unionByName(
            before.join(same, ["vehicle", "state"], "left_semi")
        )
        return kept.unionByName(learnt.where("document != ''").select(*names))

    def types(self, baselines: DataFrame) -> DataFrame:
        """Return the baselines of types, each learnt from a limited number of its vehicles where these have changed."""
        schema = SCHEMAS["types"]
        order = Window.partitionBy("type").orderBy(f.xxhash64("vehicle"), "vehicle")
        ranked = baselines.withColumn("rank", f.row_number().over(order)).where(f.col("rank") <= _MOST_OF_TYPE)
        names = self.fleet.select("vehicle", "type_name")
        sample = ranked.select("vehicle", "type", "vehicle_file", "until", "state").join(names, "vehicle")
        digest = f.hex(f.bit_xor(f.xxhash64("vehicle", "state")))
        kinds = sample.groupBy("type").agg(
            f.min("type_name").alias("name"), digest.alias("state"), f.count(f.lit(1)).alias("count")
        )
        before = self.known("types", *schema.names)
        enough = kinds.where(f.col("count") >= MIN_VEHICLES)
        fresh = enough.join(before.select("type", "state"), ["type", "state"], "left_anti")
        rows = self._rows(sample.join(fresh.select("type"), "type"), until="until")
        learnt = self._per("type", fresh, rows, schema, of=dict, function=type_of)
        return before.join(kinds.select("type", "state"), ["type", "state"], "left_semi").unionByName(learnt)

    def scatter(self, baselines: DataFrame) -> DataFrame:
        """Return what the baselines of each type show together of the scatter of parts."""
        own = baselines.select("vehicle", "type", "document").mapInArrow(weights_of, spark_schema(WEIGHTS))
        return own.groupBy("type").applyInArrow(common_scatter, spark_schema(SCATTER))

    def compared(
        self,
        outlines: DataFrame,
        learnt: DataFrame,
        baselines: DataFrame,
        *,
        types: DataFrame,
        scatter: DataFrame,
        touched: DataFrame,
    ) -> DataFrame:
        """Return the vehicles whose windows, or what they are compared with of their type, are others than before."""

        def or_empty(name: str) -> Column:
            return f.coalesce(name, f.lit(""))

        own = baselines.select("vehicle", f.col("document").alias("baseline"))
        of_type = types.select(
            f.col("type").alias("alone"), f.col("document").alias("type_baseline"), f.col("state").alias("alone_state")
        )
        failed = learnt.select("vehicle", f.col("reason").alias("no_baseline"))
        before = self.known("diagnoses", "vehicle", f.col("type_state").alias("type_before"))
        new = touched.select("vehicle", f.lit(True).alias("is_touched"))
        joined = outlines
        # Baselines are large, and one for each vehicle: they move between tasks, and not through the driver.
        for other in (failed, before, new, own.hint("merge")):
            joined = joined.join(other, "vehicle", "left")
        is_alone = f.col("baseline").isNull()
        whole = (
            joined.withColumn("alone", f.when(is_alone, f.col("type")))
            .join(of_type, "alone", "left")
            .join(scatter.withColumnRenamed("type", "known"), [~is_alone, f.col("type") == f.col("known")], "left")
            .withColumns(
                {
                    "type_state": f.when(is_alone, f.col("alone_state")).otherwise(f.col("scatter_state")),
                    "since": f.when(is_alone, f.col("since_alone")).otherwise(f.col("since")),
                    **{name: or_empty(name) for name in ("baseline", "no_baseline", "type_baseline")},
                }
            )
            .withColumn("type_state", or_empty("type_state"))
        )
        is_of_other_type = or_empty("type_before") != f.col("type_state")
        return whole.where(f.col("is_touched").isNotNull() | is_of_other_type).select(*COMPARED.names)

    def assessed(self, compared: DataFrame) -> DataFrame:
        """Return the assessments of vehicles."""
        return self._per("vehicle", compared, self._rows(compared, since="since"), SCHEMA, of=Compared, function=assess)

    def kept(self, states: DataFrame, compared: DataFrame) -> DataFrame:
        """Return the assessments of all other vehicles."""
        others = states.select("vehicle").join(compared, "vehicle", "left_anti")
        return self.known("diagnoses", *SCHEMA.names).join(others, "vehicle", "left_semi")

    def _rows(self, vehicles: DataFrame, *, since: str = "", until: str = "") -> DataFrame:
        """Return the windows of vehicles from or up to a time of each; the others are left out before these move."""
        bound = f.col(since or until).alias("bound")
        # Files of known size: a table of bounds that is small enough goes to the windows, and not these to it.
        bounds = self.keep(vehicles.select(*_BOUNDS.names[:-1], bound).where("bound IS NOT NULL"), _BOUNDS)
        windows = self.known("windows", *KEY, "duration", "is_valid", "document", "residuals")
        is_needed = f.col("start") >= f.col("bound") if since else f.col("start") <= f.col("bound")
        needed = windows.join(bounds, ["vehicle", "vehicle_file"]).where(is_needed)
        return needed.drop("bound")

    def _per(
        self,
        key: str,
        vehicles: DataFrame,
        rows: DataFrame,
        schema: pa.Schema,
        *,
        of: Callable[..., Any],
        function: Callable[..., Any],
    ) -> DataFrame:
        """Return what a function makes of each vehicle, or type, and its windows; `of` makes its first argument."""
        settings = self.settings

        def of_groups(one: pa.Table, other: pa.Table) -> pa.Table:
            windows = [WindowRow.of(row) for row in other.to_pylist()]
            found = [function(of(**vehicle), windows, settings) for vehicle in one.to_pylist()]
            plain = [asdict(row) if isinstance(row, Outline) else row for row in found if row is not None]
            return pa.Table.from_pylist(plain, schema=schema)

        return vehicles.groupBy(key).cogroup(rows.groupBy(key)).applyInArrow(of_groups, spark_schema(schema))


def _discoveries(every: DataFrame, rate: float) -> DataFrame:
    """Return the vehicles that have changed at a rate of false discoveries."""
    n_vehicles = every.where("e_value IS NOT NULL").count()
    candidates = every.where(f.col("e_value") >= -float(np.log(rate))).select("vehicle", "e_value")

    def find(group: pa.Table) -> pa.Table:
        return discoveries(group, rate=rate, n_vehicles=n_vehicles)

    # The tail of the fleet alone: vehicles whose e-value could be among the discoveries at all.
    return candidates.withColumn("all", f.lit("")).groupBy("all").applyInArrow(find, "vehicle string")


def _replace(results: Results, every: DataFrame, baselines: DataFrame, types: DataFrame, found: DataFrame) -> None:
    """Replace the tables of vehicles; that which says what is done comes last."""
    is_found = found.withColumn("is_discovery", f.lit(True))
    whole = every.join(is_found, "vehicle", "left")
    diagnoses = whole.withColumn("is_discovery", f.coalesce("is_discovery", f.lit(False)))
    names = SCHEMAS["diagnoses"].names
    findings = diagnoses.select(*names).mapInArrow(findings_of, spark_schema(SCHEMAS["findings"]))
    n_vehicles = every.count()
    tables = {"types": types, "baselines": baselines, "findings": findings, "diagnoses": diagnoses}
    for name, frame in tables.items():
        results[name].commit(write(frame, results[name], n_rows=n_vehicles), replaces=True)


@contextmanager
def _kept_files(session: SparkSession, results: Results) -> Iterator[Keep]:
    """Yield what computes a data frame once and keeps its rows in files, which no lost machine takes with it."""
    place = f"{results.location}/passing-{uuid4().hex}"

    def keep(frame: DataFrame, schema: pa.Schema) -> DataFrame:
        folder = f"{place}/{uuid4().hex}"
        return read_files(session, schema, [f"{folder}/{file.path}" for file in write_files(frame, folder, schema)])

    try:
        yield keep
    finally:
        system, folder = filesystem(place)
        if system.get_file_info(folder).type.name == "Directory":
            system.delete_dir(folder)
