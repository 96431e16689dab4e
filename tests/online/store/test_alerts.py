from dataclasses import replace
from itertools import product

import pytest

from sprung.online.store import AlertFilter, AlertPlace, Delivery, HistoryRow, NotificationRow
from sprung.state import AlertState, severity_step

DAY = 86400 * 10**9
ALERT = AlertState("zafira", "front_left.damper", severity=2, text="Damper is weak", raised=100, evidence={"p": 0.01})
RAISED = ("raised", "monitor", "")


def test_alert_is_stored_and_replaced_by_its_cause(store) -> None:
    first = store.alerts.put(ALERT, history=RAISED, now=101)
    assert store.alerts.find() == [first] == [replace(ALERT, number=first.number, updated=101)]
    changed = replace(
        first, severity=3, count=2, is_acknowledged=True, assignee="eve", shelved_until=10**18, evidence={"p": 0.001}
    )
    second = store.alerts.put(changed, history=("acknowledged", "eve", "ordered parts"), now=202)
    assert second.number == first.number
    assert store.alerts.find() == [replace(changed, updated=202)]
    rows = store.alerts.history(first.number)
    assert rows == [
        HistoryRow(rows[0].id, first.number, 101, "raised", "monitor", "", None, None),
        HistoryRow(rows[1].id, first.number, 202, "acknowledged", "eve", "ordered parts", "eve", 10**18),
    ]


def test_an_event_is_recorded_that_leaves_the_alert_as_it_is(store) -> None:
    alert = store.alerts.put(replace(ALERT, assignee="eve"), history=RAISED, now=101)
    store.alerts.record(alert.number, "undelivered", "the mail server is away", now=102)
    assert store.alerts.find() == [alert]
    last = store.alerts.history(alert.number)[-1]
    assert last == HistoryRow(
        last.id, alert.number, 102, "undelivered", "", "the mail server is away", assignee="eve", shelved_until=None
    )


def test_alerts_are_chosen_by_vehicle_and_state(store) -> None:
    store.alerts.put(ALERT, history=RAISED, now=0)
    store.alerts.put(replace(ALERT, cause="tyre", severity=5), history=RAISED, now=0)
    store.alerts.put(replace(ALERT, vehicle="other", is_active=False, cleared=300), history=RAISED, now=0)
    assert [alert.cause for alert in store.alerts.find(vehicle="zafira")] == ["tyre", "front_left.damper"]
    assert [alert.cleared for alert in store.alerts.find(is_active=False)] == [300]
    assert len(store.alerts.find(is_active=True)) == 2
    assert store.alerts.find(vehicle="other", is_active=True) == []


def test_alerts_are_chosen_by_the_end_of_their_shelving(store) -> None:
    for cause, until in (("tyre", 100), ("damper", 101), ("spring", None)):
        store.alerts.put(replace(ALERT, cause=cause, shelved_until=until), history=RAISED, now=0)
    assert store.alerts.shelved(until=99) == []
    assert [alert.cause for alert in store.alerts.shelved(until=100)] == ["tyre"]
    assert len(store.alerts.shelved(until=101)) == 2


STATES = ("unacknowledged", "acknowledged", "returned to normal, unacknowledged", "shelved", "normal")


@pytest.fixture
def every(store):
    """An alert of every combination of severity, state and assignee, and one in its first hold-off."""
    choices = product((1, 200, 201, 400, 401, 1000), (True, False), (True, False), (None, 10**18), (None, "eve"))
    for number, (severity, is_active, is_acknowledged, until, assignee) in enumerate(choices):
        row = AlertState(
            *(f"car-{number % 3}", f"cause {number}", severity, "text", number // 7),
            is_active=is_active,
            is_acknowledged=is_acknowledged,
            shelved_until=until,
            assignee=assignee,
        )
        store.alerts.put(row, history=RAISED, now=0)
    rows = store.alerts.find()
    store.alerts.put(replace(ALERT, count=0), history=RAISED, now=0)
    return rows


def test_the_states_of_the_store_are_those_of_alerts(store, every) -> None:
    """The store selects by state and step in SQL, alerts state them in Python."""
    for state, step in product(STATES, range(5)):
        expected = [row for row in every if (row.state, severity_step(row.severity)) == (state, step)]
        assert store.alerts.page(AlertFilter((state,), (step,)), limit=1000) == expected
        assert store.alerts.counts(AlertFilter()).get((state, step), 0) == len(expected)
    assert sum(store.alerts.counts(AlertFilter()).values()) == len(every)


def test_alerts_are_listed_in_pages_and_by_vehicle_and_assignee(store, every) -> None:
    rows, after = [], None
    while page := store.alerts.page(AlertFilter(), after=after, limit=10):
        rows += page
        after = AlertPlace(page[-1].severity, page[-1].raised, page[-1].number)
    assert rows == every
    wanted = AlertFilter(vehicle="AR-1", assignee="eve")
    expected = [row for row in every if row.vehicle == "car-1" and row.assignee == "eve"]
    assert store.alerts.page(wanted, limit=1000) == expected
    assert sum(store.alerts.counts(wanted).values()) == len(expected)
    assert store.alerts.page(AlertFilter(vehicle="_"), limit=10) == []
    numbers = [expected[0].number, expected[-1].number, 10**6]
    assert store.alerts.rows(numbers) == {row.number: row for row in (expected[0], expected[-1])}


def test_each_sender_has_its_own_progress_with_a_notification(store) -> None:
    alerts, senders = store.alerts, ("log", "mail")
    alert = alerts.put(ALERT, history=RAISED, notify={"to": "workshop"}, now=1)
    alerts.put(ALERT, history=("notified", "monitor", ""), now=2)
    alerts.put(ALERT, history=("again", "monitor", ""), notify={"to": "driver"}, now=3)
    first = alerts.next_notification("log", now=4)
    assert first == NotificationRow(first.id, alert.number, 1, {"to": "workshop"}, Delivery())
    alerts.put_delivery(first.id, "log", Delivery(1, sent=4), senders=senders, now=4)
    failed = Delivery(1, next_attempt=20, last_error="no route to host")
    alerts.put_delivery(first.id, "mail", failed, senders=senders, now=4)
    second = alerts.next_notification("mail", now=5)
    assert second.document == {"to": "driver"}, "what fails lets others pass"
    assert alerts.next_notification("log", now=5) == second, "what was passed on is not sent again"
    assert alerts.next_notification("new", now=5).id == first.id
    for sender in senders:
        alerts.put_delivery(second.id, sender, Delivery(1, sent=6), senders=senders, now=6)
        assert alerts.next_notification(sender, now=6) is None
    assert alerts.next_notification("mail", now=20) == replace(first, delivery=failed)
    assert alerts.n_open() == 1
    assert store.delete_older(6, audit_before=0) == 0
    assert store.delete_older(7, audit_before=0) == 1
    assert alerts.given_up() == {}
    alerts.put_delivery(first.id, "mail", Delivery(2, given_up=21, last_error="away"), senders=senders, now=21)
    assert alerts.given_up() == {"mail": "away"}
    assert alerts.n_open() == 0
    assert store.delete_older(21, audit_before=0) == 0
    assert store.delete_older(22, audit_before=0) == 1


def test_a_clock_set_back_holds_no_notification_up(store) -> None:
    store.alerts.put(ALERT, history=RAISED, notify={}, now=1)
    late = Delivery(1, next_attempt=10**18, last_error="away")
    number = store.alerts.next_notification("mail", now=1).id
    store.alerts.put_delivery(number, "mail", late, senders=["mail"], now=1)
    assert store.alerts.next_notification("mail", now=10**18 - 10**9) is None
    assert store.alerts.next_notification("mail", now=10**18 - 2 * DAY).id == number


def test_a_notification_is_closed_once_the_remaining_senders_have_settled_it(store) -> None:
    store.alerts.put(ALERT, history=RAISED, notify={}, now=1)
    number = store.alerts.next_notification("log", now=1).id
    store.alerts.put_delivery(number, "log", Delivery(1, sent=2), senders=["log", "mail"], now=2)
    store.alerts.close_settled(["log", "mail"], now=3)
    assert store.alerts.n_open() == 1
    store.alerts.close_settled(["log"], now=4)
    assert store.alerts.n_open() == 0
