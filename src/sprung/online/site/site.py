"""The site: settings, store, senders, false alarms and state of the monitor itself."""

import json
import platform
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from urllib.parse import urlsplit

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import BaseModel, Field
from scipy.special import gammaincinv

from sprung import __version__
from sprung.online.monitor import FIGURES
from sprung.online.monitor.housekeeping import certificates_of
from sprung.online.monitor.notifier import try_senders
from sprung.online.monitor.site import Keep, Mail, Service, Site, Webhook
from sprung.online.monitor.station import loops_of
from sprung.online.site.accounts import Engineer, EngineerForm, Role, Viewer
from sprung.online.site.alerts import TAIL
from sprung.online.site.rendering import page
from sprung.online.site.shared import LIMITS, Answer, Context, Done, Name, Shared
from sprung.online.store import MAX_COUNTED, Contents, Counted
from sprung.online.store.retention import contents_of, n_windows_since
from sprung.online.store.schema import DAY
from sprung.results.tables import counted
from sprung.state import is_of_suspension

api = APIRouter(tags=["site"])
pages = APIRouter(include_in_schema=False)

_TEST = "sender tested"
#: Settings that the command line overrides.
_OPTIONS = {"broker": "--broker", "store": "--store", "http": "--http"}
#: What stands for a secret.
_SECRET = "(hidden)"
#: Libraries whose versions are shown.
_LIBRARIES = "numpy scipy pyarrow pydantic sqlalchemy psycopg paho-mqtt cbor2 fastapi uvicorn jinja2 matplotlib"


class SettingEntry(Answer):
    """A setting of the site file."""

    key: str
    value: str = Field(description="as the site file writes it; secrets are hidden; -: none")
    default: str
    source: str = Field(description="where the value comes from: default, site file, or an option of the command line")
    description: str


class StoreEntry(Answer):
    """The store, and how much it holds."""

    address: str = Field(description="address without password")
    database: str
    size: int = Field(description="size on disk [bytes]")
    free: int | None = Field(description="free space on its disk [bytes]; null with a server")
    min_free: int = Field(description="free space below which intake stops [bytes]")
    oldest: int | None = Field(description="when the oldest result was stored")
    tables: tuple[Counted, ...]


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
    tested_by: str | None
    problem: str | None = Field(description="why the last test failed; null if it succeeded")
    given_up: str | None = Field(description="why it gave up the last notification; null if it did not")


class CertificateEntry(Answer):
    """A certificate of this monitor."""

    purpose: str
    path: str
    expires: int | None = Field(description="null if the file cannot be read")
    problem: str | None = Field(description="what is wrong and what to do; null: nothing")


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
    problems: tuple[str, ...]
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


@api.get("/site")
def site(context: Shared, _: Viewer) -> SiteDetail:
    """Settings, store, senders and state of the monitor itself."""
    settings = context.site
    now = context.clock()
    contents = contents_of(context.store)
    figures = context.figures()
    certificates = tuple(
        CertificateEntry(purpose=each.purpose, path=each.path, expires=each.expires, problem=each.problem_at(now))
        for each in certificates_of(settings)
    )
    problems = (*context.problems(), *(each.problem for each in certificates if each.problem))
    things = f"{counted(len(problems), 'thing')} at this site {'needs' if len(problems) == 1 else 'need'} attention."
    return SiteDetail(
        name=settings.name,
        sentence=things if problems else "The monitor works: no problem is known.",
        problems=problems,
        is_open=context.is_open,
        vehicles=context.store.inbox.n_vehicles(),
        settings=tuple(settings_of(settings)),
        store=_store(context, contents),
        false_alarms=false_alarms(context),
        senders=senders(context),
        certificates=certificates,
        versions=_versions(contents),
        loops=_loops(settings, figures),
        figures=tuple(
            FigureEntry(name=name, meaning=meaning, value=figures[name])
            for name, (_kind, meaning) in FIGURES.items()
            if name in figures
        ),
    )


@api.post("/site/senders/{name}/test")
def try_sender(context: Shared, person: Engineer, name: Name) -> Done:
    """Send a test message through a sender of the site file; the response states the outcome."""
    problem = try_senders(context.site.send, name=name, now=context.clock())[name]
    context.store.requests.audit(person.name, _TEST, name, problem or None, now=context.clock())
    return Done(sentence=f"{name} failed: {problem}" if problem else f"{name} sent a test message")


@pages.get("/site")
def show(request: Request, context: Shared, person: Viewer) -> Response:
    """Show the site."""
    detail = site(context, person)
    return page(
        request,
        "site.html",
        section="/site",
        site=detail,
        has_url=context.site.url is not None,
        may_test=person.role.includes(Role.ENGINEER),
        now_is={each.name: each.value for each in detail.figures},
        bytes=_bytes,
        figure=_figure,
    )


@pages.post("/site/senders/{name}/test")
def try_sender_by_form(context: Shared, form: EngineerForm, name: Name) -> Response:
    """Send a test message; the page shows the outcome."""
    try_sender(context, form.person, name)
    return RedirectResponse("/site#senders", 303)


def false_alarms(context: Context) -> FalseAlarms:
    """Return the configured rate of false alarms, and the one according to the verdicts.

    Notes
    -----
    A false alarm is an alert of the suspension of which the last verdict is "nothing found"; alerts that nobody looked
    at do not count. The days of driving are those of the windows analysed in the same period. The interval is the exact
    one of a Poisson count n in a time T: from the quantile 0.025 of a gamma distribution of shape n to the quantile
    0.975 of one of shape n + 1, both divided by T.

    References
    ----------
    F. Garwood (1936): Fiducial limits for the Poisson distribution, Biometrika 28, 437-442.
    """
    watch, since = context.site.watch, context.clock() - LIMITS.false_alarm_days * DAY
    judged = context.store.verdicts.judged(since=since)
    verdicts = [row.verdict for row, cause in judged if is_of_suspension(cause)]
    looked_at = [verdict for verdict in verdicts if verdict != "not looked at"]
    n_false = looked_at.count("nothing found")
    n_windows = n_windows_since(context.store, since)
    days = n_windows * watch.window_minutes / 60 / watch.hours_per_day
    interval = None
    if days:
        low = float(gammaincinv(n_false, TAIL)) / days if n_false else 0.0
        interval = (low, float(gammaincinv(n_false + 1, 1 - TAIL)) / days)
    return FalseAlarms(
        configured=watch.false_alarms_per_day,
        hours_per_day=watch.hours_per_day,
        days=LIMITS.false_alarm_days,
        vehicle_days=days,
        is_more=n_windows >= MAX_COUNTED,
        verdicts=len(looked_at),
        false=n_false,
        rate=n_false / days if days else None,
        interval=interval,
    )


def senders(context: Context) -> tuple[SenderEntry, ...]:
    """Return the senders of a site, each with its last test."""
    tests = {row.subject: row for row in context.store.requests.audited(act=_TEST, limit=LIMITS.max_tests)}
    given_up = context.store.alerts.given_up()
    send = context.site.send
    places = [
        ("log", "log", "log of the monitor"),  # these two every monitor has
        ("publish", "topic", "sprung/v1/VEHICLE/alert at the broker"),
        *((f"webhook {k}", "webhook", _origin(hook.url)) for k, hook in enumerate(send.webhook, start=1)),
        *(
            (f"mail {k}", "mail", f"{', '.join(mail.recipients)} by {mail.host}:{mail.port}")
            for k, mail in enumerate(send.mail, start=1)
        ),
        *((f"apprise {k}", "service", _kind_of_service(each.url)) for k, each in enumerate(send.apprise, start=1)),
    ]
    return tuple(
        SenderEntry(
            name=name,
            kind=kind,
            to=to,
            is_testable=kind in {"webhook", "mail", "service"},
            tested=None if (test := tests.get(name)) is None else test.time,
            tested_by=None if test is None else test.who,
            problem=None if test is None or not test.detail else str(test.detail),
            given_up=given_up.get(name),
        )
        for name, kind, to in places
    )


def settings_of(table: BaseModel, place: str = "") -> Iterator[SettingEntry]:
    """Yield the settings of a table and of those in it with where they come from; secrets are hidden."""
    for name, field in type(table).model_fields.items():
        value, key = getattr(table, name), f"{place}{field.alias or name}"
        if isinstance(value, BaseModel):
            yield from settings_of(value, f"{key}.")
        elif isinstance(value, list) and field.description is None:
            for number, entry in enumerate(value, start=1):
                yield from settings_of(entry, f"{key} {number}.")
        else:
            is_set = name in table.model_fields_set
            source = f"site file or {_OPTIONS[key]}" if key in _OPTIONS else "site file"
            hide = _HIDDEN.get((type(table), name))
            yield SettingEntry(
                key=key,
                value=_written(value if hide is None or value in (None, {}) else hide(value)),
                default="required" if field.is_required() else _written(field.get_default()),
                source=source if is_set else "default",
                description=field.description or "",
            )


def _written(value: Any) -> str:
    """Return a value as the site file writes it."""
    return "-" if value in (None, {}) else json.dumps(value, ensure_ascii=False)


def _hide_password(address: str) -> str:
    """Return an address without the secrets in it."""
    text = re.sub("//([^:/@]*):.*@", rf"//\1:{_SECRET}@", address)
    return re.sub(r"([?&][^=&]*pass[^=&]*=)[^&]*", rf"\1{_SECRET}", text, flags=re.IGNORECASE)


def _origin(url: str) -> str:
    """Return scheme and host of an address: the rest may be a secret."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}/{_SECRET}"


def _kind_of_service(url: str) -> str:
    """Return the kind of a service of apprise: all the rest of its address may be a secret."""
    return f"{url.partition(':')[0]}://{_SECRET}"


#: Visible parts of settings that may contain a secret.
_HIDDEN: Mapping[tuple[type[BaseModel], str], Callable[[Any], Any]] = {
    (Site, "broker"): _hide_password,
    (Site, "store"): _hide_password,
    (Site, "url"): _hide_password,
    (Keep, "lake"): _hide_password,
    (Keep, "results"): _hide_password,
    (Webhook, "url"): _origin,
    (Service, "url"): _kind_of_service,
    (Webhook, "headers"): lambda headers: dict.fromkeys(headers, _SECRET),
    (Mail, "password"): lambda _: _SECRET,
}


def _store(context: Context, contents: Contents) -> StoreEntry:
    """Return the store and its tables, the largest first."""
    keep = context.site.keep
    lengths = {
        f"keep.{name}": f"{days:g} days ({name})" for name, days in keep if name.endswith("_days") and days is not None
    }
    return StoreEntry(
        address=_hide_password(context.site.store),
        database=contents.database,
        size=context.store.size(),
        free=context.store.free(),
        min_free=round(1e6 * keep.free_megabytes),
        oldest=contents.oldest,
        tables=tuple(
            replace(each, stay=lengths.get(each.stay, each.stay))
            for each in sorted(contents.tables, key=lambda each: -each.rows)
        ),
    )


def _versions(contents: Contents) -> tuple[VersionEntry, ...]:
    """Return the versions of programs and libraries."""
    database, _, number = contents.database.partition(" ")
    named = {
        "Sprung": __version__,
        "Python": platform.python_version(),
        "schema of the store": contents.schema,
        database: number,
    }
    for name in _LIBRARIES.split():
        try:
            named[name] = version(name)
        except PackageNotFoundError:  # an extra that this site does not need
            continue
    named["operating system"] = platform.platform(terse=True)
    return tuple(VersionEntry(name=name, version=text) for name, text in named.items())


def _loops(site: Site, figures: Mapping[str, float]) -> tuple[LoopEntry, ...]:
    """Return the loops of the running monitor."""
    ages = {
        match[1]: age for key, age in figures.items() if (match := re.match(r'sprung_heartbeat.*\{loop="(.*)"\}', key))
    }
    senders = [name.removeprefix("post ") for name in ages if name.startswith("post ")]
    loops = loops_of(site.watch.seconds_per_job, senders)
    return tuple(
        LoopEntry(name=name, age=age, limit=loops[name].limit if name in loops else None) for name, age in ages.items()
    )


def _bytes(number: int) -> str:
    """Return a number of bytes in a unit that is easy to read."""
    size, unit = float(number), "B"
    for larger in ("kB", "MB", "GB", "TB"):
        if size < 1000:
            break
        size, unit = size / 1000, larger
    return f"{size:.3g} {unit}" if unit != "B" else f"{number} B"


def _figure(figure: FigureEntry) -> str:
    """Return the value of a figure with its unit."""
    if "_seconds" in figure.name:
        return f"{figure.value:.1f} s"
    if figure.name.endswith("_bytes"):
        return _bytes(round(figure.value))
    if figure.name.endswith("_ratio"):
        return f"{100 * figure.value:.1f} %"
    return f"{figure.value:,.0f}"
