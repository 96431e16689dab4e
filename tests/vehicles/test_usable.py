"""The part of a recording that identification and fits may use."""

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.recording import Channel, Recording
from sprung.vehicles import read_description
from sprung.vehicles.sensor_layout import is_drive, output_channels, speed_channel, usable

RATE = 100.0


def recorded(samples, names="abc", *, quantities=(), **fields):
    samples = np.atleast_2d(samples)
    kinds = [*quantities, *["acceleration"] * (len(samples) - len(quantities))]
    channels = tuple(Channel(name, kind) for name, kind in zip(names, kinds, strict=False))
    return Recording(samples, RATE, channels, **fields)


def noise(n_channels=2, n_samples=1000, seed=0):
    return np.random.default_rng(seed).normal(size=(n_channels, n_samples))


def test_outputs_are_the_channels_of_motion() -> None:
    recording = recorded(noise(3), ("a", "oil", "b"), quantities=("acceleration", "temperature"))
    assert usable(recording).names == ("a", "b")


@pytest.mark.parametrize(
    ("name", "quantity", "values", "is_one"),
    [
        ("speed", "speed", np.full(1000, 12.0), True),
        ("wheel speed fl", "speed", np.full(1000, 12.0), True),
        ("speed", "speed", np.where(np.arange(1000) < 100, 12.0, 0.0), False),  # it stands for nine tenths
        ("GPS Latitude", "unknown", np.linspace(48.1, 48.2, 1000), True),
        ("lon", "angle", np.linspace(0.2, 0.201, 1000), True),
        ("lat", "unknown", np.full(1000, 48.1) + 1e-5 * (np.arange(1000) % 7), False),  # a bridge with a receiver
        ("acc_lateral", "acceleration", np.linspace(-5.0, 5.0, 1000), False),
        ("plateau", "displacement", np.linspace(-5.0, 5.0, 1000), False),
        ("lat", "unknown", np.full(1000, np.nan), False),
    ],
)
def test_a_drive_has_speed_or_changes_its_place(name, quantity, values, is_one) -> None:
    assert is_drive(recorded(np.vstack([values, noise()]), (name, "a", "b"), quantities=(quantity,))) is is_one


@pytest.mark.parametrize(
    ("name", "quantity", "is_motion"),
    [
        ("Heading", "angle", False),
        ("imu pitch", "angle", False),
        ("roll", "unknown", False),
        ("pitch_rate", "unknown", True),
        ("PositionAccuracy", "displacement", False),
        ("HDOP", "unknown", False),
        ("gnss_fix", "unknown", False),
        ("inclination", "angle", True),
        ("fork", "displacement", True),
    ],
)
def test_angles_places_and_flags_take_no_part(name, quantity, is_motion) -> None:
    assert (name in output_channels(recorded(noise(3), (name, "a", "b"), quantities=(quantity,)))) is is_motion


def test_an_unknown_constant_takes_no_part_but_a_constant_acceleration_is_refused() -> None:
    samples = np.vstack([np.full(1000, 3.0), noise()])
    assert output_channels(recorded(samples, ("x", "a", "b"), quantities=("unknown",))) == ("a", "b")
    with pytest.raises(DataError, match="channel 'x' is constant at 3"):
        usable(recorded(samples, ("x", "a", "b")))


def test_missing_values_become_gaps() -> None:
    samples = noise()
    samples[1, 400:450] = np.nan
    found = usable(recorded(samples))
    assert found.n_samples == 950
    (gap,) = found.gaps
    assert (gap.index, gap.duration) == (400, pytest.approx(0.5))


def test_only_what_was_recorded_while_moving_counts() -> None:
    """Above 3 m/s: the first and the last three seconds of ten."""
    speed = np.where(np.abs(np.arange(1000) - 499.5) < 200, 1.0, 10.0)
    recording = recorded(np.vstack([speed, noise()]), ("speed", "a", "b"), quantities=("speed",))
    found = usable(recording)
    assert found.names == ("a", "b", "speed")
    assert found.n_samples == 600
    assert [gap.index for gap in found.gaps] == [300]
    assert speed_channel(recording) == "speed"
    assert speed_channel(recording.select(["a"])) is None


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [
        (
            [np.ones(50), np.arange(50.0)],
            "channel 'a' is constant at 1: leave it out with --channels b",
        ),
        (
            [np.arange(50.0), np.zeros(50)],
            "channel 'b' is constant at 0: leave it out with --channels a",
        ),
        (
            [np.full(50, np.nan), np.arange(50.0)],
            "channel 'a' has no values: leave it out with --channels b",
        ),
        (
            [np.ones(50), np.full(50, np.nan)],
            "channel 'a' is constant at 1: check the sensors and their wiring",
        ),
        ([[1.0], [2.0]], "the recording has 1 sample(s): record at least a minute"),
        (np.zeros((2, 0)), "the recording has 0 sample(s): record at least a minute"),
        (
            np.zeros((0, 50)),
            "the recording has no channel of motion: give accelerations or angular velocities",
        ),
    ],
)
def test_dead_channels_and_empty_recordings_are_refused(samples, sentence) -> None:
    with pytest.raises(DataError) as refusal:
        usable(recorded(np.asarray(samples)))
    assert str(refusal.value) == sentence


def test_a_large_offset_is_not_a_dead_channel() -> None:
    """An accelerometer standing upright: 9.81 m/s^2 and little motion."""
    samples = 9.81 + 1e-4 * noise()
    assert usable(recorded(samples)).n_samples == 1000


def test_the_speed_may_have_a_name_that_means_it() -> None:
    """Where no channel is called speed and the file names none: the only one of known unit, not of a wheel."""
    wheel = "Vehicle.Chassis.Axle.Row1.Wheel.Left.Speed"
    run = recorded(noise(3), ("a", "Vehicle.Speed", wheel), quantities=("acceleration", "speed", "speed"))
    assert speed_channel(run) == "Vehicle.Speed"
    car = read_description("zafira")
    assert speed_channel(run, car) == "Vehicle.Speed"
    assert speed_channel(run, car.model_copy(update={"speed_channel": "v"})) is None
    assert speed_channel(recorded(noise(2), ("a", "Vehicle.Speed"), quantities=["unknown"] * 2)) is None
    assert speed_channel(recorded(noise(2), ("Vehicle.Speed", "gps_speed_mps"), quantities=["speed"] * 2)) is None
    assert speed_channel(recorded(noise(2), ("Vehicle.Speed", "Speed"), quantities=["speed"] * 2)) == "Speed"
