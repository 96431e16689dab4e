"""The fleet in order of urgency, in pages, and how many vehicles are in which state."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, FromClause, Select, Subquery, and_, case, exists, func, not_, or_, select

from sprung.online.store.database import Tables
from sprung.online.store.schema import (
    ALERT_HISTORY,
    ALERTS,
    BASELINES,
    OBSERVATIONS,
    STATUSES,
    VEHICLES,
    in_steps,
)
from sprung.state import SENSOR_WEIGHT, STEP_SIZE, WATCHING


class Place(NamedTuple):
    """Place of a vehicle in the fleet: the greatest severity first, then the greatest impact, then by name.

    Parameters
    ----------
    severity
        Greatest severity of its active alerts; 0: none.
    impact
        Greatest weighted severity of them, by which the health index is less than 100 (times 10).
    vehicle
        Name of the vehicle.
    """

    severity: int
    impact: float
    vehicle: str


@dataclass(frozen=True, slots=True)
class FleetRow:
    """A vehicle in the fleet.

    Parameters
    ----------
    place
        Place in the order of the fleet.
    last_seen
        Time of its last message, UTC ns.
    is_parked
        Whether it was shut down properly.
    baseline
        Version of its present baseline; None without one.
    n_channels
        Number of its channels.
    """

    place: Place
    last_seen: int
    is_parked: bool
    baseline: int | None
    n_channels: int


@dataclass(frozen=True, slots=True)
class FleetFilter:
    """Which vehicles of the fleet are selected; an omitted criterion matches all.

    Parameters
    ----------
    text
        Part of the name, in any case.
    steps
        Steps of severity of the most severe active alert, 0 to 4; -1: no active alert.
    assignee
        Name of a person to whom an active alert is assigned.
    is_unacknowledged
        Whether an active alert is neither acknowledged nor shelved.
    is_learning
        Whether a baseline is being learnt.
    silent_before
        Time, UTC ns, before which the last message came, unless the vehicle is parked.
    """

    text: str = ""
    steps: Collection[int] = ()
    assignee: str | None = None
    is_unacknowledged: bool = False
    is_learning: bool = False
    silent_before: int | None = None


@dataclass(frozen=True, slots=True)
class FleetCounts:
    """Numbers of vehicles.

    Parameters
    ----------
    vehicles
        All vehicles.
    steps
        Vehicles whose most severe active alert is of each of the five steps of severity.
    learning
        Vehicles that learn a baseline.
    silent
        Vehicles that should send and do not.
    unacknowledged
        Vehicles with an active alert that is neither acknowledged nor shelved.
    """

    vehicles: int
    steps: tuple[int, int, int, int, int]
    learning: int
    silent: int
    unacknowledged: int


class ChangeRow(NamedTuple):
    """Change of an alert: its number, and alert, vehicle and event."""

    id: int
    alert: int
    vehicle: str
    what: str


class WindowRow(NamedTuple):
    """Window that was analysed: when it was stored, UTC ns, and which."""

    stored: int
    vehicle: str
    boot: int
    number: int


class Fleet(Tables):
    """The fleet as shown to people."""

    def page(self, wanted: FleetFilter, *, after: Place | None = None, limit: int = 50) -> list[FleetRow]:
        """Return vehicles in order of urgency.

        Parameters
        ----------
        wanted
            Filter for the vehicles.
        after
            Place after which the page begins; None: from the first.
        limit
            Largest number of vehicles.
        """
        with self._database.reading() as connection:
            places: list[Place] = []
            if after is None or after.severity:
                alerted = connection.execute(_alerted(wanted, after).limit(limit))
                places = [Place(row.severity, float(row.impact), row.vehicle) for row in alerted]
            if len(places) < limit and _may_be_calm(wanted):
                # Those without alerts follow by name, in the order of the primary key.
                name = after.vehicle if after is not None and not after.severity else ""
                calm = connection.execute(_calm(wanted, name).limit(limit - len(places)))
                places += [Place(0, 0.0, row.vehicle) for row in calm]
            latest = select(func.max(BASELINES.c.version)).where(BASELINES.c.vehicle == VEHICLES.c.vehicle)
            columns = [VEHICLES.c[name] for name in ("vehicle", "last_seen", "is_parked", "channels")]
            query = select(*columns, latest.scalar_subquery().label("baseline")).where(
                VEHICLES.c.vehicle.in_([place.vehicle for place in places])
            )
            known = {row.vehicle: row for row in connection.execute(query)}
        found = ((place, known[place.vehicle]) for place in places)
        return [FleetRow(place, row.last_seen, row.is_parked, row.baseline, len(row.channels)) for place, row in found]

    def counts(self, *, silent_before: int) -> FleetCounts:
        """Return numbers of vehicles; those not parked whose last message came before a time [UTC ns] are silent."""
        worst = _worst()
        step = (worst.c.severity - 1) // STEP_SIZE
        is_known = exists().where(VEHICLES.c.vehicle == ALERTS.c.vehicle)
        of_steps = select(step, func.count()).where(exists().where(VEHICLES.c.vehicle == worst.c.vehicle))
        with self._database.reading() as connection:
            n_of = {int(key): number for key, number in connection.execute(of_steps.group_by(step))}
            n_vehicles = connection.scalar(select(func.count()).select_from(VEHICLES)) or 0
            n_learning = connection.scalar(select(func.count()).where(STATUSES.c.is_learning)) or 0
            n_silent = connection.scalar(select(func.count()).where(_is_silent(silent_before))) or 0
            n_open = connection.scalar(select(func.count(ALERTS.c.vehicle.distinct())).where(_is_open(), is_known)) or 0
        return FleetCounts(n_vehicles, tuple(n_of.get(k, 0) for k in range(5)), n_learning, n_silent, n_open)

    def newest(self) -> tuple[int, int]:
        """Return the number of the last change of an alert, and when the last window was stored, UTC ns; 0: none."""
        with self._database.reading() as connection:
            change = connection.scalar(select(func.max(ALERT_HISTORY.c.id)))
            return change or 0, connection.scalar(select(func.max(OBSERVATIONS.c.stored))) or 0

    def since(self, change: int, stored: int, *, limit: int) -> tuple[list[ChangeRow], list[WindowRow]]:
        """Return what was stored after a change of an alert and after a time [UTC ns], of each kind about `limit`."""
        changes = (
            select(ALERT_HISTORY.c.id, ALERT_HISTORY.c.alert, ALERTS.c.vehicle, ALERT_HISTORY.c.what)
            .join(ALERTS, ALERTS.c.number == ALERT_HISTORY.c.alert)
            .where(ALERT_HISTORY.c.id > change)
            .order_by(ALERT_HISTORY.c.id)
            .limit(limit)
        )
        columns = [OBSERVATIONS.c[name] for name in ("stored", "vehicle", "boot", "number")]
        order = (OBSERVATIONS.c.stored, OBSERVATIONS.c.vehicle, OBSERVATIONS.c.boot, OBSERVATIONS.c.number)
        is_new = OBSERVATIONS.c.stored > stored
        # To the end of a moment: what was stored together comes together.
        times = select(OBSERVATIONS.c.stored).where(is_new).order_by(OBSERVATIONS.c.stored).limit(limit).subquery()
        is_within = OBSERVATIONS.c.stored <= select(func.max(times.c.stored)).scalar_subquery()
        windows = select(*columns).where(is_new, is_within).order_by(*order)
        with self._database.reading() as connection:
            return (
                [ChangeRow(*row) for row in connection.execute(changes)],
                [WindowRow(*row) for row in connection.execute(windows)],
            )


def _worst() -> Subquery:
    """Return the greatest severity and impact of the active alerts of each vehicle that has any."""
    is_watching = or_(ALERTS.c.cause.in_(WATCHING), *(ALERTS.c.cause.like(f"{name}:%") for name in WATCHING))
    weight = case((is_watching, 0.0), (ALERTS.c.cause.like("%:%"), SENSOR_WEIGHT), else_=1.0)
    return (
        select(
            ALERTS.c.vehicle,
            func.max(ALERTS.c.severity).label("severity"),
            func.max(weight * ALERTS.c.severity).label("impact"),
        )
        .where(ALERTS.c.is_active)
        .group_by(ALERTS.c.vehicle)
        .subquery()
    )


def _alerted(wanted: FleetFilter, after: Place | None) -> Select[Any]:
    """Return the query for places of vehicles with active alerts, in their order."""
    worst = _worst()
    vehicle, severity, impact = worst.c.vehicle, worst.c.severity, worst.c.impact
    of_vehicle = and_(ALERTS.c.vehicle == vehicle, ALERTS.c.is_active)
    query = select(vehicle, severity, impact).where(exists().where(VEHICLES.c.vehicle == vehicle))
    query = query.where(*_conditions(wanted, vehicle))
    if wanted.steps:
        query = query.where(in_steps(severity, [step for step in wanted.steps if step >= 0]))
    if wanted.assignee is not None:
        query = query.where(exists().where(of_vehicle, ALERTS.c.assignee == wanted.assignee))
    if wanted.is_unacknowledged:
        query = query.where(exists().where(of_vehicle, _is_open()))
    if after is not None:
        is_equal = and_(severity == after.severity, impact == after.impact)
        is_later = or_(
            severity < after.severity,
            and_(severity == after.severity, impact < after.impact),
            and_(is_equal, vehicle > after.vehicle),
        )
        query = query.where(is_later)
    return query.order_by(severity.desc(), impact.desc(), vehicle)


def _is_open() -> ColumnElement[bool]:
    """Return the condition for active alerts that are neither acknowledged nor shelved."""
    return and_(ALERTS.c.is_active, not_(ALERTS.c.is_acknowledged), ALERTS.c.shelved_until.is_(None))


def _may_be_calm(wanted: FleetFilter) -> bool:
    """Return whether vehicles without active alerts may be wanted."""
    has_step = not wanted.steps or -1 in wanted.steps
    return has_step and wanted.assignee is None and not wanted.is_unacknowledged


def _calm(wanted: FleetFilter, after: str) -> Select[Any]:
    """Return the query for vehicles without active alerts whose names come after another, by name."""
    vehicle = VEHICLES.c.vehicle
    has_alert = exists().where(ALERTS.c.vehicle == vehicle, ALERTS.c.is_active)
    return select(vehicle).where(vehicle > after, not_(has_alert), *_conditions(wanted, vehicle)).order_by(vehicle)


def _conditions(wanted: FleetFilter, vehicle: ColumnElement[str]) -> list[ColumnElement[bool]]:
    """Return the conditions of a filter that vehicles with and without alerts can meet."""
    conditions: list[ColumnElement[bool]] = []
    if wanted.text:
        conditions.append(vehicle.icontains(wanted.text, autoescape=True))
    if wanted.is_learning:
        conditions.append(exists().where(STATUSES.c.vehicle == vehicle, STATUSES.c.is_learning))
    if wanted.silent_before is not None:
        of_vehicle = VEHICLES.alias()
        conditions.append(exists().where(of_vehicle.c.vehicle == vehicle, _is_silent(wanted.silent_before, of_vehicle)))
    return conditions


def _is_silent(before: int, vehicles: FromClause = VEHICLES) -> ColumnElement[bool]:
    """Return the condition for vehicles that should have sent since a time."""
    return and_(vehicles.c.last_seen < before, not_(vehicles.c.is_parked))
