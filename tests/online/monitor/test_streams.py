"""Frames of several boots come out in one order, whatever they are."""

import pytest

from sprung.link import Key, message
from sprung.online.monitor import Stream
from sprung.online.monitor.streams import Handover, Queue
from sprung.online.store import Cursor, StoredFrame


def test_order_of_boots() -> None:
    stream = Stream()
    frames = {1: list(range(3)), 2: list(range(4))}
    previous = {1: None, 2: [1, 3]}
    stream.arrived(2, 3)

    def pending(boot, *, after, limit):
        whole = {Key.BOOT: boot, Key.START: 0, Key.PREVIOUS: previous[boot]}
        payloads = [(seq, message({**whole, Key.SEQ: seq})) for seq in frames[boot] if seq > after]
        return [StoredFrame("car-1", boot, seq, 0, payload) for seq, payload in payloads][:limit]

    assert stream.next_frames(pending, 10) == []
    stream.arrived(1, 1)
    assert [(frame.boot, frame.seq) for frame in stream.next_frames(pending, 2)] == [(1, 0), (1, 1)]
    stream.dispatched[1] = 1
    assert stream.next_frames(pending, 10) == []
    stream.arrived(1, 2)
    stream.dispatched[1] = 2
    assert [(frame.boot, frame.seq) for frame in stream.next_frames(pending, 10)] == [(2, k) for k in range(4)]
    assert stream.covered(2) == [(1, 2)]
    stream.done[1] = 2
    assert stream.covered(2) == []


@pytest.mark.parametrize("kind", ["raw", "modes"])
def test_a_boot_waits_for_the_one_before(kind) -> None:
    """Also where it begins with a report, which is not a frame."""
    document = {Key.BOOT: 2, Key.SEQ: 0, Key.START: 5, Key.KIND: kind, Key.PREVIOUS: [1, 3]}
    first = StoredFrame("car-1", 2, 0, 5, message(document), kind)

    def pending(boot, *, after, limit):
        return [first] if boot == 2 else []

    stream = Stream()
    stream.arrived(2, 0)
    assert stream.next_frames(pending, 10) == []
    stream.arrived(1, 2)
    stream.complete(1, 2)
    assert stream.next_frames(pending, 10) == [first]


def test_boots_that_wait_for_others_are_read_once() -> None:
    """A box that starts a thousand times behind a boot that never comes costs one look at each."""
    reads = []

    def pending(boot, *, after, limit):
        reads.append(boot)
        document = {Key.BOOT: boot, Key.SEQ: 0, Key.START: 5, Key.PREVIOUS: [boot - 1, 2]}
        return [StoredFrame("car-1", boot, 0, 5, message(document))]

    stream = Stream()
    for boot in range(2, 1002):
        stream.arrived(boot, 0)
    for _ in range(100):
        assert stream.next_frames(pending, 10) == []
    assert sorted(reads) == list(range(2, 1002))


def test_many_lost_boots_are_passed_over_a_few_at_a_time() -> None:
    reads = []
    stream = Stream()
    for boot in range(100):
        stream.arrived(boot, 5)

    def pending(boot, *, after, limit):
        reads.append(boot)
        return []

    for n_read in (32, 64, 96, 100, 100):
        assert stream.next_frames(pending, 10) == []
        assert len(reads) == n_read
        assert stream.has_waiting == (n_read < 100)


def test_backlog_and_position() -> None:
    stream = Stream()
    assert (stream.position, stream.backlog, stream.has_waiting) == ((0, -1), 0, False)
    stream.arrived(1, 4)
    stream.arrived(3, 9)
    stream.dispatched[1] = 4
    assert (stream.position, stream.backlog, stream.has_waiting) == ((1, 4), 10, True)
    stream.complete(3, 5)
    assert (stream.position, stream.backlog, stream.has_waiting) == ((3, 5), 4, True)
    stream.rewind({1: Cursor(4, 2), 3: Cursor(9, 0)})
    assert (stream.dispatched, stream.done) == ({1: 2, 3: 0}, {1: 2, 3: 0})


def held(boot, *numbers, size=10):
    return [StoredFrame("car-1", boot, seq, 0, bytes(size)) for seq in numbers]


def test_frames_are_handed_over_in_unbroken_runs() -> None:
    handover = Handover()
    handover.hold(held(1, 0, 1, 3, 4) + held(2, 0))
    assert handover.following("car-1", 1, after=-1, until=9, limit=9) == held(1, 0, 1)
    assert handover.following("car-1", 1, after=-1, until=9, limit=1) == held(1, 0)
    assert handover.following("car-1", 1, after=2, until=3, limit=9) == held(1, 3)
    assert handover.following("car-1", 1, after=1, until=9, limit=9) == []
    assert handover.following("car-2", 1, after=-1, until=9, limit=9) == []


def test_what_is_handed_over_is_bounded_and_released() -> None:
    handover = Handover(most_bytes=40)
    handover.hold(held(1, 0, 1, 2, 3, 4))
    assert handover.following("car-1", 1, after=-1, until=9, limit=9) == held(1, 0, 1, 2, 3)
    handover.release("car-1", 1, 1)
    assert handover.n_bytes == 20
    handover.hold(held(2, 0, 0, size=15))
    assert handover.n_bytes == 35
    handover.release("car-1", 2, -1)
    assert handover.n_bytes == 15
    handover.release("car-1", 2, 0)
    assert handover.n_bytes == 0
    handover.hold(held(3, 0, 1))
    handover.forget("car-1")
    handover.forget("car-2")
    assert handover.n_bytes == 0
    assert handover.following("car-1", 3, after=-1, until=9, limit=9) == []


def test_the_first_of_frames_with_one_number_is_handed_over() -> None:
    handover = Handover()
    first, second = (StoredFrame("car-1", 1, 0, 0, payload) for payload in (b"first", b"second"))
    handover.hold([first, second])
    assert handover.following("car-1", 1, after=-1, until=0, limit=9) == [first]


def test_a_queue_is_in_order_of_waiting() -> None:
    queue = Queue()
    for vehicle, since in (("b", 5), ("a", 5), ("c", 3), ("b", 1)):
        queue.add(vehicle, since)
    assert list(queue) == ["c", "b", "a"]
    queue.remove("b")
    queue.remove("x")
    assert "b" not in queue
    queue.add("b", 9)
    assert list(queue) == ["c", "a", "b"]
