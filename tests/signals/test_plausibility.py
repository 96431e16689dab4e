"""Doubts about units and clocks, on recordings with one thing wrong and on sound ones."""

from dataclasses import replace

import numpy as np
import pytest

import sprung
from sprung.recording import Channel, Recording
from sprung.signals.inspection import doubts_of
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle

NOISE = np.random.default_rng(1).standard_normal((3, 6000))


def triad(scale: float, moving: float = 0.1) -> Recording:
    """Return what a resting accelerometer of three axes reads, gravity times a factor."""
    resting = np.array([0.3, 0.1, np.sqrt(1 - 0.1)])[:, None]
    channels = tuple(Channel(f"acc_{axis}", "acceleration") for axis in "xyz")
    return Recording(9.80665 * scale * (resting + moving * NOISE), 100.0, channels)


@pytest.mark.parametrize(("scale", "unit"), [(1000, "mg"), (9.80665, "m/s^2"), (1 / 9.80665, "g")])
def test_gravity_in_another_unit(scale, unit) -> None:
    (words,) = doubts_of(triad(scale))
    assert words.startswith("acc_x to acc_z rest together at")
    assert words.endswith(f"are their units {unit}?")


@pytest.mark.parametrize(
    ("quantity", "values", "words"),
    [
        ("acceleration", 30 + NOISE[0], "more than gravity: check unit and offset"),
        ("acceleration", 900 * NOISE[0], "no vehicle moves so"),
        ("angular_velocity", 20 * NOISE[0], "is its unit deg/s?"),
        ("speed", 130 + NOISE[0], "is its unit km/h?"),
        ("displacement", 5 * NOISE[0], "is its unit mm?"),
    ],
)
def test_levels_that_no_vehicle_has(quantity, values, words) -> None:
    (found,) = doubts_of(Recording(values[None], 100.0, (Channel("sensor", quantity),)))
    assert words in found


def test_a_clock_in_seconds_under_a_heading_in_milliseconds(tmp_path) -> None:
    path = tmp_path / "run.csv"
    rows = (f"{number / 100:.3f},{1 + value:.5f}" for number, value in enumerate(0.1 * NOISE[0]))
    path.write_text("\n".join(["Time (ms),acc_z (g)", *rows]))
    run = sprung.read(path)
    assert doubts_of(run) == ("0.06 s at 100000 Hz: is the time in s, not in ms? State it with --time-unit",)
    assert doubts_of(run)[0] in sprung.cov_ssi(run).notes


def test_sound_recordings_raise_no_doubt() -> None:
    drive = simulate_drive(read_vehicle("zafira"), RoadDrive(duration=60.0), seed=1).recording
    short = Recording(NOISE[:1], 51200.0, (Channel("mic"),))
    altitude = Recording(100 * NOISE[:1], 1.0, (Channel("altitude", "displacement"),))
    standing = replace(drive, samples=0 * drive.samples)
    corners = Recording(9.8 + NOISE, 100.0, tuple(Channel(f"acc_{end}", "acceleration") for end in ("fl", "fr", "rl")))
    leaning = Recording(1.0 + 0.1 * NOISE[:1], 100.0, (Channel("acc_x", "acceleration"),))
    sparse = Recording(NOISE[:1], 0.2, (Channel("oil", "temperature"),))
    for recording in (drive, triad(1.0), short, altitude, standing, corners, leaning, sparse):
        assert doubts_of(recording) == ()


@pytest.mark.parametrize(("heading", "name"), [("pot [V]", "pot"), ("pot (V)", "pot (V)")])
def test_raw_outputs_of_sensors_stay_as_they_are(heading, name, tmp_path) -> None:
    path = tmp_path / "run.csv"
    rows = (f"{number / 100:.3f},{value:.5f},{2048 + round(50 * value)}" for number, value in enumerate(NOISE[0]))
    path.write_text("\n".join([f"Time (s),{heading},adc [counts]", *rows]))
    run = sprung.read(path)
    assert [channel.quantity for channel in run.channels] == ["unknown", "unknown"]
    assert run.samples[0] == pytest.approx(NOISE[0], abs=1e-5)
    assert f"{name}: unit 'V' is unknown, values as in the file" in run.history
