from concurrent.futures import ThreadPoolExecutor
from itertools import count
from threading import Barrier

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sprung.online.store import Cursor, Progress, StoredFrame, VehicleRow, open_store

NEW_NAMES = (f"v{number}" for number in count())


def frames(*seqs, vehicle="zafira", boot=7):
    return [StoredFrame(vehicle, boot, seq, 1000 * seq, b"frame %d" % seq) for seq in seqs]


def waiting(store, vehicle="zafira", boot=7, *, after=-1, limit=1000):
    return [frame.seq for frame in store.inbox.pending(vehicle, boot, after=after, limit=limit)]


def lose(store, below, *, boot=7, now=0):
    """Progress of the one boot before and after frames below a number were declared lost, if it advanced."""
    return store.inbox.declare_lost({("zafira", boot): below}, now=now).get(("zafira", boot))


def test_frames_come_out_in_order_as_they_went_in(store) -> None:
    assert store.inbox.add_frames(frames(2, 0, 1), now=5) == {("zafira", 7): 2}
    assert store.inbox.pending("zafira", 7, after=0, limit=10) == frames(1, 2)
    assert waiting(store, limit=2) == [0, 1]
    assert store.inbox.cursor("zafira", 7) == Cursor(contiguous=2, done=-1, lost=0)
    assert store.inbox.cursor("zafira", 7).updated == 5


def test_frames_beyond_a_gap_wait(store) -> None:
    assert store.inbox.add_frames(frames(1, 3), now=0) == {("zafira", 7): -1}
    assert waiting(store) == []
    assert store.inbox.add_frames(frames(0), now=0) == {("zafira", 7): 1}
    assert waiting(store) == [0, 1]
    assert store.inbox.add_frames(frames(2), now=0) == {("zafira", 7): 3}


def test_long_run_behind_a_gap_is_taken_at_once(store) -> None:
    store.inbox.add_frames(frames(*range(1, 2500)), now=0)
    assert store.inbox.add_frames(frames(0), now=0) == {("zafira", 7): 2499}


def test_first_of_two_frames_of_one_number_counts(store) -> None:
    store.inbox.add_frames(frames(0), now=0)
    store.inbox.add_frames(
        [
            StoredFrame("zafira", 7, 0, 0, b"other"),
            StoredFrame("zafira", 7, 1, 0, b"first"),
            StoredFrame("zafira", 7, 1, 0, b"second"),
        ],
        now=1,
    )
    assert [frame.payload for frame in store.inbox.pending("zafira", 7, after=-1, limit=9)] == [b"frame 0", b"first"]


def test_boots_and_vehicles_are_kept_apart(store) -> None:
    batch = frames(0, 1) + frames(0, boot=2**63 - 1) + frames(5, vehicle="other")
    expected = {("zafira", 7): 1, ("zafira", 2**63 - 1): 0, ("other", 7): -1}
    assert store.inbox.add_frames(batch, now=0) == expected
    assert {key: cursor.contiguous for key, cursor in store.inbox.cursors().items()} == expected
    assert store.inbox.boots("zafira") == [7, 2**63 - 1]
    assert store.inbox.boots("nobody") == []


def test_nothing_asks_nothing_of_the_store(store) -> None:
    assert store.inbox.add_frames([], now=0) == {}
    assert store.inbox.cursor("nobody", 0) == Cursor(-1, -1, 0)


def test_lost_frames_are_counted_and_passed_over(store) -> None:
    store.inbox.add_frames(frames(0, 3, 5, 6), now=0)
    assert lose(store, 5, now=3) == (Cursor(0, -1, 0), Cursor(6, -1, 3))
    assert store.inbox.cursor("zafira", 7) == Cursor(contiguous=6, done=-1, lost=3)
    assert waiting(store) == [0, 3, 5, 6]
    assert store.inbox.add_frames(frames(1, 2, 4), now=4) == {("zafira", 7): 6}
    assert waiting(store) == [0, 3, 5, 6], "what was declared lost stays so"
    assert lose(store, 4, now=5) == (Cursor(6, -1, 3), Cursor(6, -1, 3))
    assert store.inbox.cursor("zafira", 7).lost == 3


def test_lost_before_anything_arrived(store) -> None:
    assert lose(store, 10) == (Cursor(), Cursor(9, -1, 10))
    assert store.inbox.cursor("zafira", 7) == Cursor(9, -1, 10)
    assert store.inbox.add_frames(frames(10), now=0) == {("zafira", 7): 10}


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), n_frames=st.integers(1, 12), n_batches=st.integers(1, 5))
def test_order_and_repetition_do_not_matter(store, data, n_frames, n_batches) -> None:
    vehicle = next(NEW_NAMES)
    once = frames(*range(n_frames), vehicle=vehicle)
    again = data.draw(st.lists(st.sampled_from(once), max_size=12))
    order = data.draw(st.permutations(once + again))
    arrived, acknowledged = set(), -1
    for k in range(n_batches):
        batch = order[k::n_batches]
        arrived |= {frame.seq for frame in batch}
        expected = next(seq for seq in count() if seq not in arrived) - 1
        acknowledged = store.inbox.add_frames(batch, now=k).get((vehicle, 7), acknowledged)
        assert acknowledged == expected
    assert acknowledged == n_frames - 1
    assert store.inbox.cursor(vehicle, 7) == Cursor(n_frames - 1, -1, 0)
    assert store.inbox.pending(vehicle, 7, after=-1, limit=100) == once


def test_writers_take_turns(url) -> None:
    """Two stores, four threads that begin each round together: every frame counts, and no writer is turned away."""
    rounds, together = 40, Barrier(4)
    with open_store(url) as one, open_store(url) as other, ThreadPoolExecutor(4) as threads:

        def send(k):
            store = (one, other)[k % 2]
            for number in range(rounds):
                together.wait(timeout=20)
                done = store.inbox.add_frames(frames(4 * number + k), now=k)["zafira", 7]
                store.results.commit(Progress("zafira", 7, done_seq=done, observations=((done, 0, {}),)))

        list(threads.map(send, range(4)))
        assert one.inbox.cursor("zafira", 7) == Cursor(4 * rounds - 1, 4 * rounds - 1, 0)
        assert waiting(other) == list(range(4 * rounds))


def test_vehicles(store) -> None:
    store.inbox.put_vehicle("b", configuration="#1", description="x = 1", channels=["fl"], now=10)
    store.inbox.put_vehicle("a", configuration="#2", description="", channels=[{"name": "ü"}], now=11)
    store.inbox.put_vehicle("b", configuration="#3", description="x = 2", channels=["fl", "fr"], now=12)
    store.inbox.seen({"a": 20, "b": 5, "nobody": 30})
    assert store.inbox.vehicles() == [
        VehicleRow("a", "#2", "", [{"name": "ü"}], first_seen=11, last_seen=20),
        VehicleRow("b", "#3", "x = 2", ["fl", "fr"], first_seen=10, last_seen=12),
    ]
    assert [store.inbox.vehicle(name) for name in "ab"] == store.inbox.vehicles()
    assert store.inbox.vehicle("nobody") is None
    assert store.inbox.last_seen() == {"a": 20, "b": 12}


def test_parked_vehicles_are_remembered(store) -> None:
    for name in ("zafira", "tram"):
        store.inbox.put_vehicle(name, configuration="c", description="text", channels=[], now=1)
    store.inbox.park("zafira", is_parked=True)
    store.inbox.seen({"zafira": 2})
    assert store.inbox.parked() == {"zafira"}
    store.inbox.park("zafira", is_parked=False)
    assert store.inbox.parked() == set()


def test_largest_sequence_number(store) -> None:
    last = 2**63 - 1
    lose(store, last)
    assert store.inbox.add_frames([StoredFrame("zafira", 7, last, 0, b"")], now=2) == {("zafira", 7): last}


def test_many_boots_are_lost_in_one_transaction(store, statements) -> None:
    """Boots without waiting frames cost no statement each."""
    store.inbox.add_frames(frames(1, 2, boot=3) + frames(5, boot=4) + frames(0, boot=5), now=0)
    below = {("zafira", boot): boot for boot in range(64)}
    with statements() as executed:
        advanced = store.inbox.declare_lost(below, now=1)
    assert sum(text.startswith("BEGIN") for text in executed) <= 1
    assert len(executed) <= 10
    assert advanced[("zafira", 3)] == (Cursor(-1, -1, 0), Cursor(2, -1, 1))
    assert advanced[("zafira", 4)] == (Cursor(-1, -1, 0), Cursor(3, -1, 4))
    assert advanced[("zafira", 5)] == (Cursor(0, -1, 0), Cursor(4, -1, 4))
    assert advanced[("zafira", 63)] == (Cursor(), Cursor(62, -1, 63))
    assert advanced[("zafira", 0)] == (Cursor(), Cursor())
    again = store.inbox.declare_lost(below, now=2)
    assert again == {key: (after, after) for key, (_, after) in advanced.items()}
    assert store.inbox.declare_lost({}, now=2) == {}


def test_open_boots_are_those_that_wait_or_are_not_analysed(store) -> None:
    for boot in (1, 2, 3, 4):
        store.inbox.add_frames(frames(0 if boot < 4 else 1, boot=boot), now=0)
    store.results.commit(Progress("zafira", 2, done_seq=0, delete_through_seq=0))
    assert store.inbox.open_boots("zafira", limit=10) == [1, 3, 4]
    assert store.inbox.open_boots("zafira", limit=2) == [1, 3]
    assert store.inbox.open_boots("nobody", limit=2) == []
    store.inbox.add_frames(frames(0, vehicle="other"), now=0)
    assert store.inbox.cursors(vehicle="other") == {("other", 7): Cursor(0, -1, 0)}


def test_large_frames_are_read_a_few_at_a_time(store) -> None:
    """Jobs of 300 frames of 1 MB would be 300 MB in memory."""
    large = [StoredFrame("zafira", 7, seq, 0, bytes(1 << 20)) for seq in range(20)]
    store.inbox.add_frames(large, now=0)
    assert waiting(store) == list(range(8))
    assert waiting(store, after=15) == [16, 17, 18, 19]
    assert waiting(store, limit=3) == [0, 1, 2]
    assert store.inbox.cursor("zafira", 7).contiguous == 19
