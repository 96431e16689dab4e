"""A server that does not answer is an error of the store within a stated time, and no thread waits for ever."""

import socket
from pathlib import Path

import pytest
from sqlalchemy import text

from sprung.online.store import StoredFrame, StoreError, open_store, postgresql


@pytest.fixture(autouse=True)
def _short_limits(monkeypatch: pytest.MonkeyPatch):
    """Limits for tests; 2 s are the least that connecting takes as its limit."""
    monkeypatch.setattr(postgresql, "ANSWER", 0.5)
    monkeypatch.setattr(postgresql, "CONNECT", 2)


@pytest.mark.slow
def test_a_frozen_server_is_an_error_and_the_store_is_back_when_it_is(postgresql_url, frozen_server) -> None:
    frames = [StoredFrame("car-1", 1, seq, 0, b"") for seq in range(2)]
    with open_store(postgresql_url) as store:
        store.inbox.add_frames(frames[:1], now=0)
        with frozen_server():
            for _ in range(2):  # within an open connection, and while connecting
                with pytest.raises(StoreError, match=r"does not answer \(.*\): check that its database runs and can"):
                    store.inbox.add_frames(frames[1:], now=0)
        assert store.inbox.add_frames(frames[1:], now=0) == {("car-1", 1): 1}


def test_a_server_that_freezes_within_a_transaction_is_an_error(postgresql_url, frozen_server) -> None:
    def freeze_and_ask(database):
        with database.writing() as connection:
            connection.execute(text("SELECT 1"))
            with frozen_server():
                connection.execute(text("SELECT 2"))

    with (
        open_store(postgresql_url) as store,
        pytest.raises(StoreError, match=r"the store does not answer \(no answer within 0\.5 s"),
    ):
        freeze_and_ask(store)


@pytest.mark.slow
def test_a_socket_that_never_answers_is_an_error(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / ".s.PGSQL.5432"))
        listening.listen()
        with pytest.raises(StoreError, match=r"the store does not answer \(connection timeout expired"):
            open_store(f"postgresql://sprung@/none?host={tmp_path}")


def test_limits_are_those_of_the_server_too(postgresql_url) -> None:
    with open_store(postgresql_url) as store:
        with store.reading() as connection:
            limits = [connection.scalar(text(f"SHOW {name}")) for name in ("statement_timeout", "lock_timeout")]
        assert limits == ["15s", "10s"]


def test_a_lock_that_is_held_is_a_busy_store(postgresql_url, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(postgresql, "LOCK", 1)
    with open_store(postgresql_url) as store:
        store.inbox.add_frames([StoredFrame("car-1", 1, 0, 0, b"")], now=0)
        with store.writing() as connection:
            connection.execute(text("LOCK TABLE cursors"))
            monkeypatch.setattr(postgresql, "ANSWER", 10.0)
            with pytest.raises(StoreError, match=r"the store is busy \(.*lock timeout.*\): end the program"):
                store.inbox.add_frames([StoredFrame("car-1", 1, 1, 0, b"")], now=0)
