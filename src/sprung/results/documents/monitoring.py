"""Documents of the monitor: alerts, vehicles, reports and work orders."""

from typing import Any, Literal

from pydantic import Field

from sprung.results.documents.document import Document, Pair


class AlertEntry(Document):
    """An alert; times are nanoseconds UTC since 1970."""

    number: int
    vehicle: str
    cause: str
    severity: int
    state: str
    raised: int
    count: int
    assignee: str | None
    shelved_until: int | None
    text: str


class AlertsDocument(Document):
    """Alerts in the store of a monitor."""

    schema_name: Literal["sprung.alerts/1"] = Field(alias="schema")
    alerts: tuple[AlertEntry, ...]


class HistoryEntry(Document):
    """A change of an alert; times are nanoseconds UTC since 1970."""

    time: int
    what: str
    who: str
    comment: str
    assignee: str | None
    shelved_until: int | None


class AlertHistoryDocument(Document):
    """The history of an alert, oldest entry first."""

    schema_name: Literal["sprung.alert-history/1"] = Field(alias="schema")
    number: int
    history: tuple[HistoryEntry, ...]


class NotificationDocument(Document):
    """An event of an alert, as senders pass it on; a test message has the first five keys only.

    Times are nanoseconds UTC since 1970, but for `time`, which is ISO 8601.
    """

    schema_name: Literal["sprung.alert/1"] = Field(alias="schema")
    time: str
    what: str
    subject: str
    text: str
    who: str = ""
    comment: str = ""
    vehicle: str = ""
    cause: str = ""
    severity: int | None = None
    step: str = ""
    state: str = ""
    is_active: bool = False
    is_acknowledged: bool = False
    shelved_until: int | None = None
    raised: int | None = None
    updated: int | None = None
    cleared: int | None = None
    count: int = 0
    assignee: str | None = None
    evidence: dict[str, Any] = Field(default_factory=dict)
    number: int | None = None
    link: str | None = None
    key: str = ""


class VehicleEntry(Document):
    """A vehicle that a monitor watches."""

    vehicle: str
    windows: int
    windows_learnt: int | None
    windows_needed: int | None
    baseline: int | None
    health_index: float | None
    last_seen: int
    data_until: int | None
    modes: dict[str, Pair] | tuple[dict[str, Any], ...] | None
    verdict: str
    summary: str


class VehiclesDocument(Document):
    """Vehicles in the store of a monitor."""

    schema_name: Literal["sprung.vehicles/1"] = Field(alias="schema")
    vehicles: tuple[VehicleEntry, ...]


class AccountEntry(Document):
    """A person who may log in."""

    name: str
    role: Literal["viewer", "engineer", "admin"]
    created: int


class AccountsDocument(Document):
    """Accounts in the store of a monitor."""

    schema_name: Literal["sprung.accounts/1"] = Field(alias="schema")
    accounts: tuple[AccountEntry, ...]


class TokenEntry(Document):
    """A program that may use the interface; `secret` only of a token that was just created."""

    number: int
    name: str
    role: Literal["viewer", "engineer", "admin"]
    created: int
    created_by: str
    expires: int | None
    secret: str = ""


class TokensDocument(Document):
    """Tokens in the store of a monitor."""

    schema_name: Literal["sprung.tokens/1"] = Field(alias="schema")
    tokens: tuple[TokenEntry, ...]


class QuarantineEntry(Document):
    """Consecutive frames, or a state, that a monitor quarantined; times are nanoseconds UTC since 1970."""

    vehicle: str
    kind: str
    boot: int
    first: int
    last: int
    begin: int
    stored: int
    size: int
    reason: str
    again: str | None


class QuarantineDocument(Document):
    """Frames and states in the store of a monitor that were quarantined."""

    schema_name: Literal["sprung.quarantine/1"] = Field(alias="schema")
    quarantined: tuple[QuarantineEntry, ...]


class ReproductionDocument(Document):
    """Reports that `sprung reproduce` wrote."""

    schema_name: Literal["sprung.reproduction/1"] = Field(alias="schema")
    seeds: int
    files: tuple[str, ...]


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


class WorkOrderDocument(Document):
    """The inspection or repair that a workshop is to do, and the reason; times are nanoseconds UTC since 1970."""

    schema_name: Literal["sprung.work-order/1"] = Field(alias="schema")
    key: str
    alert: int
    created: int
    created_by: str
    vehicle: str
    corner: str | None
    part: str
    change: float | None
    interval: Pair | None
    since: int
    since_interval: tuple[int, int] | None
    severity: int
    step: str
    urgency: str
    sentence: str
    runner_up: str | None
    state: str
    raised: int
    assignee: str | None
    evidence: dict[str, Any]
    link: str | None
