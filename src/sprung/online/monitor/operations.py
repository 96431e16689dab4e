"""Views and actions of operators, for command line and HTTP: alerts, vehicles, requests to the running monitor.

Everything goes through the store, so that it works whether or not a monitor runs; the audit trail records every action.
Times are UTC ns.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from typing import Any

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.online.alerts import (
    AlertSettings,
    Transition,
    acknowledged,
    assigned,
    closed,
    commented,
    shelved,
    unshelved,
)
from sprung.online.monitor.alert_book import AlertBook, alert_of
from sprung.online.monitor.fleets import rankings
from sprung.online.monitor.histories import LEARN, ROLL_BACK, restored_baseline
from sprung.online.monitor.vehicle_states import alert_state, vehicle_state
from sprung.online.store import AlertRow, Store, VehicleRow, VerdictRow
from sprung.results.documents import fleet_document

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
    rows = [row for row in store.alerts.find(vehicle=vehicle) if row.count]
    entries = [alert_state(row).as_entry() for row in rows]
    shown = [entry for entry in entries if is_complete or entry["state"] != "normal"]
    return {"schema": "sprung.alerts/1", "alerts": shown}


def history_document(store: Store, number: int) -> dict[str, Any]:
    """Return the history of an alert as `sprung.alert-history/1`, oldest event first.

    Raises
    ------
    ParameterError
        If there is no alert of that number.
    """
    _alert_row(store, number)
    rows = [asdict(row) for row in store.alerts.history(number)]
    history = [{name: value for name, value in row.items() if name not in {"id", "alert"}} for row in rows]
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
    is_new_baseline: bool = False,
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
    is_new_baseline
        Whether a new baseline is learnt, as after a repair; the alert is cleared then, and otherwise acknowledged.
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
    with _locked(store, number) as row:
        request = None
        if is_new_baseline:
            request = relearn(store, row.vehicle, reason=action.strip() or words, who=who, now=now)
        stored = VerdictRow(number, now, who, verdict, part.strip(), action.strip(), row.raised, request)
        store.verdicts.add(stored)
        if is_new_baseline and row.is_active:
            close(store, number, who=who, comment=words, now=now)
        elif not row.is_acknowledged and verdict != "not looked at":
            acknowledge(store, number, who=who, comment=words, now=now)
        else:
            add_comment(store, number, who=who, comment=words, now=now)
    return request


def relearn(store: Store, vehicle: str, *, reason: str, who: str, now: int) -> int:
    """Request a new baseline of a vehicle, such as after maintenance, and return the number of the request.

    Raises
    ------
    ParameterError
        If the vehicle is unknown, or the reason is empty.
    """
    if not reason.strip():
        raise ParameterError(f"a new baseline of {vehicle} needs a reason: give --reason TEXT, such as 'new dampers'")
    _check_known(store, vehicle)
    return store.requests.add_command(who, vehicle, LEARN, reason.strip(), now=now)


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
    _check_known(store, vehicle)
    next_version = restored_baseline(store, vehicle, version=version, reason=reason).version
    is_learning = bool((store.results.status(vehicle) or {}).get("is_learning"))
    is_requested = any(row.vehicle == vehicle and row.act in BASELINE_ACTS for row in store.requests.open_commands())
    if version == next_version - 1 and not (is_learning or is_requested):
        raise ParameterError(f"baseline {version} of {vehicle} is in use: give an earlier version")
    detail = {"version": version, "reason": reason.strip()}
    return store.requests.add_command(who, vehicle, ROLL_BACK, detail, now=now)


def request_samples(store: Store, vehicle: str, *, minutes: float, who: str, now: int) -> int:
    """Request the samples of the last minutes from a vehicle's box, and return the number of the request.

    Raises
    ------
    ParameterError
        If the vehicle is unknown, or the time is not above 0.
    """
    check_number("minutes", minutes, above=0)
    _check_known(store, vehicle)
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
        Expected share of sound vehicles among those reported to deviate, above 0 and up to 1.

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


def _act(
    store: Store, number: int, name: str, act: Callable[..., Transition], *, who: str, comment: str, now: int
) -> None:
    """Apply an operator action to an alert, and record it in the audit trail."""
    with _locked(store, number) as row:
        transition = act(alert_of(row), who=who, now=now, comment=comment)
        AlertBook(store, AlertSettings()).put(transition, now=now)
        store.requests.audit(who, name, f"{row.vehicle} {row.cause}", comment or None, now=now)


@contextmanager
def _locked(store: Store, number: int) -> Iterator[AlertRow]:
    """Yield the row of an alert, which nobody else changes until the end of the context."""
    known = _alert_row(store, number)
    with store.alerts.locked(known.vehicle, known.cause) as row:
        yield known if row is None else row


def _alert_row(store: Store, number: int) -> AlertRow:
    """Return the row of an alert."""
    row = store.alerts.row(number)
    if row is None:
        raise ParameterError(f"unknown alert {number}: sprung alerts list --all lists all alerts")
    return row


def _check_known(store: Store, vehicle: str) -> None:
    """Refuse a vehicle that the store does not contain."""
    if store.inbox.vehicle(vehicle) is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: sprung vehicles lists the known ones")
