"""The subspace residual test: silent without a change, and not after one of a stiffness."""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from sprung.diagnosis import learn_reference, residual_statistics, residual_test
from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Recording
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import parse_fault, read_description, structure, with_faults


def learnt(recordings, **settings):
    return learn_reference([residual_statistics(recording, **settings) for recording in recordings])


def p_value(reference, recording):
    window = residual_statistics(recording, segment=reference.segment)
    return residual_test(reference, window).p_value


def chain(seed, fault=None, level=1.0):
    vehicle = structure(read_description("chain3"))
    if fault is not None:
        vehicle = with_faults(vehicle, [parse_fault(fault)])
    run = simulate(vehicle, usual_excitation(vehicle), duration=120.0, sampling_rate=100.0, snr=10.0, seed=seed)
    return run.changed("level", samples=level * run.samples)


@pytest.fixture(scope="module")
def reference():
    return learnt([chain(seed) for seed in range(16)])


def test_healthy_windows_of_any_level_pass(reference) -> None:
    values = [p_value(reference, chain(seed, level=10.0 ** (seed % 3 - 1))) for seed in range(30, 56)]
    assert min(values) > 1e-3
    assert 0.2 < np.median(values) < 0.8


@pytest.mark.parametrize("change", [-0.15, 0.15])
def test_a_changed_spring_is_seen(reference, change) -> None:
    name = next(iter(structure(read_description("chain3")).components())).corner
    values = [p_value(reference, chain(seed, f"{name}.spring={change}")) for seed in range(60, 66)]
    assert max(values) < 1e-4


@pytest.mark.parametrize("n_windows", [3, pytest.param(12, marks=pytest.mark.slow)])
def test_as_many_healthy_windows_differ_as_the_p_value_says(n_windows) -> None:
    """White noise through two resonances; a reference for every window, which leaves the windows independent."""
    generator = np.random.default_rng([7, n_windows])
    values = []
    for _ in range(100):
        reference = learnt([resonances(generator) for _ in range(n_windows)])
        values.append(p_value(reference, resonances(generator)))
    assert np.count_nonzero(np.array(values) < 0.05) <= stats.binom.ppf(0.995, 100, 0.05)
    assert 0.4 < np.mean(values) < 0.6


def resonances(generator):
    poles = [0.97 * np.exp(2j * np.pi * frequency) for frequency in (0.06, 0.15)]
    white = generator.standard_normal((2, 1700))
    sources = [lfilter([1.0], np.poly([p, p.conj()]).real, w)[200:] for p, w in zip(poles, white, strict=True)]
    outputs = np.array([[1.0, 0.6], [0.5, -1.0], [0.8, 0.4]]) @ sources
    outputs += 0.1 * generator.standard_normal(outputs.shape) * outputs.std()
    return Recording(outputs, 25.0, tuple(Channel(f"a{k}", "acceleration") for k in range(3)))


def test_it_needs_windows_and_the_same_channels(reference) -> None:
    with pytest.raises(DataError, match="the residual test needs at least 3 usable windows, got 2"):
        learnt([chain(0), chain(1)])
    with pytest.raises(ParameterError, match="select the same ones"):
        p_value(reference, chain(0).select(chain(0).names[:2]))


@pytest.mark.slow
def test_flexible_against_stiff_building(real_file) -> None:
    """One record of 100 s each: learnt on the first windows of the flexible one, without that of the first shock."""

    def floors(state):
        archive = np.load(real_file(f"mini_shake_table/{state}_3_story_Northridge.npz"))
        ground, *above = (archive[f"{name}_acc"][1:, 0] for name in ("Ground", "1st", "2nd", "3rd"))
        n = min(len(one) for one in (ground, *above))
        channels = tuple(Channel(f"floor_{k}", "acceleration") for k in range(3))
        run = Recording(np.array([one[:n] - ground[:n] for one in above]), 120.0, channels)
        return [run.part(k * n // 12, (k + 1) * n // 12) for k in range(12)]

    flexible, stiff = floors("Flexible"), floors("Stiff")
    reference = learnt(flexible[:10], segment=2.0)
    assert reference.n_windows < 10
    healthy, changed = ([p_value(reference, one) for one in some] for some in (flexible[10:], stiff))
    assert min(healthy) > 0.05
    assert max(changed) < 1e-3
