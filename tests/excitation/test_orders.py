import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import Lines, RandomInputs, Stack, Sum, constant_speed

RATE = 1000.0


def drawn(excitation, n_samples=20_000, seed=1, start=0.0):
    return excitation.samples(n_samples, sampling_rate=RATE, generator=np.random.default_rng(seed), start=start)


def test_lines_run_at_order_times_speed() -> None:
    lines = Lines(constant_speed(12.0), (0.5,), (3.0,), (1.0, -2.0), reference_speed=6.0, speed_exponent=2.0)
    first, second = drawn(lines)
    spectrum = np.abs(np.fft.rfft(first)) / 10_000
    peak = int(np.argmax(spectrum))
    assert peak * RATE / 20_000 == pytest.approx(6.0)
    assert spectrum[peak] == pytest.approx(3.0 * 2**2)
    assert second == pytest.approx(-2 * first)


def test_sum_is_the_sum() -> None:
    parts = (RandomInputs(2), Lines(constant_speed(10.0), (1.0,), (5.0,), (1.0, 1.0)))
    generator = np.random.default_rng(1)
    expected = sum(part.samples(100, sampling_rate=RATE, generator=generator) for part in parts)
    assert np.array_equal(drawn(Sum(parts), n_samples=100), expected)
    assert not Sum(parts).is_smooth


def test_contradicting_orders_and_sums_are_refused() -> None:
    with pytest.raises(ParameterError, match="2 orders have 1 amplitudes"):
        Lines(constant_speed(1.0), (1.0, 2.0), (1.0,), (1.0,))
    with pytest.raises(ParameterError, match="parts have 1, 2 inputs"):
        Sum((RandomInputs(1), RandomInputs(2)))


def test_phases_of_lines_can_be_given() -> None:
    lines = Lines(constant_speed(10.0), (0.5, 1.0), (2.0, 1.0), (1.0,), phases=(0.3, -0.7))
    time = np.arange(500) / RATE
    expected = 2 * np.sin(2 * np.pi * 5 * time + 0.3) + np.sin(2 * np.pi * 10 * time - 0.7)
    assert drawn(lines, n_samples=500)[0] == pytest.approx(expected)
    with pytest.raises(ParameterError, match="2 orders have 1 phases"):
        Lines(constant_speed(1.0), (1.0, 2.0), (1.0, 1.0), (1.0,), phases=(0.0,))


def test_a_stack_has_the_inputs_of_all_its_parts() -> None:
    parts = (RandomInputs(2), Lines(constant_speed(10.0), (1.0,), (5.0,), (1.0,)))
    generator = np.random.default_rng(1)
    expected = [part.samples(100, sampling_rate=RATE, generator=generator) for part in parts]
    assert Stack(parts).n_inputs == 3
    assert not Stack(parts).is_smooth
    assert np.array_equal(drawn(Stack(parts), n_samples=100), np.vstack(expected))
    with pytest.raises(ParameterError, match="no parts"):
        Stack(())
