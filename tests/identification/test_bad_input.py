"""One clear sentence for each input that cannot be identified from."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.identification import METHODS, IdentificationSettings
from sprung.recording import Channel, Recording
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

CHAIN = chain()


def run(seed=1, *, snr=10.0, band=None, duration=60.0, sampling_rate=500.0, vehicle=CHAIN):
    excitation = usual_excitation(vehicle)
    return simulate(
        vehicle, excitation, duration=duration, sampling_rate=sampling_rate, seed=seed, snr=snr, noise_band=band
    )


def recorded(samples, sampling_rate=500.0):
    samples = np.atleast_2d(samples)
    channels = tuple(Channel(f"acc_{k}", "acceleration") for k in range(1, len(samples) + 1))
    return Recording(samples, sampling_rate, channels)


def broken(row, value):
    samples = run().samples.copy()
    samples[row] = value
    return recorded(samples)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("record", "settings", "error", "sentence"),
    [
        (
            lambda: broken(2, 3.0),
            {},
            DataError,
            "channel 'acc_3' is constant at 3: leave it out with --channels acc_1,acc_2",
        ),
        (
            lambda: broken(0, np.nan),
            {},
            DataError,
            "channel 'acc_1' has no values: leave it out with --channels acc_2,acc_3",
        ),
        (
            lambda: recorded(np.ones((2, 1))),
            {},
            DataError,
            "the recording has 1 sample(s): record at least a minute",
        ),
        (
            lambda: recorded(np.zeros((2, 0))),
            {},
            DataError,
            "the recording has 0 sample(s): record at least a minute",
        ),
        (
            lambda: recorded(np.zeros((0, 9))),
            {},
            DataError,
            "the recording has no channel of motion: give accelerations or angular velocities",
        ),
        (list, {}, DataError, "there is no recording to identify modes from: give at least one"),
        (
            lambda: iter([]),
            {},
            DataError,
            "there is no recording to identify modes from: give at least one",
        ),
        (
            lambda: recorded(np.random.default_rng(0).normal(size=(2, 100))),
            {},
            DataError,
            "the longest stretch without a gap has 100 samples at 500 Hz, but identification needs 200 or more:"
            " record longer, or decimate less",
        ),
        (
            run,
            {"block_rows": 5000, "decimate_to": 125.0},
            DataError,
            "block_rows=5000 needs 10000 lags, but the longest stretch without a gap has 7500 samples at 125 Hz:"
            " record longer or use block_rows <= 3750",
        ),
        (
            run,
            {"block_rows": 40, "max_order": 400},
            ParameterError,
            "max_order=400 is more than block_rows=40 can carry with 3 channels and 3 references:"
            " use max_order <= 117 or more block rows",
        ),
        (
            lambda: [run(), run(2, sampling_rate=100.0)],
            {"decimate_to": 125.0},
            ParameterError,
            "sampling rates 125 Hz and 100 Hz differ: bring the records to one rate first (--decimate-to)",
        ),
        (
            run,
            {"references": ("acc_9",)},
            ParameterError,
            "there is no channel 'acc_9': the recording has acc_1, acc_2, acc_3",
        ),
        (
            lambda: [run(), run(2).select(["acc_1", "acc_2"])],
            {},
            ParameterError,
            "there is no channel 'acc_3': the recording has acc_1, acc_2",
        ),
        (
            lambda: run().select(["acc_1"]),
            {"has_disjoint_references": True},
            ParameterError,
            "disjoint outputs and references need at least two channels",
        ),
    ],
)
def test_bad_input_gets_one_clear_sentence(method, record, settings, error, sentence):
    with pytest.raises(error) as refusal:
        METHODS[method](record(), settings=IdentificationSettings(**settings))
    assert str(refusal.value) == sentence


def test_records_of_one_logger_by_slightly_different_clocks_are_one_condition():
    masses = chain()
    runs = [simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=500.0, seed=k) for k in range(2)]
    late = replace(runs[1], sampling_rate=500.0 * 1.0002)
    for settings in (IdentificationSettings(), IdentificationSettings(decimate_to=100.0)):
        modes = METHODS["cov"]([runs[0], late], settings=settings).modes
        assert modes.natural_frequency == pytest.approx([7.01, 19.65, 28.39], rel=0.01)
