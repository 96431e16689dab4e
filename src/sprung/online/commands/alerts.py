"""The command `sprung alerts`: alerts in the store of a monitor, and what operators do to them."""

import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sprung.cli.options import option
from sprung.online.commands.stores import Found, group, on_store

if TYPE_CHECKING:
    from sprung.online.store import Store

Number = Annotated[int, typer.Argument(metavar="NUMBER", help="Alert number.", show_default=False)]
Comment = Annotated[str, option("TEXT", "Comment for the history.", "--comment", show_default=False)]
Vehicle = Annotated[str | None, option("ID", "Only alerts of this vehicle.", "--vehicle")]
Complete = Annotated[bool, typer.Option("--all", help="Include alerts that have returned to normal.")]


@on_store
def list_alerts(store: "Store", *, vehicle: Vehicle = None, every: Complete = False) -> Found:
    """List alerts, the most severe first."""
    return _alerts(store, vehicle=vehicle, is_complete=every)


application = group(list_alerts, "List alerts; sub-commands act on them.")


def _add_act(name: str, operation: str, text: str) -> None:
    """Add a sub-command that applies an operator action without options of its own."""

    @application.command(name, help=text)
    @on_store
    def act(store: "Store", number: Number, *, comment: Comment = "", who: str) -> Found:
        return _act(store, number, operation, comment=comment, who=who)


_add_act("ack", "acknowledge", "Acknowledge an alert.")


@application.command()
@on_store
def shelve(
    store: "Store",
    number: Number,
    *,
    hours: Annotated[float, option("H", "Hours without notifications.", min=0)] = 8.0,
    comment: Comment = "",
    who: str,
) -> Found:
    """Suspend the notifications of an alert for some hours."""
    return _act(store, number, "shelve", hours=hours, comment=comment, who=who)


_add_act("unshelve", "unshelve", "Resume the notifications of a shelved alert.")


@application.command()
@on_store
def assign(
    store: "Store",
    number: Number,
    *,
    to: Annotated[str | None, option("NAME", "Assignee; omit to unassign.")] = None,
    comment: Comment = "",
    who: str,
) -> Found:
    """Assign an alert to somebody."""
    return _act(store, number, "assign", assignee=to, comment=comment, who=who)


_add_act("comment", "add_comment", "Add a comment to the history of an alert.")
_add_act("close", "close", "Clear an active alert whose cause was removed.")


@application.command()
@on_store
def verdict(
    store: "Store",
    number: Number,
    *,
    verdict: Annotated[
        str, option("WORD", "confirmed, 'another part', 'nothing found' or 'not looked at'.", "--verdict")
    ],
    part: Annotated[str, option("TEXT", "Part that was found instead.", "--part", show_default=False)] = "",
    action: Annotated[str, option("TEXT", "What was done.", "--action", show_default=False)] = "",
    new_baseline: Annotated[
        bool, typer.Option("--new-baseline", help="Learn a new baseline and clear the alert.")
    ] = False,
    who: str,
) -> Found:
    """Record what the workshop found and did."""
    given = {"verdict": verdict, "part": part, "action": action, "new_baseline": new_baseline}
    return _act(store, number, "add_verdict", **given, who=who)


@application.command()
@on_store
def history(store: "Store", number: Number) -> Found:
    """Show what happened to an alert, when, and by whom."""
    from sprung.online.monitor.operations import history_document
    from sprung.results import tables

    document = history_document(store, number)
    return Found(document, [tables.alert_history_table(document)])


def _act(store: "Store", number: int, operation: str, **given: Any) -> Found:
    """Apply an operator action of `sprung.online.monitor.operations` to an alert, and return all alerts."""
    from sprung.online.monitor import operations

    getattr(operations, operation)(store, number, **given, now=time.time_ns())
    return _alerts(store)


def _alerts(store: "Store", *, vehicle: str | None = None, is_complete: bool = True) -> Found:
    from sprung.online.monitor.operations import alerts_document
    from sprung.results import tables

    document = alerts_document(store, vehicle=vehicle, is_complete=is_complete)
    return Found(document, [tables.alerts_table(document) if document["alerts"] else ["no alerts"]])
