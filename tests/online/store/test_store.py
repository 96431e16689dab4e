import os
import sqlite3
from pathlib import Path

import pytest
from sqlalchemy import create_engine, inspect, text

from sprung.errors import ParameterError
from sprung.online.store import StoredFrame, StoreError, check_address, open_store
from sprung.online.store.schema import METADATA


@pytest.fixture
def engine(url):
    """An engine on the database of a store that was closed."""
    open_store(url).close()
    made = create_engine(check_address(url))
    yield made
    made.dispose()


@pytest.mark.parametrize(
    ("change", "schema"),
    [("UPDATE schema_version SET version = 2", "2"), ("DROP TABLE schema_version", "of a trial version")],
)
def test_store_of_another_version_is_refused_and_left_alone(url, engine, change, schema) -> None:
    with engine.begin() as connection:
        connection.execute(text(change))
    with pytest.raises(StoreError, match=f"the store has the schema {schema}, and this program uses 1: install"):
        open_store(url)
    tables = METADATA.tables.keys() - ({"schema_version"} if change.startswith("DROP") else set())
    assert set(inspect(engine).get_table_names()) == tables


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


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620])
def test_a_file_is_for_its_owner_alone(tmp_path, mode) -> None:
    path = tmp_path / "made" / "store.sqlite"
    before = os.umask(0o022)
    try:
        with open_store(f"sqlite:///{path}") as store:
            store.requests.audit("eve", "log in", "service", now=1)
            assert {oct(each.stat().st_mode & 0o777) for each in path.parent.iterdir()} == {"0o600"}
    finally:
        os.umask(before)
    path.chmod(mode)
    with pytest.raises(StoreError, match=f"other users .* {path}, which .* chmod -R go= {path.parent}"):
        open_store(f"sqlite:///{path}")
    assert path.exists()
