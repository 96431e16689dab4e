from dataclasses import replace

from sprung.storage import AlertRow, HistoryRow, NotificationRow

ALERT = AlertRow("zafira", "front_left.damper", severity=2, text="Damper is weak", raised=100, document={"p": 0.01})
RAISED = ("raised", "monitor", "")


def test_alert_is_stored_and_replaced_by_its_cause(store) -> None:
    first = store.alerts.put(ALERT, history=RAISED, now=101)
    assert store.alerts.find() == [first] == [replace(ALERT, id=first.id, updated=101)]
    changed = replace(
        first, severity=3, count=2, is_acknowledged=True, assignee="eve", shelved_until=10**18, document={"p": 0.001}
    )
    second = store.alerts.put(changed, history=("acknowledged", "eve", "ordered parts"), now=202)
    assert second.id == first.id
    assert store.alerts.find() == [replace(changed, updated=202)]
    rows = store.alerts.history(first.id)
    assert rows == [
        HistoryRow(rows[0].id, first.id, 101, "raised", "monitor", "", None, None),
        HistoryRow(rows[1].id, first.id, 202, "acknowledged", "eve", "ordered parts", "eve", 10**18),
    ]


def test_an_event_is_recorded_that_leaves_the_alert_as_it_is(store) -> None:
    alert = store.alerts.put(replace(ALERT, assignee="eve"), history=RAISED, now=101)
    store.alerts.record(alert.id, "undelivered", "the mail server is away", now=102)
    assert store.alerts.find() == [alert]
    last = store.alerts.history(alert.id)[-1]
    assert last == HistoryRow(
        last.id, alert.id, 102, "undelivered", "", "the mail server is away", assignee="eve", shelved_until=None
    )


def test_alerts_are_chosen_by_vehicle_and_state(store) -> None:
    store.alerts.put(ALERT, history=RAISED, now=0)
    store.alerts.put(replace(ALERT, cause="tyre", severity=5), history=RAISED, now=0)
    store.alerts.put(replace(ALERT, vehicle="other", is_active=False, cleared=300), history=RAISED, now=0)
    assert [alert.cause for alert in store.alerts.find(vehicle="zafira")] == ["tyre", "front_left.damper"]
    assert [alert.cleared for alert in store.alerts.find(is_active=False)] == [300]
    assert len(store.alerts.find(is_active=True)) == 2
    assert store.alerts.find(vehicle="other", is_active=True) == []


def test_notifications_stay_until_sent(store) -> None:
    alert = store.alerts.put(ALERT, history=RAISED, notify={"to": "workshop"}, now=1)
    store.alerts.put(ALERT, history=("notified", "monitor", ""), now=2)
    store.alerts.put(ALERT, history=("again", "monitor", ""), notify={"to": "driver"}, now=3)
    first, second = store.alerts.due_notifications(10)
    assert first == NotificationRow(first.id, alert.id, 1, {"to": "workshop"}, None, 0, None)
    store.alerts.notification_failed(first.id, "no route to host")
    assert store.alerts.due_notifications(1) == [second], "what fails lets others pass"
    store.alerts.notification_sent(second.id, 5)
    (left,) = store.alerts.due_notifications(10)
    assert (left.id, left.attempts, left.last_error) == (first.id, 1, "no route to host")
    store.alerts.notification_sent(first.id, 6)
    assert store.alerts.due_notifications(10) == []
    assert store.delete_older(6) == 1
    assert store.delete_older(7) == 1
