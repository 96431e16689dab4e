"""What vehicles send is validated, stored, acknowledged and counted."""

from pathlib import Path

import pytest

from sprung.link import Key, checked_map, message, topic
from sprung.monitor.intake import Intake
from sprung.storage import open_store
from sprung.vehicles import read_vehicle, vehicle_text

ANSWER = {"did": "raw", "boot": 1, "last": 4, "frames": 5, "from": 0, "to": 5, "reason": "r" * 300}


@pytest.fixture
def published():
    """Topics and contents that the intake published."""
    return []


@pytest.fixture
def intake(tmp_path: Path, published):
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as store:
        yield Intake(store, lambda name, payload: published.append((name, checked_map(payload))))


def test_frames_are_acknowledged_up_to_the_first_that_is_missing(intake, drive, frames_of, published) -> None:
    frames = frames_of(drive(0))[:5]
    for taken, contiguous in ((frames[:2], 1), (frames[4:], 1), (frames[2:4], 4), (frames[:1], 4)):
        arrived = intake.take([(topic("car-1", "raw"), payload) for payload in taken], now=0).arrived
        assert arrived == {("car-1", 1): contiguous}
        assert published.pop() == (topic("car-1", "ack"), {Key.VERSION: 1, Key.BOOT: 1, Key.SEQ: contiguous})
    assert published == []
    assert intake.figures["sprung_frames_total"] == 6


def test_nothing_is_acknowledged_before_the_first_frame_of_a_boot(intake, drive, frames_of, published) -> None:
    intake.take([(topic("car-1", "raw"), frames_of(drive(0))[3])], now=0)
    assert published == []


def test_a_description_is_reported_whenever_it_comes_as_others_may_have_stored_it(intake) -> None:
    text = vehicle_text(read_vehicle("zafira"))
    document = {Key.VERSION: 1, Key.CONFIGURATION: "c", "description": text, "quantities": {"acc_fl": "acceleration"}}
    meta = (topic("car-1", "meta"), message(document))
    assert intake.take([meta], now=0).described == {"car-1"}
    assert intake.take([meta], now=0).described == {"car-1"}


def test_a_frame_on_the_topic_of_another_vehicle_is_refused(intake, drive, frames_of, published) -> None:
    taken = intake.take([(topic("car-2", "raw"), frames_of(drive(0))[0])], now=0)
    assert taken.arrived == {}
    assert published == []
    assert intake.figures["sprung_messages_refused_total"] == 1


def test_what_monitors_say_of_themselves_is_ignored(intake) -> None:
    intake.take([(topic("monitor", "state"), b"anything")], now=0)
    assert intake.figures["sprung_messages_refused_total"] == 0


def test_frames_that_a_box_no_longer_has_are_lost(intake, drive, frames_of) -> None:
    intake.take([(topic("car-1", "raw"), frames_of(drive(0))[5])], now=0)
    taken = intake.take([(topic("car-1", "state"), message({"boots": [[1, 5, 6]], "is_leaving": True}))], now=1)
    assert taken.arrived == {("car-1", 1): 5}
    assert intake.figures["sprung_frames_lost_total"] == 5
    assert intake.is_parked("car-1")
    intake.take([(topic("car-1", "state"), message({"boots": []}))], now=2)
    assert not intake.is_parked("car-1")


def test_the_last_thousand_answers_are_kept(intake) -> None:
    answers = [(topic("car-2", "event"), message({**ANSWER, "number": number})) for number in range(1100)]
    intake.take([*answers, (topic("car-2", "event"), message({"did": "something new"}))], now=0)
    assert [number for number in range(1100) if intake.answer("car-2", number)] == list(range(100, 1100))
    assert intake.answer("car-2", 1099) == {key: ANSWER[key] for key in ("boot", "last", "frames", "from", "to")} | {
        "reason": "r" * 200
    }
    assert intake.answer("car-1", 1099) is None
