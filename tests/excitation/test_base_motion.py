import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import QUARTER_CASES, BaseMotion, pulse_indices


def test_base_motion_is_the_printed_sum() -> None:
    """Eqs 5-5 to 5-8, written out sample by sample."""
    motion = BaseMotion(random=0.0, harmonic=0.5, frequencies=(3.65, 17.0), phases=(0.3, -1.0), pulse=7.0)
    found = motion.samples(2000, sampling_rate=1000.0, generator=np.random.default_rng(0))[0]
    for sample in range(2000):
        t = sample / 1000.0
        expected = 0.5 * (np.sin(2 * np.pi * 3.65 * t + 0.3) + np.sin(2 * np.pi * 17.0 * t - 1.0))
        nearest = round(t * 3.65) / 3.65
        expected += 7.0 * (round(nearest * 1000) == sample)
        assert found[sample] == pytest.approx(expected, abs=1e-12)


def test_base_motion_continues_from_any_start() -> None:
    motion = QUARTER_CASES[3]
    settings = {"sampling_rate": 1000.0}
    quiet = BaseMotion(0.0, motion.harmonic, motion.frequencies, motion.phases, motion.pulse, motion.pulse_frequency)
    whole = quiet.samples(3000, generator=np.random.default_rng(0), start=-1.0, **settings)
    later = quiet.samples(2000, generator=np.random.default_rng(0), start=0.0, **settings)
    np.testing.assert_array_equal(whole[:, 1000:], later)
    assert later[0, 0] == pytest.approx(1e-4 * (np.sin(np.pi / 3) + np.sin(np.pi / 4)) + 5e-3)


def test_pulses_fall_on_the_nearest_samples() -> None:
    assert pulse_indices(1000, 3.65 / 1000.0).tolist() == [0, 274, 548, 822]
    assert pulse_indices(10, 0.25, first=-6).tolist() == [2, 6]
    assert len(pulse_indices(60_000, 3.65 / 1000.0)) == 219
    assert pulse_indices(0, 0.1).tolist() == []


def test_quarter_cases_are_those_of_the_thesis() -> None:
    assert [case.pulse for case in QUARTER_CASES] == [0.0, 5e-3, 5e-3, 5e-3]
    assert [len(case.frequencies) for case in QUARTER_CASES] == [0, 0, 1, 2]
    assert {case.random for case in QUARTER_CASES} == {1e-4}


def test_contradicting_base_motion_is_refused() -> None:
    with pytest.raises(ParameterError, match="2 frequencies have 1 phases: give one phase for each"):
        BaseMotion(frequencies=(1.0, 2.0), phases=(0.0,))
    with pytest.raises(ParameterError, match="pulse_frequency=0 must be above 0"):
        BaseMotion(pulse_frequency=0.0)
    with pytest.raises(ParameterError, match="random=-1 must be at least 0"):
        BaseMotion(random=-1.0)
