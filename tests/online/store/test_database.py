"""Transactions, and errors in one sentence that says what to do."""

from pathlib import Path

import pytest
from sqlalchemy import Column, Integer, MetaData, Table, Text, func, select

from sprung.online.store import RefusedError, StoreError
from sprung.online.store.database import Database
from sprung.online.store.store import check_address

NUMBERS = Table("numbers", MetaData(), Column("number", Integer, primary_key=True), Column("text", Text))


@pytest.fixture
def database(url, tmp_path: Path):
    """A database with one empty table."""
    (tmp_path / "new").mkdir()
    made = Database(check_address(url))
    with made.writing() as connection:
        NUMBERS.create(connection)
    yield made
    made.close()


def count(database: Database) -> int:
    with database.reading() as connection:
        return int(connection.scalar(select(func.count()).select_from(NUMBERS)) or 0)


def insert_and_break_down(database: Database) -> None:
    with database.writing() as connection:
        connection.execute(NUMBERS.insert().values(number=1))
        raise KeyError("broken")


def insert_twice(database: Database, *, is_broken: bool) -> None:
    with database.together():
        for number in (1, 2):
            with database.writing() as connection:
                connection.execute(NUMBERS.insert().values(number=number))
            assert count(database) == number
        if is_broken:
            raise KeyError("broken")


def test_what_is_written_together_is_there_as_a_whole(database) -> None:
    with pytest.raises(KeyError):
        insert_twice(database, is_broken=True)
    assert count(database) == 0
    insert_twice(database, is_broken=False)
    assert count(database) == 2
    with pytest.raises(StoreError, match="refuses this"):
        insert_twice(database, is_broken=False)
    with database.writing() as connection:
        connection.execute(NUMBERS.insert().values(number=3))
    assert count(database) == 3


def test_a_transaction_is_whole_or_not_there(database) -> None:
    with pytest.raises(KeyError):
        insert_and_break_down(database)
    assert count(database) == 0
    with database.writing() as connection:
        connection.execute(NUMBERS.insert().values(number=1))
    assert count(database) == 1


def test_a_row_that_is_there_may_stay(database) -> None:
    for text in ("first", "second"):
        with database.writing() as connection:
            row = database.insert(NUMBERS).values(number=1, text=text)
            connection.execute(row.on_conflict_do_nothing())
    with database.reading() as connection:
        assert connection.execute(select(NUMBERS.c.text)).scalars().all() == ["first"]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"number": "one"}, "^the store refuses this: "),
        ({"text": "\ud800"}, "^the store cannot hold this: "),
        ({"number": 2**63}, "^the store (cannot hold|refuses) this: "),
        ({"number": 0}, "^the store refuses this: "),
    ],
    ids=["text for a number", "half a character", "64 bits", "a number that is there"],
)
def test_what_a_column_cannot_hold_is_a_sentence(database, values, sentence) -> None:
    with database.writing() as connection:
        connection.execute(NUMBERS.insert().values(number=0))
    with pytest.raises(RefusedError, match=sentence), database.writing() as connection:
        connection.execute(NUMBERS.insert().values(**values))
    assert count(database) == 1


def test_without_a_server_the_store_does_not_answer(tmp_path: Path) -> None:
    database = Database(check_address(f"postgresql://sprung@/none?host={tmp_path}"))
    with pytest.raises(StoreError, match=r"the store does not answer \(.*\): check that its database runs") as caught:
        count(database)
    assert not isinstance(caught.value, RefusedError)
    database.close()


def test_settings_of_sqlite(sqlite_file) -> None:
    """Write-ahead log, every commit synced (2: FULL), foreign keys checked, writers wait 10 s for each other."""
    sqlite_file.parent.mkdir()
    database = Database(check_address(f"sqlite:///{sqlite_file}"))
    with database.reading() as connection:
        settings = [
            connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
        ]
    assert settings == ["wal", 2, 1, 10_000]
    database.close()
