"""The commands `sprung alerts`, `sprung vehicles` and `sprung report`: the store of a monitor, and requests to it."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.cli.options import OUTPUT, Json, Since, Until, check_file, option
from sprung.cli.output import progress_bar, show, write_pieces, write_result, written
from sprung.errors import ParameterError
from sprung.online.commands.stores import DEFAULT_STORE, Found, StoreUrl, existing_store, group, on_store

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


alerts_application = group(list_alerts, "List alerts; sub-commands act on them.")


def _add_act(name: str, operation: str, text: str) -> None:
    """Add a sub-command that applies an operator action without options of its own."""

    @alerts_application.command(name, help=text)
    @on_store
    def act(store: "Store", number: Number, *, comment: Comment = "", who: str) -> Found:
        return _act(store, number, operation, comment=comment, who=who)


_add_act("ack", "acknowledge", "Acknowledge an alert.")


@alerts_application.command()
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


@alerts_application.command()
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


@alerts_application.command()
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


@alerts_application.command()
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


#: Endings of the pages that can be written.
_PAGES = (".html", ".htm", ".pdf")

VehicleName = Annotated[str, typer.Argument(metavar="ID", help="Name of the vehicle.", show_default=False)]


@on_store
def list_vehicles(store: "Store") -> Found:
    """List the monitored vehicles and the open requests."""
    from sprung.online.monitor.operations import describe_request

    return _vehicles(store, *map(describe_request, store.requests.open_commands()))


application = group(
    list_vehicles,
    "List the monitored vehicles. Sub-commands rank them, show the quarantine, or request baselines or samples.",
)


@application.command()
@on_store
def rank(
    store: "Store",
    *,
    rate: Annotated[float, option("SHARE", "Expected share of healthy vehicles among those that deviate.")] = 0.05,
) -> Found:
    """Rank the vehicles of each type by deviation from the others. A type is a vehicle file."""
    from sprung.online.monitor.operations import NO_VEHICLES, ranking_document
    from sprung.results import tables

    document = ranking_document(store, rate=rate)
    notes = document["notes"] or ([] if document["types"] else [NO_VEHICLES])
    notes = [*filter(None, map(tables.describe_next_inspection, document["types"])), *notes]
    return Found(document, tables.fleet_tables(document), notes)


@application.command()
@on_store
def quarantine(
    store: "Store",
    vehicle: Annotated[str, typer.Argument(metavar="[ID]", help="Name of the vehicle.", show_default=False)] = "",
    *,
    again: Annotated[
        bool, typer.Option("--again", help="Analyse the frames again with this version; nothing is stored.")
    ] = False,
) -> Found:
    """List frames and states that could not be analysed. They were quarantined, such as after an upgrade."""
    from sprung.online.monitor.operations import quarantine_document
    from sprung.results import tables

    document = quarantine_document(store, vehicle=vehicle, is_analysed=again)
    table = tables.quarantine_table(document)
    return Found(document, [table if document["quarantined"] else ["nothing is quarantined"]])


@application.command()
@on_store
def learn(
    store: "Store",
    vehicle: VehicleName,
    *,
    reason: Annotated[str, option("TEXT", "Reason, such as 'new dampers'; required.", show_default=False)] = "",
    mileage: Annotated[float | None, option("KM", "Mileage of the vehicle in km. Default: unknown.", min=0)] = None,
    who: str,
) -> Found:
    """Learn a new baseline of a vehicle, such as after maintenance."""
    from sprung.online.monitor.operations import describe_relearning, relearn

    relearn(store, vehicle, reason=reason, mileage=mileage, who=who, now=time.time_ns())
    return _vehicles(store, describe_relearning(vehicle, reason))


@application.command()
@on_store
def inspected(
    store: "Store",
    vehicle: VehicleName,
    *,
    found: Annotated[str, option("nothing|PART", "What was found: nothing, or a part such as front_left.spring.")],
    who: str,
) -> Found:
    """Store what an inspection without an alert found. The vehicle becomes a member of its type, or leaves it."""
    from sprung.online.monitor.operations import inspected

    part = "" if found in {"nothing", "none"} else found
    inspected(store, vehicle, part=part, who=who, now=time.time_ns())
    return _vehicles(store, f"{vehicle}: {part or 'nothing'} was found; rank the vehicles again")


@application.command("rollback")
@on_store
def roll_back(
    store: "Store",
    vehicle: VehicleName,
    *,
    version: Annotated[int | None, option("N", "Earlier version to return to; required.", min=1)] = None,
    reason: Annotated[
        str, option("TEXT", "Reason, such as 'learnt with a broken spring'; required.", show_default=False)
    ] = "",
    who: str,
) -> Found:
    """Return to an earlier baseline of a vehicle. It becomes the newest version."""
    from sprung.online.monitor.operations import describe_rollback, roll_back

    if version is None:
        raise ParameterError("give --version N, the baseline to return to: the page of the vehicle lists them")
    roll_back(store, vehicle, version=version, reason=reason, who=who, now=time.time_ns())
    return _vehicles(store, describe_rollback(vehicle, version, reason))


@application.command()
@on_store
def raw(
    store: "Store",
    vehicle: VehicleName,
    *,
    minutes: Annotated[float, option("M", "Minutes to look back.", min=0)] = 30.0,
    wait: Annotated[float, option("SECONDS", "Longest wait for the samples; the request stays open.", min=0)] = 60.0,
    who: str,
) -> Found:
    """Request the latest samples of a vehicle. Its box identifies on board."""
    from sprung.online.monitor.operations import request_samples, wait_for_samples

    number = request_samples(store, vehicle, minutes=minutes, who=who, now=time.time_ns())
    with progress_bar() as report:
        return _vehicles(store, wait_for_samples(store, number, timeout=wait, on_progress=report))


@application.command()
def export(
    vehicle: VehicleName,
    *,
    what: Annotated[Literal["windows", "modes", "findings", "alerts"], option(None, "What to export.")] = "windows",
    out: Annotated[Path | None, option("FILE", "File to write: .csv, .parquet or .json.", "--out")] = None,
    since: Since = None,
    until: Until = None,
    store: StoreUrl = DEFAULT_STORE,
    json: Json = None,
) -> None:
    """Export windows, modes, findings or alerts as a table."""
    from sprung.online.monitor.exports import FORMATS, export
    from sprung.results.tables.wording import parse_period

    check_file("--out", out)
    check_file("--json", json)
    file_format = "" if out is None else out.suffix.lower().removeprefix(".")
    if out is not None and file_format not in FORMATS:
        raise ParameterError(f"--out {out} must end in {', '.join(f'.{name}' for name in FORMATS)}: rename it")
    if out is None and json is None:
        raise ParameterError("there is no file to write: give --out FILE or --json PATH")
    period = parse_period(since, until)
    with existing_store(store) as opened:
        if out is not None:
            write_pieces(export(opened, vehicle, what, file_format=file_format, period=period), str(out))
        if json is not None:
            write_pieces(export(opened, vehicle, what, file_format="json", period=period), json)
    if json != "-":
        show(written([] if out is None else [out], json))


def report(
    vehicle: VehicleName,
    *,
    out: Annotated[
        Path | None, option("FILE.html", "Page to write; .pdf needs the extra pdf.", "--out", panel=OUTPUT)
    ] = None,
    since: Since = None,
    until: Until = None,
    store: StoreUrl = DEFAULT_STORE,
    json: Json = None,
) -> None:
    """Write a page about a monitored vehicle and a period. Changes, trends, alerts, modes, conditions, data."""
    from sprung.online.monitor.vehicle_report import vehicle_report
    from sprung.results.page import pdf_of, render
    from sprung.results.tables.wording import parse_period

    check_file("--out", out)
    check_file("--json", json)
    if out is None and json is None:
        raise ParameterError("there is no file to write: give --out FILE.html or --json PATH")
    if out is not None and out.suffix.lower() not in _PAGES:
        raise ParameterError(f"--out {out} must be an HTML or PDF file: name it {out.with_suffix('.html').name}")
    period = parse_period(since, until)
    with existing_store(store) as opened:
        content = vehicle_report(opened, vehicle, period=period, now=time.time_ns())
    if out is not None:
        page = render(content)
        out.write_bytes(pdf_of(page) if out.suffix.lower() == ".pdf" else page.encode())
    if write_result(content.document or {}, json):
        show([content.verdict, *written([] if out is None else [out], json)])


def _vehicles(store: "Store", *sentences: str) -> Found:
    """Return the vehicles, with sentences under their table."""
    from sprung.online.monitor.operations import NO_VEHICLES, vehicles_document
    from sprung.results import tables

    now = time.time_ns()
    document = vehicles_document(store, now=now)
    table = tables.vehicles_table(document, now=now)
    return Found(document, [table if document["vehicles"] else [NO_VEHICLES]], sentences)
