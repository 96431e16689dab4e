"""The fleet in order of urgency, in pages, and how many vehicles are in which state."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

from sqlalchemy import ColumnElement, Subquery, and_, case, exists, func, not_, or_, select, tuple_

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
        worst = _worst()
        severity, impact = func.coalesce(worst.c.severity, 0), func.coalesce(worst.c.impact, 0.0)
        place = (-severity, -impact, VEHICLES.c.vehicle)
        baseline = select(func.max(BASELINES.c.version)).where(BASELINES.c.vehicle == VEHICLES.c.vehicle)
        columns = [VEHICLES.c[name] for name in ("vehicle", "last_seen", "is_parked", "channels")]
        query = select(*columns, severity.label("severity"), impact.label("impact"))
        query = query.add_columns(baseline.scalar_subquery().label("baseline"))
        query = query.outerjoin(worst, worst.c.vehicle == VEHICLES.c.vehicle).where(*_conditions(wanted, severity))
        if after is not None:
            query = query.where(tuple_(*place) > tuple_(-after.severity, -after.impact, after.vehicle))
        with self._database.reading() as connection:
            rows = connection.execute(query.order_by(*place).limit(limit)).all()
        return [
            FleetRow(
                Place(row.severity, float(row.impact), row.vehicle),
                last_seen=row.last_seen,
                is_parked=row.is_parked,
                baseline=row.baseline,
                n_channels=len(row.channels),
            )
            for row in rows
        ]

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


def _is_open() -> ColumnElement[bool]:
    """Return the condition for active alerts that are neither acknowledged nor shelved."""
    return and_(ALERTS.c.is_active, not_(ALERTS.c.is_acknowledged), ALERTS.c.shelved_until.is_(None))


def _conditions(wanted: FleetFilter, severity: ColumnElement[int]) -> list[ColumnElement[bool]]:
    """Return the conditions of a filter, with the greatest severity of the active alerts of a vehicle."""
    vehicle, conditions = VEHICLES.c.vehicle, []
    of_vehicle = and_(ALERTS.c.vehicle == vehicle, ALERTS.c.is_active)
    if wanted.text:
        conditions.append(vehicle.icontains(wanted.text, autoescape=True))
    if wanted.steps:
        conditions.append(in_steps(severity, wanted.steps))
    if wanted.assignee is not None:
        conditions.append(exists().where(of_vehicle, ALERTS.c.assignee == wanted.assignee))
    if wanted.is_unacknowledged:
        conditions.append(exists().where(of_vehicle, _is_open()))
    if wanted.is_learning:
        conditions.append(exists().where(STATUSES.c.vehicle == vehicle, STATUSES.c.is_learning))
    if wanted.silent_before is not None:
        conditions.append(_is_silent(wanted.silent_before))
    return conditions


def _is_silent(before: int) -> ColumnElement[bool]:
    """Return the condition for vehicles that should have sent since a time."""
    return and_(VEHICLES.c.last_seen < before, not_(VEHICLES.c.is_parked))
