"""What a store holds, counted on both databases."""

from sprung.online.store import Counted, Progress, StoredFrame
from sprung.online.store.retention import AGE_KEYS, KEPT, conditions, contents_of, n_windows_since
from sprung.online.store.schema import METADATA


def window(number, *, now):
    return Progress("car-1", 1, done_seq=number, observations=((number, 7, {"time": 7}),), now=now)


def test_every_table_has_a_key_or_a_reason() -> None:
    assert set(conditions()) | KEPT.keys() == METADATA.tables.keys()
    assert AGE_KEYS.keys() <= set(conditions())
    assert not KEPT.keys() & set(conditions())


def test_rows_are_counted_by_table(store) -> None:
    store.inbox.add_frames([StoredFrame("car-1", 1, seq, 7, b"x") for seq in range(3)], now=50)
    for number, now in ((0, 100), (1, 200)):
        store.results.commit(window(number, now=now))
    contents = contents_of(store)
    tables = {each.table: each for each in contents.tables}
    assert tables.keys() == METADATA.tables.keys()
    assert tables["observations"] == Counted("observations", 2, False, "keep.results_days")
    assert tables["vehicles"] == Counted("vehicles", 0, False, "one for each vehicle")
    assert tables["frames"].rows == 3
    assert contents.oldest == 100
    assert [n_windows_since(store, time) for time in (0, 100, 101, 201)] == [2, 2, 1, 0]


def test_an_empty_store_has_no_oldest_result(store) -> None:
    contents = contents_of(store)
    assert contents.oldest is None
    name, version = contents.database.split(" ")
    assert name in {"SQLite", "PostgreSQL"}
    assert version[0].isdigit()
    assert contents.schema == "1"


def test_counting_ends(store, monkeypatch) -> None:
    monkeypatch.setattr("sprung.online.store.retention.MAX_COUNTED", 2)
    store.inbox.add_frames([StoredFrame("car-1", 1, seq, 7, b"x") for seq in range(3)], now=50)
    tables = {each.table: each for each in contents_of(store).tables}
    assert (tables["frames"].rows, tables["frames"].is_more) == (2, True)


def test_the_record_is_read_in_pages_and_by_act(store) -> None:
    for number in range(5):
        store.requests.audit("eve", "ack" if number % 2 else "test", str(number), now=number)
    last = store.requests.audited(limit=2)
    assert [row.subject for row in last] == ["3", "4"]
    assert [row.subject for row in store.requests.audited(before=last[0].id, limit=2)] == ["1", "2"]
    assert [row.subject for row in store.requests.audited(act="ack")] == ["1", "3"]
