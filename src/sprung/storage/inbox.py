"""The durable inbox: frames that arrived, in any order and repeatedly, and their progress towards completeness."""

from collections.abc import Container, Mapping, Sequence
from typing import Any

from sqlalchemy import ColumnElement, Connection, Table, and_, bindparam, func, select, tuple_, update

from sprung.storage.database import Database
from sprung.storage.rows import Cursor, StoredFrame, VehicleRow, check_count
from sprung.storage.schema import CURSORS, FRAMES, VEHICLES

Key = tuple[str, int]

_STRIDE = 1000
_LARGEST = 2**63 - 1
_ADVANCE = (
    update(CURSORS)
    .where(CURSORS.c.vehicle == bindparam("of_vehicle"), CURSORS.c.boot == bindparam("of_boot"))
    .values(contiguous=bindparam("reached"), updated=bindparam("now"))
)


class Inbox:
    """Vehicles and their frames that are not yet analysed.

    Parameters
    ----------
    database
        Database of the store.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def put_vehicle(
        self, vehicle: str, *, configuration: str, description: str, channels: Sequence[Any], now: int
    ) -> None:
        """Store the description of a vehicle: hash and text of its configuration, its channels."""
        values = {"configuration": configuration, "description": description, "channels": list(channels)}
        row = self._database.insert(VEHICLES).values(vehicle=vehicle, first_seen=now, last_seen=now, **values)
        with self._database.writing() as connection:
            connection.execute(row.on_conflict_do_update(index_elements=["vehicle"], set_={**values, "last_seen": now}))

    def seen(self, times: Mapping[str, int]) -> None:
        """Store when vehicles were last seen; those without a description are ignored."""
        of_vehicle = and_(VEHICLES.c.vehicle == bindparam("of"), VEHICLES.c.last_seen < bindparam("now"))
        rows = [{"of": vehicle, "now": now} for vehicle, now in sorted(times.items())]
        if rows:
            with self._database.writing() as connection:
                connection.execute(update(VEHICLES).where(of_vehicle).values(last_seen=bindparam("now")), rows)

    def vehicles(self) -> list[VehicleRow]:
        """Return the vehicles in order of their names."""
        with self._database.reading() as connection:
            rows = connection.execute(select(VEHICLES).order_by(VEHICLES.c.vehicle))
            return [VehicleRow(**row) for row in rows.mappings()]

    def vehicle(self, vehicle: str) -> VehicleRow | None:
        """Return a vehicle; None if it has no description."""
        with self._database.reading() as connection:
            row = connection.execute(select(VEHICLES).where(VEHICLES.c.vehicle == vehicle)).mappings().first()
            return None if row is None else VehicleRow(**row)

    def n_vehicles(self) -> int:
        """Return the number of vehicles."""
        with self._database.reading() as connection:
            return connection.scalar(select(func.count()).select_from(VEHICLES)) or 0

    def last_seen(self) -> dict[str, int]:
        """Return when each vehicle was last seen."""
        with self._database.reading() as connection:
            rows = connection.execute(select(VEHICLES.c.vehicle, VEHICLES.c.last_seen).order_by(VEHICLES.c.vehicle))
            return {row.vehicle: row.last_seen for row in rows}

    def add_frames(self, frames: Sequence[StoredFrame], *, now: int) -> dict[Key, int]:
        """Put new frames into the inbox, and sync them to disk.

        Parameters
        ----------
        frames
            Frames in any order; of several with one number the first counts.
        now
            Present time, UTC ns.

        Returns
        -------
        dict
            Sequence number up to which every frame arrived or is lost, and can be acknowledged, for each vehicle and
            boot among `frames`.

        Raises
        ------
        ParameterError
            If boot or seq is negative, or 2^63 or more.
        StoreError
            If the store cannot write; nothing is stored then.
        """
        batches: dict[Key, dict[int, StoredFrame]] = {}
        for frame in frames:
            key = (frame.vehicle, check_count("boot", frame.boot))
            batches.setdefault(key, {}).setdefault(check_count("seq", frame.seq), frame)
        if not batches:
            return {}
        with self._database.writing() as connection:
            cursors = self._locked(connection, sorted(batches), now)
            new = [
                frame._asdict()
                for key, batch in batches.items()
                for seq, frame in batch.items()
                if seq > cursors[key].contiguous
            ]
            if new:
                connection.execute(self._database.insert(FRAMES).on_conflict_do_nothing(), new)
            reached = {key: _run(batch, after=cursors[key].contiguous) for key, batch in batches.items()}
            for key in _followed(connection, reached):
                reached[key] = _unbroken(connection, key, after=reached[key])
            moved = [
                {"of_vehicle": key[0], "of_boot": key[1], "reached": seq, "now": now}
                for key, seq in reached.items()
                if seq > cursors[key].contiguous
            ]
            if moved:
                connection.execute(_ADVANCE, moved)
        return reached

    def declare_lost(self, vehicle: str, boot: int, below_seq: int, *, now: int) -> int:
        """Declare lost the frames below `below_seq` that have not arrived.

        Returns
        -------
        int
            Sequence number up to which every frame arrived or is lost, and can be acknowledged.
        """
        key = (vehicle, check_count("boot", boot))
        check_count("below_seq", below_seq)
        with self._database.writing() as connection:
            before = self._locked(connection, [key], now)[key]
            last = below_seq - 1
            if last <= before.contiguous:
                return before.contiguous
            arrived = select(func.count()).where(_of(FRAMES, key), FRAMES.c.seq.between(before.contiguous + 1, last))
            lost = before.lost + last - before.contiguous - (connection.scalar(arrived) or 0)
            reached = _unbroken(connection, key, after=last)
            moved = update(CURSORS).where(_of(CURSORS, key)).values(contiguous=reached, lost=lost, updated=now)
            connection.execute(moved)
        return reached

    def cursor(self, vehicle: str, boot: int) -> Cursor:
        """Return how far the frames of one boot of a vehicle have come."""
        with self._database.reading() as connection:
            return _cursors(connection, _of(CURSORS, (vehicle, boot))).get((vehicle, boot), Cursor())

    def cursors(self) -> dict[Key, Cursor]:
        """Return how far the frames have come, by vehicle and boot."""
        with self._database.reading() as connection:
            return _cursors(connection)

    def pending(self, vehicle: str, boot: int, *, after: int, limit: int) -> list[StoredFrame]:
        """Return at most `limit` frames that follow the number `after`, up to where the inbox is complete."""
        key = (vehicle, boot)
        complete = select(CURSORS.c.contiguous).where(_of(CURSORS, key)).scalar_subquery()
        ready = and_(_of(FRAMES, key), FRAMES.c.seq > after, FRAMES.c.seq <= complete)
        columns = (FRAMES.c[name] for name in StoredFrame._fields)
        query = select(*columns).where(ready).order_by(FRAMES.c.seq).limit(limit)
        with self._database.reading() as connection:
            return [StoredFrame._make(row) for row in connection.execute(query)]

    def boots(self, vehicle: str) -> list[int]:
        """Return the boots of a vehicle with frames in the inbox, ascending."""
        query = select(FRAMES.c.boot).distinct().where(FRAMES.c.vehicle == vehicle).order_by(FRAMES.c.boot)
        with self._database.reading() as connection:
            return list(connection.scalars(query))

    def _locked(self, connection: Connection, keys: Sequence[Key], now: int) -> dict[Key, Cursor]:
        """Return cursors, created if missing; on PostgreSQL other writers of them wait from here on."""
        fresh = {"contiguous": -1, "done": -1, "lost": 0, "updated": now}
        rows = [{"vehicle": vehicle, "boot": boot, **fresh} for vehicle, boot in keys]
        connection.execute(self._database.insert(CURSORS).on_conflict_do_nothing(), rows)
        return _cursors(connection, tuple_(CURSORS.c.vehicle, CURSORS.c.boot).in_(keys), is_locked=True)


def _of(table: Table, key: Key) -> ColumnElement[bool]:
    """Return the condition for the rows of one boot of a vehicle."""
    return and_(table.c.vehicle == key[0], table.c.boot == key[1])


def _cursors(connection: Connection, *conditions: ColumnElement[bool], is_locked: bool = False) -> dict[Key, Cursor]:
    """Return cursors by vehicle and boot."""
    query = select(CURSORS).where(*conditions).order_by(CURSORS.c.vehicle, CURSORS.c.boot)
    rows = connection.execute(query.with_for_update() if is_locked else query)
    return {(row.vehicle, row.boot): Cursor(row.contiguous, row.done, row.lost, row.updated) for row in rows}


def _run(batch: Container[int], *, after: int) -> int:
    """Return the end of the unbroken run of sequence numbers that follows `after`."""
    while after + 1 in batch:
        after += 1
    return after


def _followed(connection: Connection, reached: Mapping[Key, int]) -> list[Key]:
    """Return the vehicles and boots whose next frame arrived earlier."""
    following = [(vehicle, boot, seq + 1) for (vehicle, boot), seq in reached.items() if seq < _LARGEST]
    columns = FRAMES.c.vehicle, FRAMES.c.boot, FRAMES.c.seq
    rows = connection.execute(select(*columns).where(tuple_(*columns).in_(following)))
    return [(row.vehicle, row.boot) for row in rows]


def _unbroken(connection: Connection, key: Key, *, after: int) -> int:
    """Return the end of the unbroken run of frames that follows `after`."""
    while True:
        following = (
            select(FRAMES.c.seq).where(_of(FRAMES, key), FRAMES.c.seq > after).order_by(FRAMES.c.seq).limit(_STRIDE)
        )
        run = sum(seq == after + place for place, seq in enumerate(connection.scalars(following), start=1))
        after += run
        if run < _STRIDE:
            return after
