"""The command `sprung alerts`: alerts in the store of a monitor, and what operators do to them."""

import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.options import Json, option
from sprung.cli.output import show, write_result, written
from sprung.online.commands.stores import DEFAULT_STORE, StoreUrl, Who, existing_store, group

if TYPE_CHECKING:
    from sprung.online.store import Store

Number = Annotated[int, typer.Argument(metavar="NUMBER", help="Alert number.", show_default=False)]
Comment = Annotated[str, option("TEXT", "Comment for the history.", "--comment", show_default=False)]
Vehicle = Annotated[str | None, option("ID", "Only alerts of this vehicle.", "--vehicle")]
Complete = Annotated[bool, typer.Option("--all", help="Include alerts that have returned to normal.")]


def list_alerts(
    *, store: StoreUrl = DEFAULT_STORE, vehicle: Vehicle = None, every: Complete = False, json: Json = None
) -> None:
    """List alerts, the most severe first."""
    with existing_store(store) as opened:
        _print_alerts(opened, json, vehicle=vehicle, is_complete=every)


application = group(list_alerts, "List alerts; sub-commands act on them.")


def _add_act(name: str, operation: str, text: str) -> None:
    """Add a sub-command that applies an operator action without options of its own."""

    @application.command(name, help=text)
    def act(
        number: Number, *, store: StoreUrl = DEFAULT_STORE, who: Who, comment: Comment = "", json: Json = None
    ) -> None:
        from sprung.online.monitor import operations

        _act(getattr(operations, operation), number, store=store, who=who, comment=comment, json=json)


_add_act("ack", "acknowledge", "Acknowledge an alert.")


@application.command()
def shelve(
    number: Number,
    *,
    hours: Annotated[float, option("H", "Hours without notifications.", min=0)] = 8.0,
    store: StoreUrl = DEFAULT_STORE,
    who: Who,
    comment: Comment = "",
    json: Json = None,
) -> None:
    """Suspend the notifications of an alert for some hours."""
    from sprung.online.monitor import operations

    _act(partial(operations.shelve, hours=hours), number, store=store, who=who, comment=comment, json=json)


_add_act("unshelve", "unshelve", "Resume the notifications of a shelved alert.")


@application.command()
def assign(
    number: Number,
    *,
    to: Annotated[str | None, option("NAME", "Assignee; omit to unassign.")] = None,
    store: StoreUrl = DEFAULT_STORE,
    who: Who,
    comment: Comment = "",
    json: Json = None,
) -> None:
    """Assign an alert to somebody."""
    from sprung.online.monitor import operations

    _act(partial(operations.assign, assignee=to), number, store=store, who=who, comment=comment, json=json)


_add_act("comment", "add_comment", "Add a comment to the history of an alert.")
_add_act("close", "close", "Clear an active alert whose cause was removed.")


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
    who: Who,
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
            new_baseline=new_baseline,
            who=who,
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


def _act(act: Callable[..., None], number: int, *, store: str, who: str, comment: str, json: str | None) -> None:
    """Apply an operator action of `sprung.online.monitor.operations` to an alert, and list all alerts."""
    with existing_store(store) as opened:
        act(opened, number, who=who, comment=comment, now=time.time_ns())
        _print_alerts(opened, json)


def _print_alerts(store: "Store", json: str | None, *, vehicle: str | None = None, is_complete: bool = True) -> None:
    """Print alerts as a table, as JSON, or both."""
    from sprung.online.monitor.operations import alerts_document
    from sprung.results import tables

    document = alerts_document(store, vehicle=vehicle, is_complete=is_complete)
    if write_result(document, json):
        show(tables.alerts_table(document) if document["alerts"] else ["no alerts"], written([], json))
