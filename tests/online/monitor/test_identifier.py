"""Modes of complete windows: with lines that are known from an earlier one, those of the batch."""

from dataclasses import replace

import cbor2
import numpy as np
import pytest

from sprung.identification import METHODS, cov_ssi
from sprung.online.monitor import MonitorSettings, engine
from sprung.online.monitor.engine import IDENTIFICATION, ModeIdentifier
from sprung.results.documents import mode_documents
from sprung.signals import harmonics
from sprung.simulation import RoadDrive, simulate_drive
from sprung.simulation.conditions import WheelOrders

#: Windows of 1,000 s: lines are known for the three after a search.
SETTINGS = MonitorSettings(window=1000.0)


@pytest.fixture
def searches(monkeypatch):
    """A list that grows with each search for lines proportional to speed, and no identification from memory."""
    monkeypatch.setattr(engine, "METHODS", METHODS)
    found = []
    searching = harmonics._speed_lines

    def counted(*given):
        found.append(searching(*given))
        return found[-1]

    monkeypatch.setattr(harmonics, "_speed_lines", counted)
    return found


@pytest.fixture(scope="module")
def windows(car):
    """Drives of a car whose wheels are out of balance."""
    settings = RoadDrive(duration=200.0, snr=50.0, wheel_orders=WheelOrders(unbalance=15e-3, run_out=(1e-3,)))
    return [simulate_drive(car, settings, seed=seed).recording for seed in range(2)]


def modes_of(monitored, window, car):
    identified = monitored.identify([window], window, car)
    assert identified.reason == ""
    return list(identified.modes)


def of_batch(window, car):
    return mode_documents(cov_ssi(window, settings=IDENTIFICATION, vehicle=car).modes)


@pytest.mark.slow
def test_lines_are_sought_once_an_hour(car, windows, searches) -> None:
    monitored = ModeIdentifier(SETTINGS)
    expected = [of_batch(window, car) for window in windows]
    n_before = len(searches)
    assert all(searches)
    assert n_before == 2
    found = []
    for k in range(5):
        assert modes_of(monitored, windows[k % 2], car) == expected[k % 2]
        found.append(len(searches) - n_before)
        monitored = ModeIdentifier.from_state(SETTINGS, cbor2.loads(cbor2.dumps(monitored.state())))
    assert found == [1, 1, 1, 1, 2]


def test_lines_are_sought_anew_where_an_unknown_tone_appears(car, windows, searches) -> None:
    monitored = ModeIdentifier(SETTINGS)
    modes_of(monitored, windows[0], car)
    times = np.arange(windows[1].n_samples) / windows[1].sampling_rate
    is_motion = np.array([channel.quantity != "speed" for channel in windows[1].channels])
    level = windows[1].samples.std(axis=1) * is_motion
    humming = replace(windows[1], samples=windows[1].samples + 0.3 * np.outer(level, np.sin(2 * np.pi * 31.0 * times)))
    expected, before = of_batch(humming, car), len(searches)
    assert modes_of(monitored, humming, car) == expected
    assert len(searches) == before + 1
    modes_of(monitored, humming, car)
    assert len(searches) == before + 1


@pytest.mark.slow
def test_lines_are_sought_anew_where_a_mode_may_be_one(car, windows, searches, monkeypatch) -> None:
    """In the same window after an identification with known lines, and again where the mode is still there."""
    monitored = ModeIdentifier(SETTINGS)
    modes_of(monitored, windows[0], car)
    expected, before = [of_batch(window, car) for window in windows], len(searches)
    monkeypatch.setattr(engine, "_NARROW", 1.0)
    assert modes_of(monitored, windows[1], car) == expected[1]
    assert len(searches) == before + 1
    assert modes_of(monitored, windows[0], car) == expected[0]
    assert len(searches) == before + 2
