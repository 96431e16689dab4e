"""State of the monitor itself for the page of the site and the interface: values, no markup."""

import json
import platform
import re
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from urllib.parse import urlsplit

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from scipy.special import gammaincinv

from sprung import __version__
from sprung.online.alerts import is_of_suspension
from sprung.online.monitor import FIGURES
from sprung.online.monitor.certificates import certificates_of
from sprung.online.monitor.postman import try_senders
from sprung.online.monitor.site import Keep, Mail, Service, Site, Webhook
from sprung.online.monitor.station import loops_of
from sprung.online.site.context import Context
from sprung.online.site.site_models import (
    CertificateEntry,
    FalseAlarms,
    FigureEntry,
    LoopEntry,
    SenderEntry,
    SettingEntry,
    SiteDetail,
    StoreEntry,
    TableEntry,
    VersionEntry,
)
from sprung.online.store import MAX_COUNTED, Contents
from sprung.results.tables import counted

_DAY = 86400 * 10**9
#: Period of the false alarms that are counted [days].
_PERIOD = 90
#: Name of a test in the audit trail, and number of tests among which the last is sought.
_TEST, _MOST_TESTS = "sender tested", 200
#: Settings that the command line overrides, and what stands for a secret.
_OPTIONS = {"broker": "--broker", "store": "--store", "http": "--http"}
_SECRET = "(hidden)"
#: Senders that every monitor has: name, kind and where it sends.
_ALWAYS = (("log", "log", "log of the monitor"), ("publish", "topic", "sprung/v1/VEHICLE/alert at the broker"))
#: Libraries whose versions are shown.
_LIBRARIES = (
    "numpy",
    "scipy",
    "pyarrow",
    "pydantic",
    "sqlalchemy",
    "psycopg",
    "paho-mqtt",
    "cbor2",
    "fastapi",
    "uvicorn",
    "jinja2",
    "matplotlib",
)


def site_detail(context: Context) -> SiteDetail:
    """Return settings, store, senders and state of the monitor itself."""
    store, site, now = context.store, context.site, context.clock()
    contents, figures = store.contents(), context.figures()
    certificates = tuple(
        CertificateEntry(purpose=each.purpose, path=each.path, expires=each.expires, trouble=each.trouble(now))
        for each in certificates_of(site)
    )
    troubles = (*context.troubles(), *(each.trouble for each in certificates if each.trouble))
    return SiteDetail(
        name=site.name,
        sentence=_sentence(len(troubles)),
        troubles=troubles,
        is_open=context.is_open,
        vehicles=store.inbox.n_vehicles(),
        settings=tuple(settings_of(site)),
        store=_store(context, contents),
        false_alarms=false_alarms(context),
        senders=senders(context),
        certificates=certificates,
        versions=_versions(contents),
        loops=_loops(site, figures),
        figures=_figures(figures),
    )


def settings_of(site: Site) -> Iterator[SettingEntry]:
    """Yield all settings of a site file with their values and where they come from; secrets are hidden."""
    yield from _settings(site)


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
    watch, since = context.site.watch, context.clock() - _PERIOD * _DAY
    judged = context.store.verdicts.judged(since=since)
    verdicts = [row.verdict for row, cause in judged if is_of_suspension(cause)]
    looked_at = [verdict for verdict in verdicts if verdict != "not looked at"]
    n_false = looked_at.count("nothing found")
    n_windows = context.store.n_windows_since(since)
    days = n_windows * watch.window_minutes / 60 / watch.hours_per_day
    interval = None
    if days:
        low = float(gammaincinv(n_false, 0.025)) / days if n_false else 0.0
        interval = (low, float(gammaincinv(n_false + 1, 0.975)) / days)
    return FalseAlarms(
        configured=watch.false_alarms_per_day,
        hours_per_day=watch.hours_per_day,
        days=_PERIOD,
        vehicle_days=days,
        is_more=n_windows >= MAX_COUNTED,
        verdicts=len(looked_at),
        false=n_false,
        rate=n_false / days if days else None,
        interval=interval,
    )


def senders(context: Context) -> tuple[SenderEntry, ...]:
    """Return the senders of a site, each with its last test."""
    tests = {row.subject: row for row in context.store.requests.audited(act=_TEST, limit=_MOST_TESTS)}
    given_up = context.store.alerts.given_up()
    send = context.site.send
    hooks = [(f"webhook {k}", "webhook", _origin(hook.url)) for k, hook in enumerate(send.webhook, start=1)]
    mails = [
        (f"mail {k}", "mail", f"{', '.join(mail.recipients)} by {mail.host}:{mail.port}")
        for k, mail in enumerate(send.mail, start=1)
    ]
    services = [
        (f"apprise {k}", "service", _kind_of_service(service.url)) for k, service in enumerate(send.apprise, start=1)
    ]
    entries = []
    for name, kind, to in (*_ALWAYS, *hooks, *mails, *services):
        test = tests.get(name)
        entries.append(
            SenderEntry(
                name=name,
                kind=kind,
                to=to,
                is_testable=kind in {"webhook", "mail", "service"},
                tested=None if test is None else test.time,
                tested_by="" if test is None else test.who,
                problem="" if test is None else str(test.detail or ""),
                given_up=given_up.get(name, ""),
            )
        )
    return tuple(entries)


def try_sender(context: Context, name: str, *, who: str) -> str:
    """Send a test message through a sender, and return why that failed; empty if it was sent.

    Raises
    ------
    ParameterError
        If the site file has no sender of that name.
    """
    problem = try_senders(context.site.send, name=name, now=context.clock())[name]
    context.store.requests.audit(who, _TEST, name, problem or None, now=context.clock())
    return problem


def _sentence(n_troubles: int) -> str:
    """Return whether the monitor works."""
    if not n_troubles:
        return "The monitor works: no problem is known."
    return f"{counted(n_troubles, 'thing')} at this site {'needs' if n_troubles == 1 else 'need'} attention."


def _settings(table: BaseModel, place: str = "") -> Iterator[SettingEntry]:
    """Yield the settings of a table and of those in it."""
    for name, field in type(table).model_fields.items():
        value, key = getattr(table, name), f"{place}{field.alias or name}"
        if isinstance(value, BaseModel):
            yield from _settings(value, f"{key}.")
        elif isinstance(value, list) and field.description is None:
            for number, entry in enumerate(value, start=1):
                yield from _settings(entry, f"{key} {number}.")
        else:
            is_set = name in table.model_fields_set
            source = f"site file or {_OPTIONS[key]}" if key in _OPTIONS else "site file"
            yield SettingEntry(
                key=key,
                value=_shown(table, name, value),
                default=_default(field),
                source=source if is_set else "default",
                description=field.description or "",
            )


def _shown(table: BaseModel, name: str, value: Any) -> str:
    """Return a value as the site file writes it, without secrets."""
    if value in (None, {}):
        return "-"
    hide = _HIDDEN.get((type(table), name))
    return json.dumps(value if hide is None else hide(value), ensure_ascii=False)


def _default(field: FieldInfo) -> str:
    """Return a default as the site file writes it."""
    if field.is_required():
        return "required"
    default = field.get_default()
    return "-" if default in (None, {}) else json.dumps(default, ensure_ascii=False)


def _hide_password(address: str) -> str:
    """Return an address without the secrets in it."""
    text = re.sub("//([^:/@]*):.*@", rf"//\1:{_SECRET}@", address)
    return re.sub(r"([?&][^=&]*pass[^=&]*=)[^&]*", rf"\1{_SECRET}", text, flags=re.IGNORECASE)


def _origin(url: str) -> str:
    """Return scheme and host of an address: the rest may be a secret."""
    parts = urlsplit(url)
    port = "" if parts.port is None else f":{parts.port}"
    return f"{parts.scheme}://{parts.hostname}{port}/{_SECRET}"


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
    days = {name: value for name, value in keep if name.endswith("_days") and value is not None}
    lengths = {f"keep.{name}": f"{value:g} days ({name})" for name, value in days.items()}
    tables = sorted(contents.tables, key=lambda each: -each.rows)
    return StoreEntry(
        address=_hide_password(context.site.store),
        database=contents.database,
        size=context.store.size(),
        free=context.store.free(),
        least_free=round(1e6 * keep.free_megabytes),
        oldest=contents.oldest,
        tables=tuple(
            TableEntry(table=each.table, rows=each.rows, is_more=each.is_more, stay=lengths.get(each.stay, each.stay))
            for each in tables
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
    for name in _LIBRARIES:
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


def _figures(figures: Mapping[str, float]) -> tuple[FigureEntry, ...]:
    """Return the figures of the running monitor that are of the whole, in the order of `FIGURES`."""
    return tuple(
        FigureEntry(name=name, meaning=meaning, value=figures[name])
        for name, (_, meaning) in FIGURES.items()
        if name in figures
    )
