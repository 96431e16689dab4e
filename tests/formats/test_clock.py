import numpy as np
import pytest

from sprung.errors import DataError, FormatError
from sprung.formats import read
from sprung.formats.clock import Clock, ClockFit, find_gaps, interpolate, resolution, time_scale, uncrowded


def fitted(seconds, *, pieces=1):
    fit = ClockFit("run.csv, line")
    rows = 2 + np.arange(seconds.size)
    for part, numbers in zip(np.array_split(seconds, pieces), np.array_split(rows, pieces), strict=True):
        fit.update(part, numbers)
    return fit.clock()


@pytest.mark.parametrize("rate", [100.0, 104.36, 1000.0, 3.2, 25600.0])
@pytest.mark.parametrize("pieces", [1, 3])
def test_uniform_stamps_give_their_rate_exactly(rate, pieces) -> None:
    clock = fitted(np.round(np.arange(2000) / rate, 9), pieces=pieces)
    assert clock.sampling_rate == pytest.approx(rate, rel=1e-12)
    assert clock.jitter_max < 1e-4
    assert not clock.is_resampled


@pytest.mark.parametrize(
    ("rate", "digits"), [(104.36, 3), (95.0, 3), (1500.0, 3), (1050.0, 3), (333.3, 4), (2048.0, 3)]
)
def test_printed_digits_do_not_count_as_jitter(rate, digits) -> None:
    stamps = np.round(np.arange(20_000) / rate, digits)
    clock = fitted(stamps)
    assert not clock.is_resampled
    assert not clock.in_bursts
    assert clock.sampling_rate == pytest.approx(rate, rel=1e-6)
    assert find_gaps(stamps, clock).size == 0


def test_true_jitter_asks_for_resampling_and_is_measured() -> None:
    rng = np.random.default_rng(1)
    jitter = rng.uniform(-0.1, 0.1, 50_000)
    clock = fitted((np.arange(jitter.size) + jitter) / 200)
    assert clock.is_resampled
    assert clock.sampling_rate == pytest.approx(200, rel=1e-5)
    assert clock.jitter_rms == pytest.approx(0.2 / np.sqrt(12), rel=0.02)
    assert clock.jitter_max == pytest.approx(0.1, rel=0.1)


def test_jitter_is_stated_as_the_standard_deviation_of_the_intervals() -> None:
    seconds = np.cumsum(np.random.default_rng(0).uniform(0.004, 0.006, 50_000))
    clock = fitted(seconds)
    assert clock.interval_std == pytest.approx(np.diff(seconds).std(), rel=0.01)
    assert "intervals of 5.002 ms with a standard deviation of 0.58 ms" in clock.describe()
    assert fitted(np.arange(1000) / 104).describe().startswith("time stamps advance at 104 Hz in constant intervals")


def test_slow_drift_of_the_clock_is_no_jitter() -> None:
    # A crystal that warms up: 5 ppm faster at the end of 3 h, 27 samples off its mean line.
    index = np.arange(1_080_000)
    clock = fitted((index + 2.5e-6 * index**2 / index.size) / 100)
    assert not clock.is_resampled
    assert clock.jitter_max < 0.01


def test_gaps_are_found_one_lost_sample_too() -> None:
    index = np.delete(np.arange(10_000), [500, 3000, 3001, 7000])
    seconds = index / 250
    clock = fitted(seconds)
    assert clock.sampling_rate == pytest.approx(250, rel=1e-9)
    assert list(find_gaps(seconds, clock)) == [500, 2999, 6997]


def test_late_stamp_is_no_gap() -> None:
    seconds = np.arange(1000) / 100
    seconds[300] += 0.008
    assert find_gaps(seconds, Clock(100.0, 0.01)).size == 0


def test_gap_of_half_an_interval_needs_no_alarm() -> None:
    seconds = np.arange(1000) / 100 + np.where(np.arange(1000) >= 400, 0.004, 0.0)
    assert find_gaps(seconds, Clock(100.0, 0.01)).size == 0


def test_bursts_are_read_as_a_straight_line() -> None:
    sampled = np.arange(4000) / 117
    arrived = np.ceil(sampled / 0.065) * 0.065
    clock = fitted(np.round(arrived, 4))
    assert clock.in_bursts
    assert not clock.is_resampled
    assert clock.sampling_rate == pytest.approx(117, rel=1e-3)
    assert find_gaps(arrived, clock).size == 0


def test_gap_between_bursts() -> None:
    sampled = np.arange(8000) / 117
    arrived = np.round(np.ceil(sampled / 0.065) * 0.065, 4)
    arrived[4000:] += 2.0
    clock = fitted(arrived)
    gaps = find_gaps(arrived, clock)
    assert gaps.size == 1
    assert abs(gaps[0] - 4000) <= 8
    assert clock.sampling_rate == pytest.approx(117, rel=1e-3)


def test_stalled_logger_that_catches_up_lost_nothing() -> None:
    sampled = np.arange(8000) / 117
    arrived = np.ceil(sampled / 0.065) * 0.065
    stalled = (sampled > 10) & (sampled < 13)
    arrived[stalled] = 13.0
    clock = fitted(np.round(arrived, 4))
    assert find_gaps(arrived, clock).size == 0
    assert clock.sampling_rate == pytest.approx(117, rel=1e-3)


STEADY = np.arange(100) / 10
BACKWARDS = np.where(np.arange(100) == 40, 3.8, STEADY)
REPEATED = np.where(np.arange(100) % 40 == 20, STEADY - 0.1, STEADY) + 1e-4 * np.sin(np.arange(100)) * (STEADY > 7)
MIXED = np.cumsum(np.tile([0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.5], 200))


@pytest.mark.parametrize(
    ("seconds", "pieces", "error", "message"),
    [
        (BACKWARDS, 1, FormatError, r"run.csv, line 42: time runs backwards"),
        (BACKWARDS, 40, FormatError, "line 42: time runs backwards"),
        (REPEATED, 1, FormatError, "line 22 repeats the time"),
        (np.append(np.arange(5000) / 100, 60 + np.arange(5000) / 200), 1, DataError, "changes from 200 to 100 Hz"),
        (MIXED, 1, DataError, "rates are mixed"),
        (np.zeros(1), 1, DataError, "two samples"),
        (np.zeros(100), 1, DataError, "share one time stamp"),
    ],
)
def test_doubtful_stamps_are_refused(seconds, pieces, error, message) -> None:
    with pytest.raises(error, match=message):
        fitted(seconds, pieces=pieces)


def test_few_repeated_stamps_are_read_and_noted(tmp_path) -> None:
    """A logger that writes a row twice, and one whose clock stood still for a sample: the whole file was refused."""
    rng = np.random.default_rng(1)
    time = np.arange(400) / 100 + 4e-4 * rng.uniform(size=400)
    motion = np.sin(2 * np.pi * 2 * np.arange(400) / 100)
    rows = [f"{t:.5f},{value:.4f}" for t, value in zip(time, motion, strict=True)]
    (tmp_path / "double.csv").write_text(
        "\n".join(["time [s],acc [m/s^2]", *rows[:151], rows[150], *rows[151:]]) + "\n"
    )
    late = [*rows[:150], f"{time[149]:.5f},{motion[150]:.4f}", *rows[151:]]
    (tmp_path / "late.csv").write_text("\n".join(["time [s],acc [m/s^2]", *late]) + "\n")
    for name, word in (("double", "1 row left out that repeats the row before"), ("late", "1 row with the stamp of")):
        run = read(tmp_path / f"{name}.csv")
        assert any(word in line for line in run.history)
        assert run.sampling_rate == pytest.approx(100, rel=1e-4)
        np.testing.assert_allclose(run.samples[0, :390], motion[:390], atol=0.01)


@pytest.mark.parametrize(("step", "expected"), [(0.01, 0.01), (0.25, 0.01), (1e-6, 1e-6), (20.0, 10.0), (1 / 3, 0.0)])
def test_resolution_is_the_coarsest_power_of_ten(step, expected) -> None:
    assert resolution(step * np.arange(1000)) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("stamps", "factor", "start"),
    [
        (np.array([17.5, 17.6]), 1.0, None),
        (np.array([1.7e9, 1.7e9 + 1]), 1.0, 1_700_000_000_000_000_000),
        (np.array([1.7e12, 1.7e12 + 1]), 1e-3, 1_700_000_000_000_000_000),
        (np.array([1_700_000_000_123_456, 1_700_000_000_123_457]), 1e-6, 1_700_000_000_123_456_000),
        (np.array([1_700_000_000_123_456_789, 1_700_000_000_123_456_790]), 1e-9, 1_700_000_000_123_456_789),
        (np.array(["2023-11-14T22:13:20.5", "2023-11-14T22:13:21"], dtype="M8[ms]"), 1e-9, 1_700_000_000_500_000_000),
        (np.array([5, 7], dtype="m8[ms]"), 1e-9, None),
    ],
)
def test_epoch_is_named_by_its_magnitude(stamps, factor, start) -> None:
    scale = time_scale(stamps)
    assert scale.factor == pytest.approx(factor)
    assert scale.start == start
    first, second = scale.seconds(stamps)
    step = stamps[1] - stamps[0]
    assert first == 0
    assert second == pytest.approx(step / np.timedelta64(1, "s") if stamps.dtype.kind in "mM" else step * factor)


def test_stated_unit_of_time_is_no_epoch() -> None:
    scale = time_scale(np.array([2e9, 2e9 + 5]), 1e-6)
    assert scale.start is None
    assert scale.seconds(np.array([2e9 + 5]))[0] == pytest.approx(5e-6)


def test_crowded_stamps_are_spread_backwards() -> None:
    seconds = np.array([0.0, 1.0, 2.9, 3.0, 4.0])
    assert uncrowded(seconds, 1.0) == pytest.approx([0, 1, 2.5, 3, 4])


def test_splines_reproduce_a_cubic_and_leave_a_dead_channel() -> None:
    rng = np.random.default_rng(2)
    times = np.sort(rng.uniform(0, 10, 40))
    wanted = np.linspace(times[0], times[-1], 57)
    samples = np.stack([times**3 - 4 * times, np.where(times > 5, np.nan, 1.0)])
    result = interpolate(samples, times, wanted)
    assert result[0] == pytest.approx(wanted**3 - 4 * wanted, abs=1e-8)
    assert np.isnan(result[1]).all()
