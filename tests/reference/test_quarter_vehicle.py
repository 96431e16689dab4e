"""The quarter vehicle of F. Liu (2020), section 5.3: four excitations, with and without cepstrum editing.

Ten records of 60 s at 1000 Hz, acceleration of the body alone. True modes: 13.21 Hz at 13.10 %, 56.35 Hz at 6.33 %;
frequencies are compared with the exact ones of the vehicle, of which these are the printed digits.
"""

import functools

import numpy as np
import pytest

from sprung.excitation import QUARTER_CASES
from sprung.identification import IdentificationSettings, coss_ssi, cov_ssi
from sprung.signals.spectrum import Exponential, ShortPass
from sprung.simulation import simulate
from sprung.vehicles import read_description, structure

FREQUENCIES = structure(read_description("quarter")).modes().natural_frequency
RATIOS = [0.1310, 0.0633]
PULSES, TONE = 3.65, 17.0


@functools.cache
def records(case):
    """Return the body's acceleration in the ten records of a case, 1 to 4."""
    vehicle = structure(read_description("quarter"))
    return [
        simulate(vehicle, QUARTER_CASES[case - 1], duration=60.0, sampling_rate=1000.0, seed=seed).select(["acc_body"])
        for seed in range(10)
    ]


def is_true_mode(modes):
    """Whether each mode lies within 5 % of a true one."""
    return np.abs(modes.natural_frequency[:, None] / FREQUENCIES - 1).min(axis=1) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("case", [1, 2, 3, 4])
def test_edited_records_give_the_true_modes_and_no_other(case) -> None:
    settings = IdentificationSettings(lifter=ShortPass(0.25), block_rows=80)
    modes = coss_ssi(records(case), settings=settings).modes
    assert modes.natural_frequency == pytest.approx(FREQUENCIES, rel=0.005)
    assert modes.damping_ratio == pytest.approx(RATIOS, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", [1, 2])
def test_raw_records_with_noise_and_pulses_give_the_true_modes(case) -> None:
    modes = coss_ssi(records(case)).modes
    assert modes.natural_frequency == pytest.approx(FREQUENCIES, rel=0.005)
    assert modes.damping_ratio == pytest.approx(RATIOS, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", [3, 4])
def test_raw_records_with_tones_give_no_false_mode(case) -> None:
    """The thesis finds false modes at 3.56 and 17.37 Hz, and in case 4 loses the mode at 13.21 Hz, as this does."""
    modes = coss_ssi(records(case)).modes
    assert np.all(is_true_mode(modes))
    assert modes.natural_frequency[-1] == pytest.approx(FREQUENCIES[1], rel=0.005)
    assert modes.damping_ratio[-1] == pytest.approx(RATIOS[1], rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", [2, 3, 4])
def test_pulses_and_tones_are_named_harmonics(case) -> None:
    lines = cov_ssi(records(case)).harmonics
    pulses = [line for line in lines if line.fundamental == pytest.approx(PULSES, rel=1e-3)]
    assert len(pulses) > 30
    assert all(line.frequency == pytest.approx(line.order * PULSES, abs=0.05) for line in pulses)
    tones = [line.frequency for line in lines if line not in pulses]
    assert tones == ([pytest.approx(TONE, abs=0.02)] if case == 4 else [])


@pytest.mark.slow
def test_random_records_have_no_harmonics() -> None:
    assert cov_ssi(records(1)).harmonics == ()


@pytest.mark.slow
def test_damping_of_an_exponential_lifter_is_subtracted() -> None:
    # exp(-q / 0.25 s) adds 4 rad/s to every pole: 4.8 % of damping at 13.21 Hz.
    settings = IdentificationSettings(lifter=Exponential(0.25))
    modes = cov_ssi(records(1), settings=settings).modes
    assert modes.natural_frequency == pytest.approx(FREQUENCIES, rel=0.02)
    assert modes.damping_ratio == pytest.approx(RATIOS, rel=0.1)
