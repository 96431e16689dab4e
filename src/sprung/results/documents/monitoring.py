"""The documents of the monitor: alerts, their history, and vehicles."""

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
