from functools import partial

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import RandomInputs
from sprung.recording import Channel, Recording
from sprung.simulation import (
    clipped,
    dead,
    delayed,
    drifting,
    held,
    inverted,
    jittered,
    mems_accelerometers,
    noisy,
    quantised,
    scaled,
    simulate,
    spiking,
    stuck,
    swapped,
    with_gap,
    with_hum,
    with_imperfections,
    with_noise,
)
from sprung.vehicles import chain

RATE = 200.0
N = 20_000
TIME = np.arange(N) / RATE


@pytest.fixture
def run():
    samples = np.stack([np.sin(2 * np.pi * 1.3 * TIME), np.cos(2 * np.pi * 2.9 * TIME), 10 + 0 * TIME])
    channels = (Channel("a", "acceleration"), Channel("b", "acceleration"), Channel("speed", "speed"))
    return Recording(samples, RATE, channels)


def random():
    return np.random.default_rng(1)


def test_quantisation_error_has_the_variance_of_a_step(run) -> None:
    found = quantised(run, full_scale=2.0, bits=10)
    error = found.samples[:2] - run.samples[:2]
    step = 4.0 / 1024
    assert error.var(axis=1) == pytest.approx(step**2 / 12, rel=0.05)
    assert np.allclose(found.samples[:2] / step, np.rint(found.samples[:2] / step))
    assert np.array_equal(found.samples[2], run.samples[2])  # no acceleration


def test_quantisation_clips_at_full_scale(run) -> None:
    found = quantised(run, full_scale=0.5, bits=8)
    assert [found.samples[0].min(), found.samples[0].max()] == pytest.approx([-0.5, 0.5 - 1 / 256])


def test_noise_has_its_size_on_its_channels(run) -> None:
    found = noisy(run, standard_deviation=0.1, generator=random()).samples - run.samples
    assert found.std(axis=1) == pytest.approx([0.1, 0.1, 0], rel=0.03)
    assert abs(np.corrcoef(found[:2])[0, 1]) < 0.03
    one = noisy(run, standard_deviation=0.1, channel="b", band=(1.0, 20.0), generator=random()).samples - run.samples
    assert one.std(axis=1) == pytest.approx([0, 0.1, 0], rel=0.1)


def test_delay_moves_one_channel_by_a_fraction_of_a_sample(run) -> None:
    found = delayed(run, channel="a", delay=0.0123).samples
    inside = slice(400, -400)
    assert found[0][inside] == pytest.approx(np.sin(2 * np.pi * 1.3 * (TIME - 0.0123))[inside], abs=2e-4)
    assert np.array_equal(found[1], run.samples[1])


def test_drift_after_an_hour(run) -> None:
    ends = [
        drifting(run, channel="a", per_hour=2.0, generator=np.random.default_rng(seed)).samples[0, -1]
        - run.samples[0, -1]
        for seed in range(200)
    ]
    assert np.std(ends) == pytest.approx(2.0 * np.sqrt(N / RATE / 3600), rel=0.15)


def test_jitter_is_the_slope_times_the_error_in_time(run) -> None:
    error = jittered(run, standard_deviation=1e-4, generator=random()).samples[0] - run.samples[0]
    assert error.std() == pytest.approx(1e-4 * 2 * np.pi * 1.3 / np.sqrt(2), rel=0.05)


def test_hum_has_its_frequency_and_amplitude(run) -> None:
    error = with_hum(run, channel="a", amplitude=0.2, generator=random()).samples[0] - run.samples[0]
    spectrum = np.abs(np.fft.rfft(error)) * 2 / N
    assert np.argmax(spectrum) * RATE / N == pytest.approx(50.0)
    assert spectrum.max() == pytest.approx(0.2)


def test_channels_fail_from_their_onset_on(run) -> None:
    for fail, value in ((dead, 0.0), (stuck, run.samples[0, 1999])):
        found = fail(run, channel="a", onset=10.0).samples
        assert np.array_equal(found[0, :2000], run.samples[0, :2000])
        assert np.all(found[0, 2000:] == value)
        assert np.array_equal(found[1:], run.samples[1:])


def test_signs_gains_and_cables(run) -> None:
    found = swapped(scaled(inverted(run, channel="a"), channel="b", factor=0.5), first="a", second="b").samples
    assert np.array_equal(found[0], 0.5 * run.samples[1])
    assert np.array_equal(found[1], -run.samples[0])


def test_clipping_and_spikes(run) -> None:
    assert np.abs(clipped(run, channel="a", limit=0.7).samples[0]).max() == 0.7
    error = spiking(run, channel="b", rate=2.0, height=30.0, generator=random()).samples[1] - run.samples[1]
    assert np.count_nonzero(error) == pytest.approx(200, abs=50)
    assert np.unique(np.abs(error[error != 0]).round(9)).tolist() == [30.0]


def test_gap_takes_the_samples_out_and_is_marked(run) -> None:
    found = with_gap(run, onset=20.0, duration=3.0)
    assert found.n_samples == N - 600
    assert (found.gaps[0].index, found.gaps[0].duration) == (4000, pytest.approx(3.0))
    assert np.array_equal(found.samples[:, 4000:], run.samples[:, 4600:])


def test_every_step_is_in_the_history(run) -> None:
    steps = [partial(inverted, channel="a"), partial(dead, channel="b", onset=3.0), partial(quantised, full_scale=2.0)]
    found = with_imperfections(run, steps)
    assert found.history == ("a: inverted", "b: dead from 3 s on", "quantised to 16 bits of +-2")


def test_what_does_not_fit_is_refused(run) -> None:
    with pytest.raises(ParameterError, match="there is no channel 'c'"):
        inverted(run, channel="c")
    with pytest.raises(ParameterError, match="must lie inside the recording"):
        with_gap(run, onset=99.0, duration=5.0)
    with pytest.raises(ParameterError, match="bits=40 must be"):
        quantised(run, full_scale=1.0, bits=40)


def test_random_imperfections_draw_from_one_generator_in_their_order(run) -> None:
    steps = [
        partial(noisy, standard_deviation=0.1),
        partial(inverted, channel="a"),
        partial(spiking, channel="b", rate=1.0, height=9.0),
    ]
    generator = np.random.default_rng(7)
    by_hand = noisy(run, standard_deviation=0.1, generator=generator)
    by_hand = spiking(inverted(by_hand, channel="a"), channel="b", rate=1.0, height=9.0, generator=generator)
    assert np.array_equal(with_imperfections(run, steps, seed=7).samples, by_hand.samples)


@pytest.mark.parametrize("snr", [10.0, 0.5])
@pytest.mark.parametrize("band", [None, (0.5, 50.0)])
def test_noise_has_the_amplitude_ratio(snr, band) -> None:
    clean = simulate(chain(), RandomInputs(3), duration=20.0, sampling_rate=500.0)
    noisy = with_noise(clean, snr=snr, generator=np.random.default_rng(1), band=band)
    added = noisy.samples - clean.samples
    ratio = np.sqrt(np.mean(clean.samples**2, axis=1) / np.mean(added**2, axis=1))
    assert ratio == pytest.approx([snr] * 3, rel=1e-12)
    assert np.abs(np.corrcoef(added) - np.eye(3)).max() < (0.06 if band is None else 0.15)
    spectrum = np.abs(np.fft.rfft(added, axis=1)) ** 2
    inside = spectrum[:, : 60 * 20].sum() / spectrum.sum()
    assert inside == pytest.approx(0.24 if band is None else 0.97, abs=0.02)
    assert noisy.history[-1].endswith(f"at SNR {snr:g}")


def test_noise_keeps_gaps_missing_values_and_silence() -> None:
    samples = np.vstack([np.sin(np.arange(100.0)), np.zeros(100)])
    samples[0, 7] = np.nan
    clean = Recording(samples, 10.0, (Channel("a"), Channel("b")))
    noisy = with_noise(clean, snr=1.0, generator=np.random.default_rng(0))
    assert np.flatnonzero(np.isnan(noisy.samples[0])).tolist() == [7]
    np.testing.assert_array_equal(noisy.samples[1], 0.0)


def test_mems_accelerometers_have_their_noise_and_steps(run):
    """White noise of density d has d^2 half the sampling rate; 12 bits of +-2 g have steps of 4 g / 4096."""
    noise, resolution = mems_accelerometers(noise_density=2e-3, full_scale=2 * 9.81, bits=12)
    added = with_imperfections(run, [noise], seed=1).samples - run.samples
    assert added[:2].std(axis=1) == pytest.approx(2e-3 * np.sqrt(RATE / 2), rel=0.03)
    assert np.array_equal(added[2], np.zeros(N))
    steps = with_imperfections(run, [resolution]).samples[:2] / (4 * 9.81 / 4096)
    assert np.allclose(steps, np.rint(steps))


def test_a_channel_is_held_between_late_updates(run):
    ramp = run.changed("ramp", samples=np.stack([TIME, TIME, TIME]))
    values = held(ramp, channel="speed", rate=4.0, delay=0.3).samples
    assert np.array_equal(values[:2], ramp.samples[:2])
    updates = (np.arange(N) // 50) * 0.25  # 50 samples at 200 Hz are a quarter of a second
    assert values[2] == pytest.approx(np.maximum(updates - 0.3, 0))
    assert (ramp.samples[2] - values[2])[1000:].mean() == pytest.approx(0.3 + 1 / 8, abs=0.5 / RATE + 1e-9)
    with pytest.raises(ParameterError, match="rate of updates=0 must be above 0"):
        held(run, channel="speed", rate=0.0)
