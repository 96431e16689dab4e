"""What vehicles send is validated, stored, acknowledged and counted."""

from itertools import count
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sprung.link import RAW, UPWARDS, Frame, Key, checked_map, encode, message, topic
from sprung.online.monitor import Site
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.intake import Intake
from sprung.online.monitor.message_queue import BOOTS, INVALID, QUOTA, UNSTORABLE, VERSION_UNKNOWN, Refusals
from sprung.online.store import Progress, RefusedError
from sprung.vehicles import read_vehicle, vehicle_text

ANSWER = {"did": "raw", "boot": 1, "last": 4, "frames": 5, "from": 0, "to": 5, "reason": "r" * 300}


@pytest.fixture
def published():
    """Topics and contents that the intake published."""
    return []


@pytest.fixture
def refusals():
    return Refusals()


def intake_of(store, published, refusals=None):
    return Intake(
        Context(Site(), store), lambda name, payload: published.append((name, checked_map(payload))), refusals=refusals
    )


@pytest.fixture
def intake(store, published, refusals):
    return intake_of(store, published, refusals)


def raw(vehicle, boot, seq, *, start=0):
    """The smallest frame."""
    counts = np.ones((1, 1), dtype=np.int16)
    return topic(vehicle, "raw"), encode(Frame(vehicle, boot, seq, start, 10**6, ("a",), np.ones(1), counts))


def state(vehicle, boots):
    """What a box says of its spool: boot, first frame and end of each."""
    return topic(vehicle, "state"), message({0: 1, 2: 1, "boots": boots, "dropped": 0, "is_leaving": False})


def test_a_frame_on_the_topic_of_another_vehicle_is_refused(intake, drive, frames_of, published) -> None:
    taken = intake.take([(topic("car-2", "raw"), frames_of(drive(0))[0])], now=0)
    assert taken.arrived == {}
    assert published == []
    assert intake.figures["sprung_messages_refused_total"] == 1


def test_nothing_is_acknowledged_before_the_first_frame_of_a_boot(intake, published) -> None:
    intake.take([raw("car-1", 1, 3)], now=0)
    assert published == []


def test_the_last_thousand_answers_are_kept(intake) -> None:
    answers = [(topic("car-2", "event"), message({**ANSWER, "number": number})) for number in range(1100)]
    intake.take([*answers, (topic("car-2", "event"), message({"did": "something new"}))], now=0)
    assert [number for number in range(1100) if intake.answer("car-2", number)] == list(range(100, 1100))
    assert intake.answer("car-2", 1099) == {key: ANSWER[key] for key in ("boot", "last", "frames", "from", "to")} | {
        "reason": "r" * 200
    }
    assert intake.answer("car-1", 1099) is None


@pytest.mark.parametrize("number", [2**63, 2**64 - 1, -1, -(2**64), True, 1.0, float("nan"), "1", None])
def test_a_state_with_impossible_numbers_costs_no_other_message(intake, published, refusals, number) -> None:
    batch = [raw("car-1", 1, 0), state("car-2", [[number, 1, 1]]), raw("car-3", 1, 0)]
    assert intake.take(batch, now=0).arrived == {("car-1", 1): 0, ("car-3", 1): 0}
    assert [name for name, _ in published] == [topic("car-1", "ack"), topic("car-3", "ack")]
    assert refusals.counts == {("car-2", INVALID): 1}


def test_refusals_have_reasons(intake, refusals) -> None:
    name, payload = raw("car-1", 1, 0)
    intake.take([(name, message(checked_map(payload) | {0: 2})), (name, b"x"), ("else/where", b"")], now=0)
    assert refusals.counts == {("car-1", VERSION_UNKNOWN): 1, ("car-1", INVALID): 1, ("(others)", INVALID): 1}


#: Every value that a message can hold, extreme ones first.
VALUES = st.recursive(
    st.sampled_from([2**63, 2**64 - 1, 2**63 - 1, -(2**63), -(2**64), 0, -1, 1, "", "\0", "\ud7ff", float("inf"), None])
    | st.integers(-(2**64), 2**64 - 1)
    | st.floats()
    | st.text(max_size=20)
    | st.binary(max_size=20)
    | st.booleans(),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.integers(-9, 30) | st.text(max_size=9), inner, max_size=4)
    ),
    max_leaves=8,
)
ORIGINALS: dict[str, dict[Any, Any]] = {
    "raw": checked_map(raw("car-2", 1, 3)[1]),
    "state": {0: 1, 2: 1, "boots": [[1, 2, 5], [2, 0, 9]], "dropped": 1, "spooled": 5, "is_leaving": False},
    "modes": {0: 1, 1: "car-2", 2: 1, 3: 7, 4: 5, 5: 0, 7: 9, 15: [0, 4], 16: "modes", "number": 1, "modes": []},
    "corr": {0: 1, 1: "car-2", 2: 1, 3: 8, 4: 5, 16: "corr", "number": 1, "summary": {}},
    "meta": {0: 1, 14: "c", "description": vehicle_text(read_vehicle("zafira")), "quantities": {"a": "acceleration"}},
    "health": {0: 1, "cpu_seconds": 1.0, "memory": 5, "free": 5, "waiting": 0, "problem": ""},
    "event": {0: 1, **ANSWER, "number": 3},
}
NAMES = count()


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_any_value_in_any_field_costs_an_honest_vehicle_nothing(store, published, data) -> None:
    honest, intake = (
        f"car-{next(NAMES)}",
        intake_of(store, published),
    )
    batch = []
    for _ in range(data.draw(st.integers(1, 4))):
        what = data.draw(st.sampled_from(sorted(ORIGINALS)))
        document = dict(ORIGINALS[what])
        key = data.draw(st.sampled_from(list(document)))
        document[key] = data.draw(VALUES)
        if what == "state" and key == "boots":
            place = data.draw(st.integers(0, 2))
            entry = [1, 2, 5]
            entry[place] = data.draw(VALUES)
            document[key] = [entry, [3, 4, 5]]
        batch.append((topic("car-2", data.draw(st.sampled_from([what, *UPWARDS]))), message(document)))
    place = data.draw(st.integers(0, len(batch)))
    batch[place:place] = [raw(honest, 1, seq) for seq in range(3)]
    published.clear()
    assert intake.take(batch, now=10**18).arrived[honest, 1] == 2
    assert (topic(honest, "ack"), {Key.VERSION: 1, Key.BOOT: 1, Key.SEQ: 2}) in published
    assert len(store.inbox.pending(honest, 1, after=-1, limit=9)) == 3


def test_what_the_store_refuses_all_the_same_is_left_out_alone(
    intake, store, refusals, caplog, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_frames, declare_lost = store.inbox.add_frames, store.inbox.declare_lost

    def add(frames, *, now, new):
        if any((frame.vehicle, frame.seq) == ("car-2", 1) for frame in frames):
            raise RefusedError("the store cannot hold this: a number of 65 bits")
        return add_frames(frames, now=now, new=new)

    def declare(below, *, now):
        if ("car-2", 5) in below:
            raise RefusedError("the store cannot hold this: a number of 65 bits")
        return declare_lost(below, now=now)

    monkeypatch.setattr(store.inbox, "add_frames", add)
    monkeypatch.setattr(store.inbox, "declare_lost", declare)
    batch = [raw(vehicle, 1, seq) for seq in range(3) for vehicle in ("car-1", "car-2", "car-3")]
    batch += [state("car-2", [[5, 1, 1], [6, 1, 1]]), state("car-1", [[9, 2, 2]])]
    assert intake.take(batch, now=0).arrived == {
        ("car-1", 1): 2,
        ("car-2", 1): 0,
        ("car-3", 1): 2,
        ("car-2", 6): 0,
        ("car-1", 9): 1,
    }
    assert refusals.counts == {("car-2", UNSTORABLE): 2}
    assert caplog.messages == [
        "messages on sprung/v1/car-2/raw are refused: the store cannot hold this: a number of 65 bits",
        "messages on sprung/v1/car-2/state are refused: the store cannot hold this: a number of 65 bits",
    ]
    assert intake.figures["sprung_frames_total"] == 8


def test_of_many_boots_the_first_32_count(intake, store) -> None:
    boots = [[boot, 1, 1] for boot in range(1, 1001)]
    taken = intake.take([state("car-1", boots)], now=0)
    assert sorted(boot for _, boot in taken.arrived) == list(range(1, 33))
    assert len(store.inbox.cursors()) == 32


def test_boots_that_are_analysed_make_room(intake, store, refusals, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sprung.online.monitor.intake._MAX_OPEN_BOOTS", 6)
    for boot in range(30):
        intake.take([raw("car-1", boot, 0)], now=0)
        store.results.commit(Progress("car-1", boot, done_seq=0, delete_through_seq=0))
    assert refusals.counts == {}
    assert len(store.inbox.cursors(vehicle="car-1")) == 30


def test_a_vehicle_has_at_most_a_thousand_boots_that_wait(intake, store, refusals, caplog) -> None:
    intake.take([raw("car-1", boot, 0) for boot in range(1001)], now=0)
    assert refusals.counts == {("car-1", BOOTS): 1}
    assert caplog.messages == [
        "messages on sprung/v1/car-1/raw are refused: boot 1000 of car-1, while 1000 of its boots wait to be analysed: "
        "a box must count its starts one by one, and send the oldest first"
    ]
    intake.take([state("car-1", [[2000, 1, 1]]), raw("car-1", 5, 1), raw("car-2", 1, 0)], now=0)
    assert refusals.counts == {("car-1", BOOTS): 2}
    assert store.inbox.cursor("car-1", 5).contiguous == 1
    assert store.inbox.cursor("car-2", 1).contiguous == 0
    again = intake_of(store, [], refusals)
    again.take([raw("car-1", 1000, 0)], now=0)
    assert refusals.counts == {("car-1", BOOTS): 3}, "the bound holds after a restart"
    store.results.commit(Progress("car-1", 0, done_seq=0, delete_through_seq=0))
    intake.take([raw("car-1", 1000, 0)], now=0)
    assert store.inbox.cursor("car-1", 1000).contiguous == 0


def large(vehicle, seq, size=250_000, boot=1):
    """A frame of raw samples of a second."""
    counts = np.ones((8, size // 16), dtype=np.int16)
    frame = Frame(vehicle, boot, seq, 0, 16 * 10**9 // size, tuple("abcdefgh"), np.ones(8), counts)
    return topic(vehicle, "raw"), encode(frame, codec=RAW)


def test_of_a_vehicle_without_description_a_megabyte_waits(intake, store, refusals) -> None:
    taken = intake.take([raw("car-1", 1, 0), *(large("car-2", seq) for seq in range(9))], now=0)
    assert taken.arrived == {("car-1", 1): 0, ("car-2", 1): 3}
    assert refusals.counts == {("car-2", QUOTA): 5}
    assert sum(store.inbox.n_bytes().values()) < 1.1 * (1 << 20)
    (sentence,) = intake.quotas.take_full().values()
    assert sentence.endswith("until the monitor has its description: start its box with its vehicle file")
    assert intake.quotas.take_full() == {}
    description = topic("car-2", "meta"), message(ORIGINALS["meta"])
    assert intake.take([description, *(large("car-2", seq) for seq in range(4, 9))], now=1).arrived == {("car-2", 1): 8}


def test_what_waits_of_a_vehicle_is_bounded_until_it_is_analysed(intake, store, refusals, monkeypatch) -> None:
    monkeypatch.setattr("sprung.online.monitor.message_queue._MOST", 1_000_000)
    monkeypatch.setattr("sprung.online.monitor.message_queue._HOURS", 0.0)
    intake.quotas._time = 2.0
    intake.take([(topic("car-1", "meta"), message(ORIGINALS["meta"]))], now=0)
    assert intake.take([large("car-1", seq) for seq in (0, 1, 3, 4, 5)], now=0).arrived == {("car-1", 1): 1}
    assert refusals.counts == {("car-1", QUOTA): 2}
    # What waits for an earlier frame does not keep it out.
    assert intake.take([large("car-1", 2)], now=0).arrived == {("car-1", 1): 3}
    store.results.commit(Progress("car-1", 1, done_seq=3, delete_through_seq=3))
    assert intake.take([large("car-1", 4)], now=10**10).arrived == {("car-1", 1): 4}


def test_while_disk_space_is_short_the_largest_senders_are_refused_first(intake, refusals) -> None:
    intake.take([(topic(name, "meta"), message(ORIGINALS["meta"])) for name in ("car-1", "car-2")], now=0)
    intake.take([raw("car-1", 1, 0), *(large("car-2", seq) for seq in range(12))], now=0)
    intake.quotas.narrow(is_short=True)
    assert intake.take([raw("car-1", 1, 1), large("car-2", 12)], now=0).arrived == {("car-1", 1): 1}
    assert refusals.counts == {("car-2", QUOTA): 1}
    intake.quotas.narrow(is_short=False)
    assert intake.take([large("car-2", 12)], now=0).arrived == {("car-2", 1): 12}


@pytest.mark.parametrize("boots", [[[1, 2**63 - 1, 2**63 - 1]], [[boot, 2 * 10**8, 2 * 10**8] for boot in (1, 2)]])
def test_a_box_lost_no_more_frames_than_it_can_have_made(intake, refusals, boots) -> None:
    assert intake.take([state("car-2", boots)], now=0).arrived == {}
    assert refusals.counts == {("car-2", INVALID): 1}
    assert intake.figures["sprung_frames_lost_total"] == 0
    assert intake.take([state("car-2", [[1, 31_536_000, 31_536_000]])], now=0).arrived == {("car-2", 1): 31_535_999}


@pytest.mark.parametrize("change", [{77: bytes(2000)}, {16: "x" * 2000}, {9: ["0" * 2000 + "1"]}, {11: None}])
def test_a_frame_carries_nothing_but_samples(intake, store, refusals, change) -> None:
    name, payload = raw("car-1", 1, 0)
    document = checked_map(payload)
    change = {key: value or document[key] + bytes(2000) for key, value in change.items()}
    intake.take([(name, message(document | change))], now=0)
    assert refusals.counts == {("car-1", INVALID): 1}
    assert intake.take([(name, message(document | {77: bytes(900)}))], now=0).arrived == {("car-1", 1): 0}


def test_descriptions_of_many_vehicles_are_one_transaction(intake, store, refusals, monkeypatch) -> None:
    begun, checked = count(), store.inbox._database._checked
    monkeypatch.setattr(store.inbox._database, "_checked", lambda: (next(begun), checked())[1])
    other = vehicle_text(read_vehicle("y25"))
    metas = [(topic(f"car-{number}", "meta"), message(ORIGINALS["meta"])) for number in range(50)]
    changed = topic("car-7", "meta"), message(ORIGINALS["meta"] | {"description": other})
    bad = topic("car-9", "meta"), message(ORIGINALS["meta"] | {"description": "kind = 1"})
    taken = intake.take([*metas, changed, bad, raw("car-50", 1, 0)], now=0)
    assert next(begun) <= 3
    assert len(taken.described) == store.inbox.n_vehicles() == 50
    assert store.inbox.vehicle("car-7").description == other
    assert refusals.counts == {("car-9", INVALID): 1}
    # The last one counts, although it is stored already.
    taken = intake.take([metas[7], changed], now=0)
    assert (len(taken.described), store.inbox.vehicle("car-7").description) == (1, other)


def test_a_description_that_the_store_refuses_costs_no_other(intake, store, refusals, monkeypatch) -> None:
    put = store.inbox.put_vehicle

    def refuse(vehicle, **values):
        put(vehicle, **values)
        if vehicle == "car-2":
            raise RefusedError("the store cannot hold this: a number of 65 bits")

    monkeypatch.setattr(store.inbox, "put_vehicle", refuse)
    metas = [(topic(name, "meta"), message(ORIGINALS["meta"])) for name in ("car-1", "car-2", "car-3")]
    assert intake.take(metas, now=0).described.keys() == {"car-1", "car-3"}
    assert [row.vehicle for row in store.inbox.vehicles()] == ["car-1", "car-3"]
    assert refusals.counts == {("car-2", UNSTORABLE): 1}
