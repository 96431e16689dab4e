import numpy as np
import pytest

from sprung.errors import DataError
from sprung.recording import Channel, Gap, Recording
from sprung.signals.inspection import inspect, inspect_blocks


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


def test_faults_are_named_with_their_shares() -> None:
    from sprung.results.tables import inspection_table

    noise = np.random.default_rng(6).standard_normal((6, 6000))
    half, stuck, filled, repeating, spiking, healthy = noise
    half[3000:] = 0
    stuck[3000:3600] = 0.5
    filled[[10, 20, 30]] = 1e6
    repeating[4000:4100] = repeating[100:200]
    spiking[[500, 1500, 2500]] += [40, -40, 40]
    healthy[:3] = np.nan
    whole = recording(*noise)
    assert [facts.faults for facts in inspect(whole).channels] == [
        ("half-dead",),
        ("stuck",),
        ("filled",),
        ("repeating",),
        ("spiking",),
        (),
    ]
    assert [row[-1] for row in inspection_table(inspect(whole)).rows] == [
        "half-dead 50 %",
        "stuck 10 %",
        "filler value 1e+06 in 0.05 %",
        "copies of earlier stretches 1.67 %",
        "3 spikes",
        "missing 0.05 %",
    ]


def test_rest_of_a_standing_vehicle_is_no_fault() -> None:
    values = np.random.default_rng(7).standard_normal(6000)
    values[:2000] = 0.1
    speed = np.where(np.arange(6000) < 2000, 0.0, 12.0)
    channels = (Channel("acc", "acceleration"), Channel("speed", "speed"))
    assert inspect(Recording(np.stack([values, speed]), 100.0, channels)).channels[0].faults == ()
    assert inspect(Recording(values[None], 100.0, channels[:1])).channels[0].faults == ("stuck",)
