"""What services need: logs, as text for people and JSON lines for machines, and signals that stop them."""

import json
import logging
import os
import signal
import threading
from datetime import UTC, datetime
from typing import Annotated

from sprung.cli.options import option

LOG = logging.getLogger("sprung")

LogFormat = Annotated[str, option("text|json", "Format of the log on standard error.", "--log")]

_USUAL = set(logging.makeLogRecord({}).__dict__) | {"message", "asctime", "taskName"}


def log_to(form: str) -> None:
    """Log to standard error: "text", or "json" with one object a line."""
    from sprung._checks import check_one_of

    check_one_of("--log", form, ("text", "json"))
    handler = logging.StreamHandler()
    handler.setFormatter(JsonLines() if form == "json" else Text())
    root = logging.getLogger("sprung")
    root.handlers, root.propagate = [handler], False
    root.setLevel(logging.INFO)


def extras(record: logging.LogRecord) -> dict[str, object]:
    """Return the fields of a record besides its message."""
    return {name: value for name, value in record.__dict__.items() if name not in _USUAL}


class Text(logging.Formatter):
    """Time, level, message and further fields in one line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return a line."""
        more = "".join(f" {name}={value}" for name, value in extras(record).items())
        return f"{_time(record)} {record.levelname.lower():7} {record.getMessage()}{more}"


class JsonLines(logging.Formatter):
    """One JSON object a line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return a line."""
        fields = {"time": _time(record), "level": record.levelname.lower(), "message": record.getMessage()}
        return json.dumps({**fields, **extras(record)}, default=str)


def _time(record: logging.LogRecord) -> str:
    """Return the time of a record, ISO 8601."""
    return datetime.fromtimestamp(record.created, tz=UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def stop_on_signals(*, within: float | None = None) -> threading.Event:
    """Return an event that SIGINT and SIGTERM set.

    Parameters
    ----------
    within
        Longest time from the first signal to the end of the process [s], after which it ends with status 1, its child
        processes first; None: no limit.
    """
    stopping = threading.Event()

    def stop() -> None:
        if stopping.is_set():
            return
        stopping.set()
        if within is not None:
            timer = threading.Timer(within, _end, (within,))
            timer.daemon = True
            timer.start()

    for number in (signal.SIGINT, signal.SIGTERM):
        # In a thread: if this one holds the lock of the event when the signal comes, it would deadlock.
        signal.signal(number, lambda *_: threading.Thread(target=stop).start())
    return stopping


def _end(within: float) -> None:
    """End the process whatever its threads wait for: results are in the store, transaction by transaction."""
    import multiprocessing

    LOG.error(f"no clean stop within {within:g} s, as the store or a disk does not answer: process ended")
    for child in multiprocessing.active_children():
        child.kill()
        child.join(1.0)
    os._exit(1)
