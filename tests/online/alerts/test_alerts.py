"""Names, severities and weights of alerts."""

import pytest

from sprung.online.alerts import Report
from sprung.state import AlertState, health_index, severity_step


def an_alert(cause="front_left.spring", severity=500, is_active=True, is_acknowledged=False, shelved_until=None):
    return AlertState("car", cause, severity, "softer", 1, is_active, is_acknowledged, shelved_until)


@pytest.mark.parametrize(
    ("is_active", "is_acknowledged", "shelved_until", "name"),
    [
        (True, False, None, "unacknowledged"),
        (True, True, None, "acknowledged"),
        (False, False, None, "returned to normal, unacknowledged"),
        (False, True, None, "normal"),
        (True, False, 2000, "shelved"),
        (False, True, 2000, "shelved"),
    ],
)
def test_names_of_isa_18_2(is_active, is_acknowledged, shelved_until, name) -> None:
    alert = an_alert(is_active=is_active, is_acknowledged=is_acknowledged, shelved_until=shelved_until)
    assert alert.state == name


@pytest.mark.parametrize(
    ("severity", "step"), [(1, 0), (200, 0), (201, 1), (300, 1), (500, 2), (700, 3), (900, 4), (1000, 4)]
)
def test_steps_of_severity(severity, step) -> None:
    assert severity_step(severity) == step


def test_values_can_be_keys() -> None:
    reports = {Report("car", "front_left.spring", 500, "softer", {"a": [value]}) for value in (1, 2)}
    assert len(reports) == 2
    assert len({an_alert(), an_alert()}) == 1


@pytest.mark.parametrize(
    ("alerts", "health"),
    [
        ([], 100.0),
        ([an_alert(severity=900)], 10.0),
        ([an_alert(severity=300), an_alert("rear_left.tyre")], 50.0),
        ([an_alert("sensor:acc_fl", 600)], 80.0),
        ([an_alert("sensor:acc_fl", 900), an_alert(severity=200)], 70.0),
        ([an_alert("silent", 900), an_alert("monitor:disk", 1000)], 100.0),
        ([an_alert(severity=1000)], 0.0),
        ([an_alert(shelved_until=2000, is_acknowledged=True)], 50.0),
        ([an_alert(is_active=False)], 100.0),
    ],
)
def test_health_forgets_what_cleared_and_not_what_is_shelved(alerts, health) -> None:
    assert health_index(alerts) == pytest.approx(health)
