"""The command `sprung alerts`: alerts in the store of a monitor, and what operators do to them."""

import getpass
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.options import Json, option
from sprung.cli.output import show, write_result, written
from sprung.online.commands.stores import DEFAULT_STORE, StoreUrl, Who, check_options_follow, existing_store

if TYPE_CHECKING:
    from sprung.online.store import Store

application = typer.Typer(invoke_without_command=True)

Number = Annotated[int, typer.Argument(metavar="NUMBER", help="Alert number.", show_default=False)]
Comment = Annotated[str, option("TEXT", "Comment for the history.", "--comment", show_default=False)]
Vehicle = Annotated[str | None, option("ID", "Only alerts of this vehicle.", "--vehicle")]
Complete = Annotated[bool, typer.Option("--all", help="Include alerts that have returned to normal.")]


@application.callback()
def alerts(
    context: typer.Context,
    *,
    store: StoreUrl = DEFAULT_STORE,
    vehicle: Vehicle = None,
    every: Complete = False,
    json: Json = None,
) -> None:
    """List alerts; sub-commands act on them."""
    check_options_follow(context)
    if context.invoked_subcommand is None:
        list_alerts(store=store, vehicle=vehicle, every=every, json=json)


@application.command("list")
def list_alerts(
    *, store: StoreUrl = DEFAULT_STORE, vehicle: Vehicle = None, every: Complete = False, json: Json = None
) -> None:
    """List alerts, the most severe first."""
    with existing_store(store) as opened:
        _print_alerts(opened, json, vehicle=vehicle, is_complete=every)


@application.command()
def ack(
    number: Number, *, store: StoreUrl = DEFAULT_STORE, who: Who = None, comment: Comment = "", json: Json = None
) -> None:
    """Acknowledge an alert."""
    from sprung.online.monitor import operations

    _act(operations.acknowledge, number, store=store, who=who, comment=comment, json=json)


@application.command()
def shelve(
    number: Number,
    *,
    hours: Annotated[float, option("H", "Hours without notifications.", min=0)] = 8.0,
    store: StoreUrl = DEFAULT_STORE,
    who: Who = None,
    comment: Comment = "",
    json: Json = None,
) -> None:
    """Suspend the notifications of an alert for some hours."""
    from sprung.online.monitor import operations

    _act(partial(operations.shelve, hours=hours), number, store=store, who=who, comment=comment, json=json)


@application.command()
def unshelve(
    number: Number, *, store: StoreUrl = DEFAULT_STORE, who: Who = None, comment: Comment = "", json: Json = None
) -> None:
    """Resume the notifications of a shelved alert."""
    from sprung.online.monitor import operations

    _act(operations.unshelve, number, store=store, who=who, comment=comment, json=json)


@application.command()
def assign(
    number: Number,
    *,
    to: Annotated[str | None, option("NAME", "Assignee; omit to unassign.")] = None,
    store: StoreUrl = DEFAULT_STORE,
    who: Who = None,
    comment: Comment = "",
    json: Json = None,
) -> None:
    """Assign an alert to somebody."""
    from sprung.online.monitor import operations

    _act(partial(operations.assign, assignee=to), number, store=store, who=who, comment=comment, json=json)


@application.command()
def comment(
    number: Number, *, comment: Comment = "", store: StoreUrl = DEFAULT_STORE, who: Who = None, json: Json = None
) -> None:
    """Add a comment to the history of an alert."""
    from sprung.online.monitor import operations

    _act(operations.add_comment, number, store=store, who=who, comment=comment, json=json)


@application.command()
def close(
    number: Number, *, store: StoreUrl = DEFAULT_STORE, who: Who = None, comment: Comment = "", json: Json = None
) -> None:
    """Clear an active alert whose cause was removed."""
    from sprung.online.monitor import operations

    _act(operations.close, number, store=store, who=who, comment=comment, json=json)


@application.command()
def verdict(
    number: Number,
    *,
    verdict: Annotated[
        str,
        option("WORD", "confirmed, 'another part', 'nothing found' or 'not looked at'.", "--verdict"),
    ],
    part: Annotated[str, option("TEXT", "Part that was found instead.", "--part", show_default=False)] = "",
    action: Annotated[str, option("TEXT", "What was done.", "--action", show_default=False)] = "",
    new_baseline: Annotated[bool, typer.Option("--new-baseline", help="Learn a new baseline and clear the alert.")] = (
        False
    ),
    store: StoreUrl = DEFAULT_STORE,
    who: Who = None,
    json: Json = None,
) -> None:
    """Record what the workshop found and did."""
    from sprung.online.monitor import operations

    with existing_store(store) as opened:
        operations.add_verdict(
            opened,
            number,
            verdict=verdict,
            part=part,
            action=action,
            is_new_baseline=new_baseline,
            who=who or getpass.getuser(),
            now=time.time_ns(),
        )
        _print_alerts(opened, json)


@application.command()
def history(number: Number, *, store: StoreUrl = DEFAULT_STORE, json: Json = None) -> None:
    """Show what happened to an alert, when, and by whom."""
    from sprung.online.monitor.operations import history_document
    from sprung.results import tables

    with existing_store(store) as opened:
        document = history_document(opened, number)
    if write_result(document, json):
        show(tables.alert_history_table(document), written([], json))


def _act(act: Callable[..., None], number: int, *, store: str, who: str | None, comment: str, json: str | None) -> None:
    """Apply an operator action of `sprung.online.monitor.operations` to an alert, and list all alerts."""
    with existing_store(store) as opened:
        act(opened, number, who=who or getpass.getuser(), comment=comment, now=time.time_ns())
        _print_alerts(opened, json)


def _print_alerts(store: "Store", json: str | None, *, vehicle: str | None = None, is_complete: bool = True) -> None:
    """Print alerts as a table, as JSON, or both."""
    from sprung.online.monitor.operations import alerts_document
    from sprung.results import tables

    document = alerts_document(store, vehicle=vehicle, is_complete=is_complete)
    if write_result(document, json):
        show(tables.alerts_table(document) if document["alerts"] else ["no alerts"], written([], json))
