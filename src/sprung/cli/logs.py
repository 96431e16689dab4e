"""Logs of services, text for people and JSON lines for machines."""

import json
import logging
from datetime import UTC, datetime
from typing import Annotated

from sprung.cli.options import option

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
