"""What operators do to alerts and ask of the monitor, by way of the store."""

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import AlertSettings
from sprung.online.monitor import VehicleStatus, operations
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.store import Progress, StoredFrame, open_store

NOW = 1_795_219_200_000_000_000
HOUR = 3600 * 10**9


@pytest.fixture
def store(sqlite_url):
    with open_store(sqlite_url) as opened:
        opened.inbox.put_vehicle("car-1", configuration="c", description="", channels=[], now=NOW)
        AlertBook(opened, AlertSettings()).report("car-1", "silent", "car-1 has sent nothing", now=NOW)
        yield opened


def alert(store):
    (entry,) = operations.alerts_document(store)["alerts"]
    return entry


def test_acts_on_an_alert(store) -> None:
    operations.acknowledge(store, 1, who="anna", comment="seen", now=NOW + 1)
    assert alert(store)["state"] == "acknowledged"
    operations.assign(store, 1, assignee="bert", who="anna", now=NOW + 2)
    assert alert(store)["assignee"] == "bert"
    operations.shelve(store, 1, hours=2.0, who="bert", now=NOW + 3)
    assert alert(store)["shelved_until"] == NOW + 3 + 2 * HOUR
    operations.unshelve(store, 1, who="bert", now=NOW + 4)
    assert alert(store)["shelved_until"] is None
    operations.add_comment(store, 1, who="anna", comment="on its way", now=NOW + 5)
    history = operations.history_document(store, 1)["history"]
    assert [(entry["what"], entry["who"]) for entry in history[1:]] == [
        ("acknowledged", "anna"),
        ("assigned", "anna"),
        ("shelved", "bert"),
        ("unshelved", "bert"),
        ("commented", "anna"),
    ]
    audit = [(row.who, row.act, row.subject, row.time) for row in store.requests.audited()]
    assert audit[0] == ("anna", "ack", "car-1 silent", NOW + 1)
    assert [row[1] for row in audit] == ["ack", "assign", "shelve", "unshelve", "comment"]


LEARNING = VehicleStatus(n_learnt=4, n_needed=12, is_learning=True, window=600.0, until=NOW - HOUR)


@pytest.mark.parametrize(
    ("status", "verdict", "summary"),
    [
        (None, "waiting", "No samples analysed yet."),
        (LEARNING, "learning", "Learning: 4 of 12 windows."),
        (
            LEARNING._replace(note="the vehicle stood"),
            "learning",
            "Learning: 4 of 12 windows; last window: the vehicle stood.",
        ),
        (
            LEARNING._replace(n_learnt=0, share=0.5),
            "learning",
            "Learning: 0 of 12 windows; 5.0 of the 10 min of the next window have arrived.",
        ),
        (
            LEARNING._replace(repeated=1500.0),
            "learning",
            "Learning: 4 of 12 windows; the last 25.0 min were analysed before and do not count again.",
        ),
        (
            LEARNING._replace(is_learning=False, n_learnt=12, share=0.5),
            "inconclusive",
            "Inconclusive: no change detected, but there is no baseline to compare with.",
        ),
        (
            LEARNING._replace(is_learning=False, note="sensor a is dead"),
            "inconclusive",
            "Inconclusive: last window: sensor a is dead.",
        ),
    ],
)
def test_a_vehicle_states_what_is_learnt_and_why_not(store, status, verdict, summary) -> None:
    AlertBook(store, AlertSettings()).clear("car-1", "silent", now=NOW)
    if status is not None:
        store.inbox.add_frames([StoredFrame("car-1", 1, 0, NOW, b"x")], now=NOW)
        store.results.commit(Progress("car-1", 1, done_seq=0, status=status._asdict()))
    (vehicle,) = operations.vehicles_document(store, now=NOW)["vehicles"]
    assert (vehicle["verdict"], vehicle["summary"]) == (verdict, summary)
    expected = (None, None, None) if status is None else (status.n_learnt, 12, NOW - HOUR)
    assert (vehicle["windows_learnt"], vehicle["windows_needed"], vehicle["data_until"]) == expected


def test_an_alert_says_more_than_the_note_of_the_last_window(store) -> None:
    store.inbox.add_frames([StoredFrame("car-1", 1, 0, NOW, b"x")], now=NOW)
    status = LEARNING._replace(note="car-1 has sent nothing")
    store.results.commit(Progress("car-1", 1, done_seq=0, status=status._asdict()))
    (vehicle,) = operations.vehicles_document(store, now=NOW)["vehicles"]
    assert (vehicle["verdict"], vehicle["summary"]) == ("stale", "car-1 has sent nothing.")
    assert (vehicle["windows_learnt"], vehicle["windows_needed"]) == (4, 12)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (
            lambda store: operations.acknowledge(store, 7, who="anna", now=NOW),
            "unknown alert 7: see the list of alerts",
        ),
        (lambda store: operations.history_document(store, 7), "unknown alert 7"),
        (lambda store: operations.shelve(store, 1, hours=0.0, who="anna", now=NOW), "hours=0"),
        (lambda store: operations.relearn(store, "car-1", reason=" ", who="anna", now=NOW), "needs a reason"),
        (lambda store: operations.relearn(store, "car-9", reason="x", who="anna", now=NOW), "unknown vehicle 'car-9'"),
        (
            lambda store: operations.request_samples(store, "car-9", minutes=1, who="a", now=NOW),
            "unknown vehicle 'car-9'",
        ),
        (lambda store: operations.request_samples(store, "car-1", minutes=0, who="a", now=NOW), "minutes=0"),
    ],
)
def test_acts_that_are_impossible(store, act, words) -> None:
    with pytest.raises(ParameterError, match=words):
        act(store)
    assert store.requests.open_commands() == []
    assert store.requests.audited() == []
