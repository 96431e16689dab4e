"""Lists of alerts, the evidence behind one, and its chart."""

import math
import re

import numpy as np
import pytest
from tests.online.site.conftest import HOUR, NOW, raise_alert

from sprung.diagnosis import Observation
from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import operations
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.site.accounts import Person, Role
from sprung.online.site.alert import PAGE, EvidencePoint, course_of, evidence
from sprung.online.site.alerts import STATES, WantedAlerts, WantedPage, alerts, counts
from sprung.online.site.rendering import _road, _rounded
from sprung.online.store import Progress, StoredFrame
from sprung.results.documents import observation_document
from sprung.vehicles import Component

PERSON = Person("anna", Role.VIEWER)
PARTS = (Component("front_left", "spring"), Component("front_right", "spring"), Component("rear_left", "spring"))


def window(number, t0, *, reason=""):
    """A window in which the springs have 70, 90 and 100 % of the file's value, with a standard deviation of 2 %."""
    logs = np.log([0.7, 0.9, 1.0])
    conditions = {"speed": 10.0, "roughness": 16e-6, "payload": math.nan, "temperature": 8.0}
    if reason:
        made = Observation(t0 / 1e9, (), np.zeros(0), np.zeros((0, 0)), {"speed": 0.0}, {}, (), reason=reason)
    else:
        made = Observation(t0 / 1e9, PARTS, logs, 0.02**2 * np.eye(3), conditions, {}, ())
    return number, t0, observation_document(made)


@pytest.fixture
def alert(store):
    """Number of an alert on the springs of the front axle, whose onset was an hour before."""
    windows = [window(k, NOW + (k - 10) * HOUR // 4, reason="the vehicle stood" if k == 8 else "") for k in range(10)]
    store.inbox.add_frames([StoredFrame("bus-3", 1, 0, NOW, b"x")], now=NOW)
    store.results.commit(Progress("bus-3", 1, done_seq=0, observations=tuple(windows), now=NOW))
    parts = [{"name": "front_left.spring", "change": -0.2, "interval": [-0.3, -0.1], "score": 4.0}]
    hypotheses = [
        {"name": "front.spring", "log_evidence": 20.0, "change": -0.2, "interval": [-0.3, -0.1], "parts": []},
        {"name": "front_left.spring+rear.tyre", "log_evidence": 9.0, "change": None, "interval": None, "parts": parts},
    ]
    course = {"times": [NOW / 1e9 - 60, NOW / 1e9], "evidence": [3.0, 20.0]}
    evidence = {
        "change": -0.2,
        "interval": [-0.3, -0.1],
        "since": (NOW - HOUR) / 1e9,
        "since_interval": [(NOW - 2 * HOUR) / 1e9, (NOW - HOUR) / 1e9],
        "runner_up": "front-left spring",
        "advice": "inspect before the next 500 km",
        "detectable": {"front_left.spring": 0.07},
        "detection": {**course, "threshold": 10.8, "hypotheses": hypotheses},
    }
    text = "both front springs 20 % (10 to 30 %) softer; inspect"
    return raise_alert(store, "bus-3", "front.spring", 700, text, evidence=evidence)


def test_the_evidence_of_an_alert(serve, alert) -> None:
    context, _ = serve()
    found = evidence(context, PERSON, alert)
    assert (found.change, found.interval, found.runner_up) == (-0.2, (-0.3, -0.1), "front-left spring")
    assert found.since == pytest.approx(NOW - HOUR, abs=1e6)
    first, second = found.hypotheses
    assert (first.name, first.log_evidence, first.change, first.parts) == ("front.spring", 20.0, -0.2, ())
    assert [(part.name, part.change) for part in second.parts] == [("front_left.spring", -0.2)]
    assert [point.log_evidence for point in found.course] == [3.0, 20.0]
    assert found.threshold == 10.8


def test_the_windows_behind_an_alert_have_their_conditions(serve, alert) -> None:
    """Five windows before the onset, and the four since then, of which one says nothing."""
    context, _ = serve()
    windows = evidence(context, PERSON, alert).windows
    assert [(each.number, each.is_since_onset) for each in windows] == [(k, k >= 6) for k in range(1, 10)]
    assert [each.note for each in windows if each.note] == ["the vehicle stood"]
    last = windows[-1]
    assert (last.boot, last.t0, last.speed, last.payload, last.temperature) == (1, NOW - HOUR // 4, 10.0, None, 8.0)
    assert [part.name for part in last.parts] == ["front_left.spring", "front_right.spring"]
    assert last.parts[0].value == pytest.approx(0.7, rel=1e-9)
    assert last.parts[0].interval == pytest.approx((0.7 * math.exp(-0.0392), 0.7 * math.exp(0.0392)), rel=1e-9)


def test_the_windows_behind_the_alert_of_a_sensor_begin_with_its_fault(serve, store) -> None:
    """Also where the samples are older than the alert, as after a replay."""
    fault = {"channel": "acc_rr", "kind": "stuck_low", "detail": "it is constant"}
    windows = [window(k, NOW + (k - 40) * HOUR) for k in range(10)]
    for _, _, document in windows[6:]:
        document["sensor_faults"] = [fault]
    store.inbox.add_frames([StoredFrame("bus-3", 1, 0, NOW, b"x")], now=NOW)
    store.results.commit(Progress("bus-3", 1, done_seq=0, observations=tuple(windows), now=NOW))
    number = raise_alert(store, "bus-3", "sensor:acc_rr", 300, "sensor acc_rr is dead", evidence={"kind": "dead"})
    context, _ = serve()
    found = [(each.number, each.is_since_onset, each.note) for each in evidence(context, PERSON, number).windows]
    assert found == [(k, k >= 6, "acc_rr stuck low" if k >= 6 else None) for k in range(1, 10)]


def test_alerts_by_state_severity_vehicle_and_assignee(serve, alert, store) -> None:
    """Alert 1 (high) is acknowledged, 2 (low) shelved, 3 (high) assigned."""
    context, _ = serve()
    operations.acknowledge(store, 1, who="eve", now=NOW)
    operations.shelve(store, 2, hours=1.0, who="eve", now=NOW)
    operations.assign(store, alert, assignee="bert", who="eve", now=NOW)

    def numbers(**wanted):
        return [entry.number for entry in alerts(context, PERSON, WantedPage(**wanted)).alerts]

    assert numbers() == [1, alert, 2]
    assert numbers(state=["acknowledged"]) == [1]
    assert numbers(state=["shelved", "unacknowledged"]) == [alert, 2]
    assert numbers(step=["low"]) == [2]
    assert numbers(vehicle="BUS-3") == [alert]
    assert numbers(vehicle="%") == []
    assert numbers(assignee="bert") == [alert]
    found = counts(context, PERSON, WantedAlerts())
    assert found.states == dict(zip(STATES, (1, 1, 0, 1, 0), strict=True))
    assert found.steps == {"note": 0, "low": 1, "medium": 0, "high": 2, "critical": 0}
    operations.close(store, 1, who="eve", now=NOW + 1)
    assert numbers() == [alert, 2]
    assert numbers(is_complete=True) == [1, alert, 2]
    assert numbers(state=["normal"]) == [1]
    assert counts(context, PERSON, WantedAlerts()).steps["high"] == 1


def test_pages_of_alerts_follow_their_cursor(serve, store) -> None:
    """Alerts of equal severity that were raised at the same time and at others: none twice, none left out."""
    context, _ = serve()
    book = AlertBook(store, AlertSettings())
    for k in range(7):
        book.report(f"car-{k}", "monitor", "text", now=NOW - k // 2)
    found, cursor = [], None
    while True:
        page = alerts(context, PERSON, WantedPage(cursor=cursor, limit=2))
        found += [entry.number for entry in page.alerts]
        cursor = page.next
        if cursor is None:
            break
    assert len(found) == len(set(found)) == 9
    assert found == [row.number for row in store.alerts.find()]


def test_alerts_in_their_first_hold_off_are_none_yet(serve, store) -> None:
    context, _ = serve()
    settings = AlertSettings(raise_after=2)
    AlertBook(store, settings).put(reported(None, Report("car", "a.spring", 500, "x"), settings, NOW), now=NOW)
    assert len(alerts(context, PERSON, WantedPage(is_complete=True)).alerts) == 2


def points(*values):
    return [EvidencePoint(time=k, log_evidence=value) for k, value in enumerate(values)]


def test_the_scale_reaches_from_0_to_above_the_largest_value() -> None:
    """Values 0, 10, 20 with a threshold of 10: heights in proportion, 21 at the top."""
    course = course_of(points(0.0, 10.0, 20.0), 10.0)
    assert course is not None
    top, left, right = PAGE.top, PAGE.left, PAGE.width - PAGE.right
    inner = PAGE.height - top - PAGE.bottom
    assert [dot.y for dot in course.dots] == pytest.approx([top + inner * (21 - value) / 21 for value in (0, 10, 20)])
    assert [dot.x for dot in course.dots] == pytest.approx([left, (left + right) / 2, right])
    assert [dot.is_above for dot in course.dots] == [False, True, True]
    assert course.threshold == pytest.approx(course.dots[1].y)
    assert [number for _, number in course.marks] == [0, 5, 10, 15, 20]


@pytest.mark.parametrize("values", [(-3.0,), (-0.5, -2.5, 1.0), (1e4, 2e4), (0.0,)])
def test_all_is_within_the_drawing(values) -> None:
    course = course_of(points(*values), 10.8)
    assert course is not None
    heights = [*(dot.y for dot in course.dots), course.threshold, *(y for y, _ in course.marks)]
    assert all(PAGE.top - 1e-9 <= y <= PAGE.height - PAGE.bottom + 1e-9 for y in heights)
    assert 1 <= len(course.marks) <= 6


def test_no_chart_without_windows() -> None:
    assert course_of([], 10.8) is None
    assert course_of(points(1.0), None) is None


@pytest.mark.slow
def test_the_page_of_an_alert_folds_pairs_with_the_best_and_shows_likelihoods_beside_it(serve, store) -> None:
    names = {"rear_right.damper": 20.0, "rear_right.damper+front_left.tyre": 19.0, "rear.damper": 17.0}
    hypotheses = [
        {"name": name, "log_evidence": value, "change": -0.2, "interval": [-0.3, -0.1], "parts": []}
        for name, value in names.items()
    ]
    detection = {"times": [NOW / 1e9], "evidence": [20.0], "threshold": 10.8, "hypotheses": hypotheses}
    evidence = {"change": -0.2, "interval": [-0.3, -0.1], "detection": detection}
    number = raise_alert(store, "bus-3", "rear_right.damper", 700, "rear-right damper softer", evidence=evidence)
    page = serve()[1].get(f"/alerts/{number}").text
    shown, _, folded = page.partition("1 pair of the best hypothesis and another part")
    assert "front left tyre" not in shown
    assert "front left tyre" in folded
    assert re.findall(r'value="([\d.]+)">', shown[shown.index("What may have changed") :]) == ["1", "0.0498"]


def test_values_of_windows_are_in_km_per_hour_and_words(serve, alert) -> None:
    page = serve()[1].get(f"/alerts/{alert}").text
    assert "36 km/h" in page
    assert "smooth (A)" in page
    assert [_rounded(value) for value in (-0.3, -0.0, 0.4, -12.4)] == ["0", "0", "0", "−12"]
    assert [_road(value * 1e-6) for value in (16, 64, 256, 1024)] == [
        "smooth (A)",
        "smooth (B)",
        "normal (C)",
        "rough (D)",
    ]
