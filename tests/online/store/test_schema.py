"""Migrations lead to the tables of the schema, and back."""

from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import create_engine, make_url, text

from sprung.online.store import Cursor, StoredFrame, open_store
from sprung.online.store.migrations import steps, upgrade
from sprung.online.store.schema import METADATA


@pytest.fixture
def engine(url, tmp_path: Path):
    """An engine on an empty database, without what the store adds."""
    address = make_url(url)
    if address.get_backend_name() == "sqlite":
        (tmp_path / "new").mkdir()
    else:
        address = address.set(drivername="postgresql+psycopg")
    made = create_engine(address)
    yield made
    made.dispose()


def test_steps_lead_to_the_tables(engine) -> None:
    with engine.begin() as connection:
        upgrade(connection)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []


@pytest.mark.slow
@pytest.mark.parametrize("revision", [step.revision for step in steps().walk_revisions()])
def test_every_released_schema_is_brought_up_to_date(engine, url, revision) -> None:
    with engine.begin() as connection:
        upgrade(connection, target=revision)
        columns = "vehicle, boot, contiguous, done, lost, updated"
        connection.execute(text(f"INSERT INTO cursors ({columns}) VALUES ('zafira', 7, 12, 10, 3, 99)"))
    with open_store(url) as store:
        assert store.inbox.cursors() == {("zafira", 7): Cursor(12, 10, 3)}
        assert store.inbox.add_frames([StoredFrame("zafira", 7, 13, 0, b"")], now=0) == {("zafira", 7): 13}
    with engine.connect() as connection:
        assert MigrationContext.configure(connection).get_current_revision() == steps().get_current_head()
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []


def test_steps_can_be_taken_back(engine) -> None:
    from alembic.operations import Operations

    with engine.begin() as connection:
        upgrade(connection)
        with Operations.context(MigrationContext.configure(connection)):
            for step in steps().walk_revisions():
                step.module.downgrade()
        assert set(engine.dialect.get_table_names(connection)) == {"alembic_version"}
