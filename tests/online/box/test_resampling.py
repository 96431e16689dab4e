"""Values one by one, each with its time, against what they must be at the times of the samples."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.online.box import Regular
from sprung.recording import Channel

TODAY = 1_700_000_000_000_000_000
HOUR = 3_600_000_000_000


def fed(regular, stream):
    """Return the blocks of (time [ns], values)."""
    blocks = [block for when, values in stream for block in regular.add(when, values)]
    return [*blocks, *regular.finish()]


def joined(blocks):
    """Return time [ns] and values (channels, samples) of blocks."""
    steps = [np.round(np.arange(block.n_samples) * 1e9 / block.sampling_rate).astype(int) for block in blocks]
    times = [block.start + step for block, step in zip(blocks, steps, strict=True)]
    return np.concatenate(times), np.concatenate([block.samples for block in blocks], axis=1)


def stamps(seconds):
    return [TODAY + round(1e9 * second) for second in seconds]


def steady(name, seconds, values=None):
    values = np.arange(len(seconds)) if values is None else values
    return [(when, {name: value}) for when, value in zip(stamps(seconds), values, strict=True)]


def sine(frequency, times):
    return np.sin(2 * np.pi * frequency * (np.asarray(times) - TODAY) / 1e9)


@pytest.mark.parametrize("rate", [10.0, 99.9, 200.0, 1000 / 3])
def test_values_at_the_times_of_samples_stay_as_they_are(rate) -> None:
    values = np.random.default_rng(1).normal(size=round(5.3 * rate))
    times, found = joined(fed(Regular(["a"], rate), steady("a", np.arange(values.size) / rate, values)))
    assert np.array_equal(found[0], values)
    assert times[0] == TODAY
    assert np.abs(times - stamps(np.arange(values.size) / rate)).max() <= 1


def test_sine_from_irregular_times_is_off_by_no_more_than_straight_lines_are() -> None:
    """Between points h apart: at most h^2/8 of the second derivative (textbook bound of linear interpolation)."""
    rate, frequency = 200.0, 3.0
    seconds = np.cumsum(np.random.default_rng(2).uniform(0.001, 0.008, 4000))
    times = stamps(seconds)
    times, found = joined(fed(Regular(["a"], rate), steady("a", seconds, sine(frequency, times))))
    bound = (2 * np.pi * frequency) ** 2 * 0.008**2 / 8
    assert times.size == pytest.approx((seconds[-1] - seconds[0]) * rate, abs=1)
    assert np.abs(found[0] - sine(frequency, times)).max() < bound
    assert np.abs(found[0] - sine(frequency, times + 5_000_000)).max() > 3 * bound  # one sample late is seen


def test_values_that_are_slower_than_the_limit_need_a_longer_one() -> None:
    stream = steady("a", np.arange(0, 10.0), np.arange(10.0))
    assert np.isfinite(joined(fed(Regular(["a"], 10.0), stream))[1]).sum() == 10
    times, found = joined(fed(Regular(["a"], 10.0, longest=1.5), stream))
    assert np.allclose(found[0], (times - TODAY) / 1e9)


@pytest.mark.parametrize("pause", [0.6, 1.7, 2.5, 30.0, 90.0, 86400.0])
def test_nothing_lies_in_a_gap(pause) -> None:
    """Never interpolated across, however long; all samples on either side are there."""
    seconds = np.concatenate([np.arange(300) / 100, 2.99 + pause + np.arange(300) / 100])
    times, found = joined(fed(Regular(["a"], 100.0), steady("a", seconds, np.arange(600.0))))
    after = (times - TODAY) / 1e9
    in_gap = (after > 2.995) & (after < 2.985 + pause)
    assert np.isnan(found[0][in_gap]).all()
    assert np.allclose(found[0][~in_gap], np.arange(600.0))
    assert found[0].size < 900


@pytest.mark.parametrize("step", [-HOUR, HOUR, -TODAY + 5_000_000_000, -3_000_000_000, -2_100_000_000])
def test_clock_that_steps(step) -> None:
    """What was before and what comes after are both whole, each with its time."""
    before = [(TODAY + k * 10_000_000, {"a": k}) for k in range(250)]
    later = [(TODAY + step + k * 10_000_000, {"a": k}) for k in range(250, 600)]
    blocks = fed(Regular(["a"], 100.0), before + later)
    times, found = joined(blocks)
    assert np.array_equal(found[0], np.arange(600.0))
    assert np.array_equal(times, [when for when, _ in before + later])
    assert max(block.n_samples for block in blocks) == 100


@pytest.mark.parametrize("wrong", [0, TODAY - HOUR, TODAY + HOUR, 1 << 62, -5, 10**30])
def test_a_time_that_is_wrong_once_does_no_harm(wrong) -> None:
    stream = [(TODAY + k * 10_000_000, {"a": k}) for k in range(400)]
    expected = joined(fed(Regular(["a"], 100.0), stream))
    regular = Regular(["a"], 100.0)
    found = joined(fed(regular, [*stream[:220], (wrong, {"a": 1e6}), *stream[220:]]))
    assert all(np.array_equal(one, other) for one, other in zip(found, expected, strict=True))


def test_senders_whose_clocks_contradict_each_other() -> None:
    """Who came first is kept; the other channel is missing, and blocks go on."""
    stream = [(TODAY + k * 5_000_000 + (HOUR if k % 2 else 0), {"b": k} if k % 2 else {"a": k}) for k in range(2000)]
    blocks = fed(Regular(["a", "b"], 100.0), stream)
    times, found = joined(blocks)
    assert np.array_equal(found[0], np.arange(0, 2000, 2))
    assert np.isnan(found[1]).all()
    assert (np.diff(times) == 10_000_000).all()


def test_channels_may_come_late() -> None:
    """Those of one time in any order within a second."""
    seconds = np.arange(1000) / 100
    arrivals = [(when, when, {"a": k}) for k, when in enumerate(stamps(seconds))]
    arrivals += [(when + 900_000_000, when, {"b": -k}) for k, when in enumerate(stamps(seconds))]
    stream = [(when, values) for _, when, values in sorted(arrivals, key=lambda item: item[0])]
    found = joined(fed(Regular(["a", "b"], 100.0), stream))[1]
    assert np.array_equal(found[0], np.arange(1000.0))
    assert np.array_equal(found[1], -np.arange(1000.0))


def test_missing_and_impossible_values_are_missing() -> None:
    values = np.arange(200.0)
    values[[50, 80, 120]] = [np.nan, np.inf, 1e200]
    found = joined(fed(Regular(["a"], 100.0), steady("a", np.arange(200) / 100, values)))[1][0]
    assert np.flatnonzero(np.isnan(found)).tolist() == [50, 80, 120]


def test_blocks_hold_what_they_should() -> None:
    channels: list[Channel | str] = [Channel("acc", "acceleration"), "speed"]
    regular = Regular(channels, 200.0)
    assert regular.add(TODAY, {"other": 1.0}) == []
    blocks = [
        block for k in range(900) for block in regular.add(TODAY + k * 5_000_000, {"acc": k, "speed": 1, "other": 0})
    ]
    assert [block.n_samples for block in blocks] == [200, 200, 200]
    assert [block.start for block in blocks] == [TODAY, TODAY + 10**9, TODAY + 2 * 10**9]
    assert blocks[0].channels == (channels[0], Channel("speed"))
    assert [block.n_samples for block in regular.finish()] == [200, 100]
    assert regular.finish() == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "time_of",
    [
        lambda k: TODAY,
        lambda k: TODAY + k,
        lambda k: TODAY - k,
        lambda k: TODAY + (k % 2) * HOUR,
        lambda k: TODAY + HOUR * (k > 0),
        lambda k: TODAY - k * HOUR // 50,
        lambda k: int(np.random.default_rng(k).integers(0, 2 * TODAY)) if k % 100 == 0 else TODAY + k * 1_000_000,
    ],
    ids=["same", "crowded", "back", "two", "stuck", "leaps", "wild"],
)
def test_memory_is_bounded_whatever_comes(time_of, memory_below) -> None:
    regular = Regular(["a"], 100.0)
    n_samples = 0
    with memory_below(8e6, kept=5e6):
        for k in range(60_000):
            n_samples += sum(block.n_samples for block in regular.add(time_of(k), {"a": k}))
    assert n_samples < 20_000


@pytest.mark.parametrize(
    ("names", "rate", "options", "said"),
    [
        ([], 100.0, {}, "no channel is named"),
        (["a", "a"], 100.0, {}, "'a' is named more than once"),
        (["a"], 0.0, {}, "sampling_rate=0 must be above 0"),
        (["a"], np.nan, {}, "sampling_rate=nan must be finite"),
        (["a"], 1e6, {}, "at most 100000"),
        (["a"], 100.0, {"longest": 5.0}, "longest=5 must be above 0 and at most 2"),
    ],
)
def test_settings_that_cannot_be(names, rate, options, said) -> None:
    with pytest.raises(ParameterError, match=said):
        Regular(names, rate, **options)


def test_stamps_that_are_rounded_lose_nothing() -> None:
    """Seconds since 1970 as floats have steps of 0.24 us: no sample is lost at the ends, at gaps, at missing values."""
    seconds = np.array([TODAY / 1e9 + k / 200 + (3 if k >= 500 else 0) for k in range(1000)])
    values = np.where(np.arange(1000) == 321, np.nan, np.arange(1000.0))
    stream = [(round(second * 1e9), {"a": value}) for second, value in zip(seconds, values, strict=True)]
    found = joined(fed(Regular(["a"], 200.0), stream))[1][0]
    assert np.allclose(found, values, atol=1e-3, equal_nan=True)
