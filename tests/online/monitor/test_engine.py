"""One vehicle over time: whatever the blocks, the batch answer; and the same after a restart."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import cbor2
import numpy as np
import pytest

from sprung.diagnosis import Detection, Diagnosis, diagnose, observe_window
from sprung.errors import ParameterError
from sprung.identification import IdentificationSettings, RunningSummary, modes_of_summary
from sprung.online.monitor import Identified, MonitorSettings, Observed, VehicleMonitor
from sprung.recording import Recording
from sprung.results.documents import diagnosis_document, finding_document, mode_documents, observation_document

#: 2026-11-21, UTC ns.
BEGUN = 1_795_219_200_000_000_000

SETTINGS = MonitorSettings(identify_every=300.0, learning_windows=4)


def fed(monitor: VehicleMonitor, recording: Recording, cuts: Iterable[int]) -> list[Identified | Observed]:
    """Feed a recording in pieces, and return the events."""
    events: list[Identified | Observed] = []
    edges = [0, *sorted(cuts), recording.n_samples]
    for first, last in pairwise(edges):
        if last > first:
            events += monitor.update(recording.part(first, last))
    return events


def windows(events: Iterable[Identified | Observed]) -> list[Observed]:
    """Return the complete windows among events."""
    return [event for event in events if isinstance(event, Observed)]


def diagnosed(event: Observed) -> Diagnosis:
    assert event.diagnosis is not None, "the baseline is being learnt"
    return event.diagnosis


def detection_of(diagnosis: Diagnosis | None) -> Detection:
    assert diagnosis is not None
    assert diagnosis.detection is not None
    return diagnosis.detection


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_online_is_batch(car, drive, alike, seed) -> None:
    run = drive(0)
    cuts = np.random.default_rng(seed).integers(1, run.n_samples, [3, 60, 700][seed])
    events = fed(VehicleMonitor(car, settings=SETTINGS), run, cuts)
    assert [type(event) for event in events] == [Identified, Identified, Observed]
    (window,) = windows(events)
    batch = observe_window(run, car, time=BEGUN / 1e9)
    assert alike(observation_document(window.observation), observation_document(batch))
    assert np.array_equal(window.recording.samples, run.samples)


def identified(events: Iterable[Identified | Observed]) -> list[Identified]:
    """Return the identifications among events."""
    return [event for event in events if isinstance(event, Identified)]


@pytest.mark.slow
def test_each_minute_is_a_record_of_the_modes_so_far(car, drive, alike) -> None:
    """The batch of the same records gives the same modes, and so does a monitor continued from its state."""
    run = drive(0)
    whole, stopped = (VehicleMonitor(car, settings=MonitorSettings(identify_every=60.0)) for _ in range(2))
    seconds = [run.part(200 * k, 200 * (k + 1)) for k in range(300)]
    events = identified(event for second in seconds for event in whole.update(second))
    assert [event.reason for event in events] == ["the window is shorter than 120 s", *[""] * 4]
    assert [mode["label"] for mode in events[-1].modes] == ["bounce", "pitch"]
    records = [run.part(0, 24_000), *(run.part(12_000 * k, 12_000 * (k + 1)) for k in range(2, 5))]
    running = RunningSummary(
        "cov",
        settings=IdentificationSettings(
            refine=False, has_road_modes=False, allow_missing=True, decimate_to=40.0, segment=10.0
        ),
        vehicle=car,
        duration=600.0,
    )
    for record in records:
        running.update(record)
    assert alike(list(events[-1].modes), mode_documents(modes_of_summary(running.summary, vehicle=car)))
    again = identified(event for second in seconds[:250] for event in stopped.update(second))
    stopped = VehicleMonitor.from_state(car, cbor2.loads(cbor2.dumps(stopped.state())))
    again += identified(event for second in seconds[250:] for event in stopped.update(second))
    assert alike([event.modes for event in again], [event.modes for event in events])


@pytest.mark.slow
def test_a_channel_that_vanishes_is_a_failing_sensor(car, drive) -> None:
    """The monitor goes on without it, says so, and learns nothing from the window."""
    monitor = VehicleMonitor(car, settings=SETTINGS)
    part = drive(0).select([name for name in drive(0).names if name != "acc_fl"])
    identified, window = monitor.update(part)
    assert isinstance(identified, Identified)
    assert identified.reason == ""
    assert isinstance(window, Observed)
    (fault,) = window.observation.sensor_faults
    assert (fault.channel, fault.kind) == ("acc_fl", "missing")
    assert window.observation.is_conclusive
    assert monitor.learning == (0, 4)


@pytest.mark.slow
def test_it_learns_and_finds(car, drive) -> None:
    monitor = VehicleMonitor(car, settings=SETTINGS)
    for number in range(4):
        assert monitor.learning == (number, 4)
        (window,) = windows(monitor.update(drive(number)))
    assert monitor.learning == (4, 4)
    assert window.baseline is not None
    assert window.baseline.residuals is not None
    assert (window.baseline.n_windows, window.baseline.residuals.n_windows) == (4, 4)
    assert window.diagnosis is None
    (window,) = windows(monitor.update(drive(4)))
    found = diagnosed(window)
    assert found.is_healthy
    assert found.residual_tests.keys() == {drive(4).start / 1e9}
    assert found.notes[-1].startswith("second opinion")
    (kept,) = monitor.observations
    assert kept.residuals is not None
    assert kept.residuals.segments is None  # 1.4 kB instead of 170 kB
    (window,) = windows(monitor.update(drive(5, "front_left.spring=-0.2")))
    (finding,) = diagnosed(window).findings
    assert (finding.corner, finding.component) == ("front_left", "spring")
    assert finding.interval is not None
    assert finding.interval[0] <= -0.2 <= finding.interval[1]
    assert "since 2026-11-21 00:50 UTC" in finding.sentence
    monitor.learn_again("new springs")
    assert monitor.learning == (0, 4)
    with pytest.raises(ParameterError, match="needs a reason"):
        monitor.learn_again(" ")


@pytest.mark.slow
def test_it_goes_on_from_its_state(car, drive, alike) -> None:
    """A restart after every window, and in the middle of one, changes nothing."""
    faulty = [drive(5, "rear_right.damper=-0.3"), drive(6, "rear_right.damper=-0.3")]
    drives = [*(drive(number) for number in range(5)), *faulty]
    settings = replace(SETTINGS, identify_every=600.0)
    through, stopped = (VehicleMonitor(car, settings=settings) for _ in range(2))
    for run in drives:
        (expected,) = windows(through.update(run))
        assert windows(stopped.update(run.part(0, 70_001))) == []
        stopped = VehicleMonitor.from_state(car, cbor2.loads(cbor2.dumps(stopped.state())))
        (window,) = windows(stopped.update(run.part(70_001, run.n_samples)))
        assert alike(observation_document(window.observation), observation_document(expected.observation))
        if expected.diagnosis is not None:
            assert alike(
                [finding_document(finding) for finding in diagnosed(window).findings],
                [finding_document(finding) for finding in expected.diagnosis.findings],
            )
            first, second = (
                {time: test.p_value for time, test in diagnosed(one).residual_tests.items()}
                for one in (window, expected)
            )
            assert first
            assert alike(first, second)
    assert through.diagnosis is not None
    assert through.diagnosis.findings
    with pytest.raises(ParameterError, match="start from scratch"):
        VehicleMonitor.from_state(car, {"schema": "other"})
    with pytest.raises(ParameterError, match="incomplete or invalid"):
        VehicleMonitor.from_state(car, {"schema": "sprung.vehicle-monitor/1"})


@pytest.mark.slow
def test_evidence_is_that_of_the_batch(car, drive, alike) -> None:
    """Through restarts, and a window with a dead sensor."""
    settings = MonitorSettings(window=120.0, identify_every=0, learning_windows=2)
    runs = [drive(0), drive(1, "front_left.spring=-0.4")]
    parts = [run.part(k, k + 24_000) for run in runs for k in range(0, 120_000, 24_000)]
    dead = parts[5].samples.copy()
    dead[0] = 0.0
    parts[5] = replace(parts[5], samples=dead)
    through, stopped = (VehicleMonitor(car, settings=settings) for _ in range(2))
    for part in parts:
        (expected,), (window,) = windows(through.update(part)), windows(stopped.update(part))
        stopped = VehicleMonitor.from_state(car, cbor2.loads(cbor2.dumps(stopped.state())))
        if expected.diagnosis is None:
            continue
        batch = diagnose(through.observations, through.baseline, windows_per_day=settings.hours_per_day * 30)
        assert diagnosis_document(expected.diagnosis).as_json() == diagnosis_document(batch).as_json()
        assert alike(diagnosis_document(diagnosed(window)).as_json(), diagnosis_document(batch).as_json())
        for one in (expected, window):
            evidence = detection_of(one.diagnosis).evidence
            assert alike(evidence.tolist(), detection_of(batch).evidence.tolist())
    assert through.observations[3].sensor_faults
    assert detection_of(batch).first_alert is not None


@pytest.mark.slow
def test_evidence_of_windows_that_are_forgotten_goes(car, drive) -> None:
    settings = MonitorSettings(window=120.0, identify_every=0, learning_windows=2, max_windows=3)
    monitor = VehicleMonitor(car, settings=settings)
    monitor.update(drive(0))
    before = detection_of(monitor.diagnosis)
    assert before.times.size == 3
    monitor.update(drive(1).part(0, 24_000))
    after = detection_of(monitor.diagnosis)
    assert after.times[:2].tolist() == before.times[1:].tolist()
    assert after.evidence[:2].tolist() == before.evidence[1:].tolist()


def test_other_channels_begin_a_new_window(car, drive) -> None:
    run = drive(0)
    monitor = VehicleMonitor(car, settings=SETTINGS)
    monitor.update(run.part(0, 60_000))
    monitor.update(run.select(run.names[1:]).part(0, 600))
    assert monitor.buffered == pytest.approx(600 / run.n_samples)


@pytest.mark.slow
def test_a_recording_that_is_replayed_teaches_once(car, drive) -> None:
    monitor = VehicleMonitor(car, settings=replace(SETTINGS, identify_every=0))
    run = drive(0)
    assert len(windows(monitor.update(run))) == 1
    taught = monitor.learning
    assert monitor.update(run) == ()
    assert (monitor.learning, monitor.repeated, monitor.buffered) == (taught, run.duration, 0.0)
    assert monitor.until == run.start + 600 * 10**9
    state = cbor2.loads(cbor2.dumps(monitor.state()))
    assert VehicleMonitor.from_state(car, state).update(run) == ()
    corrected = car.model_copy(update={"name": "corrected"})
    assert len(windows(VehicleMonitor.from_state(corrected, state).update(run))) == 1
    monitor.learn_again("new springs")
    assert len(windows(monitor.update(run))) == 1


@pytest.mark.parametrize(
    ("channel", "level", "note"),
    [
        ("speed", 1e-3, "the vehicle stood still for 100 % of the time"),
        ("acc_fl", 1.0, "sensor acc_fl is dead: stays at 0 throughout"),
    ],
)
def test_a_window_that_teaches_nothing_leaves_its_reason(car, drive, channel, level, note) -> None:
    run = drive(0)
    samples = level * run.samples
    samples[run.index(channel)] = 0.0
    monitor = VehicleMonitor(car, settings=replace(SETTINGS, identify_every=0))
    monitor.update(replace(run, samples=samples))
    assert (monitor.note, monitor.learning) == (note, (0, 4))
