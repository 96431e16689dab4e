"""Two months of a vehicle in a store: healthy, a dead sensor for a day, then a soft spring with its alert."""

from typing import Any

import numpy as np
from tests.diagnosis.conftest import COMPONENTS, drawn_window

from sprung.diagnosis import Observation, SensorFault, diagnose, learn
from sprung.online.alerts import AlertSettings, Report, reported
from sprung.online.monitor import operations
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.ledger import window_document
from sprung.online.store import Progress, Store, StoredFrame
from sprung.results.documents import baseline_document

#: 2026-09-22, UTC s.
BEGIN = 1_790_035_200
DAY, DAYS, ONSET_DAY, DEAD_DAY, MISSING_DAY, PER_DAY = 86400, 60, 50, 30, 20, 4
VEHICLE = "bus-17"
#: What a person may write who wants to harm a reader.
HOSTILE = '=1+1 <script>alert(1)</script> "$\\frac{'


def fill(store: Store) -> int:
    """Fill a store, and return the time after the last window, UTC ns."""
    generator = np.random.default_rng(1)
    windows = [
        (number, _window(generator, day, k))
        for number, (day, k) in enumerate((day, k) for day in range(DAYS) if day != MISSING_DAY for k in range(PER_DAY))
    ]
    baseline = learn([window for _, window in windows[:12]])
    test = diagnose([window for _, window in windows[12:24]], baseline)
    changed = [(number, window) for number, window in windows if window.time >= BEGIN + ONSET_DAY * DAY]
    now = (BEGIN + DAYS * DAY) * 10**9
    start = BEGIN * 10**9
    store.inbox.put_vehicle(
        VEHICLE, configuration="c", description="", channels=[["acc_fl", "acceleration"]], now=start
    )
    store.inbox.add_frames([StoredFrame(VEHICLE, 1, 0, start, b"x")], now=now)
    modes = {"modes": [_mode("bounce", 1.33), _mode(None, 4.5)], "reason": ""}
    store.results.commit(
        Progress(
            VEHICLE,
            1,
            done_seq=0,
            observations=tuple((number, _ns(window.time), window_document(window, test)) for number, window in windows),
            modes=tuple((number, _ns(window.time), modes) for number, window in windows[::10]),
            findings=tuple(
                (number, _ns(window.time), finding(-0.25 + 0.001 * k)) for k, (number, window) in enumerate(changed)
            ),
            baselines=((1, _ns(windows[11][1].time) + 600 * 10**9, "first", baseline_document(baseline).as_json()),),
            status={"share": 0.0, "n_learnt": 12, "n_needed": 12, "window": 600.0, "until": now},
            now=now,
        )
    )
    _raise(store, "sensor:acc_fl", 400, "sensor acc_fl is dead", {"kind": "dead"}, at=DEAD_DAY)
    text = "front-left spring 25 % (23 to 27 %) softer; inspect before the next 500 km"
    _raise(store, "front_left.spring", 700, text, finding(-0.25), at=ONSET_DAY)
    operations.close(store, 1, who="bert", comment="plug cleaned", now=_day(DEAD_DAY + 1))
    operations.acknowledge(store, 2, who="bert", comment=HOSTILE, now=_day(ONSET_DAY) + 10**9)
    operations.add_verdict(
        store, 2, verdict="not looked at", action="-no bay free", who="bert", now=_day(ONSET_DAY + 1)
    )
    return now


def finding(change: float) -> dict[str, Any]:
    """Return the document of a finding."""
    least, size, most = (round(-100 * value) for value in (change + 0.02, change, change - 0.02))
    return {
        "corner": "front_left",
        "component": "spring",
        "change": change,
        "interval": [change - 0.02, change + 0.02],
        "score": change / 0.01,
        "severity": "high",
        "severity_number": 700,
        "advice": "inspect before the next 500 km",
        "since": float(BEGIN + ONSET_DAY * DAY),
        "since_interval": [float(BEGIN + ONSET_DAY * DAY - 600), float(BEGIN + ONSET_DAY * DAY + 600)],
        "runner_up": "",
        "trend": None,
        "sentence": f"front-left spring {size} % ({least} to {most} %) softer; inspect before the next 500 km",
    }


def _window(generator: np.random.Generator, day: int, k: int) -> Observation:
    """Return a window of a day."""
    time = float(BEGIN + day * DAY + 600 * k)
    if day == DEAD_DAY:
        fault = SensorFault("acc_fl", "dead", "no signal")
        return Observation(
            time, (), np.zeros(0), np.zeros((0, 0)), {"speed": 9.0}, {}, (fault,), reason="acc_fl is dead"
        )
    window = drawn_window(generator, time, {"front_left.spring": -0.25} if day >= ONSET_DAY else {})
    modes = {"bounce": (1.3 + 0.001 * day, 0.24), "roll": (1.9, 0.2)}
    return Observation(time, COMPONENTS, window.log_ratios, window.covariance, window.conditions, modes, ())


def _mode(label: str | None, frequency: float) -> dict[str, Any]:
    """Return an identified mode."""
    return {
        "natural_frequency": frequency,
        "natural_frequency_std": 0.01,
        "damping_ratio": 0.2,
        "damping_ratio_std": 0.01,
        "mode_shape": {"real": [1.0], "imag": [0.0]},
        "mpc": 0.98,
        "label": label,
        "stable_rate": 0.9,
    }


def _raise(store: Store, cause: str, severity: int, text: str, evidence: dict[str, Any], *, at: int) -> None:
    """Raise an alert on a day."""
    report = Report(VEHICLE, cause, severity, text, evidence)
    AlertBook(store, AlertSettings()).put(reported(None, report, AlertSettings(), _day(at)), now=_day(at))


def _day(day: int) -> int:
    """Return the begin of a day, UTC ns."""
    return (BEGIN + day * DAY) * 10**9


def _ns(time: float) -> int:
    """Return a time [s] in UTC ns."""
    return round(1e9 * time)
