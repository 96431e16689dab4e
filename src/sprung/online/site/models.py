"""What the interface accepts and returns: the source of its OpenAPI document. Times are UTC ns."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from sprung.results.documents.monitoring import AlertEntry, HistoryEntry
from sprung.state import Verdict

VerdictWord = Literal["confirmed", "another part", "nothing found", "not looked at"]
#: Texts of people, short enough for a table.
Line = Annotated[str, Field(max_length=200)]
Text = Annotated[str, Field(max_length=4000)]


class Answer(BaseModel):
    """A part of an answer."""

    model_config = ConfigDict(frozen=True, from_attributes=True)


class Given(BaseModel):
    """The body of a request: closed to unknown keys."""

    model_config = ConfigDict(extra="forbid", str_strip_whitespace=True)


class FleetVehicle(Answer):
    """A vehicle in the fleet."""

    vehicle: str
    verdict: Verdict = Field(description="what matters most")
    severity: int = Field(description="greatest severity of its active alerts, 1 to 1000; 0: none")
    step: str | None = Field(description="step of that severity: note, low, medium, high or critical")
    alert: int | None = Field(description="number of that alert")
    sentence: str = Field(description="its state in a sentence")
    since: int | None = Field(description="time when that alert was raised")
    health_index: float | None = Field(description="0 to 100 for planning; null while its state is not known")
    channels: int = Field(description="number of its channels")
    failing: tuple[str, ...] = Field(description="channels with an active alert about their sensor")
    has_lost: bool = Field(description="whether an active alert states that frames were lost")
    last_seen: int
    is_parked: bool
    is_old: bool = Field(description="whether it is silent, or was parked more than a day ago")
    windows_learnt: int | None = Field(description="windows collected for a baseline")
    windows_needed: int | None = Field(description="windows needed for a baseline")
    baseline: int | None = Field(description="version of its baseline")
    assignee: str | None
    alert_state: str | None = Field(description="state of that alert in the terms of ISA-18.2")


class FleetCount(Answer):
    """Numbers of vehicles; of the steps: note, low, medium, high, critical."""

    vehicles: int
    steps: tuple[int, int, int, int, int]
    learning: int
    silent: int
    unacknowledged: int = Field(description="vehicles with an active alert that is neither acknowledged nor shelved")


class FleetPage(Answer):
    """Vehicles in order of urgency."""

    vehicles: tuple[FleetVehicle, ...]
    next: str | None = Field(description="cursor of the next page; null after the last")


class WindowEntry(Answer):
    """A window: its place, time and document."""

    boot: int
    number: int
    t0: int
    document: dict[str, Any]


class WindowPage(Answer):
    """Windows in order of time."""

    windows: tuple[WindowEntry, ...]
    next: int | None = Field(description="value of `until` for the page before; null before the first")


class BaselineEntry(Answer):
    """A version of a baseline."""

    version: int
    created: int
    reason: str
    windows: int | None


class VerdictEntry(Answer):
    """A verdict of the workshop on an alert."""

    id: int
    alert: int
    time: int
    who: str
    verdict: VerdictWord
    part: str
    action: str
    request: int | None = Field(description="number of the request for a new baseline")


class AlertDetail(Answer):
    """An alert with its evidence, history and verdicts."""

    alert: AlertEntry
    evidence: dict[str, Any]
    history: tuple[HistoryEntry, ...]
    verdicts: tuple[VerdictEntry, ...]


class Alerts(Answer):
    """Alerts, the most severe first."""

    alerts: tuple[AlertEntry, ...]
    next: str | None = Field(description="cursor of the next page; null after the last")


class VehicleDetail(Answer):
    """A vehicle: its place in the fleet, active alerts, baselines and open requests."""

    summary: FleetVehicle
    channels: tuple[str, ...]
    first_seen: int
    configuration: str
    alerts: tuple[AlertEntry, ...]
    baselines: tuple[BaselineEntry, ...]
    windows: int


class Done(Answer):
    """Outcome of an action."""

    sentence: str
    number: int | None = None


class Comment(Given):
    """A comment."""

    comment: Text = ""


class Shelf(Given):
    """Duration for which an alert is shelved."""

    hours: float = Field(gt=0, le=24 * 366)
    comment: Text = ""


class Assignment(Given):
    """Assignee of an alert; null: nobody."""

    assignee: Line | None
    comment: Text = ""


class WorkshopVerdict(Given):
    """Finding and work of the workshop, and whether a new baseline is learnt."""

    verdict: VerdictWord
    part: Line = ""
    action: Text = ""
    new_baseline: bool = False


class Learning(Given):
    """Why a new baseline is learnt."""

    reason: Line = Field(min_length=1)


class LogIn(Given):
    """Name and password."""

    name: Line
    password: str = Field(max_length=200)


class NewAccount(Given):
    """A person."""

    name: Line
    role: Line
    password: str = Field(max_length=200)


class NewRole(Given):
    """Another role of a person."""

    role: Line


class AccountEntry(Answer):
    """A person."""

    name: str
    role: str
    created: int


class NewToken(Given):
    """A program; days until its token expires, null: never."""

    name: Line
    role: Line
    days: float | None = None


class TokenEntry(Answer):
    """A program's token; its secret is not stored."""

    id: int
    name: str
    role: str
    created: int
    created_by: str
    expires: int | None


class TokenMade(Answer):
    """A new token; its secret is shown only once."""

    number: int
    secret: str


class WhoAmI(Answer):
    """Who makes this request; csrf_token: value of the header X-CSRF-Token of requests that change something."""

    name: str
    role: str
    has_account: bool
    csrf_token: str


class AuditEntry(Answer):
    """An entry of the audit trail: who did what to what."""

    id: int
    time: int
    who: str
    act: str
    subject: str
    detail: Any
