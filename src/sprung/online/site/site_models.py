"""Values that the interface returns about the site: settings, store, senders, certificates, loops. Times are UTC ns."""

from pydantic import Field

from sprung.online.site.models import Answer


class SettingEntry(Answer):
    """A setting of the site file."""

    key: str
    value: str = Field(description="as the site file writes it; secrets are hidden; -: none")
    default: str
    source: str = Field(description="where the value comes from: default, site file, or an option of the command line")
    description: str


class TableEntry(Answer):
    """Rows of a table of the store."""

    table: str
    rows: int
    is_more: bool = Field(description="whether there are more: counting ends at a million")
    stay: str = Field(description="how long rows are kept")


class StoreEntry(Answer):
    """The store, and how much it holds."""

    address: str = Field(description="address without password")
    database: str
    size: int = Field(description="size on disk [bytes]")
    free: int | None = Field(description="free space on its disk [bytes]; null with a server")
    least_free: int = Field(description="free space below which intake stops [bytes]")
    oldest: int | None = Field(description="when the oldest result was stored")
    tables: tuple[TableEntry, ...]


class FalseAlarms(Answer):
    """False alarms: the configured rate, and the rate according to the verdicts of the workshop."""

    configured: float = Field(description="rate, per vehicle and day of driving")
    hours_per_day: float = Field(description="hours of driving in a day")
    days: int = Field(description="length of the period that is counted [days]")
    vehicle_days: float = Field(description="days of driving of all vehicles that were analysed in it")
    is_more: bool = Field(description="whether there were more: counting ends at a million windows")
    verdicts: int = Field(description="alerts of the suspension after which the workshop inspected the vehicle")
    false: int = Field(description="those of them where it found nothing")
    rate: float | None = Field(description="false alarms per vehicle and day of driving; null: not known yet")
    interval: tuple[float, float] | None = Field(description="95 % interval of the rate (Poisson)")


class SenderEntry(Answer):
    """A sender of notifications, and the result of its last test."""

    name: str
    kind: str
    to: str = Field(description="where it sends; secrets are hidden")
    is_testable: bool
    tested: int | None = Field(description="when it was tested last")
    tested_by: str
    problem: str = Field(description="why the last test failed; empty if it succeeded")
    given_up: str = Field(description="why it gave up the last notification; empty if it did not")


class CertificateEntry(Answer):
    """A certificate of this monitor."""

    purpose: str
    path: str
    expires: int | None = Field(description="null if the file cannot be read")
    trouble: str = Field(description="what is wrong and what to do; empty: nothing")


class VersionEntry(Answer):
    """A program or library, and its version."""

    name: str
    version: str


class LoopEntry(Answer):
    """A loop of the monitor, and when it last ran."""

    name: str
    age: float = Field(description="time since the last pass [s]")
    limit: float | None = Field(description="longest time between two passes [s]")


class FigureEntry(Answer):
    """A figure of the running monitor, as at /metrics."""

    name: str
    meaning: str
    value: float


class SiteDetail(Answer):
    """Settings, store, senders and state of the monitor itself."""

    name: str
    sentence: str
    troubles: tuple[str, ...]
    is_open: bool = Field(description="whether anybody on this machine may act, as there are no accounts")
    vehicles: int
    settings: tuple[SettingEntry, ...]
    store: StoreEntry
    false_alarms: FalseAlarms
    senders: tuple[SenderEntry, ...]
    certificates: tuple[CertificateEntry, ...]
    versions: tuple[VersionEntry, ...]
    loops: tuple[LoopEntry, ...]
    figures: tuple[FigureEntry, ...]
