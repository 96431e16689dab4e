"""Views and actions of operators, for command line and HTTP: alerts, work orders, vehicles, requests, quarantine.

Everything goes through the store, so that it works whether or not a monitor runs; the audit trail records every action.
Times are UTC ns.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import Any

from sprung._checks import check_number, nearest_name
from sprung._display import counted
from sprung.diagnosis.scatter import COMMON
from sprung.errors import DataError, ParameterError
from sprung.online.alerts import (
    AlertSettings,
    Message,
    Sender,
    Transition,
    acknowledged,
    assigned,
    closed,
    commented,
    deliver,
    shelved,
    unshelved,
)
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.engine import StateError
from sprung.online.monitor.events import Identified, MonitorSettings, Observed
from sprung.online.monitor.fleets import INSPECTED, rankings
from sprung.online.monitor.histories import (
    LEARN,
    MILEAGE,
    ROLL_BACK,
    history_of,
    odometer_of,
    require_vehicle,
    restored_baseline,
    vehicle_state,
)
from sprung.online.monitor.jobs import Limits, Opening, analyse, open_monitor
from sprung.online.monitor.site import Site
from sprung.online.store import CommandRow, QuarantineRow, Store, VehicleRow, VerdictRow
from sprung.results.documents import WorkOrderDocument, fleet_document
from sprung.results.documents.monitoring import HistoryEntry
from sprung.results.tables import describe_diagnosis
from sprung.results.tables.wording import format_span, format_time
from sprung.state import AlertState
from sprung.vehicles import Component

#: Possible verdicts of the workshop on an alert.
VERDICTS = ("confirmed", "another part", "nothing found", "not looked at")
#: Requests that change the baseline of a vehicle.
BASELINE_ACTS = (LEARN, ROLL_BACK)
#: Advice until a vehicle has sent frames.
NO_VEHICLES = (
    "no vehicles yet: start sprung box on a vehicle, or sprung replay FILE --vehicle-id ID --vehicle V.toml, with "
    "the monitor's broker as --broker"
)


def alerts_document(store: Store, *, vehicle: str | None = None, is_complete: bool = False) -> dict[str, Any]:
    """Return alerts as `sprung.alerts/1`, the most severe first.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of a vehicle; None: alerts of all vehicles.
    is_complete
        Whether alerts that have returned to normal are included.
    """
    entries = [alert.as_entry() for alert in store.alerts.find(vehicle=vehicle) if alert.count]
    shown = [entry for entry in entries if is_complete or entry["state"] != "normal"]
    return {"schema": "sprung.alerts/1", "alerts": shown}


def history_document(store: Store, number: int) -> dict[str, Any]:
    """Return the history of an alert as `sprung.alert-history/1`, oldest event first.

    Raises
    ------
    ParameterError
        If there is no alert of that number.
    """
    require_alert(store, number)
    history = [HistoryEntry.model_validate(row).model_dump() for row in store.alerts.history(number)]
    return {"schema": "sprung.alert-history/1", "number": number, "history": history}


def acknowledge(store: Store, number: int, *, who: str, comment: str = "", now: int) -> None:
    """Acknowledge an alert.

    Parameters
    ----------
    store
        Store of the monitor.
    number
        Alert number.
    who
        Name of the operator.
    comment
        Comment for the history.
    now
        Present time, UTC ns.

    Raises
    ------
    ParameterError
        If no alert has that number, or it needs no acknowledgement.
    """
    _act(store, number, "ack", acknowledged, who=who, comment=comment, now=now)


def shelve(store: Store, number: int, *, hours: float, who: str, comment: str = "", now: int) -> None:
    """Shelve an alert, without notifications for some hours; other parameters as for `acknowledge`.

    Raises
    ------
    ParameterError
        If no alert has that number, or the time is not above 0.
    """
    until = now + round(3600e9 * check_number("hours", hours, above=0))
    _act(store, number, "shelve", partial(shelved, until=until), who=who, comment=comment, now=now)


def unshelve(store: Store, number: int, *, who: str, comment: str = "", now: int) -> None:
    """End the shelving of an alert; parameters as for `acknowledge`.

    Raises
    ------
    ParameterError
        If no alert has that number, or it is not shelved.
    """
    _act(store, number, "unshelve", unshelved, who=who, comment=comment, now=now)


def assign(store: Store, number: int, *, assignee: str | None, who: str, comment: str = "", now: int) -> None:
    """Assign an alert to somebody, or to nobody (None); other parameters as for `acknowledge`.

    Raises
    ------
    ParameterError
        If no alert has that number, or it has that assignee already.
    """
    _act(store, number, "assign", partial(assigned, assignee=assignee), who=who, comment=comment, now=now)


def add_comment(store: Store, number: int, *, who: str, comment: str, now: int) -> None:
    """Add a comment to the history of an alert; parameters as for `acknowledge`.

    Raises
    ------
    ParameterError
        If no alert has that number, or the comment is empty.
    """
    _act(store, number, "comment", commented, who=who, comment=comment, now=now)


def close(store: Store, number: int, *, who: str, comment: str = "", now: int) -> None:
    """Clear an active alert whose cause was removed; parameters as for `acknowledge`.

    Raises
    ------
    ParameterError
        If no alert has that number, or it is not active.
    """
    _act(store, number, "close", closed, who=who, comment=comment, now=now)


def add_verdict(
    store: Store,
    number: int,
    *,
    verdict: str,
    part: str = "",
    action: str = "",
    new_baseline: bool = False,
    mileage: float | None = None,
    who: str,
    now: int,
) -> int | None:
    """Store what the workshop found on an alert, and request a new baseline in the same transaction if required.

    Parameters
    ----------
    store
        Store of the monitor.
    number
        Alert number.
    verdict
        One of `VERDICTS`.
    part
        Part that was found instead, with the verdict "another part".
    action
        Work that was done.
    new_baseline
        Whether a new baseline is learnt, as after a repair; the alert is cleared then, and otherwise acknowledged.
    mileage
        Mileage of the vehicle [km]; None: unknown, or with a new baseline that of the odometer.
    who
        Name of the operator.
    now
        Present time, UTC ns.

    Returns
    -------
    int or None
        Number of the request for a new baseline; None if none was requested.

    Raises
    ------
    ParameterError
        If no alert has that number, the verdict is unknown, or the part is missing or superfluous.
    """
    if verdict not in VERDICTS:
        raise ParameterError(f"verdict {verdict!r} is unknown: give {', '.join(VERDICTS)}")
    if bool(part.strip()) != (verdict == "another part"):
        raise ParameterError("name the part with the verdict 'another part', and with no other verdict")
    words = "; ".join(text for text in (f"verdict: {verdict}", part.strip(), action.strip()) if text)
    with _locked(store, number) as alert:
        request = None
        if new_baseline:
            reason = action.strip() or words
            request = relearn(store, alert.vehicle, reason=reason, mileage=mileage, who=who, now=now)
        else:
            _state_mileage(store, alert.vehicle, mileage, who=who, now=now)
        stored = VerdictRow(number, now, who, verdict, part.strip(), action.strip(), alert.raised, request)
        store.verdicts.add(stored)
        if new_baseline and alert.is_active:
            close(store, number, who=who, comment=words, now=now)
        elif not alert.is_acknowledged and verdict != "not looked at":
            acknowledge(store, number, who=who, comment=words, now=now)
        else:
            add_comment(store, number, who=who, comment=words, now=now)
    return request


def relearn(store: Store, vehicle: str, *, reason: str, mileage: float | None = None, who: str, now: int) -> int:
    """Request a new baseline of a vehicle, such as after maintenance, and return the number of the request.

    The reset is recorded with its time, the person, the reason and the mileage [km], by default that of the odometer.

    Raises
    ------
    ParameterError
        If the vehicle is unknown, the reason is empty, or the mileage is below 0.
    """
    if not reason.strip():
        raise ParameterError(f"a new baseline of {vehicle} needs a reason: give --reason TEXT, such as 'new dampers'")
    require_vehicle(store, vehicle)
    reading = odometer_of(store, vehicle, limit=1000) if mileage is None else None
    _state_mileage(store, vehicle, mileage if reading is None else reading[1], who=who, now=now)
    return store.requests.add_command(who, vehicle, LEARN, reason.strip(), now=now)


def _state_mileage(store: Store, vehicle: str, mileage: float | None, *, who: str, now: int) -> None:
    """Record the mileage of a vehicle [km]; None: it is unknown."""
    if mileage is not None:
        check_number("mileage", mileage, at_least=0)
        store.requests.audit(who, MILEAGE, vehicle, mileage, now=now)


def roll_back(store: Store, vehicle: str, *, version: int, reason: str, who: str, now: int) -> int:
    """Request the return to an earlier baseline of a vehicle, such as after learning from a faulty one.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    version
        Version of the earlier baseline, or of the present one to end learning in progress.
    reason
        Reason for using it again.
    who
        Name of the operator.
    now
        Present time, UTC ns.

    Returns
    -------
    int
        Number of the request. The earlier baseline becomes the newest version, so this can be undone in the same way.

    Raises
    ------
    ParameterError
        If the vehicle or the version is unknown, the version is in use already, or the reason is empty.
    """
    if not reason.strip():
        raise ParameterError(
            f"the return to baseline {version} of {vehicle} needs a reason, such as 'learnt with a broken spring'"
        )
    require_vehicle(store, vehicle)
    next_version = restored_baseline(store, vehicle, version=version, reason=reason).version
    is_learning = bool((store.results.status(vehicle) or {}).get("is_learning"))
    is_requested = any(row.vehicle == vehicle and row.act in BASELINE_ACTS for row in store.requests.open_commands())
    if version == next_version - 1 and not (is_learning or is_requested):
        raise ParameterError(f"baseline {version} of {vehicle} is in use: give an earlier version")
    detail = {"version": version, "reason": reason.strip()}
    return store.requests.add_command(who, vehicle, ROLL_BACK, detail, now=now)


def inspected(store: Store, vehicle: str, *, part: str, who: str, now: int) -> None:
    """Store what an inspection of a vehicle found without an alert, for the comparison with its type.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    part
        Part that was found, such as "front_left.spring"; empty: the vehicle is healthy.
    who
        Name of the operator.
    now
        Present time, UTC ns.

    Raises
    ------
    ParameterError
        If the vehicle is unknown, or the part is no component or a slip of one; parts of other kinds are taken.
    """
    require_vehicle(store, vehicle)
    if part:
        found = Component.parse(part)
        meant = nearest_name(found.kind, COMMON)
        if meant not in {None, found.kind}:
            raise ParameterError(f"{part} is not known: write {found.corner}.{meant}")
    store.requests.audit(who, INSPECTED, vehicle, part, now=now)


def request_samples(store: Store, vehicle: str, *, minutes: float, who: str, now: int) -> int:
    """Request the samples of the last minutes from a vehicle's box, and return the number of the request.

    Raises
    ------
    ParameterError
        If the vehicle is unknown, or the time is not above 0.
    """
    check_number("minutes", minutes, above=0)
    require_vehicle(store, vehicle)
    return store.requests.add_command(who, vehicle, "raw", {"from": now - round(60e9 * minutes), "to": now}, now=now)


def vehicles_document(store: Store, *, now: int) -> dict[str, Any]:
    """Return summaries of all vehicles at a time (UTC ns) as `sprung.vehicles/1`, by name."""
    vehicles = [vehicle_summary(store, row, now=now) for row in store.inbox.vehicles()]
    return {"schema": "sprung.vehicles/1", "vehicles": vehicles}


def ranking_document(store: Store, *, rate: float = 0.05) -> dict[str, Any]:
    """Return the vehicles of each type as `sprung.fleet/1`, ranked by how much their last windows deviate.

    Parameters
    ----------
    store
        Store of the monitor.
    rate
        Expected share of healthy vehicles among those reported to deviate, above 0 and up to 1.

    Raises
    ------
    ParameterError
        If the rate is not above 0 and at most 1.
    """
    ranked, notes = rankings(store, rate=rate)
    return fleet_document(ranked, rate=rate, notes=notes).as_json()


def vehicle_summary(store: Store, row: VehicleRow, *, now: int) -> dict[str, Any]:
    """Return windows, baseline, health index, modes and state of a vehicle, as in `sprung.vehicles/1`."""
    results, vehicle = store.results, row.vehicle
    last = results.observations(vehicle, limit=1)
    reports = [] if last else [entry.document for entry in results.modes(vehicle) if entry.document.get("is_on_board")]
    baselines = results.baselines(vehicle)
    state = vehicle_state(
        store, vehicle, now=now, last_seen=row.last_seen, is_parked=row.is_parked, baselines=baselines
    )
    return {
        "vehicle": vehicle,
        "windows": results.n_observations(vehicle),
        "windows_learnt": state.windows_learnt,
        "windows_needed": state.windows_needed,
        "baseline": baselines[-1].version if baselines else None,
        "health_index": state.health_index,
        "last_seen": row.last_seen,
        "data_until": (results.status(vehicle) or {}).get("until"),
        "modes": last[0].document.get("modes", {}) if last else reports[-1]["modes"] if reports else None,
        "verdict": state.verdict,
        "summary": state.sentence,
    }


def work_order(store: Store, number: int, *, who: str, now: int, link: str | None = None) -> WorkOrderDocument:
    """Return the work order of an alert.

    Parameters
    ----------
    store
        Store of the monitor.
    number
        Alert number.
    who
        Name of the person or program that requests it.
    now
        Present time, UTC ns.
    link
        Address of the alert; None: none.

    Raises
    ------
    ParameterError
        If no alert has that number, or it is about the monitor and not about a vehicle.
    """
    alert = require_alert(store, number)
    if alert.cause.partition(":")[0] == "monitor":
        raise ParameterError(f"alert {number} is about the monitor ({alert.cause}): a work order is about a vehicle")
    corner, part = alert.place
    return WorkOrderDocument.model_validate(
        {
            **alert.facts(WorkOrderDocument),
            "schema": "sprung.work-order/1",
            "key": f"work-order-{number}-{alert.raised}",
            "alert": number,
            "created": now,
            "created_by": who,
            "corner": corner,
            "part": part,
            "since": alert.onset or alert.raised,
            "since_interval": alert.onset_interval,
            "sentence": alert.text,
            "link": link or None,
        }
    )


def send_work_order(
    store: Store, number: int, senders: Sequence[Sender], *, who: str, now: int, link: str | None = None
) -> dict[str, str | None]:
    """Send the work order of an alert, and record in its history who sent it and where it arrived.

    Parameters
    ----------
    store, number, who, now, link
        As for `work_order`.
    senders
        Webhooks of the site file.

    Returns
    -------
    dict
        Reason of the failure by name of the sender; None if it arrived.

    Raises
    ------
    ParameterError
        If there is no such work order, or no sender.
    """
    order = work_order(store, number, who=who, now=now, link=link)
    if not senders:
        raise ParameterError("the site file has no webhook: add [[send.webhook]] to it, or download the work order")
    subject = f"Work order: {order.vehicle} {order.part}"
    errors = deliver(
        Message(
            vehicle=order.vehicle,
            what="work order",
            severity=order.severity,
            subject=subject,
            text=order.sentence,
            time=order.created,
            document=order.as_json(),
            key=order.key,
        ),
        senders,
    )
    results = {sender.name: errors.get(sender.name) for sender in senders}
    words = "; ".join(f"by {name}: {error or 'sent'}" for name, error in results.items())
    add_comment(store, number, who=who, comment=f"work order {words}", now=now)
    return results


def quarantine_document(store: Store, *, vehicle: str | None = None, is_analysed: bool = False) -> dict[str, Any]:
    """Return what was quarantined as `sprung.quarantine/1`, consecutive frames as one entry.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle; None: all vehicles.
    is_analysed
        Whether frames are analysed again by this version, each run of them starting from the baseline of the vehicle.
        The result is in `again`; nothing is stored.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    """
    names = store.quarantine.vehicles()
    if vehicle and vehicle not in names:
        require_vehicle(store, vehicle)
    entries = []
    for name in [vehicle] if vehicle else names:
        numbered = enumerate(store.quarantine.find(name))
        runs = groupby(numbered, key=lambda each: (each[1].boot, each[1].seq - each[0], each[1].kind, each[1].reason))
        for rows in ([row for _, row in run] for _, run in runs):
            first, last = rows[0], rows[-1]
            entries.append(
                {
                    "vehicle": first.vehicle,
                    "kind": first.kind,
                    "boot": first.boot,
                    "first": first.seq,
                    "last": last.seq,
                    "begin": first.t0,
                    "stored": last.stored,
                    "size": sum(len(row.payload) for row in rows),
                    "reason": first.reason,
                    "again": _analysed(store, name, rows) if is_analysed and first.kind == "raw" else None,
                }
            )
    return {"schema": "sprung.quarantine/1", "quarantined": entries}


def _analysed(store: Store, vehicle: str, rows: Sequence[QuarantineRow]) -> str:
    """Return the result of analysing consecutive frames, in words."""
    described = store.inbox.vehicle(vehicle)
    if described is None:
        return "cannot be analysed: the vehicle has sent no description"
    watch = Site().watch
    limits = Limits(vehicle_bytes=1e6 * watch.megabytes_per_vehicle, job_bytes=1e6 * watch.megabytes_per_job)
    saved = store.results.snapshot(vehicle)
    state = None if saved is None else saved.document
    known = Opening(vehicle, described.description, dict(described.channels), state, MonitorSettings())
    with suppress(StateError):  # the settings of the saved state, where it can be read
        known = replace(known, settings=open_monitor(known)[0].settings)
    history = history_of(store, vehicle, max_windows=known.settings.max_windows)
    opened = open_monitor(replace(known, state=None, history=history))
    windows: list[Observed] = []
    n_identified, place = 0, 0
    while place < len(rows):
        outcome = analyse(vehicle, opened, [row.payload for row in rows[place:]], limits=limits)
        windows += [event for event in outcome.events if isinstance(event, Observed)]
        n_identified += sum(isinstance(event, Identified) for event in outcome.events)
        if outcome.error:
            return f"fails at frame {rows[place + outcome.n_consumed].seq}: {outcome.error}"
        place += outcome.n_consumed
    said = f"can be analysed: {counted(len(windows), 'window')}, {counted(n_identified, 'identification')} of modes"
    if not windows or windows[-1].diagnosis is None:
        return said
    return f"{said}; {describe_diagnosis(windows[-1].diagnosis)[0]}"


def _act(
    store: Store, number: int, name: str, act: Callable[..., Transition], *, who: str, comment: str, now: int
) -> None:
    """Apply an operator action to an alert, and record it in the audit trail."""
    with _locked(store, number) as alert:
        transition = act(alert, who=who, now=now, comment=comment)
        AlertBook(store, AlertSettings()).put(transition, now=now)
        store.requests.audit(who, name, f"{alert.vehicle} {alert.cause}", comment or None, now=now)


@contextmanager
def _locked(store: Store, number: int) -> Iterator[AlertState]:
    """Yield an alert, which nobody else changes until the end of the context."""
    known = require_alert(store, number)
    with store.alerts.locked(known.vehicle, known.cause) as present:
        yield present or known


def require_alert(store: Store, number: int) -> AlertState:
    """Return an alert.

    Raises
    ------
    ParameterError
        If no alert has that number.
    """
    alert = store.alerts.row(number)
    if alert is None:
        raise ParameterError(f"unknown alert {number}: see the list of alerts (sprung alerts list --all)")
    return alert


#: Time between checks of a request [s].
_LOOK = 0.2


def wait_for_samples(
    store: Store, number: int, *, timeout: float, on_progress: Callable[[str, float], None] = lambda step, share: None
) -> str:
    """Wait for the samples of a request, and return a sentence about them.

    Parameters
    ----------
    store
        Store of the monitor.
    number
        Number of the request, from `sprung.online.monitor.operations.request_samples`.
    timeout
        Longest wait [s]; 0: none, the request stays open.
    on_progress
        Callback that receives the current step and the share that is done (0: unknown).

    Raises
    ------
    DataError
        If the box has no such samples, or none arrived in time; the request then stays open.
    ParameterError
        If the request is no longer in the store.
    """
    end = time.monotonic() + timeout
    while (row := _request(store, number)).done is None and time.monotonic() < end:
        on_progress(f"waiting for samples of {row.vehicle}", 0.0)
        time.sleep(_LOOK)
    if row.done is None and not timeout:
        return describe_request(row)
    if row.done is None:
        known = store.inbox.vehicle(row.vehicle)
        seen = "never" if known is None else f"at {format_time(known.last_seen)} UTC"
        raise DataError(
            f"no samples {_span(row.detail)} of {row.vehicle} within {timeout:g} s (last seen {seen}): check that its"
            " box and the monitor run; the request stays open and is sent again when the vehicle is next seen"
        )
    if not row.detail["frames"]:
        raise DataError(f"no samples {_span(row.detail['asked'])} of {row.vehicle}: {row.detail['reason']}")
    return f"received samples {_span(row.detail)} of {row.vehicle}, {counted(row.detail['frames'], 'frame')}"


def describe_relearning(vehicle: str, reason: str) -> str:
    """Return the sentence about a request for a new baseline."""
    return (
        f"{vehicle} will relearn its baseline ({reason.strip()!r}) from its next usable windows (learning_windows of"
        f" the site file, default {Site().watch.learning_windows}); change detection resumes after that"
    )


def describe_rollback(vehicle: str, version: int, reason: str) -> str:
    """Return the sentence about a request to return to an earlier baseline."""
    return (
        f"{vehicle} will return to its baseline {version} ({reason.strip()!r}): change detection restarts with its"
        " next window"
    )


def describe_request(row: CommandRow) -> str:
    """Return the sentence about a request that is not yet done."""
    if row.act == "raw":
        what = f"samples {_span(row.detail)}"
    elif row.act == ROLL_BACK:
        what = f"return to baseline {row.detail['version']} ({row.detail['reason']!r})"
    else:
        what = f"new baseline ({row.detail!r})"
    return f"{row.vehicle}: {what} requested at {format_time(row.created)} UTC, not yet done"


def _request(store: Store, number: int) -> CommandRow:
    """Return a request that is still in the store."""
    row = store.requests.command(number)
    if row is None:
        raise ParameterError(f"request {number} is no longer in the store: repeat it")
    return row


def _span(times: dict[str, int]) -> str:
    """Return begin and end of samples in words."""
    return format_span(times["from"], times["to"])
