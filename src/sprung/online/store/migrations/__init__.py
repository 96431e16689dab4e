"""Steps from every released schema to the present one, taken when a store is opened."""

from functools import cache
from pathlib import Path

from alembic.migration import MigrationContext
from alembic.operations import Operations
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, inspect, select, text

from sprung.online.store.schema import COMPATIBILITY, StoreError

#: Oldest revision whose programs can use a store of the newest one, at the same time as the present program. A step
#: only adds columns with a default, tables and indices; one that does more sets this to its own revision.
COMPATIBLE_SINCE = "0006"

# Any number, but the same in every program that opens the store.
_LOCK = 0x737072756E67


@cache
def steps() -> ScriptDirectory:
    """Return the steps, newest first."""
    return ScriptDirectory(str(Path(__file__).parent))


def upgrade(connection: Connection, *, target: str | None = None) -> None:
    """Take the steps to a revision, in the transaction of `connection`.

    Parameters
    ----------
    connection
        Connection in a transaction, which the caller commits.
    target
        Revision to stop at; None: the newest.

    Raises
    ------
    StoreError
        If the schema is of a newer program, and that does not state that this one can use it.
    """
    if connection.dialect.name == "postgresql":
        connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _LOCK})
    context = MigrationContext.configure(connection)
    present = context.get_current_revision()
    target = target or steps().get_current_head() or "base"
    if present == target:
        return
    known = {step.revision for step in steps().walk_revisions()}
    if present is not None and present not in known:
        if _since(connection, present) in known:
            return
        raise StoreError(
            f"the store has the schema {present!r}, and this program knows only up to {target!r}: "
            f"install the newer sprung that wrote it, or open another store"
        )
    ahead = list(steps().iterate_revisions(target, present or "base"))
    with Operations.context(context):
        for step in reversed(ahead):
            step.module.upgrade()
    context.stamp(steps(), target)
    if target == steps().get_current_head():
        connection.execute(COMPATIBILITY.insert().values(revision=target, since=COMPATIBLE_SINCE))


def revision(connection: Connection) -> str | None:
    """Return the revision of the schema; None if there is none yet."""
    return MigrationContext.configure(connection).get_current_revision()


def _since(connection: Connection, revision: str) -> str | None:
    """Return the oldest revision whose programs can use a revision; None if nothing is known."""
    if not inspect(connection).has_table(COMPATIBILITY.name):
        return None
    return connection.scalar(select(COMPATIBILITY.c.since).where(COMPATIBILITY.c.revision == revision))
