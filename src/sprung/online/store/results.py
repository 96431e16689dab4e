"""Results of analysis: observations, modes, findings, baselines, and the state to continue from."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partialmethod
from typing import Any, Literal

from sqlalchemy import ColumnElement, Connection, Table, and_, bindparam, delete, func, not_, select, tuple_, update

from sprung.errors import ParameterError
from sprung.online.store.database import Tables
from sprung.online.store.schema import (
    BASELINES,
    CURSORS,
    FINDINGS,
    FRAMES,
    MODES,
    OBSERVATIONS,
    SNAPSHOTS,
    STATUSES,
    VEHICLES,
    BaselineRow,
    Document,
    Entry,
    Numbered,
    Progress,
    Snapshot,
)

# Statements are built once: building one takes longer than running it.
_OF_CURSOR, _OF_FRAMES = (
    and_(table.c.vehicle == bindparam("of_vehicle"), table.c.boot == bindparam("of_boot"))
    for table in (CURSORS, FRAMES)
)
_LAST = bindparam("last", type_=CURSORS.c.done.type)
_CONTIGUOUS = select(func.coalesce(func.max(CURSORS.c.contiguous), -1)).where(_OF_CURSOR)
_ANALYSED = update(CURSORS).where(_OF_CURSOR, CURSORS.c.done < _LAST).values(done=_LAST)
_UNNEEDED = delete(FRAMES).where(_OF_FRAMES, FRAMES.c.seq <= _LAST)
#: Tables of documents about windows.
_KINDS = {"observations": OBSERVATIONS, "modes": MODES, "findings": FINDINGS}


class Results(Tables):
    """Results, stored together with the progress of analysis."""

    def commit(self, progress: Progress, *before: Progress) -> None:
        """Store results of analysis in one transaction; storing the same again has no effect.

        Parameters
        ----------
        progress
            Results of one vehicle.
        before
            Others that are stored first, of any vehicles.

        Raises
        ------
        ParameterError
            If incomplete frames are declared analysed.
        StoreError
            If the store cannot write; nothing is stored then.
        """
        every = (*before, progress)
        with self._database.writing() as connection:
            for each in every:
                _mark_done(connection, each)
                if each.modes_from is not None:
                    connection.execute(
                        delete(MODES).where(MODES.c.vehicle == each.vehicle, MODES.c.number >= each.modes_from)
                    )
            self._add(connection, OBSERVATIONS, [row for each in every for row in _rows(each, each.observations)])
            self._add(connection, MODES, [row for each in every for row in _rows(each, each.modes)])
            self._add(connection, FINDINGS, [row for each in every for row in _placed(_rows(each, each.findings))])
            names = ("version", "created", "reason", "document")
            rows = [
                {"vehicle": each.vehicle, **dict(zip(names, baseline, strict=True))}
                for each in every
                for baseline in each.baselines
            ]
            self._add(connection, BASELINES, rows)
            for each in every:
                if each.snapshot is not None:
                    self._put_snapshot(connection, each, each.snapshot)
            self._put_statuses(connection, {each.vehicle: each.status for each in every if each.status is not None})

    def _entries(
        self,
        table: Table,
        vehicle: str,
        *where: ColumnElement[bool],
        since: int | None = None,
        until: int | None = None,
        limit: int | None = None,
    ) -> list[Entry]:
        """Return documents in order of time, from `since` to `until`, at most the last `limit`."""
        newest_first = (column.desc() for column in (table.c.t0, *reversed(table.primary_key.columns)))
        columns = (table.c[name] for name in Entry.__dataclass_fields__)
        query = select(*columns).where(table.c.vehicle == vehicle, *where, *_within(table, since, until))
        return self._database.rows(Entry, query.order_by(*newest_first).limit(limit))[::-1]

    #: Observations, modes and findings of a vehicle in order of time, as `_entries` takes `since`, `until` and `limit`.
    observations: partialmethod[list[Entry]] = partialmethod(_entries, OBSERVATIONS)
    modes: partialmethod[list[Entry]] = partialmethod(_entries, MODES)
    findings: partialmethod[list[Entry]] = partialmethod(_entries, FINDINGS)

    def last_modes(
        self, vehicle: str, *, since: int | None = None, until: int | None = None, limit: int | None = None
    ) -> list[Entry]:
        """Return the modes of a vehicle as `modes` does, of each window only those identified last."""
        last = select(MODES.c.boot, func.max(MODES.c.number)).where(MODES.c.vehicle == vehicle)
        last = last.where(*_within(MODES, since, until)).group_by(MODES.c.boot, MODES.c.t0)
        is_last = tuple_(MODES.c.boot, MODES.c.number).in_(last)
        return self._entries(MODES, vehicle, is_last, since=since, until=until, limit=limit)

    def observation(self, vehicle: str, boot: int, number: int) -> Entry | None:
        """Return the observation of one window; None if there is none."""
        where = OBSERVATIONS.c.boot == boot, OBSERVATIONS.c.number == number
        return next(iter(self._entries(OBSERVATIONS, vehicle, *where)), None)

    def first_observation(self, vehicle: str, *, after: int) -> Entry | None:
        """Return the first observation of a vehicle that begins after a time; None if there is none."""
        first = select(func.min(OBSERVATIONS.c.t0)).where(OBSERVATIONS.c.vehicle == vehicle, OBSERVATIONS.c.t0 > after)
        is_first = OBSERVATIONS.c.t0 == first.scalar_subquery()
        return next(iter(self._entries(OBSERVATIONS, vehicle, is_first, limit=1)), None)

    def findings_of(self, vehicle: str, boot: int, number: int) -> list[Entry]:
        """Return the findings of one window."""
        return self._entries(FINDINGS, vehicle, FINDINGS.c.boot == boot, FINDINGS.c.number == number)

    def n_observations(self, vehicle: str) -> int:
        """Return the number of observations of a vehicle."""
        query = select(func.count()).where(OBSERVATIONS.c.vehicle == vehicle)
        return self._database.scalar(query) or 0

    def n_numbered(self, vehicle: str) -> tuple[int, int]:
        """Return the numbers that follow those of the observations and of the modes of a vehicle."""
        following = [
            self._database.scalar(select(func.max(table.c.number) + 1).where(table.c.vehicle == vehicle))
            for table in (OBSERVATIONS, MODES)
        ]
        return following[0] or 0, following[1] or 0

    def latest(self, vehicles: Sequence[str]) -> dict[str, tuple[int, int]]:
        """Return number of the last observation and version of the baseline of vehicles, -1 if there is none."""
        ends = (
            select(func.coalesce(func.max(column), -1)).where(column.table.c.vehicle == VEHICLES.c.vehicle)
            for column in (OBSERVATIONS.c.number, BASELINES.c.version)
        )
        query = select(VEHICLES.c.vehicle, *(end.scalar_subquery() for end in ends))
        with self._database.reading() as connection:
            rows = connection.execute(query.where(VEHICLES.c.vehicle.in_(vehicles)).order_by(VEHICLES.c.vehicle))
            return {vehicle: (number, version) for vehicle, number, version in rows}

    def status(self, vehicle: str) -> Document | None:
        """Return the progress of the analysis of a vehicle; None before the first."""
        query = select(STATUSES.c.document).where(STATUSES.c.vehicle == vehicle)
        status: Document | None = self._database.scalar(query)
        return status

    def baselines(self, vehicle: str) -> list[BaselineRow]:
        """Return the baselines of a vehicle, the present one last."""
        query = select(BASELINES).where(BASELINES.c.vehicle == vehicle).order_by(BASELINES.c.version)
        return self._database.rows(BaselineRow, query)

    def pieces(
        self,
        kind: Literal["observations", "modes", "findings"],
        vehicle: str,
        *,
        since: int | None = None,
        until: int | None = None,
        size: int = 500,
    ) -> Iterator[list[Entry]]:
        """Yield all documents of a kind about a vehicle in order of time, so that memory does not grow with them.

        Parameters
        ----------
        kind
            Kind of the documents.
        vehicle
            Name of the vehicle.
        since, until
            Earliest and latest time, UTC ns; None: the first and the last.
        size
            Largest number of documents in a piece, each of which is a transaction of its own.
        """
        table = _KINDS[kind]
        place = (table.c.t0, *(column for column in reversed(table.primary_key.columns) if column.name != "vehicle"))
        columns = [table.c[name] for name in Entry.__dataclass_fields__]
        query = select(*columns, *(column.label(f"at_{column.name}") for column in place)).order_by(*place).limit(size)
        query = query.where(table.c.vehicle == vehicle, *_within(table, None, until))
        following = query.where(*_within(table, since, None))
        while True:
            with self._database.reading() as connection:
                rows = connection.execute(following).all()
            if rows:
                yield [Entry(*row[: len(columns)]) for row in rows]
            if len(rows) < size:
                return
            following = query.where(tuple_(*place) > tuple_(*rows[-1][len(columns) :]))

    def snapshot(self, vehicle: str) -> Snapshot | None:
        """Return the state from which the analysis of a vehicle continues."""
        return self._database.row(Snapshot, select(SNAPSHOTS).where(SNAPSHOTS.c.vehicle == vehicle))

    def _add(self, connection: Connection, table: Table, rows: list[dict[str, Any]]) -> None:
        """Store new rows."""
        if rows:
            connection.execute(self._database.insert(table).on_conflict_do_nothing(), rows)

    def _put_snapshot(self, connection: Connection, progress: Progress, document: bytes) -> None:
        """Store the state, unless that of the same boot is ahead."""
        values = {"boot": progress.boot, "seq": progress.done_seq, "document": document}
        row = self._database.insert(SNAPSHOTS).values(vehicle=progress.vehicle, **values)
        is_behind = and_(SNAPSHOTS.c.boot == progress.boot, SNAPSHOTS.c.seq > progress.done_seq)
        connection.execute(row.on_conflict_do_update(index_elements=["vehicle"], set_=values, where=not_(is_behind)))

    def _put_statuses(self, connection: Connection, documents: Mapping[str, Document]) -> None:
        """Store the progress of vehicles."""
        if documents:
            row = self._database.insert(STATUSES)
            new = {name: row.excluded[name] for name in ("document", "is_learning")}
            rows = [
                {"vehicle": name, "document": own, "is_learning": bool(own.get("is_learning"))}
                for name, own in sorted(documents.items())
            ]
            connection.execute(row.on_conflict_do_update(index_elements=["vehicle"], set_=new), rows)


def _within(table: Table, since: int | None, until: int | None) -> list[ColumnElement[bool]]:
    """Return the conditions for documents about a period."""
    begun = [] if since is None else [table.c.t0 >= since]
    return begun if until is None else [*begun, table.c.t0 <= until]


def _mark_done(connection: Connection, progress: Progress) -> None:
    """Advance the cursor and delete the frames that are no longer needed."""
    if progress.done_seq < 0:
        return
    place = {"of_vehicle": progress.vehicle, "of_boot": progress.boot}
    contiguous = connection.scalar(_CONTIGUOUS, place)
    if contiguous is None or progress.done_seq > contiguous:
        raise ParameterError(
            f"done_seq={progress.done_seq} of {progress.vehicle!r} {progress.boot} must be at most {contiguous}, "
            f"up to where its frames are complete: analyse what pending returns"
        )
    connection.execute(_ANALYSED, {**place, "last": progress.done_seq})
    connection.execute(_UNNEEDED, {**place, "last": progress.delete_through_seq})


def _rows(progress: Progress, entries: Sequence[Numbered]) -> list[dict[str, Any]]:
    """Return the columns of documents about numbered windows."""
    common = {"vehicle": progress.vehicle, "boot": progress.boot, "stored": progress.now}
    return [common | {"number": number, "t0": t0, "document": document} for number, t0, document in entries]


def _placed(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the columns of findings, counted within each window."""
    numbers = [row["number"] for row in rows]
    return [row | {"place": numbers[:k].count(row["number"])} for k, row in enumerate(rows)]
