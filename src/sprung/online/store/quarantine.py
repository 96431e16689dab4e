"""Frames whose analysis fails, and states that cannot be read: quarantined for a later release, and not deleted."""

from sqlalchemy import ColumnElement, Connection, and_, delete, func, literal, select, tuple_

from sprung.online.store.database import Database
from sprung.online.store.rows import QuarantineRow, StoredFrame
from sprung.online.store.schema import FRAMES, QUARANTINE, SNAPSHOTS

#: Kind of a state; the others are those of frames.
_STATE = "state"
#: Largest size of what is kept of one vehicle [bytes]; what was quarantined first is deleted first.
_MAX_BYTES = 64 << 20


class Quarantine:
    """Frames and states that are quarantined, with the reason.

    Parameters
    ----------
    database
        Database of the store.

    Notes
    -----
    Of each vehicle the last 64 MiB are kept, as long as results.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

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
        chosen = and_(FRAMES.c.vehicle == vehicle, FRAMES.c.boot == boot, FRAMES.c.seq.between(first, last))
        names = StoredFrame._fields
        rows = select(*(FRAMES.c[name] for name in names), literal(reason), literal(now)).where(chosen)
        insert = self._database.insert(QUARANTINE).from_select([*names, "reason", "stored"], rows)
        with self._database.writing() as connection:
            connection.execute(insert.on_conflict_do_nothing())
            moved = connection.execute(delete(FRAMES).where(chosen)).rowcount
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
            row = connection.execute(select(SNAPSHOTS).where(chosen)).mappings().first()
            if row is None:
                return False
            values = {"kind": _STATE, "t0": now, "payload": row["document"], "reason": reason, "stored": now}
            insert = self._database.insert(QUARANTINE).values(
                vehicle=vehicle, boot=row["boot"], seq=row["seq"], **values
            )
            keys = [column.name for column in QUARANTINE.primary_key]
            connection.execute(insert.on_conflict_do_update(index_elements=keys, set_=values))
            connection.execute(delete(SNAPSHOTS).where(chosen))
            _limit(connection, vehicle)
        return True

    def vehicles(self) -> list[str]:
        """Return the vehicles of which something was quarantined, by name."""
        query = select(QUARANTINE.c.vehicle).distinct().order_by(QUARANTINE.c.vehicle)
        with self._database.reading() as connection:
            return list(connection.scalars(query))

    def find(self, vehicle: str) -> list[QuarantineRow]:
        """Return what was quarantined of a vehicle, in order of boots and sequence numbers."""
        query = select(QUARANTINE).where(QUARANTINE.c.vehicle == vehicle).order_by(*QUARANTINE.primary_key)
        with self._database.reading() as connection:
            return [QuarantineRow(**row) for row in connection.execute(query).mappings()]


def _limit(connection: Connection, vehicle: str) -> None:
    """Delete what was quarantined first, down to the largest size."""
    key = (QUARANTINE.c.boot, QUARANTINE.c.seq, QUARANTINE.c.kind)
    of_vehicle: ColumnElement[bool] = QUARANTINE.c.vehicle == vehicle
    newest_first = (QUARANTINE.c.stored.desc(), *(column.desc() for column in key))
    sizes = select(*key, func.length(QUARANTINE.c.payload)).where(of_vehicle).order_by(*newest_first)
    total, beyond = 0, []
    for *place, size in connection.execute(sizes):
        total += size
        if total > _MAX_BYTES:
            beyond.append(tuple(place))
    for start in range(0, len(beyond), 500):
        connection.execute(delete(QUARANTINE).where(of_vehicle, tuple_(*key).in_(beyond[start : start + 500])))
