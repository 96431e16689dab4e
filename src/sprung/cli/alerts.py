"""The command `sprung alerts`: alerts in the store of a monitor, and what operators do to them."""

import getpass
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import Json
from sprung.cli.help import Command, Group
from sprung.cli.printing import console, notes, table
from sprung.cli.stores import DEFAULT_STORE, StoreUrl, Who, check_options_follow, existing_store, shown_time

if TYPE_CHECKING:
    from sprung.storage import Store

application = typer.Typer(cls=Group, invoke_without_command=True)

Number = Annotated[int, typer.Argument(metavar="NUMBER", help="Alert number.", show_default=False)]
Comment = Annotated[str, typer.Option("--comment", metavar="TEXT", help="Comment for the history.", show_default=False)]
Vehicle = Annotated[
    str | None, typer.Option("--vehicle", metavar="ID", help="Only alerts of this vehicle.", show_default=False)
]
Complete = Annotated[bool, typer.Option("--all", help="Include alerts that are normal again.")]


@application.callback()
def alerts(
    context: typer.Context,
    *,
    store: StoreUrl = DEFAULT_STORE,
    vehicle: Vehicle = None,
    every: Complete = False,
    json: Json = None,
) -> None:
    """List alerts; sub-commands acknowledge, shelve, assign or comment on them."""
    check_options_follow(context)
    if context.invoked_subcommand is None:
        list_alerts(store=store, vehicle=vehicle, every=every, json=json)


@application.command("list", cls=Command)
def list_alerts(
    *, store: StoreUrl = DEFAULT_STORE, vehicle: Vehicle = None, every: Complete = False, json: Json = None
) -> None:
    """List alerts, the most severe first."""
    with existing_store(store) as opened:
        _print_alerts(opened, json, vehicle=vehicle, is_complete=every)


@application.command(cls=Command)
def ack(
    number: Number, *, store: StoreUrl = DEFAULT_STORE, who: Who = None, comment: Comment = "", json: Json = None
) -> None:
    """Acknowledge an alert."""
    from sprung.monitor.desk import acknowledge

    with existing_store(store) as opened:
        acknowledge(opened, number, who=who or getpass.getuser(), comment=comment, now=time.time_ns())
        _print_alerts(opened, json)


@application.command(cls=Command)
def shelve(
    number: Number,
    *,
    hours: Annotated[float, typer.Option(metavar="H", help="Hours without notifications.", min=0)] = 8.0,
    store: StoreUrl = DEFAULT_STORE,
    who: Who = None,
    comment: Comment = "",
    json: Json = None,
) -> None:
    """Send no notifications of an alert for some hours."""
    from sprung.monitor import desk

    with existing_store(store) as opened:
        now = time.time_ns()
        desk.shelve(opened, number, hours=hours, who=who or getpass.getuser(), comment=comment, now=now)
        _print_alerts(opened, json)


@application.command(cls=Command)
def unshelve(
    number: Number, *, store: StoreUrl = DEFAULT_STORE, who: Who = None, comment: Comment = "", json: Json = None
) -> None:
    """End the shelf of an alert."""
    from sprung.monitor import desk

    with existing_store(store) as opened:
        desk.unshelve(opened, number, who=who or getpass.getuser(), comment=comment, now=time.time_ns())
        _print_alerts(opened, json)


@application.command(cls=Command)
def assign(
    number: Number,
    *,
    to: Annotated[
        str | None, typer.Option(metavar="NAME", help="Assignee; omit to unassign.", show_default=False)
    ] = None,
    store: StoreUrl = DEFAULT_STORE,
    who: Who = None,
    comment: Comment = "",
    json: Json = None,
) -> None:
    """Assign an alert to somebody."""
    from sprung.monitor import desk

    with existing_store(store) as opened:
        now = time.time_ns()
        desk.assign(opened, number, assignee=to, who=who or getpass.getuser(), comment=comment, now=now)
        _print_alerts(opened, json)


@application.command(cls=Command)
def comment(
    number: Number, *, comment: Comment = "", store: StoreUrl = DEFAULT_STORE, who: Who = None, json: Json = None
) -> None:
    """Add a comment to the history of an alert."""
    from sprung.monitor import desk

    with existing_store(store) as opened:
        desk.add_comment(opened, number, who=who or getpass.getuser(), comment=comment, now=time.time_ns())
        _print_alerts(opened, json)


@application.command(cls=Command)
def history(number: Number, *, store: StoreUrl = DEFAULT_STORE, json: Json = None) -> None:
    """Show what happened to an alert, by whom, and when."""
    from sprung.monitor.desk import history_document

    with existing_store(store) as opened:
        document = history_document(opened, number)
    if json is not None:
        write_json(document, json)
    if json != "-":
        rows = [
            (shown_time(entry["time"]), _event(entry), entry["who"] or "the monitor", entry["comment"])
            for entry in document["history"]
        ]
        console().print(table("", ("time (UTC)", "what", "by", "comment"), rows, n_words=3))


def _print_alerts(store: "Store", json: str | None, *, vehicle: str | None = None, is_complete: bool = True) -> None:
    """Print alerts as a table, as JSON, or both."""
    from sprung.monitor.desk import alerts_document

    document = alerts_document(store, vehicle=vehicle, is_complete=is_complete)
    if json is not None:
        write_json(document, json)
    if json == "-":
        return
    rows = [
        (
            str(alert["number"]),
            alert["vehicle"],
            _with_end_of_shelf(alert["state"], alert["shelved_until"]),
            shown_time(alert["raised"]),
            str(alert["severity"]),
            alert["assignee"] or "",
            alert["text"],
        )
        for alert in document["alerts"]
    ]
    columns = ("number", "vehicle", "state", "raised (UTC)", "severity", "assigned to", "what")
    console().print(table("", columns, rows, n_words=3) if rows else notes(["no alerts"]))


def _event(entry: dict[str, Any]) -> str:
    """Return what happened to an alert, in words."""
    if entry["what"] == "assigned":
        return f"assigned to {entry['assignee'] or 'nobody'}"
    return _with_end_of_shelf(entry["what"], entry["shelved_until"])


def _with_end_of_shelf(what: str, shelved_until: int | None) -> str:
    """Return a state or event, with the end of the shelf where it is one."""
    is_shelf = what == "shelved" and shelved_until is not None
    return f"shelved until {shown_time(shelved_until or 0)} UTC" if is_shelf else what
