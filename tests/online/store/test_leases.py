"""One monitor on a file, several on a server: shards change hands, and a monitor that lost them writes nothing."""

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from sqlalchemy import create_engine, make_url, text

from sprung.online.store import (
    N_SHARDS,
    Cursor,
    Lease,
    LeaseLostError,
    Progress,
    Store,
    StoredFrame,
    StoreError,
    open_store,
    shard_of,
)

FRAMES = [StoredFrame("car-1", 1, seq, 0, b"x") for seq in range(3)]
SHARD = shard_of("car-1")
PATIENCE = 30.0
HOLDER = """
import sys
from sprung.online.store import open_store
with open_store(sys.argv[1]) as store:
    store.leases.lock("machine, process 7")
    print("locked", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def server(postgresql_url):
    """An empty store on a server, and what makes a monitor seem to have been silent for a time."""
    engine = create_engine(make_url(postgresql_url).set(drivername="postgresql+psycopg"))

    def silence(monitor: str, seconds: float) -> None:
        with engine.begin() as connection:
            passed = {"passed": round(1e9 * seconds), "monitor": monitor}
            connection.execute(text("UPDATE monitors SET seen = seen - :passed WHERE monitor = :monitor"), passed)

    with open_store(postgresql_url) as store:
        yield store, silence
    engine.dispose()


def held(store: Store, monitor: str) -> set[int]:
    return set(store.leases.renew(monitor, patience=PATIENCE).epochs)


def test_shards_are_the_same_everywhere_and_for_ever() -> None:
    assert [shard_of(name) for name in ("car-1", "car-2", "zafira")] == [214, 7, 30]
    assert {shard_of(f"car-{number}") for number in range(5000)} == set(range(N_SHARDS))


def test_second_monitor_on_a_file_is_refused_with_the_name_of_the_first(sqlite_file: Path) -> None:
    url = f"sqlite:///{sqlite_file}"
    with open_store(url) as first, open_store(url) as second:
        assert not first.leases.is_shared
        first.leases.lock("depot, process 7")
        with pytest.raises(StoreError, match=r"used by another monitor \(depot, process 7 since 20.* UTC\): stop that"):
            second.leases.lock("depot, process 8")
        first.leases.unlock()
        second.leases.lock("depot, process 8")


def test_file_of_a_killed_monitor_is_free_at_once(sqlite_file: Path) -> None:
    url = f"sqlite:///{sqlite_file}"
    command = [sys.executable, "-c", HOLDER, url]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "locked\n"
        with open_store(url) as store:
            with pytest.raises(StoreError, match="machine, process 7"):
                store.leases.lock("successor")
            process.kill()
            process.wait()
            store.leases.lock("successor")


def test_monitors_share_the_shards_fairly(server) -> None:
    store, _ = server
    assert store.leases.is_shared
    assert held(store, "a") == set(range(N_SHARDS))
    assert held(store, "b") == set()
    assert len(held(store, "a")) == N_SHARDS // 2
    assert len(held(store, "b")) == N_SHARDS // 2
    held(store, "c")
    for _ in range(2):
        shares = [held(store, monitor) for monitor in "abc"]
    assert sorted(map(len, shares)) == [84, 86, 86]
    assert set.union(*shares) == set(range(N_SHARDS))


def test_stop_in_good_order_frees_the_shards_at_once(server) -> None:
    store, _ = server
    held(store, "a"), held(store, "b"), held(store, "a")
    store.leases.release("a")
    assert held(store, "b") == set(range(N_SHARDS))


def test_shards_of_a_dead_monitor_are_taken_over_after_its_patience(server) -> None:
    store, silence = server
    held(store, "a")
    silence("a", PATIENCE - 1.0)
    assert held(store, "b") == set()
    silence("a", 2.0)
    holding = store.leases.renew("b", patience=PATIENCE)
    assert holding.epochs == dict.fromkeys(range(N_SHARDS), 2)
    assert (holding.monitors, holding.dead) == (("b",), ("a",))
    assert store.leases.renew("b", patience=PATIENCE).dead == ()


def test_write_under_a_lost_lease_is_refused_as_a_whole(server) -> None:
    store, silence = server
    lease = Lease(SHARD, store.leases.renew("a", patience=PATIENCE).epochs[SHARD])
    store.inbox.add_frames(FRAMES, now=0)
    with store.leases.fence(lease):
        store.results.commit(Progress("car-1", 1, done_seq=0))
    silence("a", PATIENCE + 1.0)
    successor = Lease(SHARD, store.leases.renew("b", patience=PATIENCE).epochs[SHARD])
    with store.leases.fence(lease), pytest.raises(LeaseLostError, match=f"has taken over shard {SHARD}"):
        store.results.commit(Progress("car-1", 1, done_seq=2, snapshot=b"late"))
    assert store.inbox.cursors() == {("car-1", 1): Cursor(2, 0)}
    assert store.results.snapshot("car-1") is None
    with store.leases.fence(successor):
        store.results.commit(Progress("car-1", 1, done_seq=1))
    with store.leases.fence(Lease(0, 2), lease), pytest.raises(LeaseLostError, match=f"shard {SHARD}:"):
        store.results.commit(Progress("car-1", 1, done_seq=2))
    store.results.commit(Progress("car-1", 1, done_seq=2))  # outside of the context anybody may write


def test_take_over_passes_over_a_shard_in_which_a_transaction_runs(server, postgresql_url) -> None:
    """The transaction of the old holder ends with its commit, and the shard changes hands after it."""
    store, silence = server
    lease = Lease(SHARD, store.leases.renew("a", patience=PATIENCE).epochs[SHARD])
    store.inbox.add_frames(FRAMES, now=0)
    begun, finish = threading.Event(), threading.Event()

    def commit() -> None:
        with store.leases.fence(lease), store.together():
            store.results.commit(Progress("car-1", 1, done_seq=0))
            begun.set()
            finish.wait(60.0)

    thread = threading.Thread(target=commit)
    thread.start()
    with open_store(postgresql_url) as other:
        assert begun.wait(60.0)
        silence("a", PATIENCE + 1.0)
        assert held(other, "b") == set(range(N_SHARDS)) - {SHARD}
        finish.set()
        thread.join()
        assert store.inbox.cursor("car-1", 1).done == 0
        assert held(other, "b") == set(range(N_SHARDS))


def test_cursors_are_found_by_shard_and_time(store) -> None:
    store.inbox.add_frames(FRAMES, now=100)
    store.inbox.add_frames([StoredFrame("car-2", 1, 0, 0, b"x")], now=200)
    assert set(store.inbox.cursors([SHARD])) == {("car-1", 1)}
    assert set(store.inbox.cursors([SHARD, shard_of("car-2")], since=150)) == {("car-2", 1)}
    assert len(store.inbox.cursors()) == 2


def test_transaction_stores_all_or_nothing(store) -> None:
    store.inbox.add_frames(FRAMES, now=0)

    def fail() -> None:
        with store.together():
            store.results.commit(Progress("car-1", 1, done_seq=1))
            assert store.inbox.cursor("car-1", 1).done == 1
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert store.inbox.cursor("car-1", 1).done == -1
    with store.together():
        store.results.commit(Progress("car-1", 1, done_seq=1))
        store.results.commit(Progress("car-1", 1, done_seq=2))
    assert store.inbox.cursor("car-1", 1).done == 2
