"""What comes of jobs is stored together with how far they came."""

from pathlib import Path

import pytest

from sprung.alerting import AlertSettings
from sprung.link import Key, message
from sprung.monitor import AlertBook, Identified, Outcome, Site, VehicleStatus
from sprung.monitor.ledger import Ledger
from sprung.storage import StoredFrame, open_store

NOW = 1_795_219_200_000_000_000


@pytest.fixture
def store(tmp_path: Path):
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as opened:
        opened.inbox.add_frames([StoredFrame("car-1", 1, seq, NOW, b"x") for seq in range(5)], now=NOW)
        yield opened


@pytest.fixture
def ledger(store, tmp_path: Path):
    site = Site.model_validate({"store": f"sqlite:///{tmp_path}/store.sqlite"})
    return Ledger(site, store, alerts=AlertBook(store, AlertSettings()), clock=lambda: NOW)


def waiting(store):
    return [frame.seq for frame in store.inbox.pending("car-1", 1, after=-1, limit=99)]


def outcome(*events, state=None) -> Outcome:
    return Outcome("car-1", 3, events, state, VehicleStatus())


def test_a_job_without_results_stores_nothing(ledger, store) -> None:
    assert not ledger.commit(outcome(), 1, 2)
    assert store.inbox.cursor("car-1", 1).done == -1


def test_modes_before_a_complete_window_leave_the_frames(ledger, store) -> None:
    """A restart analyses them again, and stores the same modes under the same number."""
    for _ in range(2):
        assert not ledger.commit(outcome(Identified(4, NOW, ({"natural_frequency": 1.4},))), 1, 2)
    (entry,) = store.results.modes("car-1")
    assert (entry.number, entry.document) == (4, {"modes": [{"natural_frequency": 1.4}], "reason": ""})
    assert waiting(store) == [0, 1, 2, 3, 4]


def test_a_state_replaces_the_frames_that_are_in_it(ledger, store) -> None:
    assert ledger.commit(outcome(state=b"state"), 1, 2)
    assert waiting(store) == [3, 4]
    snapshot = store.results.snapshot("car-1")
    assert (snapshot.boot, snapshot.seq, snapshot.document) == (1, 2, b"state")


def test_excluded_frames_are_an_alert(ledger, store) -> None:
    ledger.exclude("car-1", 1, 3, n_frames=4, reason="the analysis failed")
    (row,) = store.alerts.find(vehicle="car-1", is_active=True)
    assert (row.cause, row.text) == ("monitor:analysis", "4 frames were excluded: the analysis failed")
    assert waiting(store) == [4]


@pytest.mark.parametrize(("modes", "n_stored"), [([{"natural_frequency": 1.4}], 1), ([float("nan")], 0)])
def test_a_report_is_done_whether_it_can_be_stored_or_not(ledger, store, modes, n_stored) -> None:
    document = {Key.VERSION: 1, Key.BOOT: 1, Key.SEQ: 5, Key.START: NOW, Key.KIND: "modes", "number": 0}
    report = StoredFrame("car-1", 1, 5, NOW, message({**document, "modes": modes, "reason": ""}), "modes")
    store.inbox.add_frames([report], now=NOW)
    ledger.store_report(report)
    assert len(store.results.modes("car-1")) == n_stored
    assert store.inbox.cursor("car-1", 1).done == 5
