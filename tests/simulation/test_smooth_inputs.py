import numpy as np
import pytest

from sprung.excitation import Lines, constant_speed
from sprung.simulation import response, simulate, with_linear_inputs, with_rises
from sprung.vehicles import frequency_response, read_description, read_vehicle, structure


def test_a_ramp_is_exact_at_any_rate():
    """Response to y = v t: the same at the common instants for two rates, to rounding."""
    quarter = structure(read_description("quarter"))
    found = []
    for rate in (100.0, 400.0):
        inputs = 0.3 * np.arange(round(rate)) / rate
        discrete = with_linear_inputs(quarter.state_space(), sampling_rate=rate)
        found.append(response(discrete, with_rises(inputs[None]))[0, :: round(rate / 100)])
    assert found[0] == pytest.approx(found[1], rel=1e-9, abs=1e-10)


def test_a_sine_comes_out_with_gain_and_phase_of_the_frequency_response():
    """No delay of half a sample: phase within 1e-4 rad at 3 Hz and 200 Hz sampling."""
    car = structure(read_vehicle("zafira"))
    motion = Lines(constant_speed(10.0), (0.3,), (0.01,), (1.0, 1.0, 1.0, 1.0))
    found = simulate(car, motion, duration=20.0, sampling_rate=200.0, seed=1)
    generator = np.random.default_rng(1)
    phase = generator.uniform(0, 2 * np.pi)
    time = np.arange(found.n_samples) / 200.0
    gain = frequency_response(car, [3.0])[0].sum(axis=1)
    expected = 0.01 * (gain[:, None] * np.exp(1j * (2 * np.pi * 3 * time + phase))).imag
    inside = slice(200, -200)
    assert found.samples[:, inside] == pytest.approx(expected[:, inside], abs=1e-4 * np.abs(expected).max())
