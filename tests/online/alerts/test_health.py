"""The health index of a vehicle."""

import pytest

from sprung.online.alerts import (
    AlertSettings,
    Report,
    assess,
    health_index,
    shelved,
)

CAUSES = ("front_left.spring", "rear_right.damper", "sensor:acc_fl", "silent")
ONCE = AlertSettings(raise_after=1, clear_after=1)


def report(cause, severity=500, vehicle="car"):
    return Report(vehicle, cause, severity, f"{cause} at {severity}")


def play(alerts, reports, *, looked_for=lambda cause: True, is_inhibited=False, settings=ONCE, now=0):
    transitions = assess(alerts, reports, looked_for=looked_for, is_inhibited=is_inhibited, settings=settings, now=now)
    return {**alerts, **{one.alert.cause: one.alert for one in transitions}}, transitions


@pytest.fixture
def all_active():
    return play({}, [report(cause) for cause in CAUSES])[0]


@pytest.mark.parametrize(
    ("reports", "health"),
    [
        ([], 100.0),
        ([report("front_left.spring", 900)], 10.0),
        ([report("front_left.spring", 300), report("rear_left.tyre", 500)], 50.0),
        ([report("sensor:acc_fl", 600)], 80.0),
        ([report("sensor:acc_fl", 900), report("front_left.spring", 200)], 70.0),
        ([report("silent", 900), report("monitor", 1000)], 100.0),
        ([report("rear_left.tyre", 1000)], 0.0),
    ],
)
def test_health(reports, health) -> None:
    alerts, _ = play({}, reports)
    assert health_index(alerts.values()) == pytest.approx(health)


def test_health_forgets_what_cleared_and_not_what_is_shelved(all_active) -> None:
    hidden = [shelved(one, "ann", 10, 1).alert for one in all_active.values()]
    assert health_index(hidden) == 50.0
    assert health_index(play(all_active, [], now=1)[0].values()) == 100.0
