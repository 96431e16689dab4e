"""Names and severities of alerts."""

import pytest

from sprung.online.alerts import (
    Alert,
    Report,
    severity_step,
    state_name,
)


def report(evidence):
    return Report("car", "front_left.spring", 500, "softer", evidence)


def an_alert(is_active, is_acknowledged, shelved_until=None):
    return Alert(
        "car", "front_left.spring", 500, "softer", is_active, is_acknowledged, shelved_until, 1, 2, None, 1, None, 0
    )


@pytest.mark.parametrize(
    ("alert", "name"),
    [
        (an_alert(True, False), "unacknowledged"),
        (an_alert(True, True), "acknowledged"),
        (an_alert(False, False), "returned to normal, unacknowledged"),
        (an_alert(False, True), "normal"),
        (an_alert(True, False, 2000), "shelved"),
        (an_alert(False, True, 2000), "shelved"),
    ],
)
def test_names_of_isa_18_2(alert, name) -> None:
    assert state_name(alert) == name


@pytest.mark.parametrize(
    ("severity", "step"), [(1, 0), (200, 0), (201, 1), (300, 1), (500, 2), (700, 3), (900, 4), (1000, 4)]
)
def test_steps_of_severity(severity, step) -> None:
    assert severity_step(severity) == step


def test_values_can_be_keys() -> None:
    assert len({report({"a": [1]}), report({"a": [2]})}) == 2
    assert len({an_alert(True, False), an_alert(True, False)}) == 1
