import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import RollerRig, SpeedProfile, constant_speed

RATE = 1000.0


def drawn(excitation, n_samples=20_000, seed=1, start=0.0):
    return excitation.samples(n_samples, sampling_rate=RATE, generator=np.random.default_rng(seed), start=start)


def test_driven_wheelsets_only() -> None:
    rig = RollerRig((True, False), constant_speed(1.0), random=1e-5)
    motion = drawn(rig)
    assert np.all(motion[2:] == 0)
    assert motion[:2].std(axis=1) == pytest.approx([1e-5, 1e-5], rel=0.05)


def test_joints_pulse_at_their_rate() -> None:
    rig = RollerRig((True,), constant_speed(0.9125), random=0.0, joints=4, joint=1e-3, asymmetry=0.2)
    left, right = drawn(rig, n_samples=100_000)
    times = np.flatnonzero(left) / RATE
    assert times.size == pytest.approx(365, abs=1)
    assert np.diff(times) == pytest.approx(1 / 3.65, abs=1.01 / RATE)
    assert [left.max(), right.max()] == pytest.approx([1.1e-3, 0.9e-3])


def test_harmonics_follow_the_rotation_and_grow_with_it() -> None:
    rotation = SpeedProfile(np.array([0.0, 20.0]), np.array([1.0, 3.0]))
    rig = RollerRig((True,), rotation, random=0.0, harmonics=(0.0, 1e-4), asymmetry=0.0)
    motion = drawn(rig)[0]
    crossings = np.flatnonzero(np.diff(np.signbit(motion)))
    assert crossings.size / 2 == pytest.approx(2 * rotation.distance(20.0), abs=1)
    early, late = np.abs(motion[:2000]).max(), np.abs(motion[-2000:]).max()
    assert late / early == pytest.approx(3.0 / 1.2, rel=0.05)


def test_a_rig_without_driven_wheelsets_is_refused() -> None:
    with pytest.raises(ParameterError, match="at least one driven wheelset"):
        RollerRig((False,), constant_speed(1.0))
