"""The durable inbox: frames that arrived, in any order and repeatedly, and their progress towards completeness.

Frames whose analysis fails, and states that cannot be read, are quarantined for a later release, and not deleted.
"""

from collections.abc import Collection, Container, Iterator, Mapping, Sequence
from typing import Any

import sqlalchemy as sa

from sprung.online.store.database import Tables
from sprung.online.store.schema import (
    CURSORS,
    FORGOTTEN,
    FRAMES,
    LARGEST,
    QUARANTINE,
    SNAPSHOTS,
    VEHICLES,
    Cursor,
    QuarantineRow,
    StoredFrame,
    VehicleRow,
    check_count,
)

Key = tuple[str, int]

_STRIDE = 1000
#: Bytes of frames that are read together, and rows that the database hands over together.
_MAX_BYTES, _ROWS = 8 << 20, 16
_ADVANCE = (
    sa.update(CURSORS)
    .where(CURSORS.c.vehicle == sa.bindparam("of_vehicle"), CURSORS.c.boot == sa.bindparam("of_boot"))
    .values(contiguous=sa.bindparam("reached"), updated=sa.bindparam("now"))
)
# Statements that are made once take a third of the time.
_AFTER = (
    FRAMES.c.vehicle == sa.bindparam("of_vehicle"),
    FRAMES.c.boot == sa.bindparam("of_boot"),
    FRAMES.c.seq > sa.bindparam("after"),
)
_FOLLOWING = sa.select(FRAMES.c.seq).where(*_AFTER).order_by(FRAMES.c.seq).limit(_STRIDE)
_N_ARRIVED = sa.select(sa.func.count()).where(*_AFTER, FRAMES.c.seq <= sa.bindparam("last"))
#: Kind of a state; the others are those of frames.
_STATE = "state"
#: Largest size of what is kept of one vehicle [bytes]; what was quarantined first is deleted first.
_MAX_QUARANTINED = 64 << 20


class Inbox(Tables):
    """Vehicles and their frames that are not yet analysed."""

    def put_vehicle(
        self, vehicle: str, *, configuration: str, description: str, channels: Sequence[Any], now: int
    ) -> None:
        """Store the description of a vehicle: hash and text of its configuration, its channels."""
        values = {"configuration": configuration, "description": description, "channels": list(channels)}
        new = {"vehicle": vehicle, "first_seen": now, "last_seen": now, "is_parked": False, **values}
        row = self._database.insert(VEHICLES).values(new)
        with self._database.writing() as connection:
            connection.execute(row.on_conflict_do_update(index_elements=["vehicle"], set_={**values, "last_seen": now}))

    def seen(self, times: Mapping[str, int]) -> None:
        """Store when vehicles were last seen; those without a description are ignored."""
        of_vehicle = sa.and_(VEHICLES.c.vehicle == sa.bindparam("of"), VEHICLES.c.last_seen < sa.bindparam("now"))
        rows = [{"of": vehicle, "now": now} for vehicle, now in sorted(times.items())]
        if rows:
            with self._database.writing() as connection:
                connection.execute(sa.update(VEHICLES).where(of_vehicle).values(last_seen=sa.bindparam("now")), rows)

    def vehicles(self) -> list[VehicleRow]:
        """Return the vehicles in order of their names."""
        return self._database.rows(VehicleRow, sa.select(VEHICLES).order_by(VEHICLES.c.vehicle))

    def vehicle(self, vehicle: str) -> VehicleRow | None:
        """Return a vehicle; None if it has no description."""
        return self._database.row(VehicleRow, sa.select(VEHICLES).where(VEHICLES.c.vehicle == vehicle))

    def n_vehicles(self) -> int:
        """Return the number of vehicles."""
        return self._database.scalar(sa.select(sa.func.count()).select_from(VEHICLES)) or 0

    def last_seen(self) -> dict[str, int]:
        """Return when each vehicle was last seen."""
        with self._database.reading() as connection:
            rows = connection.execute(sa.select(VEHICLES.c.vehicle, VEHICLES.c.last_seen).order_by(VEHICLES.c.vehicle))
            return {row.vehicle: row.last_seen for row in rows}

    def parked(self) -> set[str]:
        """Return the vehicles that were shut down properly."""
        return set(self._database.scalars(sa.select(VEHICLES.c.vehicle).where(VEHICLES.c.is_parked)))

    def park(self, vehicle: str, *, is_parked: bool) -> None:
        """Store whether a vehicle was shut down properly."""
        with self._database.writing() as connection:
            connection.execute(sa.update(VEHICLES).where(VEHICLES.c.vehicle == vehicle).values(is_parked=is_parked))

    def add_frames(
        self, frames: Sequence[StoredFrame], *, now: int, new: list[StoredFrame] | None = None
    ) -> dict[Key, int]:
        """Put new frames into the inbox, and sync them to disk.

        Parameters
        ----------
        frames
            Frames in any order; of several with one number the first counts.
        now
            Present time, UTC ns.
        new
            List to which frames are added that follow the unbroken run of those before; None: none is wanted.

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
            cursors = self._locked(connection, {key: max(batch) for key, batch in sorted(batches.items())}, now)
            later = [
                frame for key, batch in batches.items() for seq, frame in batch.items() if seq > cursors[key].contiguous
            ]
            if later:
                rows = [frame._asdict() for frame in later]
                connection.execute(self._database.insert(FRAMES).on_conflict_do_nothing(), rows)
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
        if new is not None:
            new.extend(later)
        return reached

    def declare_lost(self, below: Mapping[Key, int], *, now: int) -> dict[Key, tuple[Cursor, Cursor]]:
        """Declare lost the frames below a sequence number that have not arrived, in one transaction.

        Parameters
        ----------
        below
            Sequence number of the first frame that may still arrive, for each vehicle and boot.
        now
            Present time, UTC ns.

        Returns
        -------
        dict
            Progress before and after of each vehicle and boot; `contiguous` can be acknowledged.

        Raises
        ------
        ParameterError
            If a number is negative, or 2^63 or more.
        StoreError
            If the store cannot write; nothing is stored then.
        """
        ends = {
            (vehicle, check_count("boot", boot)): check_count("below", first) - 1
            for (vehicle, boot), first in sorted(below.items())
        }
        if not ends:
            return {}
        with self._database.writing() as connection:
            cursors = self._locked(connection, ends, now)
            progress = {key: (cursors[key], cursors[key]) for key in ends}
            advancing = {key: last for key, last in ends.items() if last > cursors[key].contiguous}
            for key, last, n_arrived, reached in _advances(connection, advancing):
                before = cursors[key]
                lost = before.lost + last - before.contiguous - n_arrived
                progress[key] = before, Cursor(reached, before.done, lost, now)
            moved = [
                {"of_vehicle": key[0], "of_boot": key[1], "reached": after.contiguous, "lost": after.lost, "now": now}
                for key, (before, after) in progress.items()
                if after.contiguous > before.contiguous
            ]
            if moved:
                connection.execute(_ADVANCE.values(lost=sa.bindparam("lost")), moved)
        return progress

    def cursor(self, vehicle: str, boot: int) -> Cursor:
        """Return the progress of the frames of one boot of a vehicle."""
        with self._database.reading() as connection:
            return _cursors(connection, _of(CURSORS, (vehicle, boot))).get((vehicle, boot), Cursor())

    def cursors(self, *, vehicle: str | None = None) -> dict[Key, Cursor]:
        """Return the progress of frames by vehicle and boot: of one vehicle, or of all."""
        with self._database.reading() as connection:
            return _cursors(connection, *([] if vehicle is None else [CURSORS.c.vehicle == vehicle]))

    def open_boots(self, vehicle: str, *, limit: int) -> list[int]:
        """Return at most `limit` boots of a vehicle that are not analysed up to where they are complete, ascending."""
        is_open = sa.or_(CURSORS.c.done < CURSORS.c.contiguous, CURSORS.c.contiguous < 0)
        query = sa.select(CURSORS.c.boot).where(CURSORS.c.vehicle == vehicle, is_open).order_by(CURSORS.c.boot)
        return list(self._database.scalars(query.limit(limit)))

    def pending(self, vehicle: str, boot: int, *, after: int, limit: int) -> list[StoredFrame]:
        """Return at most `limit` frames that follow the number `after`, up to where the inbox is complete.

        Of large frames they are fewer: the last one ends the first 8 MiB.
        """
        key = (vehicle, boot)
        complete = sa.select(CURSORS.c.contiguous).where(_of(CURSORS, key)).scalar_subquery()
        ready = sa.and_(_of(FRAMES, key), FRAMES.c.seq > after, FRAMES.c.seq <= complete)
        columns = (FRAMES.c[name] for name in StoredFrame._fields)
        query = sa.select(*columns).where(ready).order_by(FRAMES.c.seq).limit(limit)
        frames: list[StoredFrame] = []
        n_bytes = 0
        with (
            self._database.reading() as connection,
            connection.execution_options(yield_per=_ROWS).execute(query) as rows,
        ):
            for row in rows:
                frames.append(StoredFrame._make(row))
                n_bytes += len(frames[-1].payload)
                if n_bytes >= _MAX_BYTES:
                    break
        return frames

    def n_bytes(self, vehicle: str | None = None) -> dict[str, int]:
        """Return the size of the payloads that wait, by vehicle: of one vehicle, or of all."""
        query = sa.select(FRAMES.c.vehicle, sa.func.sum(sa.func.length(FRAMES.c.payload))).group_by(FRAMES.c.vehicle)
        with self._database.reading() as connection:
            rows = connection.execute(query if vehicle is None else query.where(FRAMES.c.vehicle == vehicle))
            return {name: int(size) for name, size in rows}

    def last(self, vehicle: str) -> tuple[int, int] | None:
        """Return boot and sequence number of the last frame of a vehicle that waits; None: none does."""
        place = FRAMES.c.boot, FRAMES.c.seq
        query = sa.select(*place).where(FRAMES.c.vehicle == vehicle).order_by(*(one.desc() for one in place)).limit(1)
        with self._database.reading() as connection:
            row = connection.execute(query).first()
        return None if row is None else (row.boot, row.seq)

    def boots(self, vehicle: str) -> list[int]:
        """Return the boots of a vehicle with frames in the inbox, ascending."""
        query = sa.select(FRAMES.c.boot).distinct().where(FRAMES.c.vehicle == vehicle).order_by(FRAMES.c.boot)
        return list(self._database.scalars(query))

    def _locked(self, connection: sa.Connection, ends: Mapping[Key, int], now: int) -> dict[Key, Cursor]:
        """Return cursors, created if missing; on PostgreSQL other writers of them wait from here on.

        Frames up to `ends` of boots whose progress was deleted are repeats of what was analysed long ago, and count as
        analysed.
        """
        fresh = {"contiguous": -1, "done": -1, "lost": 0, "updated": now}
        rows = [{"vehicle": vehicle, "boot": boot, **fresh} for vehicle, boot in ends]
        connection.execute(self._database.insert(CURSORS).on_conflict_do_nothing(), rows)
        cursors = _cursors(connection, sa.tuple_(CURSORS.c.vehicle, CURSORS.c.boot).in_(list(ends)), is_locked=True)
        for key in _forgotten(connection, {key: end for key, end in ends.items() if _may_be_old(cursors[key], end)}):
            values = {"contiguous": ends[key], "done": ends[key], "updated": now}
            connection.execute(sa.update(CURSORS).where(_of(CURSORS, key)).values(values))
            cursors[key] = Cursor(ends[key], ends[key], cursors[key].lost, now)
        return cursors


def _may_be_old(cursor: Cursor, end: int) -> bool:
    """Return whether nothing of a boot waits for analysis, so that its progress may have been deleted."""
    return cursor.contiguous == cursor.done < end


def _forgotten(connection: sa.Connection, keys: Collection[Key]) -> list[Key]:
    """Return the vehicles and boots whose progress was deleted."""
    if not keys:
        return []
    vehicles = {vehicle for vehicle, _ in keys}
    rows = connection.execute(sa.select(FORGOTTEN).where(FORGOTTEN.c.vehicle.in_(vehicles)))
    newest = {row.vehicle: row.boot for row in rows}
    return [key for key in keys if key[1] <= newest.get(key[0], -1)]


def _of(table: sa.Table, key: Key) -> sa.ColumnElement[bool]:
    """Return the condition for the rows of one boot of a vehicle."""
    return sa.and_(table.c.vehicle == key[0], table.c.boot == key[1])


def _cursors(
    connection: sa.Connection, *conditions: sa.ColumnElement[bool], is_locked: bool = False
) -> dict[Key, Cursor]:
    """Return cursors by vehicle and boot."""
    query = sa.select(CURSORS).where(*conditions).order_by(CURSORS.c.vehicle, CURSORS.c.boot)
    rows = connection.execute(query.with_for_update() if is_locked else query)
    return {(row.vehicle, row.boot): Cursor(row.contiguous, row.done, row.lost, row.updated) for row in rows}


def _run(batch: Container[int], *, after: int) -> int:
    """Return the end of the unbroken run of sequence numbers that follows `after`."""
    while after + 1 in batch:
        after += 1
    return after


def _followed(connection: sa.Connection, reached: Mapping[Key, int]) -> list[Key]:
    """Return the vehicles and boots whose next frame arrived earlier."""
    following = [(vehicle, boot, seq + 1) for (vehicle, boot), seq in reached.items() if seq < LARGEST]
    columns = FRAMES.c.vehicle, FRAMES.c.boot, FRAMES.c.seq
    rows = connection.execute(sa.select(*columns).where(sa.tuple_(*columns).in_(following)))
    return [(row.vehicle, row.boot) for row in rows]


def _advances(connection: sa.Connection, ends: Mapping[Key, int]) -> Iterator[tuple[Key, int, int, int]]:
    """Yield key, last frame that may be lost, number of frames up to it, and end of the unbroken run after it."""
    later = sa.select(FRAMES.c.seq).where(
        FRAMES.c.vehicle == CURSORS.c.vehicle, FRAMES.c.boot == CURSORS.c.boot, FRAMES.c.seq > CURSORS.c.contiguous
    )
    columns = CURSORS.c.vehicle, CURSORS.c.boot
    rows = connection.execute(
        sa.select(*columns, CURSORS.c.contiguous).where(sa.tuple_(*columns).in_(ends), later.exists())
    )
    waiting = {(row.vehicle, row.boot): row.contiguous for row in rows}
    followed = set(_followed(connection, {key: ends[key] for key in waiting}))
    for key, last in ends.items():
        n_arrived, reached = 0, last
        if key in waiting:
            of_key = {"of_vehicle": key[0], "of_boot": key[1], "after": waiting[key], "last": last}
            n_arrived = connection.scalar(_N_ARRIVED, of_key) or 0
        if key in followed:
            reached = _unbroken(connection, key, after=last)
        yield key, last, n_arrived, reached


def _unbroken(connection: sa.Connection, key: Key, *, after: int) -> int:
    """Return the end of the unbroken run of frames that follows `after`."""
    while True:
        following = connection.scalars(_FOLLOWING, {"of_vehicle": key[0], "of_boot": key[1], "after": after})
        run = sum(seq == after + place for place, seq in enumerate(following, start=1))
        after += run
        if run < _STRIDE:
            return after


class Quarantine(Tables):
    """Frames and states that are quarantined, with the reason.

    Notes
    -----
    Of each vehicle the last 64 MiB are kept, as long as results.
    """

    def put_frames(self, vehicle: str, boot: int, first: int, last: int, *, reason: str, now: int) -> int:
        """Move frames of a boot, from one sequence number to another, out of the inbox.

        Returns
        -------
        int
            Number of frames moved.

        Raises
        ------
        StoreError
            If the store cannot write; nothing is moved then.
        """
        chosen = sa.and_(FRAMES.c.vehicle == vehicle, FRAMES.c.boot == boot, FRAMES.c.seq.between(first, last))
        names = StoredFrame._fields
        rows = sa.select(*(FRAMES.c[name] for name in names), sa.literal(reason), sa.literal(now)).where(chosen)
        insert = self._database.insert(QUARANTINE).from_select([*names, "reason", "stored"], rows)
        with self._database.writing() as connection:
            connection.execute(insert.on_conflict_do_nothing())
            moved = connection.execute(sa.delete(FRAMES).where(chosen)).rowcount
            _limit(connection, vehicle)
        return moved

    def put_state(self, vehicle: str, *, reason: str, now: int) -> bool:
        """Move the state of a vehicle out of the way; return whether it had one.

        Raises
        ------
        StoreError
            If the store cannot write; nothing is moved then.
        """
        chosen = SNAPSHOTS.c.vehicle == vehicle
        with self._database.writing() as connection:
            row = connection.execute(sa.select(SNAPSHOTS).where(chosen)).mappings().first()
            if row is None:
                return False
            values = {"kind": _STATE, "t0": now, "payload": row["document"], "reason": reason, "stored": now}
            insert = self._database.insert(QUARANTINE).values(
                vehicle=vehicle, boot=row["boot"], seq=row["seq"], **values
            )
            keys = [column.name for column in QUARANTINE.primary_key]
            connection.execute(insert.on_conflict_do_update(index_elements=keys, set_=values))
            connection.execute(sa.delete(SNAPSHOTS).where(chosen))
            _limit(connection, vehicle)
        return True

    def vehicles(self) -> list[str]:
        """Return the vehicles of which something was quarantined, by name."""
        query = sa.select(QUARANTINE.c.vehicle).distinct().order_by(QUARANTINE.c.vehicle)
        return list(self._database.scalars(query))

    def find(self, vehicle: str) -> list[QuarantineRow]:
        """Return what was quarantined of a vehicle, in order of boots and sequence numbers."""
        query = sa.select(QUARANTINE).where(QUARANTINE.c.vehicle == vehicle).order_by(*QUARANTINE.primary_key)
        return self._database.rows(QuarantineRow, query)


def _limit(connection: sa.Connection, vehicle: str) -> None:
    """Delete what was quarantined first, down to the largest size."""
    key = (QUARANTINE.c.boot, QUARANTINE.c.seq, QUARANTINE.c.kind)
    of_vehicle: sa.ColumnElement[bool] = QUARANTINE.c.vehicle == vehicle
    newest_first = (QUARANTINE.c.stored.desc(), *(column.desc() for column in key))
    sizes = sa.select(*key, sa.func.length(QUARANTINE.c.payload)).where(of_vehicle).order_by(*newest_first)
    total, beyond = 0, []
    for *place, size in connection.execute(sizes):
        total += size
        if total > _MAX_QUARANTINED:
            beyond.append(tuple(place))
    for start in range(0, len(beyond), 500):
        connection.execute(sa.delete(QUARANTINE).where(of_vehicle, sa.tuple_(*key).in_(beyond[start : start + 500])))
