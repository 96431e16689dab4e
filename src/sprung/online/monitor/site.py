"""The site file: settings of a monitor."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator

from sprung.errors import FormatError, ParameterError
from sprung.link import Address
from sprung.online.alerts import AlertSettings, MailSender, SelectiveSender, Sender, ServiceSender, WebhookSender
from sprung.online.monitor.events import MonitorSettings
from sprung.online.store import check_address
from sprung.state import STEPS, StepName
from sprung.toml import checked, toml_fields
from sprung.vehicles.structure import PARTS

_DAY = 86400 * 10**9
# A century: times are nanoseconds in 64 bits.
_MAX_DAYS = 36525.0


class _Table(BaseModel):
    """A table of the file: typed strictly, closed to unknown keys, unchangeable."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


#: Kinds of parts that limits are set for.
_KINDS = tuple(dict.fromkeys(kind for kinds in PARTS.values() for kind in kinds if kind))
_MONITOR, _ALERT = MonitorSettings(), AlertSettings()


class Watch(_Table):
    """Settings of the monitoring of vehicles."""

    window_minutes: float = Field(_MONITOR.window / 60, ge=1, le=120, description="length of a window [min]")
    identify_every_minutes: float = Field(
        _MONITOR.identify_every / 60, ge=0, description="time between identifications of modes [min]; 0: none"
    )
    method: Literal["cov", "acs", "coss"] = Field("cov", description="method of identification: cov, acs or coss")
    learning_windows: int = Field(
        _MONITOR.learning_windows, ge=2, description="usable windows from which a baseline is learnt"
    )
    false_alarms_per_day: float = Field(
        _MONITOR.false_alarms, gt=0, description="rate of false alarms of a vehicle per day of driving"
    )
    hours_per_day: float = Field(_MONITOR.hours_per_day, gt=0, le=24, description="hours of driving in a day")
    calibrate: bool | None = Field(
        None, description="whether vehicle files are calibrated before a baseline is learnt; left out: imperfect ones"
    )
    workers: int = Field(1, ge=1, le=256, description="number of analysis processes")
    seconds_per_job: float = Field(
        180.0, gt=0, description="longest time of a job [s]; a longer one is stopped and raises an alert"
    )
    megabytes_per_vehicle: float = Field(
        100.0, gt=0, description="largest size of the samples of a window, and of the state, of one vehicle [MB]"
    )
    megabytes_per_job: float = Field(
        1500.0, gt=0, description="largest memory that the analysis of a window may take [MB]"
    )

    @property
    def settings(self) -> MonitorSettings:
        """Settings of each vehicle's monitor."""
        return MonitorSettings(
            window=60 * self.window_minutes,
            identify_every=60 * self.identify_every_minutes,
            method=self.method,
            learning_windows=self.learning_windows,
            false_alarms=self.false_alarms_per_day,
            hours_per_day=self.hours_per_day,
            calibrate=self.calibrate,
            max_windows=max(_MONITOR.max_windows, self.learning_windows),
        )


def _limits(limits: dict[str, list[float]]) -> dict[str, list[float]]:
    """Return soft and hard limits of parts, or refuse them."""
    for name, ends in limits.items():
        if name.rpartition(".")[2] not in _KINDS:
            raise ParameterError(
                f"{name!r} is no part: limit one of {', '.join(_KINDS)}, or a part such as rear_left.damper"
            )
        if len(ends) != 2 or not 0 < ends[0] <= ends[1]:
            raise ParameterError(f"{name} = {ends} must be a soft limit above 0 and a hard one: write [0.2, 0.4]")
    return limits


_Limits = Annotated[dict[str, list[float]], AfterValidator(_limits)]


class Alerts(_Table):
    """When alerts are raised, cleared and repeated."""

    raise_after_windows: int = Field(
        _ALERT.raise_after, ge=1, description="consecutive windows with a finding before an alert is raised (hold-off)"
    )
    clear_after_windows: int = Field(
        _ALERT.clear_after, ge=1, description="consecutive windows without it before an alert clears (hysteresis)"
    )
    remind_after_hours: float | None = Field(
        None, gt=0, description="time between reminders of an unacknowledged alert [h]; left out: none"
    )
    silent_after_minutes: float = Field(
        60.0, gt=0, description="time without messages after which a vehicle is silent, unless switched off [min]"
    )
    limits: _Limits = Field(
        {},
        description="soft and hard limit of the certain change of a kind of part or of one part, such as damper ="
        " [0.2, 0.4] or rear_left.damper: high from the first on, critical from the second, low below; left out: by the"
        " severity of findings",
    )
    vehicle_limits: dict[str, _Limits] = Field(
        {},
        description='such limits of vehicles by name or pattern: `[alerts.vehicle_limits."bus-0*"]`; the first that'
        " matches and states the part or its kind counts, then `limits`",
    )

    @property
    def settings(self) -> AlertSettings:
        """Settings of the alerts."""
        remind = None if self.remind_after_hours is None else round(3600e9 * self.remind_after_hours)
        return AlertSettings(
            self.raise_after_windows, self.clear_after_windows, remind, self.limits, self.vehicle_limits
        )


class Keep(_Table):
    """Retention of results and samples."""

    results_days: float = Field(730.0, gt=0, le=_MAX_DAYS, description="age at which results are deleted [days]")
    audit_days: float = Field(
        3652.0, gt=0, le=_MAX_DAYS, description="age at which the audit trail and history of alerts are deleted [days]"
    )
    boots_days: float = Field(
        90.0, gt=0, le=_MAX_DAYS, description="age at which the progress of finished starts of boxes is deleted [days]"
    )
    raw_days: float = Field(
        2.0, ge=0, le=_MAX_DAYS, description="age at which samples (Parquet) are deleted [days]; 0: none are kept"
    )
    raw_gigabytes: float = Field(20.0, gt=0, description="largest size of the samples that are kept [GB]")
    free_megabytes: float = Field(
        200.0, ge=0, description="free disk space below which intake stops and an alert is raised [MB]"
    )
    lake: str | None = Field(
        None, min_length=1, description="folder or URL of a lake that windows are written to; left out: none"
    )
    lake_days: float | None = Field(
        None,
        gt=0,
        le=_MAX_DAYS,
        description="age at which windows in the lake are deleted [days]; left out: `results_days`",
    )
    results: str | None = Field(
        None, min_length=1, description="folder or URL of the results of `sprung fleet run`, for a page; left out: none"
    )

    def before(self, days: float, now: int) -> int:
        """Return the time [UTC ns] some days before the present one."""
        return now - round(days * _DAY)

    @property
    def days_in_lake(self) -> float:
        """Age at which windows in the lake are deleted [days]."""
        return self.lake_days or self.results_days


class _Recipient(_Table):
    """Where notifications are sent to, checked when the file is read."""

    sender_type: ClassVar[Callable[..., Sender]]

    severity: StepName = Field("note", description="smallest severity of the alerts that are sent")
    vehicles: list[str] = Field(
        [], description="vehicles whose alerts are sent: names or patterns such as `bus-0*`, `monitor`; empty: all"
    )

    def as_sender(self, name: str) -> Sender:
        """Return the sender of the alerts that are selected."""
        sender = self.sender_type(**self.model_dump(exclude={"severity", "vehicles"}), name=name)
        return SelectiveSender(sender, STEPS.index(self.severity), tuple(self.vehicles))

    @model_validator(mode="after")
    def _can_send(self) -> Self:
        self.as_sender("")
        return self


class Webhook(_Recipient):
    """Notifications by HTTP."""

    sender_type = WebhookSender
    url: str = Field(description="address to which `sprung.alert/1` is posted")
    headers: dict[str, str] = Field({}, description="headers of the request, such as an Authorization")


class Mail(_Recipient):
    """Notifications by e-mail."""

    sender_type = MailSender
    host: str = Field(description="mail server")
    port: int = Field(587, description="its port")
    sender: str = Field(description="address of the sender")
    recipients: list[str] = Field(min_length=1, description="addresses of the recipients")
    username: str | None = Field(None, description="user name at the server; left out: none")
    password: str | None = Field(None, description="password at the server; left out: none")
    starttls: bool = Field(True, description="whether to encrypt the connection")


class Service(_Recipient):
    """Notifications by a service of apprise."""

    sender_type = ServiceSender
    url: str = Field(description="address of a service as apprise writes it, such as `slack://TOKEN/#channel`")


class Send(_Table):
    """Who is notified of alerts, besides the log and the topic."""

    webhook: list[Webhook] = []
    mail: list[Mail] = []
    apprise: list[Service] = []


class Web(_Table):
    """Settings of the server of the pages."""

    certificate: str | None = Field(None, description="file with the certificate of this server; left out: no TLS")
    key: str | None = Field(None, description="file with its private key")
    behind_proxy: bool = Field(
        False, description="whether a proxy on this machine or network provides TLS and passes requests on"
    )

    @model_validator(mode="after")
    def _has_both(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ParameterError("a certificate needs its key, and a key its certificate: give both, or neither")
        return self


class Site(_Table):
    """Settings of a monitor (`sprung.site/1`); docs/monitor.md has the table of all fields."""

    schema_name: Literal["sprung.site/1"] = Field("sprung.site/1", alias="schema", description="version of the file")
    name: str = Field("Site", max_length=64, description="name of the site on pages and in reports")
    broker: str = Field(
        "embedded", description="embedded, embedded:PORT, mqtt://HOST:PORT or mqtts://HOST:PORT?ca=F&cert=F&key=F"
    )
    store: str = Field(
        "sqlite:///sprung-data/sprung.sqlite", description="sqlite:///FILE or postgresql://USER@HOST/NAME"
    )
    http: str = Field("127.0.0.1:8737", description="address of the pages, of /api/v1, /metrics and /health")
    url: str | None = Field(
        None,
        description="address at which people reach this monitor, such as https://sprung.example.org, for the links in "
        "notifications; left out: no links",
    )
    watch: Watch = Watch()
    alerts: Alerts = Alerts()
    keep: Keep = Keep()
    send: Send = Send()
    web: Web = Web()

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

    @field_validator("url")
    @classmethod
    def _is_url(cls, url: str | None) -> str | None:
        parts = urlsplit(url or "http://host")
        if parts.scheme not in {"http", "https"} or not parts.hostname:
            raise ParameterError(f"{url!r} is not the address of a page: write it like https://sprung.example.org")
        return url

    def alert_url(self, number: int) -> str:
        """Return the address of an alert; empty if the site has none."""
        return "" if self.url is None else f"{self.url.rstrip('/')}/alerts/{number}"

    @property
    def url_host(self) -> str:
        """Name by which people reach this monitor; empty if the site has none."""
        return urlsplit(self.url or "").hostname or ""

    @property
    def archive(self) -> Path | None:
        """Folder of samples, next to a store in a file; None if they are not kept."""
        return self._folder / "raw" if self.keep.raw_days else None

    @property
    def outbox(self) -> Path:
        """Folder of windows that wait to be written to the lake."""
        return self._folder / "outbox"

    @property
    def correlations(self) -> Path | None:
        """Folder of correlations that boxes sent; None if they are not kept."""
        return None if self.archive is None else self.archive.with_name("correlations")

    @property
    def _folder(self) -> Path:
        """Folder of a store in a file; that of the default store otherwise."""
        is_file = self.store.startswith("sqlite:///")
        return Path(self.store.removeprefix("sqlite:///")).parent if is_file else Path("sprung-data")

    @property
    def http_address(self) -> tuple[str, int]:
        """Host and port."""
        return _http_address(self.http)


def read_site(path: Path) -> Site:
    r"""Read a site file.

    Raises
    ------
    ParameterError
        If it cannot be read.
    FormatError
        If it is not a valid site file; the message names file, field, rule and remedy.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "site.toml")
    ...     _ = path.write_text('name = "Depot"\n[watch]\nwindow_minutes = 5')
    ...     site = read_site(path)
    >>> site.name, site.watch.window_minutes, site.broker
    ('Depot', 5.0, 'embedded')
    """
    try:
        return checked(Site, toml_fields(path.read_bytes(), source=str(path)))
    except OSError as error:
        raise ParameterError(f"{path} cannot be read ({error.strerror}): give the site file of the monitor") from None
    except ParameterError as error:
        raise FormatError(f"{path}: {error} (see docs/monitor.md)") from None


def embedded_port(broker: str) -> int | None:
    """Return the port of an embedded broker, "embedded" or "embedded:PORT"; None for any other.

    Raises
    ------
    ParameterError
        If the port is not a number.

    Examples
    --------
    >>> embedded_port("embedded"), embedded_port("embedded:1884"), embedded_port("mqtt://depot:1883")
    (1883, 1884, None)
    """
    word, _, port = broker.partition(":")
    if word != "embedded":
        return None
    if port and not _is_port(port):
        raise ParameterError(f"{broker!r} is not the address of a broker: write embedded or embedded:PORT")
    return int(port or 1883)


def _http_address(http: str) -> tuple[str, int]:
    """Return host and port of an address."""
    host, _, port = http.rpartition(":")
    if not host or not _is_port(port):
        raise ParameterError(f"{http!r} is not an address: write HOST:PORT, such as 127.0.0.1:8737")
    return host.strip("[]"), int(port)


def _is_port(text: str) -> bool:
    """Return whether a text is a port number."""
    return text.isdecimal() and len(text) <= 5 and int(text) <= 65535
