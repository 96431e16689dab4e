import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import HammerBlows, Lines, RandomInputs, RollerRig, SpeedProfile, Sum, constant_speed
from sprung.excitation.hammer import corner_weights

RATE = 1000.0


def drawn(excitation, n_samples=20_000, seed=1, start=0.0):
    return excitation.samples(n_samples, sampling_rate=RATE, generator=np.random.default_rng(seed), start=start)


def test_corner_weights_keep_force_and_moments():
    x, y = np.array([2.0, 2.0, -3.0, -3.0]), np.array([1.0, -1.0, 1.0, -1.0])
    for forward, left in np.random.default_rng(1).uniform(size=(20, 2)):
        weights = corner_weights(forward, left)
        assert [weights.sum(), weights @ x, weights @ y] == pytest.approx([1, -3 + 5 * forward, -1 + 2 * left])


def test_blows_have_their_rate_strength_and_impulse():
    blows = HammerBlows(rate=2.0, strength=(5.0, 5.0), duration=0.02)
    force = drawn(blows, n_samples=500_000).sum(axis=0)
    impulse = 5.0 * 2 / np.pi * 0.02  # integral of a half sine
    assert -force.sum() / RATE / impulse == pytest.approx(1000, abs=130)  # 500 s, two a second
    assert force.min() < -4.9
    assert force.max() <= 0


def test_driven_wheelsets_only():
    rig = RollerRig((True, False), constant_speed(1.0), random=1e-5)
    motion = drawn(rig)
    assert np.all(motion[2:] == 0)
    assert motion[:2].std(axis=1) == pytest.approx([1e-5, 1e-5], rel=0.05)


def test_joints_pulse_at_their_rate():
    rig = RollerRig((True,), constant_speed(0.9125), random=0.0, joints=4, joint=1e-3, asymmetry=0.2)
    left, right = drawn(rig, n_samples=100_000)
    times = np.flatnonzero(left) / RATE
    assert times.size == pytest.approx(365, abs=1)
    assert np.diff(times) == pytest.approx(1 / 3.65, abs=1.01 / RATE)
    assert [left.max(), right.max()] == pytest.approx([1.1e-3, 0.9e-3])


def test_harmonics_follow_the_rotation_and_grow_with_it():
    rotation = SpeedProfile([0.0, 20.0], [1.0, 3.0])
    rig = RollerRig((True,), rotation, random=0.0, harmonics=(0.0, 1e-4), asymmetry=0.0)
    motion = drawn(rig)[0]
    crossings = np.flatnonzero(np.diff(np.signbit(motion)))
    assert crossings.size / 2 == pytest.approx(2 * rotation.distance(20.0), abs=1)
    early, late = np.abs(motion[:2000]).max(), np.abs(motion[-2000:]).max()
    assert late / early == pytest.approx(3.0 / 1.2, rel=0.05)


def test_lines_run_at_order_times_speed():
    lines = Lines(constant_speed(12.0), (0.5,), (3.0,), (1.0, -2.0), reference_speed=6.0, speed_exponent=2.0)
    first, second = drawn(lines)
    spectrum = np.abs(np.fft.rfft(first)) / 10_000
    peak = int(np.argmax(spectrum))
    assert peak * RATE / 20_000 == pytest.approx(6.0)
    assert spectrum[peak] == pytest.approx(3.0 * 2**2)
    assert second == pytest.approx(-2 * first)


def test_sum_is_the_sum():
    parts = (RandomInputs(2), Lines(constant_speed(10.0), (1.0,), (5.0,), (1.0, 1.0)))
    generator = np.random.default_rng(1)
    expected = sum(part.samples(100, sampling_rate=RATE, generator=generator) for part in parts)
    assert np.array_equal(drawn(Sum(parts), n_samples=100), expected)
    assert not Sum(parts).is_smooth


def test_what_does_not_fit_is_refused():
    with pytest.raises(ParameterError, match="at least one"):
        RollerRig((False,), constant_speed(1.0))
    with pytest.raises(ParameterError, match="2 orders have 1 amplitudes"):
        Lines(constant_speed(1.0), (1.0, 2.0), (1.0,), (1.0,))
    with pytest.raises(ParameterError, match="parts have 1, 2 inputs"):
        Sum((RandomInputs(1), RandomInputs(2)))
