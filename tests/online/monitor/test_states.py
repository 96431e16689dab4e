"""Saved states are continued, and whatever else is in their place is refused in a sentence."""

import lzma
import zlib
from dataclasses import replace
from pathlib import Path

import cbor2
import numpy as np
import pytest

from sprung.diagnosis import diagnose
from sprung.diagnosis.scatter import LASTING
from sprung.errors import ParameterError
from sprung.online.monitor import MonitorSettings, Observed, VehicleMonitor
from sprung.online.monitor.assessment import History
from sprung.online.monitor.engine import StateError, checked_state, read_state, write_state
from sprung.results.documents import baseline_document, observation_document

#: States that a program saved, by scripts/make-states.
KEPT = sorted((Path(__file__).parent / "states").glob("*.cbor.xz"))


def document(path):
    return lzma.decompress(path.read_bytes())


def of_present(name):
    (path,) = (path for path in KEPT if path.name == f"1-{name}.cbor.xz")
    return document(path)


def whole(body):
    """Bytes with their checksum."""
    return body + zlib.crc32(body).to_bytes(4, "little")


def window(monitor, part):
    """The one window that a part completes."""
    (event,) = monitor.update(part)
    assert isinstance(event, Observed)
    return event


def evidence(diagnosis):
    assert diagnosis is not None
    assert diagnosis.detection is not None
    return diagnosis.detection.evidence.tolist()


def baseline_of(monitor):
    assert monitor.baseline is not None
    return baseline_document(monitor.baseline).as_json()


def assert_same_baseline(baseline, saved):
    """The last digits of detectable changes, which are computed from the rest, differ between machines."""
    if saved is None:
        assert baseline is None
        return
    baseline, saved = (
        dict(baseline),
        {"weights": LASTING.prior.tolist(), "stiffenings": [], "run_outs": {}} | dict(saved),
    )
    if "coordinates" not in saved:  # of a version that did not learn them
        coordinates = baseline.pop("coordinates")
        assert baseline.pop("degrees") == [0.0] * len(coordinates)
        assert baseline.pop("squares") == [[0.0] * len(coordinates)] * len(LASTING.correlations)
    computed, kept = baseline.pop("detectable"), saved.pop("detectable")
    assert baseline == saved
    assert computed.keys() == kept.keys()
    for count, losses in kept.items():
        assert computed[count] == pytest.approx(losses, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.name)
def test_every_kept_state_is_continued(path, car, drive) -> None:
    """Nothing of it is lost, and the next samples complete the window whose beginning it holds."""
    saved = read_state(document(path))
    monitor = VehicleMonitor.from_state(car, saved)
    continued = read_state(write_state(monitor.state()))
    assert_same_baseline(continued.pop("baseline"), saved["baseline"])
    saved_windows = [  # some are of an earlier version
        {"phase_shifts": {}, "stiffening": None, "run_outs": {}, **window} for window in saved["observations"]
    ]
    assert continued == {key: value for key, value in saved.items() if key != "baseline"} | {
        "observations": saved_windows
    }
    run = drive(0)
    place = round((monitor.until - run.start) / 1e9 * run.sampling_rate)
    event = window(monitor, run.part(place, place + 115 * 200))
    assert event.number == saved["n_windows"]
    assert event.recording.start == run.start + saved["n_windows"] * 120 * 10**9
    assert event.recording.n_samples == 24_000
    if saved["is_learning"]:
        assert event.baseline is not None
        assert event.baseline.learning_times == (saved["observations"][0]["time"], event.observation.time)
        return
    assert_same_baseline(baseline_of(monitor), saved["baseline"])
    assert monitor.baseline is not None
    batch = diagnose(monitor.observations, monitor.baseline, windows_per_day=8 * 30)
    assert evidence(event.diagnosis) == pytest.approx(evidence(batch), rel=1e-12)
    assert evidence(event.diagnosis)[:1] == pytest.approx(saved["evidence"], rel=1e-12)


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (b"", "checksum"),
        (b"\xff\x00", "checksum"),
        (whole(cbor2.dumps([1])), "schema 'None'"),
        (of_present("monitoring").replace(b"zafira", b"safari"), "checksum"),
        (write_state({"schema": "other/1"}), "schema 'other/1'"),
        (write_state({"schema": "sprung.vehicle-monitor/2"}), "install the sprung that wrote it"),
        (whole(b"\x9b\x7f" + b"\xff" * 7), "not CBOR"),
        (whole(b"\x81" * 100_000), "not CBOR"),
    ],
)
def test_what_is_no_state_is_refused_in_a_sentence(state, words) -> None:
    with pytest.raises(StateError, match=words):
        read_state(state)
    assert issubclass(StateError, ParameterError)


def test_damaged_bytes_are_refused() -> None:
    """Cut, changed and added bytes, seeded."""
    whole, generator = of_present("monitoring"), np.random.default_rng(0)
    for _ in range(1000):
        damaged = bytearray(whole[: generator.integers(len(whole))] if generator.random() < 0.3 else whole)
        for place in generator.integers(0, max(1, len(damaged)), generator.integers(0, 8)):
            damaged[place : place + 1] = generator.bytes(int(generator.integers(0, 3)))
        if bytes(damaged) != whole:
            with pytest.raises(StateError):
                read_state(bytes(damaged))


@pytest.mark.slow
def test_a_lost_state_leaves_baseline_and_evidence(car, drive, alike) -> None:
    """The monitor that begins anew from the store continues as the one that was lost, next window included."""
    lost = VehicleMonitor.from_state(car, read_state(of_present("monitoring")))
    baseline = baseline_of(lost)
    history = History(baseline, tuple(map(observation_document, lost.observations)), 3, 7)
    monitor = VehicleMonitor.from_history(car, history, settings=lost.settings)
    assert baseline_of(monitor) == baseline
    assert (monitor.is_learning, monitor.buffered) == (False, 0.0)
    run = drive(1).part(0, 24_000)
    lost.update(replace(run.part(0, 1), channels=run.channels[:1], samples=run.samples[:1, :1]))  # a new window
    expected, event = window(lost, run), window(monitor, run)
    assert (event.number, monitor.state()["n_identified"]) == (3, 7)
    assert alike(evidence(event.diagnosis), evidence(expected.diagnosis))


def test_without_a_baseline_learning_begins_anew(car) -> None:
    monitor = VehicleMonitor.from_history(car, History(n_windows=5), settings=MonitorSettings())
    assert (monitor.learning, monitor.state()["n_windows"]) == ((0, 12), 5)


def test_a_learning_under_way_begins_anew_after_the_baseline_it_replaces(car) -> None:
    saved = read_state(of_present("monitoring"))
    history = History(saved["baseline"], tuple(saved["observations"]), 3, 0, relearning="new dampers")
    monitor = VehicleMonitor.from_history(car, history, settings=MonitorSettings(**saved["settings"]))
    assert monitor.is_learning
    assert monitor.learning == (0, 2)
    assert monitor.baseline is not None
    assert monitor.state()["reason"] == "new dampers"
    assert checked_state(monitor.state())
