"""A task of a run: windows are read from the lake, analysed and written as files of results."""

import multiprocessing
import signal
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import groupby
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from sprung.fleet.jobs.analysis import Analysed, WindowSettings, Work, analyse, failed
from sprung.fleet.jobs.files import described, filesystem, write_rows
from sprung.fleet.jobs.results import OF_STEP, SCHEMAS

#: Columns of the windows to analyse, as Spark names their types: `path` and `row` in a file of the lake.
WORK_COLUMNS = (
    "path string, row long, date date, vehicle string, start long, digest string, duration double, "
    "vehicle_text string, vehicle_file string, reason string, steps array<string>, has_segments boolean"
)
#: Columns of the files that tasks report, and of the seconds that their windows took.
REPORT_COLUMNS = "table string, path string, n_bytes long, n_rows long, date string, seconds double"
_REPORT = pa.schema(
    [
        ("table", pa.string()),
        ("path", pa.string()),
        ("n_bytes", pa.int64()),
        ("n_rows", pa.int64()),
        ("date", pa.string()),
        ("seconds", pa.float64()),
    ]
)
#: Number of rows after which a task writes a file.
_ROWS_IN_FILE = 256
#: Memory that a process of its own may take [bytes].
_MEMORY = 4 << 30
#: Number of the attempt at which a window that cannot be read is a row with its reason: a disk may fail for a moment.
_LAST_ATTEMPT = 3


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
        outcomes: list[tuple[dict[str, dict[str, Any]], dict[str, float]]] = []
        with apart(is_apart=_attempt() > 0) as analyst:
            for batch in batches:
                for item, row in rows_of(batch.to_pylist()):
                    outcomes.append(analyst(item, row, self.settings))
                    if len(outcomes) >= _ROWS_IN_FILE:
                        yield self._written(outcomes)
                        outcomes = []
        yield self._written(outcomes)

    def _written(self, outcomes: list[tuple[dict[str, dict[str, Any]], dict[str, float]]]) -> pa.RecordBatch:
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
        return pa.RecordBatch.from_pylist(reports, schema=_REPORT)


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

    def __call__(
        self, item: Mapping[str, Any], row: Mapping[str, Any] | None, settings: WindowSettings
    ) -> tuple[dict[str, dict[str, Any]], dict[str, float]]:
        """Return the results of a window, by table, and the seconds that they took."""
        work = Work(
            vehicle_text=item["vehicle_text"] or "",
            vehicle_file=item["vehicle_file"] or "",
            reason=item["reason"] or "",
            steps=tuple(item["steps"]),
            has_segments=bool(item["has_segments"]),
        )
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


@contextmanager
def apart(*, is_apart: bool) -> Iterator["Analyst"]:
    """Yield what analyses windows: in this process, or in another one."""
    analyst = Analyst(is_apart=is_apart)
    try:
        yield analyst
    finally:
        analyst.close()


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
            rows = _group(file, group) if own else None
            for item in own:
                row = None if rows is None else rows.slice(item["row"] - begin, 1).to_pylist()[0]
                yield item, {**row, "date": item["date"]} if row and row["digest"] == item["digest"] else None
            begin = end


def _group(file: pq.ParquetFile, number: int) -> pa.Table | None:
    """Return the rows of a row group; None if they cannot be read."""
    try:
        return file.read_row_group(number)
    except (OSError, pa.ArrowException):
        return None
