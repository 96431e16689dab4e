"""Every table has a rule for its rows, and no rule loses a frame or lets one be analysed twice."""

import pytest
from sqlalchemy import func, select

from sprung.online.store import AccountRow, Cursor, Delivery, Progress, StoredFrame
from sprung.online.store.retention import KEPT, Ages, conditions
from sprung.online.store.schema import METADATA
from sprung.state import AlertState

AGES = Ages(results=100, audit=100, boots=100)


def frame(boot, seq, vehicle="car-1"):
    return StoredFrame(vehicle, boot, seq, 0, b"x")


def count(store, name):
    """The number of rows of a table."""
    with store.reading() as connection:
        return connection.scalar(select(func.count()).select_from(METADATA.tables[name]))


def finish(store, boot, n_frames, *, vehicle="car-1", now=0):
    """Let a boot arrive and be analysed as a whole."""
    store.inbox.add_frames([frame(boot, seq, vehicle) for seq in range(n_frames)], now=now)
    last = n_frames - 1
    store.results.commit(Progress(vehicle, boot, done_seq=last, delete_through_seq=last, snapshot=b"state"))


def test_every_table_has_a_rule() -> None:
    rules = conditions()
    assert not set(rules) & set(KEPT)
    assert set(rules) | set(KEPT) == set(METADATA.tables)


def test_old_rows_of_every_table_with_an_age_go_and_new_ones_stay(store) -> None:
    for now in (50, 150):
        progress = Progress(
            "car-1",
            now,
            done_seq=0,
            delete_through_seq=0,
            observations=((0, now, {}),),
            modes=((0, now, {}),),
            findings=((0, now, {}),),
            baselines=((now, now, "", {}),),
            snapshot=b"state",
            now=now,
        )
        store.inbox.add_frames([frame(now, 0)], now=now)
        store.quarantine.put_frames("car-1", now, 0, 0, reason="it fails", now=now)
        store.results.commit(progress)
        row = AlertState("car-1", "silent", severity=300, text="", is_active=False, raised=now)
        store.alerts.put(row, history=("raised", "", ""), notify={}, now=now)
        number = store.alerts.next_notification("log", now=now).id
        store.alerts.put_delivery(number, "log", Delivery(1, sent=now), senders=["log"], now=now)
        store.requests.command_done(store.requests.add_command("eve", "car-1", "learn", now=now), now)
        store.accounts.put(AccountRow(f"eve-{now}", "viewer", "hash", now))
        store.accounts.add_session(f"digest-{now}", f"eve-{now}", now=0, expires=now)
    assert {count(store, name) for name in conditions()} == {2}
    store.delete_older(100)
    assert {name: count(store, name) for name in conditions()} == dict.fromkeys(conditions(), 1)
    assert count(store, "deliveries") == 1
    assert store.delete_older(100) == 0


@pytest.mark.slow
def test_rows_go_in_batches_up_to_a_limit(store) -> None:
    for _ in range(2500):
        store.requests.audit("eve", "ack", "1", now=1)
    assert store.delete_older(100, limit=1500) == 2000
    assert store.delete_older(100, limit=1500) == 500


def test_audit_and_boots_have_ages_of_their_own(store) -> None:
    finish(store, 1, 3, now=50)
    finish(store, 2, 3, now=50)
    store.requests.audit("eve", "ack", "1", now=50)
    assert store.delete_older(100, audit_before=50, boots_before=50) == 0
    assert store.delete_older(10, audit_before=51, boots_before=51) == 2


def test_the_present_baseline_stays_however_old_it_is(store) -> None:
    store.inbox.add_frames([frame(1, 0)], now=0)
    baselines: tuple[tuple[int, int, str, dict[str, object]], ...]
    baselines = tuple((version, version, "", {}) for version in (1, 2, 3))
    store.results.commit(Progress("car-1", 1, done_seq=0, baselines=baselines))
    store.delete_older(10**6)
    assert [row.version for row in store.results.baselines("car-1")] == [3]


def test_the_history_of_an_active_alert_stays_since_it_was_raised(store) -> None:
    for now, what, is_active in ((1, "raised", True), (2, "cleared", False), (3, "raised", True), (4, "updated", True)):
        raised = 3 if now >= 3 else 1
        row = AlertState("car-1", "silent", severity=300, text="", is_active=is_active, raised=raised)
        store.alerts.put(row, history=(what, "", ""), now=now)
    store.delete_older(100)
    assert [(row.what, row.time) for row in store.alerts.history(1)] == [("raised", 3), ("updated", 4)]


def test_progress_stays_while_its_boot_may_go_on(store) -> None:
    """The newest boot of the stored state, a boot of which frames wait, and a vehicle without a state."""
    finish(store, 1, 3)
    finish(store, 2, 3)
    store.inbox.add_frames([frame(3, seq) for seq in range(3)], now=0)
    store.inbox.add_frames([frame(4, 5)], now=0)
    store.inbox.add_frames([frame(1, 0, "car-2"), frame(2, 0, "car-2")], now=0)
    store.delete_older(100)
    assert sorted(store.inbox.cursors()) == [("car-1", 2), ("car-1", 3), ("car-1", 4), ("car-2", 1), ("car-2", 2)]


@pytest.fixture
def forgotten(store):
    """A store that has deleted the progress of boot 5 of car-1, of three frames, and analyses boot 9."""
    finish(store, 5, 3)
    finish(store, 9, 3, now=200)
    assert store.delete_older(100) == 1
    assert ("car-1", 5) not in store.inbox.cursors()
    return store


def test_late_repeats_of_a_forgotten_boot_are_acknowledged_and_not_analysed_again(forgotten) -> None:
    inbox = forgotten.inbox
    for frames, reached in (([frame(5, 1)], 1), ([frame(5, 0), frame(5, 2)], 2), ([frame(5, 1)], 2)):
        assert inbox.add_frames(frames, now=300) == {("car-1", 5): reached}
    assert inbox.pending("car-1", 5, after=-1, limit=10) == []
    assert inbox.boots("car-1") == []
    assert inbox.cursor("car-1", 5) == Cursor(2, 2)


def test_frames_of_a_forgotten_boot_are_not_declared_lost(forgotten) -> None:
    assert forgotten.inbox.declare_lost({("car-1", 5): 3}, now=300) == {("car-1", 5): (Cursor(2, 2), Cursor(2, 2))}
    assert forgotten.inbox.cursor("car-1", 5).lost == 0


def test_no_new_frame_is_taken_for_a_repeat(forgotten) -> None:
    """Of the present boot, of a later one, and of another vehicle."""
    frames = [frame(9, 3), frame(10, 0), frame(5, 0, "car-2")]
    reached = forgotten.inbox.add_frames(frames, now=300)
    assert reached == {("car-1", 9): 3, ("car-1", 10): 0, ("car-2", 5): 0}
    assert [len(forgotten.inbox.pending(*key, after=-1, limit=10)) for key in reached] == [1, 1, 1]


def test_the_space_of_deleted_rows_is_used_again(sqlite_file) -> None:
    from sprung.online.store import open_store

    with open_store(f"sqlite:///{sqlite_file}") as store:
        store.inbox.add_frames([frame(1, 0)], now=0)
        sizes = []
        for year in range(1, 6):
            windows = tuple((1000 * year + k, 10 * year, {"values": list(range(100))}) for k in range(500))
            store.results.commit(Progress("car-1", 1, done_seq=0, observations=windows, now=10 * year))
            store.delete_older(10 * year)
            sizes.append(sqlite_file.stat().st_size)
        assert store.results.n_observations("car-1") == 500
    assert sizes[-1] == sizes[1]
