"""The analysis of the windows of a lake, in tasks: rows of what `sprung identify`, `corners` and `diagnose` find."""

import json
import multiprocessing
import signal
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from sprung.diagnosis import Observation, observe_window
from sprung.diagnosis.observation import fit_drive
from sprung.errors import SprungError
from sprung.fleet.jobs.results import OF_STEP, SCHEMAS
from sprung.fleet.jobs.spark import FILE_COLUMNS, described, filesystem, write_rows
from sprung.fleet.lake import recording_of
from sprung.identification import METHODS, IdentificationSettings
from sprung.results.documents import (
    Document,
    corners_document,
    identification_document,
    observation_document,
    stored_statistics,
)
from sprung.results.documents.document import plain
from sprung.vehicles import Vehicle, vehicle_from_text

#: Columns of the files that tasks report, with the processor time that their windows took.
REPORT_COLUMNS = pa.schema([("table", pa.string()), *FILE_COLUMNS, ("seconds", pa.float64())])
#: Number of rows after which a task writes a file.
_ROWS_IN_FILE = 256
#: Memory that a process of its own may take [bytes].
_MEMORY = 4 << 30
#: Number of the attempt at which a window that cannot be read is a row with its reason: a disk may fail for a moment.
_LAST_ATTEMPT = 3

#: Results of a window: rows by table, and seconds by table.
Analysed = tuple[dict[str, dict[str, Any]], dict[str, float]]


@dataclass(frozen=True, slots=True)
class WindowSettings:
    """Settings of the analysis of windows.

    Parameters
    ----------
    method
        Method of identification, a key of `sprung.identification.METHODS`.
    allow_missing
        Whether windows may lack sensors of the vehicle file.
    seconds
        Longest time that a step may take on a window [s].
    """

    method: str = "cov"
    allow_missing: bool = False
    seconds: float = 600.0


@dataclass(frozen=True, slots=True)
class Work:
    """What is to be done with a window.

    Parameters
    ----------
    vehicle_text
        Text of the vehicle file; empty where there is none.
    vehicle_file, reason
        Digest of that text, and why it cannot be used; both empty otherwise.
    steps
        Steps to take: keys of `OF_STEP`.
    has_segments
        Whether a baseline may be learnt from the window, which needs more of its statistics.
    """

    vehicle_text: str
    vehicle_file: str = ""
    reason: str = ""
    steps: Collection[str] = field(default_factory=lambda: tuple(OF_STEP))
    has_segments: bool = False

    @classmethod
    def of(cls, item: Mapping[str, Any]) -> "Work":
        """Return the work of a row of `sprung.fleet.jobs.plan.lacking`."""
        texts = {name: item[name] or "" for name in ("vehicle_text", "vehicle_file", "reason")}
        return cls(**texts, steps=tuple(item["steps"]), has_segments=bool(item["has_segments"]))


def analyse(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> Analysed:
    """Return the results of a window, by table.

    Parameters
    ----------
    row
        Row of a lake.
    work
        What is to be done with it.
    settings
        Settings of the analysis.

    Notes
    -----
    A window that cannot be analysed is a row with its reason, whatever the error is: one window never ends a run.
    """
    results: dict[str, dict[str, Any]] = {}
    seconds: dict[str, float] = {}
    for step in sorted(work.steps):
        begin = time.process_time()
        row_of_table = _row(row, work.vehicle_file, work.reason)
        if not work.reason:
            try:
                row_of_table |= _STEPS[step](row, work, settings)
            except SprungError as error:
                row_of_table["reason"] = str(error)
            except Exception as error:  # whatever a window makes of a step, the others go on
                row_of_table["reason"] = f"{type(error).__name__}: {error}"
        results[OF_STEP[step]] = row_of_table
        seconds[OF_STEP[step]] = time.process_time() - begin
    return results, seconds


def failed(row: Mapping[str, Any], work: Work, reason: str) -> dict[str, dict[str, Any]]:
    """Return the results of a window that could not be analysed, by table."""
    return {OF_STEP[step]: _row(row, work.vehicle_file, reason) for step in work.steps}


def _identify(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> dict[str, Any]:
    """Return the modes of a window, as `sprung identify` finds them."""
    chosen = IdentificationSettings(allow_missing=settings.allow_missing)
    vehicle = _vehicle(work.vehicle_text)
    identification = METHODS[settings.method](recording_of(row), settings=chosen, vehicle=vehicle)
    document = identification_document(identification, vehicle=vehicle)
    names = ("label", "natural_frequency", "natural_frequency_std", "damping_ratio", "damping_ratio_std")
    modes = document.as_json()["modes"]
    return {"modes": [{name: mode.get(name) for name in names} for mode in modes], "document": _text(document)}


def _corners(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> dict[str, Any]:
    """Return the springs, dampers and tyres in a window, as `sprung corners` estimates them."""
    fit = fit_drive(recording_of(row), _vehicle(work.vehicle_text), allow_missing=settings.allow_missing)
    document = corners_document(fit)
    names = ("value", "std", "relative_to_nominal", "is_identifiable")
    components = [
        {"corner": corner, "component": kind, **{name: part.get(name) for name in names}}
        for corner, parts in document.as_json()["corners"].items()
        for kind, part in parts.items()
    ]
    return {"components": components, "model_error": document.fit.model_error, "document": _text(document)}


def _observe(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> dict[str, Any]:
    """Return the observation of a window, as `sprung diagnose` makes it."""
    observation = observe_window(
        recording_of(row),
        _vehicle(work.vehicle_text),
        time=row["start"] / 1e9,
        allow_missing=settings.allow_missing,
    )
    return observed(observation, has_segments=work.has_segments)


def observed(observation: Observation, *, has_segments: bool) -> dict[str, Any]:
    """Return the columns of an observation in the table of windows."""
    residuals = observation.residuals
    if residuals is not None and not has_segments:
        residuals = residuals.without_segments()
    return {
        "reason": observation.reason,
        "is_valid": observation.is_conclusive and not observation.sensor_faults,
        "conditions": sorted((name, float(value)) for name, value in observation.conditions.items()),
        "sensor_faults": [{"channel": fault.channel, "kind": fault.kind} for fault in observation.sensor_faults],
        "document": json.dumps(observation_document(observation)),
        "residuals": stored_statistics(residuals),
    }


_STEPS: dict[str, Callable[[Mapping[str, Any], Work, WindowSettings], dict[str, Any]]] = {
    "identify": _identify,
    "corners": _corners,
    "observe": _observe,
}


def _row(row: Mapping[str, Any], vehicle_file: str, reason: str) -> dict[str, Any]:
    """Return the columns that the tables of windows have in common."""
    return {
        **{name: row[name] for name in ("date", "vehicle", "start", "digest", "duration")},
        "vehicle_file": vehicle_file,
        "reason": reason,
        "is_valid": False,
    }


@lru_cache(maxsize=64)
def _vehicle(text: str) -> Vehicle:
    """Return the vehicle of the text of its file."""
    return vehicle_from_text(text, source="the vehicle file")


def _text(document: Document) -> str:
    """Return a document as one line of JSON."""
    return json.dumps(plain(document.as_json()))


class Task(NamedTuple):
    """What the tasks of a run have in common.

    Parameters
    ----------
    locations
        Folders of the tables of results, by name.
    settings
        Settings of the analysis of a window.
    """

    locations: Mapping[str, str]
    settings: WindowSettings

    def analysed(self, batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        """Analyse windows, and yield the files of their results.

        Notes
        -----
        A task that is repeated analyses each window in a process of its own: a window that ends its process is then a
        row with its reason. Files of a task that did not end are in no table.
        """
        outcomes: list[Analysed] = []
        with closing(Analyst(is_apart=_attempt() > 0)) as analyst:
            for batch in batches:
                for item, row in rows_of(batch.to_pylist()):
                    outcomes.append(analyst(item, row, self.settings))
                    if len(outcomes) >= _ROWS_IN_FILE:
                        yield self._written(outcomes)
                        outcomes = []
        yield self._written(outcomes)

    def _written(self, outcomes: list[Analysed]) -> pa.RecordBatch:
        """Write results as one file for each table and date."""
        reports = []
        for table in OF_STEP.values():
            rows = sorted((rows[table] for rows, _ in outcomes if table in rows), key=lambda row: row["date"])
            seconds = sum(spent.get(table, 0.0) for _, spent in outcomes)
            for date, of_date in groupby(rows, key=lambda row: row["date"]):
                own = list(of_date)
                file = write_rows(
                    own, location=self.locations[table], schema=SCHEMAS[table], partition={"date": str(date)}
                )
                reports.append({"table": table, **described(file), "seconds": seconds * len(own) / len(rows)})
        return pa.RecordBatch.from_pylist(reports, schema=REPORT_COLUMNS)


def analyse_apart(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> Analysed:
    """Analyse a window with limited memory, in a process of its own."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
    return analyse(row, work, settings)


class Analyst:
    """Analyses windows in this process, or in another one."""

    def __init__(self, *, is_apart: bool) -> None:
        self._is_apart = is_apart
        self._pool: ProcessPoolExecutor | None = None

    def __call__(self, item: Mapping[str, Any], row: Mapping[str, Any] | None, settings: WindowSettings) -> Analysed:
        """Return the results of a window."""
        work = Work.of(item)
        if row is None:
            if _attempt() < _LAST_ATTEMPT:
                raise OSError(f"{item['path']} cannot be read")
            return failed(item, work, "the window cannot be read from the lake: import its file again"), {}
        limit = settings.seconds * len(work.steps)
        try:
            if self._is_apart:
                return self._apart(row, work, settings, limit)
            with _time_limit(limit):
                return analyse(row, work, settings)
        except _TooLongError:
            return failed(row, work, f"the analysis took longer than {limit:.0f} s"), {}
        except BrokenProcessPool:
            self.close()
            return failed(row, work, "the process that analysed the window ended unexpectedly"), {}

    def _apart(self, row: Mapping[str, Any], work: Work, settings: WindowSettings, limit: float) -> Analysed:
        """Analyse a window in another process."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))
        future = self._pool.submit(analyse_apart, dict(row), work, settings)
        try:
            return future.result(timeout=limit)
        except TimeoutError:
            for process in self.processes:
                process.kill()
            self.close()
            raise _TooLongError from None

    @property
    def processes(self) -> list[Any]:
        """Processes of the analysis, but this one."""
        return [] if self._pool is None else list((self._pool._processes or {}).values())

    def close(self) -> None:
        """End the other process."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None


class _TooLongError(BaseException):
    """The time for a window is over; not an Exception, which the analysis of a window may catch."""


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raise `_TooLongError` in the block after some time, in the main thread of a process."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def end(*_: object) -> None:
        raise _TooLongError

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _attempt() -> int:
    """Return how often the present task was tried before."""
    from pyspark import TaskContext

    context = TaskContext.get()
    return 0 if context is None else int(context.attemptNumber())


def rows_of(items: list[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], dict[str, Any] | None]]:
    """Yield windows with their rows in the lake, file by file; None where a file cannot be read.

    Windows of a stream of frames bring their rows with them.
    """
    if items and items[0].get("samples") is not None:
        yield from ((item, item) for item in items)
        return
    ordered = sorted(items, key=lambda item: (item["path"], item["row"]))
    for path, of_file in groupby(ordered, key=lambda item: item["path"]):
        yield from _rows_of_file(path, list(of_file))


def _rows_of_file(path: str, items: list[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], dict[str, Any] | None]]:
    """Yield the rows of a file, reading each row group once."""
    system, place = filesystem(path)
    try:
        stream = system.open_input_file(place)
        file = pq.ParquetFile(stream)
    except (OSError, pa.ArrowException):
        yield from ((item, None) for item in items)
        return
    with stream:
        begin = 0
        for group in range(file.num_row_groups):
            end = begin + file.metadata.row_group(group).num_rows
            own = [item for item in items if begin <= item["row"] < end]
            rows = None
            with suppress(OSError, pa.ArrowException):
                rows = file.read_row_group(group) if own else None
            for item in own:
                row = None if rows is None else rows.slice(item["row"] - begin, 1).to_pylist()[0]
                yield item, {**row, "date": item["date"]} if row and row["digest"] == item["digest"] else None
            begin = end
