"""The commands `sprung alerts` and `sprung vehicles`: what the monitor has in its store, and what people do to it."""

import getpass
import time
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import Json
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.errors import DataError, ParameterError

if TYPE_CHECKING:
    from sprung.alerting import Alert, Transition
    from sprung.storage import CommandRow, Store

_ACTS = "ack, shelve, unshelve, assign, comment or history"

StoreUrl = Annotated[str, typer.Option("--store", metavar="URL", help="sqlite:///FILE or postgresql://USER@HOST/NAME.")]
Who = Annotated[str | None, typer.Option("--who", metavar="NAME", help="Who does it.", show_default="the user")]
_DEFAULT = "sqlite:///sprung-data/sprung.sqlite"
# Seconds between looks at whether samples have come.
_LOOK = 0.2


def alerts(
    act: Annotated[
        str | None, typer.Argument(metavar="[ACT", help=f"{_ACTS}; without it: list.", show_default=False)
    ] = None,
    number: Annotated[int | None, typer.Argument(metavar="NUMBER]", help="Of the alert.", show_default=False)] = None,
    *,
    store: StoreUrl = _DEFAULT,
    vehicle: Annotated[
        str | None, typer.Option(metavar="ID", help="Alerts of this vehicle only.", show_default=False)
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="List those that are normal again, too.")] = False,
    who: Who = None,
    comment: Annotated[str, typer.Option(metavar="TEXT", help="For the history.", show_default=False)] = "",
    hours: Annotated[float, typer.Option(metavar="H", help="How long to shelve.", min=0)] = 8.0,
    to: Annotated[
        str | None, typer.Option(metavar="NAME", help="Whom to assign to; nobody without it.", show_default=False)
    ] = None,
    json: Json = None,
) -> None:
    """List alerts, and acknowledge, shelve, assign or comment on them."""
    with _opened(store) as opened:
        if act is not None:
            if number is None:
                raise ParameterError(f"sprung alerts {act} needs the number of an alert: see sprung alerts")
            if act == "history":
                _history(opened, number, json)
                return
            _acted(opened, act, number, who=who or getpass.getuser(), comment=comment, hours=hours, to=to)
        found = _rows(opened, vehicle, every or act is not None)
    if json is not None:
        write_json({"schema": "sprung.alerts/1", "alerts": found}, json)
    if json != "-":
        _show(found)


def vehicles(
    act: Annotated[
        str | None, typer.Argument(metavar="[ACT", help="learn or raw; without it: list.", show_default=False)
    ] = None,
    vehicle: Annotated[str | None, typer.Argument(metavar="ID]", show_default=False)] = None,
    *,
    store: StoreUrl = _DEFAULT,
    reason: Annotated[
        str, typer.Option(metavar="TEXT", help="Why to learn again, such as 'new dampers'.", show_default=False)
    ] = "",
    minutes: Annotated[
        float, typer.Option(metavar="M", help="How far back to ask a box for its samples.", min=0)
    ] = 30.0,
    wait: Annotated[
        float, typer.Option(metavar="SECONDS", help="How long to wait for those samples; the request stays.", min=0)
    ] = 60.0,
    who: Who = None,
    json: Json = None,
) -> None:
    """List the vehicles that a monitor watches; have it learn again what is normal, or ask a box for its samples."""
    with _opened(store) as opened:
        said = [_waiting(row) for row in opened.requests.open_commands()]
        if act is not None:
            number = _asked(opened, act, vehicle, who=who or getpass.getuser(), reason=reason, minutes=minutes)
            said = [_done(opened, number, wait)]
        found = [_summary(opened, row.vehicle, row.last_seen) for row in opened.inbox.vehicles()]
    if json is not None:
        write_json({"schema": "sprung.vehicles/1", "vehicles": found}, json)
    if json == "-":
        return
    rows = [
        (
            one["vehicle"],
            str(one["windows"]),
            str(one["baseline"] or ""),
            f"{one['health_index']:.0f}",
            _when(one["last_seen"]),
            one["state"],
        )
        for one in found
    ]
    columns = ("vehicle", "windows", "baseline", "health index", "last seen (UTC)", "state")
    screen = console()
    screen.print(table("", columns, rows))
    if said:
        screen.print(notes(said))


def _opened(url: str) -> "Store":
    """Open a store that is there."""
    from sprung.storage import open_store

    if url.startswith("sqlite:///") and not Path(url.removeprefix("sqlite:///")).exists():
        raise ParameterError(f"there is no store {url}: give that of the monitor with --store")
    return open_store(url)


def _rows(store: "Store", vehicle: str | None, every: bool) -> list[dict[str, Any]]:
    """Return alerts as plain values."""
    from sprung.alerting import state_name
    from sprung.monitor import alert_of

    found = []
    for row in store.alerts.find(vehicle=vehicle):
        state = state_name(alert_of(row))
        if row.count and (every or state != "normal"):
            found.append(
                {
                    "number": row.id,
                    "vehicle": row.vehicle,
                    "cause": row.cause,
                    "severity": row.severity,
                    "state": state,
                    "raised": row.raised,
                    "count": row.count,
                    "assignee": row.assignee,
                    "shelved_until": row.shelved_until,
                    "text": row.text,
                }
            )
    return found


def _show(found: list[dict[str, Any]]) -> None:
    """Print alerts."""
    screen = console()
    if not found:
        screen.print(notes(["no alert"]))
        return
    rows = [
        (
            str(one["number"]),
            one["vehicle"],
            _until(one["state"], one["shelved_until"]),
            _when(one["raised"]),
            str(one["severity"]),
            one["assignee"] or "",
            one["text"],
        )
        for one in found
    ]
    columns = ("number", "vehicle", "state", "raised (UTC)", "severity", "assigned to", "what")
    screen.print(table("", columns, rows, n_words=3))


def _history(store: "Store", number: int, json: str | None) -> None:
    """Print what happened to an alert, by whom, to whom and until when."""
    found = [asdict(row) for row in store.alerts.history(number)]
    if not found:
        raise ParameterError(f"there is no alert {number}: see sprung alerts --all")
    if json is not None:
        entries = [{name: value for name, value in one.items() if name not in {"id", "alert"}} for one in found]
        write_json({"schema": "sprung.alert-history/1", "number": number, "history": entries}, json)
    if json != "-":
        rows = [(_when(one["time"]), _happened(one), one["who"] or "the monitor", one["comment"]) for one in found]
        console().print(table("", ("time (UTC)", "what", "by", "comment"), rows, n_words=3))


def _happened(entry: dict[str, Any]) -> str:
    """Return what happened to an alert, in words."""
    if entry["what"] == "assigned":
        return f"assigned to {entry['assignee'] or 'nobody'}"
    return _until(entry["what"], entry["shelved_until"])


def _until(what: str, shelved_until: int | None) -> str:
    """Return a state or change, and until when where that is a shelf."""
    return what if what != "shelved" or shelved_until is None else f"shelved until {_when(shelved_until)} UTC"


def _acted(store: "Store", act: str, number: int, *, who: str, comment: str, hours: float, to: str | None) -> None:
    """Do something to an alert, on the record."""
    from sprung.alerting import AlertSettings, acknowledged, assigned, commented, shelved, unshelved
    from sprung.monitor import AlertBook, alert_of

    row = next((one for one in store.alerts.find() if one.id == number), None)
    if row is None:
        raise ParameterError(f"there is no alert {number}: see sprung alerts --all")
    now = time.time_ns()
    acts: dict[str, Callable[[Alert], Transition]] = {
        "ack": partial(acknowledged, who=who, now=now, comment=comment),
        "shelve": partial(shelved, who=who, until=now + round(3600e9 * hours), now=now, comment=comment),
        "unshelve": partial(unshelved, who=who, now=now, comment=comment),
        "assign": partial(assigned, who=who, assignee=to, now=now, comment=comment),
        "comment": partial(commented, who=who, now=now, comment=comment),
    }
    if act not in acts:
        raise ParameterError(f"sprung alerts {act}: the acts are {_ACTS}")
    AlertBook(store, AlertSettings()).act(alert_of(row), acts[act], now=now)
    store.requests.audit(who, act, f"{row.vehicle} {row.cause}", comment or None, now=now)


def _asked(store: "Store", act: str, vehicle: str | None, *, who: str, reason: str, minutes: float) -> int:
    """Ask something of the monitor, and return the number of the request."""
    if act not in {"learn", "raw"} or vehicle is None:
        raise ParameterError("write sprung vehicles, sprung vehicles learn ID --reason TEXT or sprung vehicles raw ID")
    if act == "learn" and not reason.strip():
        raise ParameterError(f"learning {vehicle} again needs --reason TEXT, such as 'new dampers'")
    if vehicle not in {row.vehicle for row in store.inbox.vehicles()}:
        raise ParameterError(f"the store knows no vehicle {vehicle!r}: see sprung vehicles")
    now = time.time_ns()
    detail = reason.strip() if act == "learn" else {"from": now - round(60e9 * minutes), "to": now}
    return store.requests.add_command(who, vehicle, act, detail, now=now)


def _done(store: "Store", number: int, wait: float) -> str:
    """Return what comes of a request; samples are waited for."""
    row = _awaited(store, number, wait)
    if row.act == "learn":
        return (
            f"{row.vehicle} is to learn again what is normal, because of {row.detail!r}: the monitor takes its next"
            " good windows for that (12, unless the site file says otherwise), and looks for changes again after them"
        )
    if row.done is None and not wait:
        return _waiting(row)
    if row.done is None:
        (heard,) = (one.last_seen for one in store.inbox.vehicles() if one.vehicle == row.vehicle)
        raise DataError(
            f"samples {_span(row.detail)} of {row.vehicle} have not come within {wait:g} s: it was last heard at"
            f" {_when(heard)} UTC: see whether its box and the monitor run; the request stays, and goes out again when"
            f" {row.vehicle} is next heard (sprung vehicles shows whether it is still open)"
        )
    if not row.detail["frames"]:
        asked = _span(row.detail["asked"])
        raise DataError(f"no samples {asked} of {row.vehicle} came: {row.detail['reason']}")
    return f"samples {_span(row.detail)} of {row.vehicle} came, {row.detail['frames']} frames"


def _awaited(store: "Store", number: int, wait: float) -> "CommandRow":
    """Return a request when it is done, or a time [s] has passed; only samples are waited for."""
    end = time.monotonic() + wait
    with progress_bar() as report:
        while True:
            row = store.requests.command(number)
            if row is None:
                raise ParameterError(f"request {number} is gone from the store: ask again")
            if row.act != "raw" or row.done is not None or time.monotonic() >= end:
                return row
            report(f"waiting for samples of {row.vehicle}", 0.0)
            time.sleep(_LOOK)


def _waiting(row: "CommandRow") -> str:
    """Return what is asked of the monitor, and not yet done."""
    what = f"samples {_span(row.detail)}" if row.act == "raw" else f"learning again, because of {row.detail!r}"
    return f"{row.vehicle}: {what}: asked for at {_when(row.created)} UTC, and not yet done"


def _span(times: dict[str, int]) -> str:
    """Return begin and end of samples in words."""
    begin, end = _when(times["from"]), _when(times["to"])
    return f"{begin} to {end.removeprefix(begin[:11])} UTC"


def _summary(store: "Store", vehicle: str, last_seen: int) -> dict[str, Any]:
    """Return what is known of a vehicle."""
    from sprung.alerting import health_index
    from sprung.monitor import alert_of

    observations = store.results.observations(vehicle)
    baselines = store.results.baselines(vehicle)
    active = [alert_of(row) for row in store.alerts.find(vehicle=vehicle, is_active=True)]
    last = observations[-1].document if observations else None
    state = "; ".join(alert.text for alert in active)
    on_board = [entry.document for entry in store.results.modes(vehicle) if entry.document.get("is_on_board")]
    if not state and on_board and not observations:
        state = f"identifies on board: {len(on_board)} windows of modes"
    if not state:
        state = "learning" if not baselines else (last["reason"] if last and last["reason"] else "no alert")
    return {
        "vehicle": vehicle,
        "windows": len(observations),
        "baseline": baselines[-1].version if baselines else None,
        "health_index": health_index(active),
        "last_seen": last_seen,
        "modes": last["modes"] if last else on_board[-1]["modes"] if on_board else None,
        "state": state,
    }


def _when(time_: int) -> str:
    """Return a time in words."""
    return f"{datetime.fromtimestamp(time_ / 1e9, tz=UTC):%Y-%m-%d %H:%M}"
