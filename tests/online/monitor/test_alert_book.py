"""A problem with monitoring itself is one alert, however often it is reported."""

import numpy as np
import pytest

import sprung
from sprung.online.alerts import AlertSettings
from sprung.online.monitor import Observed
from sprung.online.monitor.alert_book import AlertBook
from sprung.vehicles import Component

NOW = 1_795_219_200_000_000_000


def test_problem_that_stays_the_same_is_named_once(store) -> None:
    book = AlertBook(store, AlertSettings())
    for second in range(5):
        book.report("car-1", "silent", "car-1 has sent nothing", now=NOW + second)
    assert store.alerts.n_open() == 1
    book.clear("car-1", "silent", now=NOW + 10)
    book.clear("car-1", "silent", now=NOW + 11)
    assert store.alerts.n_open() == 2
    (row,) = store.alerts.find()
    assert [entry.what for entry in store.alerts.history(row.number)] == ["raised", "cleared"]


def test_losses_add_up_while_their_alert_is_active_and_begin_anew_afterwards(store) -> None:
    book = AlertBook(store, AlertSettings())

    def lose(boot, n_frames):
        book.report_lost("car-1", {boot: n_frames}, begin=NOW, end=NOW + 10**9, now=NOW)
        (row,) = store.alerts.find()
        return row

    assert [lose(*lost).evidence["frames"] for lost in ((1, 10), (1, 20), (1, 20), (2, 5))] == [10, 20, 20, 25]
    assert len(store.alerts.history(1)) == 3, "what is stated again is not counted again"
    book.clear("car-1", "lost", now=NOW + 1)
    row = lose(2, 6)
    assert row.evidence["frames"] == 1
    assert row.text.startswith("1 frame of car-1, 2026-11-21 00:00 to 00:00 UTC, is lost, as its box had to drop it")


COMPONENTS = tuple(
    Component(f"{axle}_{side}", kind)
    for axle in ("front", "rear")
    for side in ("left", "right")
    for kind in ("spring", "damper", "tyre")
)


def window(generator, number, *, change):
    """A window whose parts scatter by 2 %, the front-left spring changed by a log ratio."""
    values = 0.02 * generator.standard_normal(12) + change * np.eye(12)[0]
    conditions = {name: float(generator.uniform(1, 2)) for name in ("payload", "roughness", "speed")}
    time = NOW / 1e9 + 600.0 * number
    return sprung.Observation(time, COMPONENTS, values, 0.02**2 * np.eye(12), conditions, {}, (), vehicle="car-1")


def test_an_alert_keeps_the_change_test_behind_it(store) -> None:
    """Eight healthy windows to learn from, fifty to compare, the last ten with a softer spring."""
    generator = np.random.default_rng(1)
    healthy = [window(generator, k, change=0.0) for k in range(8)]
    compared = [window(generator, k, change=-0.4 if k >= 48 else 0.0) for k in range(8, 58)]
    diagnosis = sprung.diagnose(compared, sprung.learn(healthy))
    recording = sprung.Recording(np.zeros((1, 2)), 1.0, (sprung.Channel("a"),), NOW)
    AlertBook(store, AlertSettings()).take_window(
        "car-1", Observed(57, recording, compared[-1], diagnosis, None), now=NOW
    )
    (row,) = store.alerts.find()
    evidence = row.evidence
    detection = diagnosis.detection
    assert detection is not None
    assert row.cause == "front_left.spring"
    assert evidence["since"] == compared[40].time
    assert evidence["detection"]["threshold"] == detection.threshold
    assert evidence["detection"]["times"] == detection.times[-40:].tolist()
    assert evidence["detection"]["evidence"] == detection.evidence[-40:].tolist()
    names = [hypothesis["name"] for hypothesis in evidence["detection"]["hypotheses"]]
    assert names == [candidate.hypothesis.name for candidate in detection.candidates[:5]]
    assert names[0] == "front_left.spring"


@pytest.mark.parametrize(
    ("limits", "severity", "advice"),
    [
        ({"damper": (0.01, 0.02)}, 700, "inspect before the next 500 km"),  # of the finding
        ({"spring": (0.1, 0.2)}, 900, "inspect before the next drive"),
        ({"spring": (0.1, 0.9)}, 700, "inspect before the next 500 km"),
        ({"spring": (0.8, 0.9)}, 300, "continue monitoring"),
        ({"spring": (0.1, 0.2), "front_left.spring": (0.8, 0.9)}, 300, "continue monitoring"),
        ({"front_left.spring": (0.1, 0.2), "car-*": {"spring": (0.8, 0.9)}}, 300, "continue monitoring"),
        ({"spring": (0.1, 0.2), "bus-*": {"spring": (0.8, 0.9)}}, 900, "inspect before the next drive"),
        ({"spring": (0.1, 0.2), "car-*": {"damper": (0.8, 0.9)}}, 900, "inspect before the next drive"),
        ({"car-1": {"spring": (0.1, 0.9)}, "car-*": {"spring": (0.8, 0.9)}}, 700, "inspect before the next 500 km"),
    ],
)
def test_soft_and_hard_limits_of_a_part_decide_the_severity(store, limits, severity, advice) -> None:
    generator = np.random.default_rng(1)
    healthy = [window(generator, k, change=0.0) for k in range(8)]
    compared = [window(generator, k, change=-0.35) for k in range(8, 18)]
    diagnosis = sprung.diagnose(compared, sprung.learn(healthy))
    recording = sprung.Recording(np.zeros((1, 2)), 1.0, (sprung.Channel("a"),), NOW)
    event = Observed(17, recording, compared[-1], diagnosis, None)
    of_vehicles = {name: limits.pop(name) for name in list(limits) if isinstance(limits[name], dict)}
    settings = AlertSettings(limits=limits, vehicle_limits=of_vehicles)
    AlertBook(store, settings).take_window("car-1", event, now=NOW)
    (row,) = store.alerts.find()
    assert (row.cause, row.severity, row.advice) == ("front_left.spring", severity, advice)
    assert row.sentence.endswith(advice)
