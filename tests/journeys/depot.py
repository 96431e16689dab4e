"""A depot with 214 vehicles in a store: alerts of each step, silence, learning, a dead sensor, a soft spring."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from tests.diagnosis.conftest import drawn_window

from sprung.diagnosis import Baseline, Observation, SensorFault, diagnose, learn
from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import operations
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.events import Observed
from sprung.online.monitor.ledger import window_document
from sprung.online.store import Progress, Store, StoredFrame
from sprung.recording import Channel, Recording
from sprung.results.documents import baseline_document, finding_document
from sprung.vehicles import read_vehicle, vehicle_text

N_VEHICLES = 214
#: Vehicles with a story.
SOFT, WEAK, DEAD, SILENT, LEARNING = "bus-017", "bus-003", "bus-050", "bus-071", "bus-009"
_S, _MINUTE, _HOUR, _DAY = 10**9, 60 * 10**9, 3600 * 10**9, 86400 * 10**9
_CAR = read_vehicle("zafira")
_TEXT = vehicle_text(_CAR)
_CHANNELS = [sensor.channel for sensor in _CAR.sensor if not sensor.is_condition]
#: Shapes of the modes of the body by position ahead and left of the centre of gravity.
_MODES = (("bounce", 1.21, 0.24, 0.0, 0.0), ("pitch", 1.42, 0.27, -0.8, 0.0), ("roll", 1.63, 0.20, 0.0, 1.3))
#: Windows that a baseline is learnt from.
_TAUGHT = 12


@dataclass(frozen=True, slots=True)
class Story:
    """What happened to a vehicle.

    Parameters
    ----------
    changes
        Changes of parts since the onset.
    onset
        Days before the present.
    days
        Days with windows.
    dead_channel
        Sensor that is dead in the last windows.
    """

    changes: Mapping[str, float]
    onset: float = 0.55
    days: float = 2.5
    dead_channel: str = ""


STORIES = {
    SOFT: Story({"front_left.spring": -0.42}, onset=0.8, days=6.0),
    WEAK: Story({"rear_right.damper": -0.26}, onset=1.2),
    "bus-088": Story({"rear_left.spring": -0.16}),
    "bus-121": Story({"front_right.tyre": -0.13}),
    "bus-156": Story({"rear_right.spring": -0.12}),
    "bus-164": Story({"front_left.damper": -0.15}),
    "bus-180": Story({"rear_left.tyre": -0.06}),
    DEAD: Story({}, onset=0.1, dead_channel=_CHANNELS[1]),
}


def fill(store: Store, *, now: int) -> None:
    """Fill an empty store.

    Parameters
    ----------
    store
        Store.
    now
        Present time, UTC ns.
    """
    silent = {SILENT, "bus-142", "bus-213"}
    learning = {LEARNING, "bus-049", "bus-089", "bus-129", "bus-169", "bus-209"}
    healthy = _windows(np.random.default_rng(0), Story({}, days=0.9), now)
    taught, baseline = _learnt_from(healthy)
    learnt, unchanged = _first_baseline((taught, baseline)), diagnose(healthy[len(taught) :], baseline)
    book = AlertBook(store, AlertSettings())
    for number in range(1, N_VEHICLES + 1):
        name = f"bus-{number:03d}"
        seen = now - (5 + number % 7) * _HOUR if name in silent else now - number % 4 * 60 * _S
        channels = [[sensor.channel, sensor.quantity] for sensor in _CAR.sensor]
        store.inbox.put_vehicle(name, configuration="c", description=_TEXT, channels=channels, now=seen)
        store.inbox.add_frames([StoredFrame(name, 1, 0, seen, b"x")], now=seen)
        story = STORIES.get(name, Story({}, days=0.4) if name in learning | {"bus-001"} else None)
        if story is None:
            windows = _windows(np.random.default_rng(number), Story({}, days=0.5), seen)
            rows = tuple((k, _ns(each.time), window_document(each, unchanged)) for k, each in enumerate(windows))
            status = _status(seen)
            store.results.commit(
                Progress(name, 1, done_seq=0, observations=rows, baselines=(learnt,), status=status, now=seen)
            )
        else:
            _tell(store, book, name, story, number, now=now, is_learning=name in learning)
        if name in silent:
            text = f"{name} has sent nothing for {5 + number % 7} h, and was not switched off"
            book.report(name, "silent", text, now=seen + _HOUR)
    _settle(store, now=now)
    _remember(store, book, now=now)


def _tell(store: Store, book: AlertBook, name: str, story: Story, number: int, *, now: int, is_learning: bool) -> None:
    """Store the windows of a vehicle, its baseline and findings, and raise the alerts of its last windows."""
    generator = np.random.default_rng(number)
    windows = _windows(generator, story, now)
    if is_learning:
        windows = windows[-4:]
    usable = [window for window in windows if window.is_conclusive]
    baselines: tuple[Any, ...] = ()
    findings = []
    diagnosis = None
    if not is_learning:
        taught, baseline = _learnt_from(windows)
        baselines = (_first_baseline((taught, baseline)),)
        late = [window for window in windows if window.time > taught[-1].time]
        diagnosis = diagnose([window for window in late if window.is_conclusive], baseline)
        if story.changes or story.dead_channel:
            since = now / 1e9 - story.onset * 86400
            changed = [window for window in late if window.time > since]
            for window in (*changed[2:5], changed[-1]):
                place = windows.index(window)
                findings += [(place, _ns(window.time), finding_document(each)) for each in diagnosis.findings]
                event = Observed(place, _RECORDING, window, diagnosis, None)
                book.take_window(name, event, now=_ns(window.time) + 600 * _S)
    n_learnt = len(usable) if is_learning else _TAUGHT
    store.results.commit(
        Progress(
            name,
            1,
            done_seq=0,
            observations=tuple((k, _ns(each.time), window_document(each, diagnosis)) for k, each in enumerate(windows)),
            modes=tuple((k, _ns(each.time), _modes(generator)) for k, each in enumerate(windows) if each.is_conclusive),
            findings=tuple(findings),
            baselines=baselines,
            status=_status(now, n_learnt=n_learnt, is_learning=is_learning),
            now=now,
        )
    )


def _windows(generator: np.random.Generator, story: Story, now: int) -> list[Observation]:
    """Return the windows of the vehicle: two shifts a day, of which one in 23 says nothing."""
    present = now / 1e9
    times = np.arange(present - story.days * 86400, present - 700, 600.0)
    onset = present - story.onset * 86400
    windows = []
    for k, time in enumerate(t for t in times if (t - present) % 86400 / 3600 % 12 > 9.5 or t > present - 4000):
        if k % 23 == 7:
            conditions = {"speed": 1.0, "standing": 0.8, "temperature": 9.0}
            nothing = np.zeros(0), np.zeros((0, 0))
            reason = "the vehicle stood still for 80 % of the time"
            windows.append(Observation(time, (), *nothing, conditions, {}, (), reason))
            continue
        share = min(1.0, 0.85 + 0.15 * (time - onset) / (present - onset)) if story.onset else 1.0
        changes = {part: share * change for part, change in story.changes.items() if time > onset}
        window = drawn_window(generator, time, changes)
        conditions = {
            "payload": float(generator.uniform(0, 300)),
            "roughness": float(np.exp(generator.normal(-11, 0.5))),
            "speed": float(generator.uniform(8, 20)),
            "temperature": float(generator.normal(9, 3)),
            "standing": 0.05,
            "turning": 0.02,
            "model_error": 0.06,
            "segments": 90.0,
        }
        modes = {label: (frequency, damping) for label, frequency, damping, *_ in _MODES}
        is_dead = story.dead_channel and time > onset
        faults = (SensorFault(story.dead_channel, "dead", "it is constant at 0"),) if is_dead else ()
        windows.append(replace(window, conditions=conditions, modes=modes, sensor_faults=faults))
    return windows


def _modes(generator: np.random.Generator) -> dict[str, Any]:
    """Return the modes of a window as they are stored."""
    places = [sensor.position for sensor in _CAR.sensor if sensor.position is not None and not sensor.is_condition]
    modes = []
    for label, frequency, damping, ahead, left in _MODES:
        shape = np.array([1.0 * (label == "bounce") + ahead * x + left * y + 0.05j * x for x, y, _ in places])
        shape /= shape[np.argmax(abs(shape))]
        modes.append(
            {
                "natural_frequency": frequency * (1 + 0.008 * generator.standard_normal()),
                "natural_frequency_std": 0.01 * frequency,
                "damping_ratio": damping * (1 + 0.05 * generator.standard_normal()),
                "damping_ratio_std": 0.06 * damping,
                "mode_shape": {"real": shape.real.tolist(), "imag": shape.imag.tolist()},
                "mode_shape_std": None,
                "mpc": 0.98,
                "label": label,
                "stable_rate": 0.6,
            }
        )
    return {"modes": modes, "reason": ""}


def _settle(store: Store, *, now: int) -> None:
    """Let people act on some alerts."""
    numbers = {row.vehicle: row.number for row in store.alerts.find(is_active=True)}
    operations.acknowledge(store, numbers[WEAK], who="Bert", comment="on my list for tonight", now=now - 40 * _MINUTE)
    operations.assign(store, numbers[WEAK], assignee="Bert", who="Anna", now=now - 35 * _MINUTE)
    operations.add_comment(
        store, numbers[SOFT], who="Anna", comment="the driver says it hangs to the left", now=now - 5 * _MINUTE
    )
    operations.shelve(store, numbers[DEAD], hours=72, who="Anna", comment="spare part ordered", now=now - 4 * _MINUTE)


def _remember(store: Store, book: AlertBook, *, now: int) -> None:
    """Store alerts of the last months that workshops have closed."""
    outcomes = ["confirmed"] * 9 + ["another part"] * 2 + ["nothing found"]
    for k, verdict in enumerate(outcomes):
        name, raised = f"bus-{10 + 15 * k:03d}", now - (6 + 6 * k) * _DAY
        evidence = {"change": -0.2, "interval": [-0.23, -0.17], "since": (raised - 9 * _HOUR) / 1e9}
        text = "front-left spring 20 % (17 to 23 %) softer; inspect before the next 500 km"
        report = Report(name, "front_left.spring", 700, text, evidence)
        book.put(reported(None, report, replace(AlertSettings(), raise_after=1), raised), now=raised)
        number = store.alerts.find(vehicle=name)[0].number
        is_repaired = verdict != "nothing found"
        operations.add_verdict(
            store,
            number,
            verdict=verdict,
            part="front-left strut mount" if verdict == "another part" else "",
            action="part renewed" if is_repaired else "",
            new_baseline=is_repaired,
            who="Bert",
            now=raised + (20 + 5 * k) * _HOUR,
        )
        if not is_repaired:
            operations.close(store, number, who="Bert", comment="road works", now=raised + (21 + 5 * k) * _HOUR)


def _learnt_from(windows: list[Observation]) -> tuple[list[Observation], Baseline]:
    """Return the windows that a baseline is learnt from, and the baseline."""
    taught = [window for window in windows if window.is_conclusive][:_TAUGHT]
    times = tuple(each.time for each in taught)
    return taught, replace(learn(taught), version=1, reason="first learning", learning_times=times)


def _first_baseline(learnt: tuple[list[Observation], Baseline]) -> tuple[int, int, str, dict[str, Any]]:
    """Return a baseline as it is stored."""
    taught, baseline = learnt
    return 1, _ns(taught[-1].time) + 600 * _S, "first learning", baseline_document(baseline).as_json()


def _status(until: int, *, n_learnt: int = _TAUGHT, is_learning: bool = False) -> dict[str, Any]:
    """Return how far the monitoring of a vehicle is."""
    return {
        "share": 0.3,
        "n_learnt": n_learnt,
        "n_needed": _TAUGHT,
        "is_learning": is_learning,
        "window": 600.0,
        "until": until,
        "note": "",
    }


def _ns(time: float) -> int:
    """Return a time [s] in ns."""
    return round(time * 1e9)


_RECORDING = Recording(np.zeros((1, 2)), 200.0, (Channel(_CHANNELS[0]),))
