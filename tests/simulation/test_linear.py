"""Responses against closed forms, a plain loop and the exact covariances."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import QUARTER_CASES, BaseMotion, Lines, RandomInputs, constant_speed
from sprung.recording import Channel
from sprung.simulation import (
    response,
    simulate,
    simulate_nonlinear,
    usual_excitation,
    with_derivatives,
    with_polynomial_inputs,
)
from sprung.vehicles import (
    chain,
    exact_correlations,
    frequency_response,
    parse_vehicle,
    read_description,
    read_vehicle,
    structure,
)

RATES = {"chain3": 500.0, "quarter": 1000.0, "zafira": 200.0, "scale-bogie": 1500.0}


def looped(discrete, inputs):
    """The recursion x[k+1] = A x + B u, y = C x + D u, one sample after the other."""
    state, outputs = np.zeros(len(discrete.state_matrix)), []
    for sample in inputs.T:
        outputs.append(discrete.output_matrix @ state + discrete.feedthrough @ sample)
        state = discrete.state_matrix @ state + discrete.input_matrix @ sample
    return np.array(outputs).T


@pytest.mark.parametrize("name", RATES)
def test_response_agrees_with_the_plain_recursion(name) -> None:
    """Over more samples than are computed together."""
    discrete = structure(read_description(name)).discretised(RATES[name])
    inputs = np.random.default_rng(3).standard_normal((discrete.input_matrix.shape[1], 5000))
    expected = looped(discrete, inputs)
    assert response(discrete, inputs) == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("damping", [0.0, 12.0, 80.0, 500.0])
def test_free_decay_is_the_closed_form(damping) -> None:
    """An impulse of one sample F/fs: y'' of x = exp(-d t) sin(w t) F / m w; 80 N s/m is critical, A defective."""
    mass, stiffness, rate = 2.0, 800.0, 20_000.0
    vehicle = chain(1, mass=mass, stiffness=stiffness, damping=damping)
    impulse = np.zeros((1, 20_000))
    impulse[0, 0] = rate
    found = response(vehicle.discretised(rate), impulse)[0, 2:]
    time = (np.arange(2, 20_000) - 0.5) / rate
    poles = np.roots([mass, damping, stiffness])
    if abs(poles[0] - poles[1]) < 1e-6:
        expected = (poles[0] ** 2 * time + 2 * poles[0]) * np.exp(poles[0] * time) / mass
    else:
        parts = poles[:, None] ** 2 * np.exp(np.outer(poles, time)) / mass
        expected = ((parts[0] - parts[1]) / (poles[0] - poles[1])).real
    assert found == pytest.approx(expected, abs=2e-5 * np.abs(expected).max())


@pytest.mark.parametrize("name", RATES)
def test_spread_is_the_exact_covariance(name) -> None:
    vehicle = structure(read_description(name))
    rate = RATES[name]
    recording = simulate(vehicle, RandomInputs(len(vehicle.inputs)), duration=120.0, sampling_rate=rate, seed=4)
    exact = exact_correlations(vehicle.discretised(rate), n_lags=3)
    n = recording.n_samples
    spread = np.sqrt(np.diag(exact[:, :, 0]))
    for lag in range(3):
        found = recording.samples[:, lag:] @ recording.samples[:, : n - lag].T / n
        assert found / np.outer(spread, spread) == pytest.approx(exact[:, :, lag] / np.outer(spread, spread), abs=0.1)


@pytest.mark.slow
def test_record_starts_in_the_steady_state() -> None:
    vehicle = chain()
    starts = [
        simulate(vehicle, RandomInputs(3), duration=0.004, sampling_rate=500.0, seed=seed).samples
        for seed in range(400)
    ]
    exact = np.diag(exact_correlations(vehicle.discretised(500.0), n_lags=1)[:, :, 0])
    assert np.mean(np.array(starts) ** 2, axis=(0, 2)) == pytest.approx(exact, rel=0.2)


def test_recording_carries_meaning_and_history() -> None:
    vehicle = structure(read_vehicle("zafira"))
    recording = simulate(vehicle, usual_excitation(vehicle), duration=2.0, sampling_rate=200.0, snr=10.0)
    assert recording.names == ("acc_fl", "acc_fr", "acc_rl", "acc_rr")
    assert recording.channels[3] == Channel("acc_rr", "acceleration", (-1.58, -0.702, 0.0), (0.0, 0.0, 1.0))
    assert recording.samples.shape == (4, 400)
    assert recording.sampling_rate == 200.0
    assert [line.split(",")[0] for line in recording.history] == ["simulated 2 s at 200 Hz", "added sensor noise"]


def test_seed_decides_everything() -> None:
    seeds: tuple[int | np.random.Generator, ...] = (1, np.random.default_rng(1), 2)
    first, again, other = (
        simulate(
            chain(), RandomInputs(3), duration=5.0, sampling_rate=500.0, snr=2.0, noise_band=(0.5, 50.0), seed=seed
        ).samples
        for seed in seeds
    )
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)


def test_time_of_the_excitation_is_that_of_the_recording() -> None:
    """Pulses at n / 3.65 s: the wheel reads the first five at samples 0, 274, 548, 822 and 1096."""
    vehicle, pulses = structure(read_description("quarter")), BaseMotion(random=0.0, pulse=5e-3)
    wheel = simulate(vehicle, pulses, duration=1.2, sampling_rate=1000.0).samples[1]
    step = 5e-3 * 75846.0 / 0.6637
    assert np.flatnonzero(wheel > 0.8 * step).tolist() == [0, 274, 548, 822, 1096]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"duration": 0.0}, "duration=0 must be above 0"),
        ({"sampling_rate": -5.0}, "sampling_rate=-5 must be above 0"),
        ({"snr": 0.0}, "snr=0 must be above 0"),
        ({"excitation": RandomInputs(2)}, "the excitation has 2 inputs, but the vehicle 3: excite force_1, force_2"),
        ({"vehicle": chain(damping=0.0)}, "a free motion of the vehicle does not decay: give every coordinate"),
    ],
)
def test_impossible_simulations_are_refused(changes, message) -> None:
    settings = {"vehicle": chain(), "excitation": RandomInputs(3), "duration": 1.0, "sampling_rate": 500.0} | changes
    with pytest.raises(ParameterError, match=message):
        simulate(**settings)


def test_vehicle_without_sensors_is_refused() -> None:
    fields = read_description("quarter").model_dump(exclude_defaults=True)
    del fields["sensor"]
    with pytest.raises(ParameterError, match=r"the vehicle has no motion sensors: add \[\[sensor\]\] tables"):
        simulate(structure(parse_vehicle(fields)), QUARTER_CASES[0], duration=1.0, sampling_rate=500.0)


def test_a_ramp_is_exact_at_any_rate() -> None:
    """Response to y = v t: the same at the common instants for two rates, to rounding."""
    quarter = structure(read_description("quarter"))
    found = []
    for rate in (100.0, 400.0):
        inputs = 0.3 * np.linspace(0, 1, round(rate), endpoint=False)
        discrete = with_polynomial_inputs(quarter.state_space(), sampling_rate=rate)
        found.append(response(discrete, with_derivatives(inputs[None]))[0, :: round(rate / 100)])
    assert found[0] == pytest.approx(found[1], rel=1e-9, abs=1e-10)


def test_a_sine_comes_out_with_gain_and_phase_of_the_frequency_response() -> None:
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


@pytest.mark.parametrize("run", [simulate, simulate_nonlinear])
@pytest.mark.parametrize("sampling_rate", [200.0, 1000.0])
def test_an_axle_box_on_a_rail_moves_as_the_frequency_response_says(run, sampling_rate) -> None:
    """The contact resonance at 177 Hz: linear between samples at 1000 Hz, its acceleration was 10 % too small."""
    bogie = structure(read_vehicle("y25"))
    motion = Lines(constant_speed(10.0), (2.0,), (1e-4,), (1.0, 1.0, 1.0, 1.0))
    found = run(bogie, motion, duration=4.0, sampling_rate=sampling_rate, seed=1)
    expected = np.abs(frequency_response(bogie, [20.0])[0].sum(axis=1)) * 1e-4
    inside = found.samples[:, round(sampling_rate) : -round(sampling_rate)]
    assert np.sqrt(2) * inside.std(axis=1) == pytest.approx(expected, rel=5e-3)
