import numpy as np
import pytest
from scipy import signal

from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Gap, Recording
from sprung.signals.conditioning import (
    band_pass,
    decimate,
    detrend,
    distance_travelled,
    over_distance,
    scale,
    while_moving,
    with_short_gaps_filled,
    without_missing,
)


def recorded(samples, sampling_rate=100.0, **fields):
    samples = np.atleast_2d(samples)
    return Recording(samples, sampling_rate, tuple(Channel(f"c{i}") for i in range(len(samples))), **fields)


def times(recording):
    """Time of every sample since the recording's own first, gaps included."""
    steps = np.full(recording.n_samples, 1 / recording.sampling_rate)
    steps[0] = 0
    for gap in recording.gaps:
        steps[gap.index] += gap.duration
    return np.cumsum(steps)


def tone(frequency, n_samples, sampling_rate, phase=0.3):
    return np.cos(2 * np.pi * frequency * np.arange(n_samples) / sampling_rate + phase)


# Scale and trends


def test_scale_multiplies_named_channels_and_leaves_the_others() -> None:
    recording = recorded(np.ones((2, 5)))
    assert scale(recording, {"c1": 9.81}).samples.tolist() == [[1.0] * 5, [9.81] * 5]
    assert scale(recording, -2.0).samples.tolist() == [[-2.0] * 5] * 2


def test_scale_refuses_unknown_channels_and_factors() -> None:
    with pytest.raises(ParameterError, match="no channel 'x'"):
        scale(recorded(np.ones((1, 5))), {"x": 2.0})
    with pytest.raises(ParameterError, match="must be finite"):
        scale(recorded(np.ones((1, 5))), np.inf)


def test_detrend_removes_each_stretch_its_own_line() -> None:
    t = np.arange(100.0)
    lines = np.where(t < 40, 3 - 0.5 * t, 7 + 2 * t)
    recording = recorded(lines, gaps=(Gap(40, 1.0),))
    assert np.abs(detrend(recording, degree=1).samples).max() < 1e-9
    centred = detrend(recording).samples[0]
    assert abs(centred[:40].mean()) < 1e-9
    assert centred[0] == pytest.approx(0.5 * 39 / 2)
    with pytest.raises(ParameterError, match="degree=2"):
        detrend(recording, degree=2)


# Butterworth


@pytest.mark.parametrize(
    ("low", "high", "kind"), [(2.0, None, "highpass"), (None, 8.0, "lowpass"), (2.0, 8.0, "bandpass")]
)
def test_band_pass_has_zero_phase_and_the_squared_butterworth_gain(low, high, kind) -> None:
    rate, n = 100.0, 4000
    edges = [edge for edge in (low, high) if edge is not None]
    sos = signal.butter(3, edges if len(edges) > 1 else edges[0], kind, fs=rate, output="sos")
    for frequency in (1.5, 2.0, 4.0, 8.0, 12.0):
        gain = abs(signal.sosfreqz(sos, [frequency], fs=rate)[1][0]) ** 2
        x = tone(frequency, n, rate)
        y = band_pass(recorded(x), low, high, order=3).samples[0]
        middle = slice(n // 4, -n // 4)
        assert np.abs(y[middle] - gain * x[middle]).max() < 1e-4


def test_band_pass_leaves_short_stretches_out_keeps_the_time_and_says_so() -> None:
    x = np.random.default_rng(1).standard_normal(1000)
    recording = recorded(x, start=10**18, gaps=(Gap(30, 2.0), Gap(600, 3.0)))
    filtered = band_pass(recording, 1.0, None)
    assert filtered.n_samples == 970
    assert filtered.start == 10**18 + round(2.3e9)
    assert [(gap.index, round(gap.duration, 9)) for gap in filtered.gaps] == [(570, 3.0)]
    assert "1 stretch of up to 100 samples left out" in filtered.history[-1]
    alone = band_pass(recorded(x[600:]), 1.0, None)
    np.testing.assert_array_equal(filtered.samples[:, 570:], alone.samples)


def test_band_pass_refuses_edges_and_short_recordings() -> None:
    recording = recorded(np.zeros(500))
    for low, high in ((None, None), (5.0, 2.0), (1.0, 50.0), (-1.0, 2.0)):
        with pytest.raises(ParameterError):
            band_pass(recording, low, high)
    with pytest.raises(DataError, match="stretches must exceed 1000 samples"):
        band_pass(recording, 0.1, None)


# Decimation


@pytest.mark.parametrize("new_rate", [500.0, 400.0, 373.7, 100.0, 37.0, 10.0])
def test_decimation_passes_and_stops_what_it_says(new_rate) -> None:
    rate, n = 1000.0, 60_000
    nyquist = new_rate / 2
    for part in (0.05, 0.4, 0.8):
        decimated = decimate(recorded(tone(part * nyquist, n, rate), rate), new_rate)
        assert decimated.sampling_rate == pytest.approx(new_rate, rel=1e-6)
        expected = tone(part * nyquist, decimated.n_samples, decimated.sampling_rate)
        middle = slice(decimated.n_samples // 8, -decimated.n_samples // 8)
        assert np.abs(decimated.samples[0] - expected)[middle].max() < 1e-3
    for frequency in (1.02 * nyquist, 1.5 * nyquist, 1.98 * nyquist, 2.3 * nyquist, 0.9 * rate / 2):
        if 1.0 * nyquist < frequency < rate / 2:
            stopped = decimate(recorded(tone(frequency, n, rate), rate), new_rate).samples[0]
            assert np.abs(stopped[len(stopped) // 8 : -len(stopped) // 8]).max() < 1e-4


@pytest.mark.parametrize("new_rate", [10.0, 40.0, 33.3])
def test_decimation_maps_gaps_and_keeps_the_time_of_each_stretch(new_rate) -> None:
    x = np.vstack([np.sin(np.arange(3000.0) / 50), np.arange(3000.0)])
    recording = recorded(x, start=0, gaps=(Gap(1003, 0.25), Gap(1006, 1.0), Gap(2001, 7.7)))
    decimated = decimate(recording, new_rate)
    old, new = times(recording), times(decimated)
    firsts = [stretch.start for stretch in decimated.stretches()]
    expected = [0, 1003, 1006, 2001] if new_rate > 33.4 else [0, 1006, 2001]
    np.testing.assert_allclose(new[firsts], old[expected], atol=1e-9)
    stretch = list(decimated.stretches())[-1]
    alone = decimate(recorded(x[:, 2001:]), new_rate)
    np.testing.assert_allclose(decimated.samples[:, stretch], alone.samples, atol=1e-12)


@pytest.mark.parametrize(("new_rate", "n_old"), [(50.0, 2), (40.0, 5), (20.0, 10), (97.0, 100)])
def test_decimation_does_not_depend_on_where_a_stretch_begins(new_rate, n_old) -> None:
    samples = np.random.default_rng(1).standard_normal((2, 4000))
    whole = decimate(recorded(samples), new_rate).samples
    for n_periods in (1, 7, 12):
        later = decimate(recorded(samples[:, n_periods * n_old :]), new_rate).samples
        shifted = whole[:, whole.shape[1] - later.shape[1] :]
        inner = slice(200, -200)
        assert np.abs(later - shifted)[:, inner].max() < 1e-13


def test_decimation_refuses_to_raise_the_rate_and_missing_values() -> None:
    with pytest.raises(ParameterError, match="sampling_rate=200 must be above 0 and at most 100"):
        decimate(recorded(np.zeros(100)), 200.0)
    with pytest.raises(ParameterError, match="decimate in steps"):
        decimate(recorded(np.zeros(100)), 1e-4)
    with pytest.raises(DataError, match="every stretch is shorter"):
        decimate(recorded(np.zeros(5)), 10.0)
    with pytest.raises(DataError, match="channel 'c0' has 1 missing values"):
        decimate(recorded([0.0, np.nan, 1.0]), 50.0)


def test_decimation_to_the_same_rate_changes_nothing() -> None:
    x = np.random.default_rng(2).standard_normal((2, 100))
    np.testing.assert_array_equal(decimate(recorded(x), 100.0).samples, x)


# Missing values


def test_missing_values_become_gaps_of_the_time_they_took() -> None:
    x = np.vstack([np.arange(10.0), np.arange(10.0)])
    x[0, [0, 4]] = np.nan
    x[1, [4, 5]] = np.nan
    recording = recorded(x, start=0, gaps=(Gap(8, 0.5),))
    complete = without_missing(recording)
    assert complete.samples[0].tolist() == [1, 2, 3, 6, 7, 8, 9]
    assert complete.start == 10_000_000
    assert [(gap.index, round(gap.duration, 12)) for gap in complete.gaps] == [(3, 0.02), (5, 0.5)]
    assert without_missing(complete) is complete


def test_a_recording_without_one_complete_sample_is_refused() -> None:
    with pytest.raises(DataError, match="no sample has a value in every channel"):
        without_missing(recorded(np.full((1, 4), np.nan)))


# Over distance


def driven(v, x, sampling_rate=100.0, **fields):
    channels = (Channel("x"), Channel("v", "speed"))
    return Recording(np.vstack([x, v]), sampling_rate, channels, **fields)


def test_a_line_proportional_to_speed_becomes_a_tone_over_distance() -> None:
    t = np.arange(12_000) / 100
    v = 10 + 5 * np.sin(0.2 * t)
    metres = 10 * t + 25 * (1 - np.cos(0.2 * t))
    along = over_distance(driven(v, np.cos(2 * np.pi * 0.5 * metres)), "v", interval=0.25)
    assert along.sampling_rate == 4.0
    expected = np.cos(2 * np.pi * 0.5 * np.arange(along.n_samples) / 4)
    assert np.abs(along.samples[0] - expected)[100:-100].max() < 3e-3
    assert along.n_samples == pytest.approx(4 * metres[-1], abs=2)


def test_resampling_over_distance_aliases_nothing() -> None:
    t = np.arange(12_000) / 100
    v = np.full(t.size, 5.0)
    along = over_distance(driven(v, np.cos(2 * np.pi * 30 * t)), "v", interval=0.25)
    assert np.abs(along.samples[0])[100:-100].max() < 1e-3


def test_standing_parts_are_left_out_and_their_distance_is_the_gap() -> None:
    v = np.concatenate([np.full(500, 10.0), np.full(300, 1.0), np.full(500, 10.0)])
    recording = driven(v, np.arange(1300.0), start=0)
    moving = while_moving(recording, "v")
    assert [(gap.index, round(gap.duration, 9)) for gap in moving.gaps] == [(500, 3.0)]
    along = over_distance(recording, "v", interval=0.5)
    assert along.start is None
    (gap,) = along.gaps
    assert gap.index / along.sampling_rate + gap.duration == pytest.approx(distance_travelled(recording, "v")[800])
    with pytest.raises(DataError, match="no part reaches 20 m/s"):
        over_distance(recording, "v", interval=0.5, minimum_speed=20.0)


def test_distance_goes_on_across_a_gap() -> None:
    recording = driven(np.full(100, 10.0), np.zeros(100), gaps=(Gap(50, 2.0),))
    assert distance_travelled(recording, "v")[-1] == pytest.approx(9.9 + 20.0)
    moving = while_moving(recording, "v")
    assert [(gap.index, round(gap.duration, 9)) for gap in moving.gaps] == [(50, 2.0)]


def autoregressive(seed=1):
    """x_k = 1.6 x_(k-1) - 0.8 x_(k-2) + e_k, and where every 200th sample is missing."""
    values = signal.lfilter([1.0], [1.0, -1.6, 0.8], np.random.default_rng(seed).standard_normal(40_000))
    return values, np.arange(200, 39_900, 200)


def test_a_missing_sample_is_filled_as_its_neighbours_predict_it() -> None:
    """Variance of the error of one sample between all others: 1 / (1 + 1.6^2 + 0.8^2) of the residuals'."""
    values, missing = autoregressive()
    holed = values.copy()
    holed[missing] = np.nan
    filled = with_short_gaps_filled(recorded(holed), ["c0"])
    error = filled.samples[0] - values
    assert np.array_equal(np.flatnonzero(error), missing)
    assert np.var(error[missing]) == pytest.approx(1 / 4.2, rel=0.25)
    assert filled.samples[0, 500] == values[500]
    assert "199 gaps of channels filled" in str(filled.history[-1])


@pytest.mark.parametrize(
    "runs", [[slice(1000, 1010)], [slice(k, k + 4) for k in range(100, 39_900, 300)], [slice(0, 3)]]
)
def test_gaps_that_are_long_many_or_at_an_end_are_not_filled(runs) -> None:
    """0.1 s at 100 Hz; 1.3 % of the time; no sample before it."""
    values, _ = autoregressive()
    for run in runs:
        values[run] = np.nan
    assert with_short_gaps_filled(recorded(values), ["c0"]).samples == pytest.approx(values[None], nan_ok=True)
