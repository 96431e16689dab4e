"""The fleet in order of urgency: pages, filters and counts, on both databases."""

import pytest

from sprung.online.store import FleetCounts, FleetFilter, Place, Progress, StoredFrame
from sprung.state import AlertState

NOW = 1_795_219_200_000_000_000
HOUR = 3600 * 10**9
#: Vehicle, cause and severity of active alerts.
ALERTS = (
    ("bus-3", "front_left.spring", 700),
    ("bus-1", "front_left.spring", 900),
    ("bus-1", "sensor:acc_fl", 400),
    ("bus-2", "sensor:acc_fl", 700),
    ("bus-4", "silent", 300),
    ("bus-5", "monitor:intake", 700),
)


@pytest.fixture
def fleet(store):
    """Seven vehicles: one learns, one is silent, one parked, one has had an alert."""
    for number in range(1, 8):
        seen = NOW - 2 * HOUR if number in {4, 7} else NOW
        store.inbox.put_vehicle(f"bus-{number}", configuration="c", description="", channels=[], now=seen)
    for vehicle, cause, severity in ALERTS:
        row = AlertState(vehicle, cause, severity, "text", NOW, assignee="bert" if vehicle == "bus-3" else None)
        store.alerts.put(row, history=("raised", "", ""), now=NOW)
    past = AlertState("bus-6", "front_left.spring", 900, "text", NOW, is_active=False, cleared=NOW)
    store.alerts.put(past, history=("cleared", "", ""), now=NOW)
    known = AlertState("bus-2", "sensor:acc_fl", 700, "text", NOW, is_acknowledged=True)
    store.alerts.put(known, history=("acknowledged", "", ""), now=NOW)
    store.inbox.park("bus-7", is_parked=True)
    store.inbox.add_frames([StoredFrame("bus-6", 1, 0, NOW, b"x")], now=NOW)
    status = {"is_learning": True, "n_learnt": 4, "n_needed": 12}
    store.results.commit(Progress("bus-6", 1, done_seq=0, status=status, baselines=((1, 0, "", {}), (2, 0, "", {}))))
    return store.fleet


def names(rows):
    return [row.place.vehicle for row in rows]


def test_the_most_severe_are_first_then_the_least_healthy_then_by_name(fleet) -> None:
    rows = fleet.page(FleetFilter())
    assert names(rows) == ["bus-1", "bus-3", "bus-2", "bus-5", "bus-4", "bus-6", "bus-7"]
    assert rows[0].place == Place(900, 900.0, "bus-1")
    assert rows[2].place == (700, pytest.approx(700 / 3), "bus-2")
    assert rows[4].place == Place(300, 0.0, "bus-4")
    assert rows[5].baseline == 2
    assert (rows[6].is_parked, rows[6].last_seen, rows[6].baseline) == (True, NOW - 2 * HOUR, None)


@pytest.mark.parametrize("limit", [1, 2, 3, 7])
def test_pages_join_without_gaps_and_repeats(fleet, limit) -> None:
    found, after = [], None
    while rows := fleet.page(FleetFilter(), after=after, limit=limit):
        assert len(rows) <= limit
        found += names(rows)
        after = rows[-1].place
    assert found == names(fleet.page(FleetFilter()))


@pytest.mark.parametrize(
    ("wanted", "vehicles"),
    [
        (FleetFilter(text="US-3"), ["bus-3"]),
        (FleetFilter(text="bus_"), []),
        (FleetFilter(text="%"), []),
        (FleetFilter(steps={4}), ["bus-1"]),
        (FleetFilter(steps={3, 1}), ["bus-3", "bus-2", "bus-5", "bus-4"]),
        (FleetFilter(steps={-1}), ["bus-6", "bus-7"]),
        (FleetFilter(assignee="bert"), ["bus-3"]),
        (FleetFilter(is_unacknowledged=True), ["bus-1", "bus-3", "bus-5", "bus-4"]),
        (FleetFilter(is_learning=True), ["bus-6"]),
        (FleetFilter(silent_before=NOW - HOUR), ["bus-4"]),
        (FleetFilter(silent_before=NOW - HOUR, is_learning=True), []),
    ],
)
def test_filters(fleet, wanted, vehicles) -> None:
    assert names(fleet.page(wanted)) == vehicles


def test_counts(fleet) -> None:
    assert fleet.counts(silent_before=NOW - HOUR) == FleetCounts(
        7, (0, 1, 0, 3, 1), learning=1, silent=1, unacknowledged=4
    )
