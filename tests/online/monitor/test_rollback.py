"""The return to an earlier baseline, from the request to the judgement of the windows that follow."""

import numpy as np
import pytest

from sprung.diagnosis import Observation, learn
from sprung.errors import ParameterError
from sprung.online.monitor import MonitorSettings, VehicleMonitor, operations
from sprung.online.monitor.histories import restored_baseline
from sprung.online.store import Progress, StoredFrame, open_store
from sprung.results.documents import baseline_document
from sprung.vehicles import Component

NOW = 1_795_219_200_000_000_000
COMPONENTS = tuple(
    Component(corner, kind)
    for corner in ("front_left", "front_right", "rear_left", "rear_right")
    for kind in ("spring", "damper", "tyre")
)
SOFT = "front_left.spring=-0.3"


def learnt(seed=0, previous=None):
    """A baseline of six windows that scatter by 1 %."""
    generator = np.random.default_rng(seed)
    covariance = 0.01**2 * np.eye(12)
    values = generator.multivariate_normal(np.zeros(12), covariance, size=6, method="cholesky")
    windows = [
        Observation(600.0 * k + seed, COMPONENTS, row, covariance, {"speed": 12.0 + k}, {}, (), vehicle="zafira")
        for k, row in enumerate(values)
    ]
    return learn(windows, reason="first learning" if previous is None else "new dampers", previous=previous)


@pytest.fixture
def store(sqlite_url):
    """A vehicle with two baselines."""
    first = learnt()
    rows = [(each.version, NOW, each.reason, baseline_document(each).as_json()) for each in (first, learnt(1, first))]
    with open_store(sqlite_url) as opened:
        opened.inbox.put_vehicle("car-1", configuration="c", description="", channels=[], now=NOW)
        opened.inbox.add_frames([StoredFrame("car-1", 1, 0, NOW, b"x")], now=NOW)
        opened.results.commit(Progress("car-1", 1, done_seq=0, baselines=tuple(rows), status={"is_learning": False}))
        yield opened


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"reason": " "}, "needs a reason"),
        ({"version": 7}, "car-1 has no baseline 7: it has 1, 2"),
        ({"version": 2}, "baseline 2 of car-1 is in use"),
        ({"vehicle": "car-9"}, "unknown vehicle 'car-9'"),
    ],
)
def test_what_is_refused(store, fields, words) -> None:
    given = {"vehicle": "car-1", "version": 1, "reason": "broken spring"} | fields
    with pytest.raises(ParameterError, match=words):
        operations.roll_back(store, given.pop("vehicle"), **given, who="anna", now=NOW)
    assert store.requests.open_commands() == []


def test_a_baseline_of_another_program_is_not_restored(store) -> None:
    store.results.commit(
        Progress("car-1", 1, done_seq=0, baselines=((3, NOW, "another form", {"schema": "sprung.baseline/9"}),))
    )
    with pytest.raises(ParameterError, match=r"baseline 3 of car-1 cannot be read"):
        restored_baseline(store, "car-1", version=3, reason="x")


def test_a_monitor_forgets_its_learning(car) -> None:
    monitor = VehicleMonitor(car, settings=MonitorSettings(learning_windows=4), baseline=learnt())
    monitor.learn_again("new springs")
    assert monitor.is_learning
    event = monitor.restore(learnt())
    assert (monitor.is_learning, monitor.baseline, monitor.observations) == (False, event.baseline, ())
    again = VehicleMonitor.from_state(car, monitor.state())
    assert again.baseline is not None
    assert (again.is_learning, again.baseline.version) == (False, 1)


@pytest.mark.slow
def test_a_running_monitor_judges_by_the_earlier_baseline(bench, drive, frames_of) -> None:
    """A soft spring is normal for the baseline that was learnt with it, and a finding for the one before."""
    one = bench(watch={"learning_windows": 2, "window_minutes": 10, "identify_every_minutes": 0})
    one.describe()

    def run(number, fault=None):
        one.send(frames_of(drive(number, fault), first=600 * number))

    run(0)
    run(1)
    operations.relearn(one.store, "car-1", reason="new springs", who="anna", now=NOW)
    one.look()
    for number in (2, 3, 4):
        run(number, SOFT)
    assert [row.version for row in one.store.results.baselines("car-1")] == [1, 2]
    assert one.store.alerts.find(vehicle="car-1", is_active=True) == []
    operations.roll_back(one.store, "car-1", version=1, reason="learnt with a soft spring", who="anna", now=NOW)
    one.look()
    assert one.store.requests.open_commands() == []
    last = one.store.results.baselines("car-1")[-1]
    assert (last.version, last.reason) == (3, "baseline 1 again: learnt with a soft spring")
    run(5, SOFT)
    (alert,) = one.store.alerts.find(vehicle="car-1", is_active=True)
    assert alert.cause == "front_left.spring"
    operations.roll_back(one.store, "car-1", version=2, reason="the springs are meant to be soft", who="bert", now=NOW)
    one.look()
    run(6, SOFT)
    assert [entry.t0 for entry in one.store.results.findings("car-1")] == [drive(5, SOFT).start]
    assert [row.version for row in one.store.results.baselines("car-1")] == [1, 2, 3, 4]
