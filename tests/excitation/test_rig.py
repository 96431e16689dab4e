import numpy as np
import pytest

from sprung.excitation import QUARTER_CASES, BaseMotion, RollerRig, SpeedProfile, constant_speed, pulse_indices

RATE = 1000.0


def test_driven_wheelsets_only(drawn) -> None:
    rig = RollerRig((True, False), constant_speed(1.0), random=1e-5)
    motion = drawn(rig)
    assert np.all(motion[2:] == 0)
    assert motion[:2].std(axis=1) == pytest.approx([1e-5, 1e-5], rel=0.05)


def test_joints_pulse_at_their_rate(drawn) -> None:
    rig = RollerRig((True,), constant_speed(0.9125), random=0.0, joints=4, joint=1e-3, asymmetry=0.2)
    left, right = drawn(rig, n_samples=100_000)
    times = np.flatnonzero(left) / RATE
    assert times.size == pytest.approx(365, abs=1)
    assert np.diff(times) == pytest.approx(1 / 3.65, abs=1.01 / RATE)
    assert [left.max(), right.max()] == pytest.approx([1.1e-3, 0.9e-3])


def test_harmonics_follow_the_rotation_and_grow_with_it(drawn) -> None:
    rotation = SpeedProfile(np.array([0.0, 20.0]), np.array([1.0, 3.0]))
    rig = RollerRig((True,), rotation, random=0.0, harmonics=(0.0, 1e-4), asymmetry=0.0)
    motion = drawn(rig)[0]
    crossings = np.flatnonzero(np.diff(np.signbit(motion)))
    assert crossings.size / 2 == pytest.approx(2 * rotation.distance(20.0), abs=1)
    early, late = np.abs(motion[:2000]).max(), np.abs(motion[-2000:]).max()
    assert late / early == pytest.approx(3.0 / 1.2, rel=0.05)


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


def test_pulses_fall_on_the_nearest_samples() -> None:
    assert pulse_indices(1000, 3.65 / 1000.0).tolist() == [0, 274, 548, 822]
    assert pulse_indices(10, 0.25, first=-6).tolist() == [2, 6]
    assert len(pulse_indices(60_000, 3.65 / 1000.0)) == 219
    assert pulse_indices(0, 0.1).tolist() == []


def test_quarter_cases_are_those_of_the_thesis() -> None:
    assert [case.pulse for case in QUARTER_CASES] == [0.0, 5e-3, 5e-3, 5e-3]
    assert [len(case.frequencies) for case in QUARTER_CASES] == [0, 0, 1, 2]
    assert {case.random for case in QUARTER_CASES} == {1e-4}
