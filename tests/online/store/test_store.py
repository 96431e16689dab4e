import sqlite3
from pathlib import Path

import pytest
from sqlalchemy import create_engine, make_url, text

from sprung.errors import ParameterError
from sprung.online.store import Cursor, StoredFrame, StoreError, open_store


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


def test_newer_schema_is_refused_and_left_alone(url, engine) -> None:
    open_store(url).close()
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(StoreError, match=r"schema '9999', and this program knows only up to .*: install the newer"):
        open_store(url)
    with engine.connect() as connection:
        assert connection.scalar(text("SELECT version_num FROM alembic_version")) == "9999"


def test_newer_schema_that_only_adds_is_used(url, engine) -> None:
    open_store(url).close()
    with engine.begin() as connection:
        connection.execute(text("ALTER TABLE cursors ADD COLUMN later INTEGER NOT NULL DEFAULT 7"))
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        connection.execute(text("INSERT INTO compatibility VALUES ('9999', '0004')"))
    with open_store(url) as store:
        store.inbox.add_frames([StoredFrame("zafira", 7, 0, 0, b"x")], now=0)
        assert store.inbox.cursors() == {("zafira", 7): Cursor(0)}
    with engine.begin() as connection:
        assert connection.scalar(text("SELECT version_num FROM alembic_version")) == "9999"
        connection.execute(text("UPDATE compatibility SET since = '9999' WHERE revision = '9999'"))
    with pytest.raises(StoreError, match=r"install the newer"):
        open_store(url)


def test_store_keeps_what_it_holds(url) -> None:
    with open_store(url) as store:
        store.inbox.add_frames([StoredFrame("zafira", 7, 0, 0, b"x")], now=0)
        assert store.notices == ()
        assert store.size() > 10_000
    with open_store(url) as store:
        assert store.inbox.pending("zafira", 7, after=-1, limit=1) == [StoredFrame("zafira", 7, 0, 0, b"x")]


def test_check_leaves_no_trace(store) -> None:
    store.check()
    assert store.results.snapshot("") is None
    assert (store.free() is None) == (store.folder is None)


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("store.sqlite", "is not the address of a store"),
        ("mysql://me:secret@host/db", r"'mysql://me:\*\*\*@host/db' is an address of neither SQLite nor PostgreSQL"),
        ("sqlite://", "names no file"),
        ("sqlite:///:memory:", "names no file"),
    ],
)
def test_other_addresses_are_refused(address, message) -> None:
    with pytest.raises(ParameterError, match=f"{message}.*: write sqlite:///folder/file.sqlite or postgresql://"):
        open_store(address)


def test_server_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"the store does not answer \(.*\): check that its database runs"):
        open_store(f"postgresql://sprung@/db?host={tmp_path}")


def test_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match=r"cannot be opened \(.*\): check that its folder and disk can be written"):
        open_store(f"sqlite:///{tmp_path}/file/store.sqlite")
    (tmp_path / "folder").mkdir()
    with pytest.raises(StoreError, match=r"unable to open database file|Is a directory"):
        open_store(f"sqlite:///{tmp_path}/folder")


def test_store_that_another_program_holds(sqlite_file, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sprung.online.store.database.PATIENCE", 0.1)
    with open_store(f"sqlite:///{sqlite_file}") as store:
        other = sqlite3.connect(sqlite_file, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match=r"the store is busy \(database is locked\): end the program"):
            store.inbox.add_frames([StoredFrame("zafira", 7, 0, 0, b"")], now=0)
        assert store.inbox.cursors() == {}
        other.close()
        assert store.inbox.add_frames([StoredFrame("zafira", 7, 0, 0, b"")], now=0) == {("zafira", 7): 0}
