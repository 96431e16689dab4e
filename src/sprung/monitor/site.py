"""The site file: how a monitor is set up."""

import tomllib
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sprung.alerting import AlertSettings
from sprung.errors import FormatError, ParameterError
from sprung.monitor.engine import MonitorSettings

_DAY = 86400 * 10**9


class _Table(BaseModel):
    """A table of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Watch(_Table):
    """How vehicles are watched; as `MonitorSettings`, with minutes and hours as people say them."""

    window_minutes: float = Field(10.0, ge=1, le=120)
    identify_every_minutes: float = Field(1.0, ge=0)
    method: str = Field("cov", pattern="^(cov|acs|coss)$")
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

    results_days: float = Field(730.0, gt=0)
    raw_days: float = Field(2.0, ge=0)
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


class Mail(_Table):
    """Alerts by e-mail."""

    host: str
    port: int = 587
    sender: str
    recipients: list[str] = Field(min_length=1)
    username: str | None = None
    password: str | None = None
    starttls: bool = True


class Send(_Table):
    """Who is told of alerts, beside the log and the topic."""

    webhook: list[Webhook] = []
    mail: list[Mail] = []


class Site(_Table):
    """A monitor's settings (`sprung.site/1`)."""

    schema_name: str = Field("sprung.site/1", alias="schema", pattern="^sprung[.]site/1$")
    broker: str = "embedded"
    store: str = "sqlite:///sprung-data/sprung.sqlite"
    http: str = "127.0.0.1:8737"
    watch: Watch = Watch()
    alerts: Alerts = Alerts()
    keep: Keep = Keep()
    send: Send = Send()

    @property
    def archive(self) -> Path | None:
        """Folder for samples, beside a store in a file; None where they are not kept."""
        if not self.keep.raw_days:
            return None
        is_file = self.store.startswith("sqlite:///")
        return (Path(self.store.removeprefix("sqlite:///")).parent if is_file else Path("sprung-data")) / "raw"

    @property
    def http_address(self) -> tuple[str, int]:
        """Host and port."""
        host, _, port = self.http.rpartition(":")
        if not host or not port.isdigit() or int(port) > 65535:
            raise ParameterError(f"http {self.http!r} is no address: write HOST:PORT, such as 127.0.0.1:8737")
        return host.strip("[]"), int(port)


def read_site(path: Path) -> Site:
    """Read a site file.

    Raises
    ------
    FormatError
        Where it is none; the message names file, field, rule and remedy.
    """
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}: give the site file of the monitor") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FormatError(f"{path} is no TOML: {error}") from None
    try:
        return Site.model_validate(fields)
    except ValidationError as problems:
        first = problems.errors()[0]
        where = ".".join(map(str, first["loc"])) or "file"
        raise FormatError(f"{path}: {where}: {first['msg']}: correct it (see docs/monitor.md)") from None
