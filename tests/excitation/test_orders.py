from typing import Any

import numpy as np
import pytest

from sprung.excitation import Lines, RandomInputs, Stack, Sum, constant_speed

RATE = 1000.0


def test_lines_run_at_order_times_speed_with_their_phases(drawn) -> None:
    options: Any = {"reference_speed": 6.0, "speed_exponent": 2.0, "phases": (0.3, -0.7)}
    first, second = drawn(Lines(constant_speed(12.0), (0.5, 1.0), (3.0, 1.0), (1.0, -2.0), **options))
    time = np.arange(20_000) / RATE
    expected = 2**2 * (3 * np.sin(2 * np.pi * 6 * time + 0.3) + np.sin(2 * np.pi * 12 * time - 0.7))
    assert first == pytest.approx(expected)
    assert second == pytest.approx(-2 * first)


@pytest.mark.parametrize(("kind", "together", "n_inputs"), [(Sum, sum, 2), (Stack, np.vstack, 4)])
def test_parts_are_drawn_in_turn(drawn, kind, together, n_inputs) -> None:
    parts = (RandomInputs(2), Lines(constant_speed(10.0), (1.0,), (5.0,), (1.0, 1.0)))
    generator = np.random.default_rng(1)
    expected = together([part.samples(100, sampling_rate=RATE, generator=generator) for part in parts])
    assert np.array_equal(drawn(kind(parts), n_samples=100), expected)
    assert kind(parts).n_inputs == n_inputs
