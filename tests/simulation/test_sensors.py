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
    noisy,
    quantised,
    scaled,
    simulate,
    spiking,
    stuck,
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


#: Imperfections of channel "a", and the line that each adds to the history.
IMPERFECTIONS = {
    "a: clipped at +-0.7": partial(clipped, channel="a", limit=0.7),
    "a: dead from 10 s on": partial(dead, channel="a", onset=10.0),
    "a: stuck from 10 s on": partial(stuck, channel="a", onset=10.0),
    "a: delayed by 0.0123 s": partial(delayed, channel="a", delay=0.0123),
    "a: drift 2 per hour": partial(drifting, channel="a", per_hour=2.0),
    "a: updated at 4 Hz, 0.3 s late": partial(held, channel="a", rate=4.0, delay=0.3),
    "a: inverted": partial(inverted, channel="a"),
    "a: gain 0.5": partial(scaled, channel="a", factor=0.5),
    "a: 2 spikes per second": partial(spiking, channel="a", rate=2.0, height=30.0),
    "a: hum of 50 Hz": partial(with_hum, channel="a", amplitude=0.2),
    "added noise of 0.1": partial(noisy, channel="a", standard_deviation=0.1),
}


@pytest.mark.parametrize("line", IMPERFECTIONS)
def test_an_imperfection_changes_its_channel_alone_and_is_in_the_history(run, line) -> None:
    found = with_imperfections(run, [IMPERFECTIONS[line]])
    assert found.history == (line,)
    assert not np.array_equal(found.samples[0], run.samples[0])
    assert np.array_equal(found.samples[1:], run.samples[1:])
    with pytest.raises(ParameterError, match="there is no channel 'c'"):
        with_imperfections(run, [partial(IMPERFECTIONS[line], channel="c")])


@pytest.mark.parametrize(
    ("imperfection", "message"),
    [
        (partial(quantised, full_scale=1.0, bits=40), "bits=40 must be"),
        (partial(held, channel="speed", rate=0.0), "rate of updates=0 must be above 0"),
    ],
)
def test_impossible_imperfections_are_refused(run, imperfection, message) -> None:
    with pytest.raises(ParameterError, match=message):
        imperfection(run)


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
