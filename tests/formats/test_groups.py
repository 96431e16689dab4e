"""Groups of a file: which are read, joined where they share a clock, interpolated where they do not."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.formats import ReadSettings, groups, read, read_blocks

FAST, SLOW = np.arange(0, 20, 0.01), np.arange(0.5, 15, 0.5)


def of(*names, **others):
    return ReadSettings(groups=names, **others)


@pytest.fixture
def path(tmp_path):
    """Body and speed with clocks of their own, wheels at the times of the body, a microphone at a higher rate."""
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        for name, times, channels in (
            ("body", FAST, {"acc": ("m/s^2", np.sin(FAST)), "pitch": ("deg/s", np.cos(FAST))}),
            ("wheels", FAST, {"acc": ("m/s^2", np.sin(2 * FAST))}),
            ("drive", SLOW, {"speed": ("km/h", 36 + SLOW), "slow": ("m/s^2", SLOW)}),
            ("shaft", FAST + 0.004, {"torsion": ("rad", np.sin(FAST + 0.004))}),
        ):
            folder = file.create_group(name)
            folder["t_s"] = times
            for channel, (unit, values) in channels.items():
                folder[channel] = values
                folder[channel].attrs["unit"] = unit
    return path


def test_groups_are_listed_with_their_channels(path) -> None:
    assert {group.name: group.headings for group in groups(path)} == {
        "body": ("acc", "pitch"),
        "drive": ("slow", "speed"),
        "shaft": ("torsion",),
        "wheels": ("acc",),
    }


def test_several_clocks_are_refused_and_listed(path) -> None:
    with pytest.raises(ParameterError, match=r"holds 4 groups .* different clocks: choose with --group .*'body' \(acc"):
        read(path)
    with pytest.raises(ParameterError, match="has no group 'bodies': choose from 'body', 'drive'"):
        read(path, settings=of("bodies"))


def test_one_group_or_its_channels(path) -> None:
    assert read(path, settings=of("body")).names == ("acc", "pitch")
    assert read(path, channels=["pitch"]).samples == pytest.approx(np.radians(np.cos(FAST))[None])
    with pytest.raises(ParameterError, match="has no channel 'yaw'"):
        read(path, channels=["yaw"])


def test_groups_of_one_clock_are_joined_and_repeated_names_carry_their_group(path) -> None:
    recording = read(path, settings=of("body", "wheels"))
    assert recording.names == ("acc", "pitch", "wheels_acc")
    assert recording.samples[2] == pytest.approx(np.sin(2 * FAST))


def test_speed_is_interpolated_at_the_times_of_the_first_group(path) -> None:
    recording = read(path, channels=["acc", "speed"], settings=of("body", "drive"))
    inside = FAST[(SLOW[0] <= FAST) & (SLOW[-1] >= FAST)]
    assert recording.samples == pytest.approx(np.stack([np.sin(inside), (36 + inside) / 3.6]))


def test_motion_of_the_same_rate_is_interpolated_by_splines(path) -> None:
    recording = read(path, settings=of("body", "shaft"))
    assert recording.samples[2] == pytest.approx(np.sin(FAST[1:]), abs=1e-8)


def test_motion_of_another_rate_is_refused(path) -> None:
    with pytest.raises(ParameterError, match=r"slow was sampled at 2 Hz, the first group at 100 Hz"):
        read(path, settings=of("body", "drive"))


@pytest.mark.parametrize(("start", "end"), [(5.0, 8.0), (None, 3.0), (12.0, None)])
def test_a_part_is_read_by_its_times(path, start, end) -> None:
    part = read(path, settings=of("body", start=start, end=end))
    wanted = slice(*np.searchsorted(FAST, [start or 0.0, np.inf if end is None else end]))
    assert part.samples[0] == pytest.approx(np.sin(FAST[wanted]))
    blocks = list(read_blocks(path, settings=of("body", start=start, end=end), block_samples=1000))
    samples = np.concatenate([block.samples for block in blocks], axis=1)
    np.testing.assert_allclose(samples, part.samples, rtol=1e-6, equal_nan=False)


def test_a_part_beyond_the_end_is_refused(path) -> None:
    with pytest.raises(ParameterError, match="no rows from 30 s on"):
        read(path, settings=of("body", start=30.0))
    with pytest.raises(ParameterError, match="end=3 must be above start=5"):
        of(start=5.0, end=3.0)


def test_a_part_without_time_stamps_keeps_the_time_of_its_start(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["a"] = np.arange(1000.0)
        file["a"].attrs["fs"] = 100.0
        file.attrs["start_ns"] = 10**18
    part = read(path, settings=ReadSettings(start=2.0, end=4.0))
    assert part.samples[0].tolist() == list(range(200, 400))
    assert part.start == 10**18 + 2 * 10**9
