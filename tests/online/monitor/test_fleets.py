"""Vehicles of one type in a store: the baseline of their type, its use by vehicles that learn, and their ranking."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import Observation, learn, learn_type
from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import MonitorSettings, Observed, VehicleMonitor, operations
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.fleets import VehicleTypes, inspections, rankings, type_of_others
from sprung.online.store import Progress, StoredFrame
from sprung.recording import Channel, Recording
from sprung.results.documents import baseline_document, observation_document
from sprung.vehicles import Component, vehicle_text

NOW = 1_795_219_200_000_000_000
COMPONENTS = tuple(
    Component(corner, kind)
    for corner in ("front_left", "front_right", "rear_left", "rear_right")
    for kind in ("spring", "damper", "tyre")
)
SPRING = COMPONENTS.index(Component("front_right", "spring"))


def drawn(seed, n_windows, *, fault=0.0, first=0):
    """Return windows of a vehicle, 0.01 from the others, with one spring changed."""
    own = 0.01 * np.random.default_rng(seed).standard_normal(12)
    own[SPRING] += fault
    return [window(own, seed, number) for number in range(first, first + n_windows)]


def window(own, seed, number):
    generator = np.random.default_rng([seed, number])
    values = own + 0.01 * generator.standard_normal(12)
    conditions = {"temperature": 20.0, "speed": float(generator.uniform(8, 18))}
    time = NOW / 1e9 + 600.0 * number
    return Observation(time, COMPONENTS, values, 0.01**2 * np.eye(12), conditions, {}, (), vehicle="van")


def put(store, name, car, windows, *, taught=()) -> None:
    """Store a vehicle with its windows, and the baseline that some of them taught."""
    store.inbox.put_vehicle(name, configuration="c", description=vehicle_text(car), channels=[], now=NOW)
    store.inbox.add_frames([StoredFrame(name, 1, 0, NOW, b"")], now=NOW)
    learnt = [learn(taught)] if taught else []
    baselines = tuple((1, NOW, "first learning", baseline_document(one).as_json()) for one in learnt)
    entries = tuple(
        (number, round(1e9 * one.time), observation_document(one)) for number, one in enumerate((*taught, *windows))
    )
    store.results.commit(Progress(name, 1, done_seq=0, observations=entries, baselines=baselines))


def fleet(store, car, count, **options):
    for number in range(count):
        put(store, f"van-{number}", car, drawn(number, 4, **options))


def test_vehicles_of_one_file_are_one_type_whatever_their_names(store, car) -> None:
    for number in range(4):
        put(store, f"van-{number}", car.model_copy(update={"name": f"no {number}"}), drawn(number, 3))
    heavy = car.model_copy(update={"body": car.body.model_copy(update={"mass": 1.1 * car.body.mass})})
    put(store, "bus", heavy, drawn(9, 3))
    put(store, "van-9", car, ())
    of_type = type_of_others(store, "van-9")
    assert of_type is not None
    assert (of_type.name, of_type.n_vehicles, of_type.n_windows) == ("zafira", 4, 12)
    assert VehicleTypes(store).has_type("van-9")
    assert not VehicleTypes(store).has_type("bus")
    assert type_of_others(store, "bus") is None
    assert type_of_others(store, "unknown") is None


def test_a_type_is_of_normal_windows_not_of_later_ones(store, car) -> None:
    """A vehicle with a baseline takes part with the windows that taught it, without a fault since then."""
    for number in range(4):
        put(store, f"van-{number}", car, drawn(number, 6, fault=-0.3, first=6), taught=drawn(number, 6))
    put(store, "van-9", car, ())
    of_type = type_of_others(store, "van-9")
    assert of_type is not None
    assert of_type.n_windows == 24
    assert of_type.mean[SPRING] == pytest.approx(0.0, abs=0.03)


@pytest.mark.slow
def test_an_inspection_makes_a_member_of_the_type_or_takes_a_vehicle_out_of_it(store, car) -> None:
    fleet(store, car, 8)
    put(store, "van-8", car, drawn(8, 4, fault=-0.1))
    put(store, "van-9", car, drawn(9, 4, fault=-0.3))
    ((_, before),), notes = rankings(store, rate=0.05)
    assert not notes
    later = NOW + 10**13  # after the four windows
    operations.inspected(store, "van-8", part="", who="ann", now=later)
    operations.inspected(store, "van-9", part="", who="ann", now=later - 10**9)
    operations.inspected(store, "van-9", part="front_right.spring", who="ann", now=later)  # the last one counts
    ((_, after),), notes = rankings(store, rate=0.05)
    assert {one.vehicle for one in before} - {one.vehicle for one in after} == {"van-8", "van-9"}
    assert notes == ["van-8 was inspected and found healthy", "van-9 was inspected: front_right.spring"]
    of_type = type_of_others(store, "van-0")
    assert of_type is not None
    assert of_type.n_vehicles == 8  # the faulty one is out
    fresh = [(4, later + 10**9, observation_document(replace(drawn(9, 1)[0], time=later / 1e9 + 1)))]
    store.results.commit(Progress("van-9", 1, done_seq=-1, observations=tuple(fresh)))
    ((_, again),), notes = rankings(store, rate=0.05)
    (compared,) = [one for one in again if one.vehicle == "van-9"]
    assert compared.n_windows == 1  # what came after the inspection
    assert not compared.is_discovery


def test_a_verdict_on_an_alert_counts_as_an_inspection(store, car) -> None:
    fleet(store, car, 6)
    report = Report("van-2", "front_right.spring", 700, "text", {})
    AlertBook(store, AlertSettings()).put(reported(None, report, AlertSettings(), NOW), now=NOW)
    (alert,) = store.alerts.find(vehicle="van-2")
    operations.add_verdict(store, alert.number, verdict="nothing found", who="ann", now=NOW + 10**13)
    assert inspections(store) == {"van-2": (NOW + 10**13, "")}
    operations.add_verdict(
        store, alert.number, verdict="another part", part="rear_left.tyre", who="ann", now=NOW + 2 * 10**13
    )
    assert inspections(store) == {"van-2": (NOW + 2 * 10**13, "rear_left.tyre")}


def test_windows_are_read_again_only_where_there_are_new_ones(store, car, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same baseline as from the store, for many vehicles that are opened one after the other."""
    from sprung.online.store.results import Results

    for number in range(5):
        put(store, f"van-{number}", car, drawn(number, 4))
    put(store, "van-9", car, (), taught=drawn(9, 6))
    types, read, observations = VehicleTypes(store), [], Results.observations

    def counted(results, vehicle, **given):
        read.append(vehicle)
        return observations(results, vehicle, **given)

    monkeypatch.setattr(Results, "observations", counted)
    names = [f"van-{number}" for number in range(5)]
    for vehicle in names * 3:
        assert type_of_others(store, vehicle, types=types) is not None
    assert sorted(read) == [*names, "van-9"]
    read.clear()
    later = [(4, NOW + 4, observation_document(drawn(2, 1, first=4)[0]))]
    store.results.commit(Progress("van-2", 1, done_seq=-1, observations=tuple(later)))
    learnt = type_of_others(store, "van-0", types=types)
    assert read == ["van-2"]
    anew = type_of_others(store, "van-0")
    assert learnt is not None
    assert anew is not None
    assert learnt.n_windows == anew.n_windows == 3 * 4 + 5 + 6
    assert np.array_equal(learnt.mean, anew.mean)


def test_a_fleet_is_ranked_by_its_last_windows(store, car, check_document) -> None:
    fleet(store, car, 7)
    put(store, "van-8", car, drawn(8, 4, fault=-0.25))
    document = operations.ranking_document(store)
    check_document(document)
    (ranking,) = document["types"]
    assert ranking["name"] == "zafira"
    assert [entry["vehicle"] for entry in ranking["vehicles"] if entry["deviates"]] == ["van-8"]
    assert ranking["vehicles"][0]["part"] == "front_right.spring"


@pytest.mark.slow
@pytest.mark.parametrize("is_calibrated", [False, True])
def test_vehicles_with_and_without_baselines_are_one_ranking(store, car, is_calibrated) -> None:
    """One changed since its baseline, one without deviates from its type, one has always deviated: no change."""
    fleet(store, car, 6)
    put(store, "van-6", car, drawn(6, 4, fault=-0.25))
    put(store, "changed", car, drawn(7, 6, fault=-0.1, first=6), taught=drawn(7, 6))
    put(store, "own way", car, drawn(8, 6, fault=-0.25, first=6), taught=drawn(8, 6, fault=-0.25))
    put(store, "unused", car, (), taught=drawn(9, 6))
    if is_calibrated:
        for name, fault in (("changed", 0.0), ("own way", -0.25)):
            learnt = replace(
                learn(drawn(7 if name == "changed" else 8, 6, fault=fault)), vehicle_file=vehicle_text(car)
            )
            entry = (2, NOW, "calibrated", baseline_document(learnt).as_json())
            store.results.commit(Progress(name, 1, done_seq=0, baselines=(entry,)))
    ((_, ranked),), notes = rankings(store, rate=0.05)
    found = {one.vehicle: one for one in ranked}
    assert {name for name, one in found.items() if one.is_discovery} == {"van-6", "changed"}
    assert {str(found[name].detection.candidates[0].hypothesis.name) for name in ("van-6", "changed")} == {
        "front_right.spring"
    }
    assert found["own way"].n_windows == 6
    assert notes == ["unused is not ranked: no window after the baseline can be compared"]


@pytest.fixture
def observed(monkeypatch):
    """Windows that a monitor observes, one after the other, whatever its samples are."""
    queue: list[Observation] = []
    monkeypatch.setattr("sprung.online.monitor.assessment.observe_window", lambda *_, **__: queue.pop(0))
    return queue


MINUTE = Recording(np.zeros((1, 600)), 10.0, (Channel("a"),))
SETTINGS = MonitorSettings(window=60.0, identify_every=0.0, learning_windows=4)


def run(monitor, observed, windows):
    """Return the complete windows of a monitor that observes these."""
    observed.extend(windows)
    return [event for _ in windows for event in monitor.update(MINUTE) if isinstance(event, Observed)]


@pytest.fixture(scope="module")
def of_type():
    return learn_type({f"van-{seed}": drawn(seed, 4) for seed in range(12)})


def test_a_new_vehicle_is_compared_with_its_type_until_it_has_a_baseline(car, observed, of_type) -> None:
    monitor = VehicleMonitor(car, settings=SETTINGS, type_baseline=of_type)
    events = run(monitor, observed, drawn(20, 4))
    assert [event.diagnosis.verdict for event in events if event.diagnosis] == ["no_change_detected"] * 4
    learnt = events[-1].baseline
    assert learnt is not None
    alone = learn(drawn(20, 4), min_windows=2)
    assert np.trace(learnt.doubt) < np.trace(alone.doubt)
    assert monitor.diagnosis is None
    assert not monitor.is_learning


def test_a_faulty_vehicle_is_found_against_its_type_and_does_not_become_normal(car, observed, of_type) -> None:
    monitor = VehicleMonitor(car, settings=SETTINGS, type_baseline=of_type)
    events = run(monitor, observed, drawn(20, 5, fault=-0.25))
    findings = [event.diagnosis.findings for event in events if event.diagnosis]
    assert [[one.hypothesis for one in each] for each in findings] == [["front_right.spring"]] * 5
    assert monitor.baseline is None
    assert monitor.is_learning
    assert "deviates from its type" in monitor.note
    monitor.learn_again("spring as ordered")
    assert run(monitor, observed, drawn(20, 4, fault=-0.25))[-1].baseline is not None


@pytest.mark.slow
def test_the_type_is_in_the_state(car, observed, of_type, alike) -> None:
    monitor = VehicleMonitor(car, settings=SETTINGS, type_baseline=of_type)
    run(monitor, observed, drawn(20, 2))
    again = VehicleMonitor.from_state(car, monitor.state())
    assert alike(again.state(), monitor.state())
    assert again.diagnosis is not None
    assert again.diagnosis.verdict == "no_change_detected"
    for one in (monitor, again):
        assert run(one, observed, drawn(20, 2, first=2))[-1].baseline is not None
    assert alike(again.state(), monitor.state())
    assert VehicleMonitor.from_state(car, again.state(), type_baseline=of_type).type_baseline is of_type
