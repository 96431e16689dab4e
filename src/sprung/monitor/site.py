"""The site file: how a monitor is set up."""

from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from sprung.alerting import AlertSettings, MailSender, WebhookSender
from sprung.errors import FormatError, ParameterError
from sprung.link import Address
from sprung.monitor.engine import MonitorSettings
from sprung.storage import check_address
from sprung.toml import checked, toml_fields

_DAY = 86400 * 10**9
# A century: times are nanoseconds in 64 bits.
_MOST_DAYS = 36525.0


class _Table(BaseModel):
    """A table of the file: typed strictly, closed to unknown keys, unchangeable."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Watch(_Table):
    """How vehicles are watched; as `MonitorSettings`, with minutes and hours as people say them."""

    window_minutes: float = Field(10.0, ge=1, le=120)
    identify_every_minutes: float = Field(1.0, ge=0)
    method: Literal["cov", "acs", "coss"] = "cov"
    learning_windows: int = Field(12, ge=2)
    false_alarms_per_day: float = Field(1e-3, gt=0)
    hours_per_day: float = Field(8.0, gt=0, le=24)
    workers: int = Field(1, ge=1, le=256)
    seconds_per_job: float = Field(60.0, gt=0)

    @property
    def settings(self) -> MonitorSettings:
        """For the vehicles."""
        return MonitorSettings(
            window=60 * self.window_minutes,
            identify_every=60 * self.identify_every_minutes,
            method=self.method,
            n_learning=self.learning_windows,
            false_alarms=self.false_alarms_per_day,
            hours_per_day=self.hours_per_day,
            most_windows=max(96, self.learning_windows),
        )


class Alerts(_Table):
    """When alerts rise, clear and come again."""

    raise_after_windows: int = Field(1, ge=1)
    clear_after_windows: int = Field(3, ge=1)
    remind_after_hours: float | None = Field(None, gt=0)
    silent_after_minutes: float = Field(60.0, gt=0)

    @property
    def settings(self) -> AlertSettings:
        """For the alerts."""
        remind = None if self.remind_after_hours is None else round(3600e9 * self.remind_after_hours)
        return AlertSettings(self.raise_after_windows, self.clear_after_windows, remind)


class Keep(_Table):
    """What is kept, and for how long."""

    results_days: float = Field(730.0, gt=0, le=_MOST_DAYS)
    raw_days: float = Field(2.0, ge=0, le=_MOST_DAYS)
    raw_gigabytes: float = Field(20.0, gt=0)
    free_megabytes: float = Field(200.0, ge=0)

    def results_before(self, now: int) -> int:
        """Time before which results go, UTC ns."""
        return now - round(self.results_days * _DAY)

    def raw_before(self, now: int) -> int:
        """Time before which samples go, UTC ns."""
        return now - round(self.raw_days * _DAY)


class Webhook(_Table):
    """Alerts by HTTP."""

    url: str
    headers: dict[str, str] = {}

    def as_sender(self, name: str) -> WebhookSender:
        """Return what sends."""
        return WebhookSender(self.url, headers=self.headers, name=name)

    @model_validator(mode="after")
    def _can_send(self) -> Self:
        self.as_sender("")
        return self


class Mail(_Table):
    """Alerts by e-mail."""

    host: str
    port: int = 587
    sender: str
    recipients: list[str] = Field(min_length=1)
    username: str | None = None
    password: str | None = None
    starttls: bool = True

    def as_sender(self, name: str) -> MailSender:
        """Return what sends."""
        return MailSender(**self.model_dump(), name=name)

    @model_validator(mode="after")
    def _can_send(self) -> Self:
        self.as_sender("")
        return self


class Send(_Table):
    """Who is told of alerts, beside the log and the topic."""

    webhook: list[Webhook] = []
    mail: list[Mail] = []


class Site(_Table):
    """A monitor's settings (`sprung.site/1`)."""

    schema_name: Literal["sprung.site/1"] = Field("sprung.site/1", alias="schema")
    broker: str = "embedded"
    store: str = "sqlite:///sprung-data/sprung.sqlite"
    http: str = "127.0.0.1:8737"
    watch: Watch = Watch()
    alerts: Alerts = Alerts()
    keep: Keep = Keep()
    send: Send = Send()

    @field_validator("broker")
    @classmethod
    def _is_broker(cls, broker: str) -> str:
        if embedded_port(broker) is None:
            Address.parse(broker)
        return broker

    @field_validator("store")
    @classmethod
    def _is_store(cls, store: str) -> str:
        check_address(store)
        return store

    @field_validator("http")
    @classmethod
    def _is_http(cls, http: str) -> str:
        _http_address(http)
        return http

    @property
    def archive(self) -> Path | None:
        """Folder for samples, beside a store in a file; None where they are not kept."""
        if not self.keep.raw_days:
            return None
        is_file = self.store.startswith("sqlite:///")
        return (Path(self.store.removeprefix("sqlite:///")).parent if is_file else Path("sprung-data")) / "raw"

    @property
    def correlations(self) -> Path | None:
        """Folder of correlations that boxes sent; None where they are not kept."""
        return None if self.archive is None else self.archive.with_name("correlations")

    @property
    def http_address(self) -> tuple[str, int]:
        """Host and port."""
        return _http_address(self.http)


def read_site(path: Path) -> Site:
    """Read a site file.

    Raises
    ------
    FormatError
        Where it is none; the message names file, field, rule and remedy.
    """
    try:
        return checked(Site, toml_fields(path.read_bytes(), source=str(path)))
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}: give the site file of the monitor") from None
    except ParameterError as error:
        raise FormatError(f"{path}: {error} (see docs/monitor.md)") from None


def embedded_port(broker: str) -> int | None:
    """Return the port of a broker that the monitor runs itself, "embedded" or "embedded:PORT"; None of any other."""
    word, _, port = broker.partition(":")
    if word != "embedded":
        return None
    if port and not _is_port(port):
        raise ParameterError(f"{broker!r} is no address of a broker: write embedded or embedded:PORT")
    return int(port or 1883)


def _http_address(http: str) -> tuple[str, int]:
    """Return host and port of an address."""
    host, _, port = http.rpartition(":")
    if not host or not _is_port(port):
        raise ParameterError(f"{http!r} is no address: write HOST:PORT, such as 127.0.0.1:8737")
    return host.strip("[]"), int(port)


def _is_port(text: str) -> bool:
    """Tell whether a text is the number of a port."""
    return text.isdecimal() and len(text) <= 5 and int(text) <= 65535
