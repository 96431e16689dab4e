import numpy as np
import pytest

from sprung.errors import DataError
from sprung.recording import Channel, Gap, Recording
from sprung.signals.inspection import (
    clipped_share,
    constant_value,
    equal_runs,
    inspect,
    inspect_blocks,
    missing_share,
    stuck_runs,
)


def recording(*rows, **fields):
    channels = tuple(Channel(f"c{number}", "acceleration") for number in range(len(rows)))
    return Recording(np.array(rows, dtype=float), 100.0, channels, **fields)


def test_levels_of_a_sine_on_an_offset() -> None:
    phase = 2 * np.pi * np.arange(1000) / 50
    (facts,) = inspect(recording(9.81 + 2 * np.sin(phase))).channels
    assert facts.mean == pytest.approx(9.81)
    assert facts.standard_deviation == pytest.approx(np.sqrt(2))
    assert facts.rms == pytest.approx(np.sqrt(9.81**2 + 2))
    assert facts.maximum == pytest.approx(11.81, abs=0.01)
    assert facts.minimum == pytest.approx(7.81, abs=0.01)
    assert facts.unit == "m/s^2"
    assert (facts.is_dead, facts.is_clipped, facts.is_stuck) == (False, False, False)


def test_dead_channels() -> None:
    facts = inspect(recording(np.zeros(200), np.full(200, np.nan), np.arange(200))).channels
    assert [channel.is_dead for channel in facts] == [True, True, False]
    assert [channel.n_values for channel in facts] == [200, 0, 200]
    assert facts[1].mean is None
    assert not facts[0].is_clipped


def test_share_of_clipped_samples() -> None:
    phase = 2 * np.pi * (np.arange(10_000) + 0.5) / 200
    (facts,) = inspect(recording(np.clip(np.sin(phase), -0.5, 2.0))).channels
    # A sine is below -1/2 for a third of its period.
    assert facts.clipped == pytest.approx(1 / 3, abs=0.01)
    assert facts.is_clipped
    assert not facts.is_stuck


def test_coarse_but_unclipped_channel_is_not_called_clipped() -> None:
    rng = np.random.default_rng(1)
    (facts,) = inspect(recording(np.round(rng.standard_normal(100_000) * 4) / 4)).channels
    assert not facts.is_clipped


def test_stuck_stretch_counts_from_a_second_on() -> None:
    values = np.random.default_rng(2).standard_normal(1000)
    values[300:450] = values[300]
    values[600:690] = values[600]
    (facts,) = inspect(recording(values)).channels
    assert facts.stuck == pytest.approx(0.15)
    assert facts.is_stuck


@pytest.mark.parametrize(
    "channel", [Channel("v", "speed"), Channel("Speed"), Channel("oil", "temperature")], ids=lambda c: c.name
)
def test_a_condition_that_rests_is_neither_clipped_nor_stuck_nor_dead(channel) -> None:
    """A vehicle that keeps its highest speed for half a minute, stands, and keeps one speed throughout."""
    rising = np.concatenate([np.zeros(2000), np.linspace(0, 15, 3000), np.full(3000, 15.0)])
    for values in (rising, np.full(500, 15.0)):
        (facts,) = inspect(Recording(values[None], 100.0, (channel,))).channels
        assert (facts.clipped, facts.stuck) == (0, 0)
        assert (facts.is_clipped, facts.is_stuck, facts.is_dead) == (False, False, False)
    (absent,) = inspect(Recording(np.full((1, 500), np.nan), 100.0, (channel,))).channels
    assert absent.is_dead
    (motion,) = inspect(recording(rising)).channels
    assert (motion.is_clipped, motion.is_stuck) == (True, True)


def test_runs_of_equal_values() -> None:
    values = np.array([1.0, 1.0, 2.0, np.nan, np.nan, 3.0, 3.0, 3.0])
    starts, lengths = equal_runs(values, breaks=[6])
    assert starts.tolist() == [0, 2, 3, 4, 5, 6]
    assert lengths.tolist() == [2, 1, 1, 1, 1, 2]
    at_10_hz = np.concatenate([np.arange(5.0), np.full(10, 7.0), np.arange(9.0)])
    assert [part.tolist() for part in stuck_runs(at_10_hz, 10.0)] == [[5], [10]]
    assert stuck_runs(at_10_hz, 11.0)[0].size == 0
    assert stuck_runs(at_10_hz, 10.0, breaks=[9])[0].size == 0


def test_shares_of_clipped_and_missing_values() -> None:
    assert clipped_share(np.array([0.0, 3.0, 3.0, 3.0, -1.0])) == pytest.approx(0.6)
    assert clipped_share(np.array([0.0, 3.0, 3.0, 3.0, -1.0]), breaks=[2]) == 0
    assert clipped_share(np.full(3, np.nan)) == 0
    assert missing_share(np.array([1.0, np.nan, np.inf, 2.0])) == pytest.approx(0.5)
    assert missing_share(np.zeros(0)) == 1


def test_a_constant_within_a_tolerance() -> None:
    assert constant_value(np.array([2.0, np.nan, 2.0])) == 2
    rising = 2 + 1e-13 * np.arange(3.0)
    assert constant_value(rising) is None
    assert constant_value(rising, tolerance=1e-12) == 2
    assert constant_value(np.full(3, np.nan)) is None


def test_gap_ends_a_run() -> None:
    values = np.random.default_rng(3).standard_normal(1000)
    values[300:450] = values[300]
    assert inspect(recording(values, gaps=(Gap(375, 1.0),))).channels[0].stuck == 0


def test_gaps_and_duration() -> None:
    facts = inspect(recording(np.arange(1000), gaps=(Gap(100, 2.5), Gap(300, 0.5)), start=7, history=("read",)))
    assert (facts.n_gaps, facts.gap_duration, facts.duration) == (2, 3.0, 10.0)
    assert (facts.start, facts.history, facts.n_samples) == (7, ("read",), 1000)


def test_blocks_equal_the_whole() -> None:
    rng = np.random.default_rng(4)
    values = rng.standard_normal((2, 9000))
    values[0] += 1e4
    values[1] = np.maximum(values[1], -1)
    values[1, 5000:5010] = np.nan
    whole = inspect(recording(*values))
    parts = inspect_blocks([recording(*part) for part in np.array_split(values, 4, axis=1)])
    for one, other in zip(whole.channels, parts.channels, strict=True):
        assert other.rms == pytest.approx(one.rms, rel=1e-12)
        assert other.standard_deviation == pytest.approx(one.standard_deviation, rel=1e-9)
        assert (other.minimum, other.maximum, other.n_values) == (one.minimum, one.maximum, one.n_values)
        assert other.clipped == pytest.approx(one.clipped, rel=0.02)
    assert parts.duration == pytest.approx(whole.duration)


def test_nothing_to_inspect() -> None:
    with pytest.raises(DataError, match="no blocks"):
        inspect_blocks([])
