"""Damaged files, torn logs, full and read-only disks."""

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import event

from sprung.online.store import Cursor, Progress, Store, StoredFrame, StoreError, open_store
from sprung.online.store.store import check_address

CANNOT_WRITE = r"the store cannot write \(.*\): free space on its disk or make it writable, then it continues"


@contextmanager
def a_store(url: str) -> Iterator[Store]:
    """Open a store that exists, without a check of its file."""
    open_store(url).close()
    with Store(check_address(url)) as store:
        yield store


def fill(store, *, n_batches, payload=b"x" * 200):
    for number in range(n_batches):
        store.inbox.add_frames([StoredFrame("zafira", 7, 3 * number + k, 0, payload) for k in range(3)], now=number)


def fill_up(store):
    """Add frames until the store cannot write, and return the last that it acknowledged."""
    acknowledged = store.inbox.cursor("zafira", 7).contiguous
    refusal = ""
    while not refusal:
        try:
            acknowledged = store.inbox.add_frames([StoredFrame("zafira", 7, acknowledged + 1, 0, b"x" * 3000)], now=0)[
                "zafira", 7
            ]
        except StoreError as error:
            refusal = str(error)
    assert re.fullmatch(CANNOT_WRITE, refusal)
    return acknowledged


def garbled(content):
    """Return content with a run of bytes in each page behind the first replaced."""
    pages = bytearray(content)
    for begin in range(4096, len(pages), 4096):
        pages[begin : begin + 100] = b"\xa5" * 100
    return bytes(pages)


@pytest.mark.parametrize(
    "damage",
    [
        garbled,
        lambda content: content[:5000],
        lambda content: b"\x00" * len(content),
        lambda _: b"this was never a database",
        lambda _: b"\x89PNG" * 5000,
    ],
    ids=["garbled", "cut", "zeros", "text", "other format"],
)
def test_a_damaged_file_is_renamed(sqlite_file, damage) -> None:
    url = f"sqlite:///{sqlite_file}"
    with open_store(url) as store:
        fill(store, n_batches=50)
    content = damage(sqlite_file.read_bytes())
    sqlite_file.write_bytes(content)
    with open_store(url) as store:
        (notice,) = store.notices
        assert store.inbox.cursors() == {}
        fill(store, n_batches=1)
    kept = re.fullmatch(
        rf"the store {sqlite_file} was damaged \(.+\): it is kept as (store\.sqlite\.corrupt-\d{{8}}T\d{{6}}), "
        r"and a new one was created",
        notice,
    )
    assert kept is not None, notice
    assert sqlite_file.with_name(kept[1]).read_bytes() == content
    with open_store(url) as store:
        assert store.notices == ()
        assert store.inbox.cursor("zafira", 7).contiguous == 2


def test_log_of_a_damaged_file_goes_with_it(sqlite_file, tmp_path: Path) -> None:
    with open_store(f"sqlite:///{sqlite_file}") as store:
        fill(store, n_batches=50)
        shutil.copytree(sqlite_file.parent, tmp_path / "copy")
    copy = tmp_path / "copy" / "store.sqlite"
    copy.write_bytes(b"no database")
    (tmp_path / "copy" / "store.sqlite-wal").write_bytes(b"no log")
    with open_store(f"sqlite:///{copy}") as store:
        (notice,) = store.notices
        fill(store, n_batches=1)
    assert "file is not a database" in notice
    names = sorted(path.name for path in copy.parent.iterdir())
    assert names[0] == "store.sqlite"
    assert re.fullmatch(r"store\.sqlite\.corrupt-\d{8}T\d{6}", names[1])


@pytest.mark.parametrize(
    "every", [pytest.param(512, marks=pytest.mark.slow, id="every 512"), pytest.param(4096 * 3 + 512, id="some")]
)
def test_torn_log_leaves_a_beginning_of_what_happened(sqlite_file, tmp_path: Path, every) -> None:
    """Whatever the disk kept of the write-ahead log, the store opens with the first transactions, each whole."""
    open_store(f"sqlite:///{sqlite_file}").close()
    with open_store(f"sqlite:///{sqlite_file}") as store:
        for number in range(6):
            store.inbox.add_frames(
                [StoredFrame("zafira", 7, 3 * number + k, 0, b"x" * 500) for k in range(3)], now=number
            )
            store.results.commit(
                Progress("zafira", 7, 3 * number + 2, 3 * number - 1, observations=((number, 0, {}),), snapshot=b"s")
            )
        copy = tmp_path / "torn.sqlite"
        copy.touch(mode=0o600)
        main = sqlite_file.read_bytes()
        log = sqlite_file.with_name("store.sqlite-wal").read_bytes()
    histories = []
    for length in [*range(0, len(log), every), len(log)]:
        copy.write_bytes(main)
        (tmp_path / "torn.sqlite-wal").write_bytes(log[:length])
        with open_store(f"sqlite:///{copy}") as store:
            assert store.notices == ()
            cursor = store.inbox.cursor("zafira", 7)
            n_done, n_arrived = (cursor.done + 1) // 3, (cursor.contiguous + 1) // 3
            assert n_done <= n_arrived <= n_done + 1
            assert [entry.number for entry in store.results.observations("zafira")] == list(range(n_done))
            first = max(3 * (n_done - 1), 0)
            kept = [frame.seq for frame in store.inbox.pending("zafira", 7, after=-1, limit=99)]
            assert kept == list(range(first, 3 * n_arrived))
            snapshot = store.results.snapshot("zafira")
            assert (snapshot.seq if snapshot else -1) == cursor.done
            histories.append((n_arrived, n_done))
    assert histories == sorted(histories)
    assert histories[0] == (0, 0)
    assert histories[-1] == (6, 6)


@pytest.mark.parametrize("setting", ["max_page_count=60", "query_only=1"], ids=["full", "read-only"])
def test_store_goes_on_when_it_can_write_again(sqlite_file, setting) -> None:
    with a_store(f"sqlite:///{sqlite_file}") as store:
        fill(store, n_batches=1)

        def limit(connection, _):
            connection.execute(f"PRAGMA {setting}")

        store.engine.dispose()
        event.listen(store.engine, "connect", limit)
        acknowledged = fill_up(store)
        with pytest.raises(StoreError, match=CANNOT_WRITE):
            store.check()
        event.remove(store.engine, "connect", limit)
        store.check()
        assert store.inbox.cursor("zafira", 7) == Cursor(acknowledged, -1, 0)
        assert store.inbox.add_frames([StoredFrame("zafira", 7, acknowledged + 1, 0, b"")], now=0) == {
            ("zafira", 7): acknowledged + 1
        }
        assert len(store.inbox.pending("zafira", 7, after=-1, limit=2000)) == acknowledged + 2


def test_full_disk(small_disk) -> None:
    folder, _ = small_disk
    ballast = folder / "ballast"
    ballast.write_bytes(b"x" * 1_000_000)
    with open_store(f"sqlite:///{folder}/store.sqlite") as store:
        acknowledged = fill_up(store)
        assert acknowledged > 10
        with pytest.raises(StoreError, match=r"its disk has \d+ bytes left"):
            store.check()
        assert store.inbox.cursor("zafira", 7).contiguous == acknowledged
        ballast.unlink()
        assert store.inbox.add_frames([StoredFrame("zafira", 7, acknowledged + 1, 0, b"")], now=0) == {
            ("zafira", 7): acknowledged + 1
        }
        assert len(store.inbox.pending("zafira", 7, after=-1, limit=2000)) == acknowledged + 2
    with open_store(f"sqlite:///{folder}/store.sqlite") as store:
        assert store.notices == ()
        assert store.inbox.cursor("zafira", 7).contiguous == acknowledged + 1


def test_read_only_disk(small_disk) -> None:
    folder, remount = small_disk
    url = f"sqlite:///{folder}/store.sqlite"
    with open_store(url) as store:
        fill(store, n_batches=1)
        store.close()
        remount("ro")
        with pytest.raises(StoreError):
            store.inbox.add_frames([StoredFrame("zafira", 7, 3, 0, b"")], now=0)
        with pytest.raises(StoreError, match=CANNOT_WRITE):
            store.check()
        with pytest.raises(StoreError):
            open_store(url)
        remount("rw")
        assert store.inbox.add_frames([StoredFrame("zafira", 7, 3, 0, b"")], now=0) == {("zafira", 7): 3}
    with open_store(url) as store:
        assert store.inbox.cursor("zafira", 7).contiguous == 3


def write_while_the_connection_is_cut(store: Store, other: Store) -> None:
    with store.writing() as connection:
        own = connection.exec_driver_sql("SELECT pg_backend_pid()").scalar()
        with other.writing() as killer:
            killer.exec_driver_sql(f"SELECT pg_terminate_backend({own}, 5000)")
        connection.exec_driver_sql("SELECT 1")


def test_server_that_goes_away_and_comes_back(postgresql_url) -> None:
    with a_store(postgresql_url) as store, a_store(postgresql_url) as other:
        fill(store, n_batches=1)
        with pytest.raises(StoreError, match="the store does not answer"):
            write_while_the_connection_is_cut(store, other)
        assert store.inbox.cursor("zafira", 7).contiguous == 2
        store.check()


def test_read_only_server(postgresql_url) -> None:
    with a_store(postgresql_url) as store:
        with store.writing() as connection:
            connection.exec_driver_sql("SET SESSION default_transaction_read_only = on")
        with pytest.raises(StoreError, match=CANNOT_WRITE):
            store.check()
        store.check()
