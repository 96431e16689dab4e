"""The command `sprung vehicles`: what a monitor knows of its vehicles, and requests to it."""

import getpass
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import Json
from sprung.cli.help import Command, Group
from sprung.cli.printing import console, notes, table
from sprung.cli.progress import progress_bar
from sprung.cli.stores import DEFAULT_STORE, StoreUrl, Who, check_options_follow, existing_store, shown_time
from sprung.errors import DataError, ParameterError

if TYPE_CHECKING:
    from sprung.storage import CommandRow, Store

application = typer.Typer(cls=Group, invoke_without_command=True)

VehicleName = Annotated[str, typer.Argument(metavar="ID", help="Name of the vehicle.", show_default=False)]
# Time between looks at a request [s].
_LOOK = 0.2


@application.callback()
def vehicles(context: typer.Context, *, store: StoreUrl = DEFAULT_STORE, json: Json = None) -> None:
    """List the monitored vehicles; sub-commands have one learn a new baseline, or request samples from its box."""
    check_options_follow(context)
    if context.invoked_subcommand is None:
        list_vehicles(store=store, json=json)


@application.command("list", cls=Command)
def list_vehicles(*, store: StoreUrl = DEFAULT_STORE, json: Json = None) -> None:
    """List the monitored vehicles and the open requests."""
    with existing_store(store) as opened:
        _print_vehicles(opened, json, [_open_request(row) for row in opened.requests.open_commands()])


@application.command(cls=Command)
def learn(
    vehicle: VehicleName,
    *,
    reason: Annotated[
        str, typer.Option(metavar="TEXT", help="Reason, such as 'new dampers'; required.", show_default=False)
    ] = "",
    store: StoreUrl = DEFAULT_STORE,
    who: Who = None,
    json: Json = None,
) -> None:
    """Have a vehicle learn a new baseline, such as after maintenance."""
    from sprung.monitor import Site, desk

    with existing_store(store) as opened:
        desk.relearn(opened, vehicle, reason=reason, who=who or getpass.getuser(), now=time.time_ns())
        sentence = (
            f"{vehicle} will relearn its baseline ({reason.strip()!r}) from its next usable windows "
            f"(learning_windows of the site file, default {Site().watch.learning_windows}); change detection resumes "
            "after that"
        )
        _print_vehicles(opened, json, [sentence])


@application.command(cls=Command)
def raw(
    vehicle: VehicleName,
    *,
    minutes: Annotated[float, typer.Option(metavar="M", help="Minutes to look back.", min=0)] = 30.0,
    wait: Annotated[
        float, typer.Option(metavar="SECONDS", help="Longest wait for the samples; the request stays open.", min=0)
    ] = 60.0,
    store: StoreUrl = DEFAULT_STORE,
    who: Who = None,
    json: Json = None,
) -> None:
    """Request the latest samples of a vehicle whose box identifies on board."""
    from sprung.monitor.desk import request_samples

    with existing_store(store) as opened:
        now = time.time_ns()
        number = request_samples(opened, vehicle, minutes=minutes, who=who or getpass.getuser(), now=now)
        _print_vehicles(opened, json, [_outcome(opened, _wait_for(opened, number, wait), wait)])


def _print_vehicles(store: "Store", json: str | None, sentences: list[str]) -> None:
    """Print vehicles as a table with sentences under it, as JSON, or both."""
    from sprung.monitor.desk import vehicles_document

    document = vehicles_document(store)
    if json is not None:
        write_json(document, json)
    if json == "-":
        return
    rows = [
        (
            vehicle["vehicle"],
            str(vehicle["windows"]),
            str(vehicle["baseline"] or ""),
            f"{vehicle['health_index']:.0f}",
            shown_time(vehicle["last_seen"]),
            vehicle["state"],
        )
        for vehicle in document["vehicles"]
    ]
    columns = ("vehicle", "windows", "baseline", "health index", "last seen (UTC)", "state")
    screen = console()
    screen.print(table("", columns, rows))
    if sentences:
        screen.print(notes(sentences))


def _wait_for(store: "Store", number: int, wait: float) -> "CommandRow":
    """Return a request for samples when it is done, or a time [s] has passed."""
    end = time.monotonic() + wait
    with progress_bar() as report:
        while True:
            row = store.requests.command(number)
            if row is None:
                raise ParameterError(f"request {number} is no longer in the store: repeat it")
            if row.done is not None or time.monotonic() >= end:
                return row
            report(f"waiting for samples of {row.vehicle}", 0.0)
            time.sleep(_LOOK)


def _outcome(store: "Store", row: "CommandRow", wait: float) -> str:
    """Return what came of a request for samples."""
    if row.done is None and not wait:
        return _open_request(row)
    if row.done is None:
        known = store.inbox.vehicle(row.vehicle)
        seen = "never" if known is None else f"at {shown_time(known.last_seen)} UTC"
        raise DataError(
            f"no samples {_span(row.detail)} of {row.vehicle} within {wait:g} s (last seen {seen}): check that its box "
            "and the monitor run; the request stays open and is sent again when the vehicle is next seen"
        )
    if not row.detail["frames"]:
        raise DataError(f"no samples {_span(row.detail['asked'])} of {row.vehicle}: {row.detail['reason']}")
    return f"received samples {_span(row.detail)} of {row.vehicle}, {row.detail['frames']} frames"


def _open_request(row: "CommandRow") -> str:
    """Return the sentence about an open request."""
    what = f"samples {_span(row.detail)}" if row.act == "raw" else f"new baseline ({row.detail!r})"
    return f"{row.vehicle}: {what} requested at {shown_time(row.created)} UTC, not yet done"


def _span(times: dict[str, Any]) -> str:
    """Return begin and end of samples in words."""
    begin, end = shown_time(times["from"]), shown_time(times["to"])
    return f"{begin} to {end.removeprefix(begin[:11])} UTC"
