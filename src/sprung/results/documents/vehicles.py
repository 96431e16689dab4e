"""The documents of a vehicle in the store of a monitor: the report of a period, and what was exported."""

from typing import Any, Literal

from pydantic import Field

from sprung.results.documents.document import Document, Pair
from sprung.results.documents.monitoring import AlertEntry, HistoryEntry


class ExportDocument(Document):
    """Rows of a table about a vehicle, each an object of all columns; times are ISO 8601 in UTC."""

    schema_name: Literal["sprung.export/1"] = Field(alias="schema")
    vehicle: str
    what: Literal["windows", "modes", "findings", "alerts"]
    columns: tuple[str, ...]
    rows: tuple[dict[str, Any], ...]


class ChangeEntry(Document):
    """Change of a component against the baseline with the interval that decides, and its smallest detectable loss.

    `interval_with_common` includes what may move all corners together.
    """

    component: str
    change: float
    interval: Pair
    interval_with_common: Pair
    detectable: float | None


class RangeEntry(Document):
    """Lowest, median and highest value of windows."""

    low: float
    median: float
    high: float


class BodyModeEntry(Document):
    """A body mode over the windows of a period."""

    windows: int
    natural_frequency: RangeEntry
    damping_ratio: RangeEntry


class FaultEntry(Document):
    """A sensor fault: number of windows with it, start of the first and of the last (UTC ns)."""

    channel: str
    kind: str
    windows: int
    first: int
    last: int


class VerdictEntry(Document):
    """A verdict of the workshop on an alert."""

    time: int
    who: str
    verdict: str
    part: str
    action: str


class ReportedAlert(Document):
    """An alert of a period with its evidence, history and verdicts."""

    alert: AlertEntry
    cleared: int | None
    evidence: dict[str, Any]
    history: tuple[HistoryEntry, ...]
    verdicts: tuple[VerdictEntry, ...]


class ReportDocument(Document):
    """A vehicle over a period; times are nanoseconds UTC since 1970."""

    schema_name: Literal["sprung.report/1"] = Field(alias="schema")
    vehicle: str
    since: int | None
    until: int | None
    written: int
    verdict: str
    sentence: str
    windows: int
    usable: int
    baseline: int | None
    changes: tuple[ChangeEntry, ...]
    changes_since: int | None
    modes: dict[str, BodyModeEntry]
    conditions: dict[str, RangeEntry]
    sensor_faults: tuple[FaultEntry, ...]
    reasons: dict[str, int]
    alerts: tuple[ReportedAlert, ...]
