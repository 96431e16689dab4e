"""Names, severities and weights of alerts."""

import pytest

from sprung.online.alerts import Report
from sprung.state import AlertState, health_index, severity_step


def an_alert(cause="front_left.spring", severity=500, is_active=True, is_acknowledged=False, shelved_until=None):
    return AlertState("car", cause, severity, "softer", 1, is_active, is_acknowledged, shelved_until)


#: States of the alarm model (ISA-18.2-2016, figure of the states) by active, acknowledged and shelved.
STATES = {
    (True, False, None): "unacknowledged",
    (True, True, None): "acknowledged",
    (False, False, None): "returned to normal, unacknowledged",
    (False, True, None): "normal",
    (True, False, 2000): "shelved",
    (True, True, 2000): "shelved",
    (False, False, 2000): "shelved",
    (False, True, 2000): "shelved",
}


def test_names_of_isa_18_2(conforms) -> None:
    wrong = [
        case
        for case, name in STATES.items()
        if an_alert(is_active=case[0], is_acknowledged=case[1], shelved_until=case[2]).state != name
    ]
    what = "wrong names of states, of all eight combinations of active, acknowledged and shelved"
    conforms("ISA-18.2-2016", "states of an alarm", what, len(wrong), 0, absolute=0)


@pytest.mark.parametrize(
    ("severity", "step"), [(1, 0), (200, 0), (201, 1), (300, 1), (500, 2), (700, 3), (900, 4), (1000, 4)]
)
def test_steps_of_severity(severity, step) -> None:
    assert severity_step(severity) == step


def test_steps_hold_the_categories_of_opc_10000_110(conforms) -> None:
    """To 200 not active, 300 resource near its limit, 400 maintenance, 600 minor, 800 major, 1000 critical fault."""
    categories = [(1, 200, 0), (201, 300, 1), (301, 400, 1), (401, 600, 2), (601, 800, 3), (801, 1000, 4)]
    found = [severity_step(end) for first, last, _ in categories for end in (first, last)]
    what = "steps of severity at both ends of each category"
    conforms(
        "OPC 10000-110:2022", "9.3, table 15", what, found, [step for *_, step in categories for _ in "ab"], absolute=0
    )


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
