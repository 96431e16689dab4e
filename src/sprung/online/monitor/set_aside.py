"""Frames and states that a monitor set aside, and the result of analysing them with this version."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from sprung.errors import ParameterError
from sprung.online.monitor.engine import Identified, MonitorSettings, Observed
from sprung.online.monitor.histories import history_of
from sprung.online.monitor.jobs import Limits, Opening, analyse, open_monitor
from sprung.online.monitor.site import Site
from sprung.online.monitor.states import StateError
from sprung.online.store import AsideRow, Store
from sprung.results.tables import counted, diagnosis_in_words


def aside_document(store: Store, *, vehicle: str = "", is_analysed: bool = False) -> dict[str, Any]:
    """Return what was set aside as `sprung.aside/1`, consecutive frames as one entry.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle; empty: all vehicles.
    is_analysed
        Whether frames are analysed again by this version, each run of them starting from the baseline of the vehicle.
        The result is in `again`; nothing is stored.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    """
    names = store.aside.vehicles()
    if vehicle and vehicle not in names and store.inbox.vehicle(vehicle) is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: sprung vehicles lists the known ones")
    entries = []
    for name in [vehicle] if vehicle else names:
        for rows in _in_a_row(store.aside.find(name)):
            again = _analysed(store, name, rows) if is_analysed and rows[0].kind == "raw" else None
            entries.append(_entry(rows, again))
    return {"schema": "sprung.aside/1", "aside": entries}


def _in_a_row(rows: Sequence[AsideRow]) -> Iterator[list[AsideRow]]:
    """Yield rows that follow each other and were set aside for the same reason."""
    start = 0
    for place, (before, after) in enumerate(pairwise(rows), start=1):
        is_next = (after.boot, after.seq) == (before.boot, before.seq + 1)
        if not is_next or (after.kind, after.reason) != (before.kind, before.reason):
            yield list(rows[start:place])
            start = place
    if rows:
        yield list(rows[start:])


def _entry(rows: Sequence[AsideRow], again: str | None) -> dict[str, Any]:
    """Return rows that follow each other as an entry of `sprung.aside/1`."""
    first, last = rows[0], rows[-1]
    return {
        "vehicle": first.vehicle,
        "kind": first.kind,
        "boot": first.boot,
        "first": first.seq,
        "last": last.seq,
        "begin": first.t0,
        "stored": last.stored,
        "size": sum(len(row.payload) for row in rows),
        "reason": first.reason,
        "again": again,
    }


def _analysed(store: Store, vehicle: str, rows: Sequence[AsideRow]) -> str:
    """Return the result of analysing consecutive frames, in words."""
    described = store.inbox.vehicle(vehicle)
    if described is None:
        return "cannot be analysed: the vehicle has sent no description"
    watch = Site().watch
    limits = Limits(vehicle_bytes=1e6 * watch.megabytes_per_vehicle, job_bytes=1e6 * watch.megabytes_per_job)
    settings = _settings(store, vehicle, described.description)
    history = history_of(store, vehicle, most_windows=settings.most_windows)
    opened = open_monitor(
        Opening(vehicle, described.description, dict(described.channels), None, settings, None, history)
    )
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
    return f"{said}; {diagnosis_in_words(windows[-1].diagnosis)[0]}"


def _settings(store: Store, vehicle: str, description: str) -> MonitorSettings:
    """Return the settings in the saved state of a vehicle; the defaults if no state can be read."""
    snapshot = store.results.snapshot(vehicle)
    if snapshot is None:
        return MonitorSettings()
    try:
        monitor, _ = open_monitor(Opening(vehicle, description, {}, snapshot.document, MonitorSettings()))
    except StateError:
        return MonitorSettings()
    return monitor.settings
