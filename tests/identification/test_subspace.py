"""Realisations: poles of exact correlations and shapes to 1e-9 in every form, and their deviations."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg

from sprung.errors import ParameterError
from sprung.identification.correlation import exact_correlations
from sprung.identification.subspace import (
    block_hankel,
    block_row_ladder,
    block_toeplitz,
    poles_of_orders,
    realise,
    undetermined_poles,
    with_deviations,
)
from sprung.modal import mac
from sprung.recording import Channel
from sprung.vehicles import MechanicalSystem, Outputs, discretised, modes, state_space
from sprung.vehicles import exact_correlations as correlations_of

BLOCK_ROWS = 20


CASES = [
    ("chain3", 125.0),
    ("chain3", 500.0),
    ("quarter", 250.0),
    ("quarter", 1000.0),
    ("zafira", 50.0),
    ("zafira", 100.0),
    ("zafira-printed", 50.0),
    ("zafira-printed", 100.0),
    ("zafira-firm", 100.0),
]


FORMS = {
    "Toeplitz, weighted": {},
    "Toeplitz, unweighted": {"is_weighted": False},
    "Hankel": {"is_hankel": True},
}


def assert_holds(found, poles, shapes):
    """Every exact pole and its shape are among those found, to 1e-9."""
    errors = np.abs(found.poles[:, None] - poles) / np.abs(poles)
    nearest = np.argmin(errors, axis=0)
    assert errors.min(axis=0).max() < 1e-9
    assert 1 - np.diag(mac(found.mode_shapes[nearest], shapes)).min() < 1e-9


def rung(poles, k):
    """The poles of one rung, as a ladder of its own."""
    chosen = np.flatnonzero(poles.rungs == k)
    names = ("poles", "mode_shapes", "natural_frequency_std", "damping_ratio_std")
    values = {name: getattr(poles, name)[chosen] for name in names}
    return replace(poles, rungs=np.zeros(len(chosen)), ladder=(poles.ladder[k],), **values)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("name", "rate"), CASES)
def test_exact_correlations_give_exact_poles_and_shapes(known, name, rate, form) -> None:
    correlations, poles, shapes = known(name, rate)
    found = poles_of_orders(
        realise(correlations, block_rows=BLOCK_ROWS, max_order=2 * len(poles), **FORMS[form]), [2 * len(poles)]
    )
    assert len(found.poles) == len(poles)
    assert_holds(found, poles, shapes)
    assert np.isnan(found.natural_frequency_std).all()
    assert np.isnan(found.damping_ratio_std).all()


#: The structure as a certified record, and its published natural frequencies [Hz] along y, along x and in torsion.
IASC = Path(__file__).parents[2] / "benchmarks" / "certified" / "answers" / "iasc-asce.json"
IASC_FREQUENCIES = [9.41, 25.54, 38.66, 48.01], [11.79, 32.01, 48.44, 60.15], [16.38, 44.64, 67.48, 83.62]


def test_the_benchmark_structure_of_iasc_and_asce(conforms) -> None:
    """Of phase I: published frequencies, and exact correlations of four accelerometers a floor give back the poles.

    E. A. Johnson, H. F. Lam, L. S. Katafygiotis, J. L. Beck, Phase I IASC-ASCE structural health monitoring benchmark
    problem using simulated data, Journal of Engineering Mechanics 130 (2004) 3-15. Damping ratios are 1 %.
    """
    stated = json.loads(IASC.read_text(encoding="utf-8"))
    mass, damping, stiffness, sensors = (np.array(stated[key]) for key in ("mass", "damping", "stiffness", "sensors"))
    coordinates = tuple(f"{direction}_{floor}" for direction in ("y", "x", "twist") for floor in range(1, 5))
    system = MechanicalSystem(mass, damping, stiffness, np.eye(12), coordinates, coordinates)
    channels = tuple(Channel(f"acc_{k}", "acceleration") for k in range(len(sensors)))
    outputs = Outputs(channels, sensors, np.zeros_like(sensors), np.zeros_like(sensors))
    exact = modes(system, outputs)
    conforms(
        "IASC-ASCE benchmark, phase I (Johnson and others 2004)",
        "12-DOF model",
        "natural frequencies of the published masses and stiffness",
        exact.natural_frequency,
        np.sort(np.concatenate(IASC_FREQUENCIES)),
        absolute=0.005,
        unit="Hz",
    )
    sampled = discretised(state_space(system, outputs), sampling_rate=250.0)
    values = correlations_of(sampled, n_lags=4 * BLOCK_ROWS)
    found = poles_of_orders(
        realise(exact_correlations(values, sampling_rate=250.0), block_rows=BLOCK_ROWS, max_order=24), [24]
    )
    assert len(found.poles) == 12
    assert_holds(found, exact.poles, exact.mode_shapes)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("name", "rate"), CASES)
def test_the_true_poles_are_found_at_every_order_from_the_true_one(known, name, rate, form) -> None:
    correlations, poles, shapes = known(name, rate)
    orders = range(2, 31, 2)
    found = poles_of_orders(realise(correlations, block_rows=BLOCK_ROWS, max_order=30, **FORMS[form]), orders)
    assert found.ladder == tuple(orders)
    for k, order in enumerate(orders):
        assert len(rung(found, k).poles) <= order / 2
        if order >= 2 * len(poles):
            assert_holds(rung(found, k), poles, shapes)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("case", "outputs", "references"),
    [
        (("chain3", 125.0), "123", "2"),
        (("chain3", 125.0), "123", "31"),
        (("chain3", 125.0), "13", "2"),
        (("chain3", 125.0), "1", "3"),
        (("chain3", 125.0), "1", "1"),
        (("quarter", 250.0), "1", "2"),
        (("quarter", 250.0), "12", "1"),
        (("zafira", 100.0), "1234", "13"),
        (("zafira", 100.0), "1234", "421"),
        (("zafira", 100.0), "13", "24"),
        (("zafira", 100.0), "421", "43"),
        (("zafira-printed", 50.0), "24", "13"),
        (("zafira-firm", 100.0), "1234", "24"),
    ],
)
def test_fewer_and_disjoint_references_give_the_same_poles(known, case, outputs, references, form) -> None:
    correlations, poles, shapes = known(*case)
    chosen = correlations.select(tuple(outputs), tuple(references))
    found = poles_of_orders(
        realise(chosen, block_rows=BLOCK_ROWS, max_order=2 * len(poles), **FORMS[form]), [2 * len(poles)]
    )
    assert_holds(found, poles, shapes[:, [int(channel) - 1 for channel in outputs]])
    assert found.channels == tuple(outputs)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("name", "rate"), [("chain3", 125.0), ("quarter", 250.0), ("zafira", 50.0)])
def test_the_ladder_over_block_rows_finds_the_true_poles_on_every_high_enough_rung(known, name, rate, form) -> None:
    correlations, poles, shapes = known(name, rate)
    block_rows = range(11, 27)
    found = block_row_ladder(correlations, block_rows, **{"is_weighted": True, **FORMS[form]})
    assert found.ladder == tuple(block_rows)
    assert sorted(set(found.rungs)) == list(range(len(block_rows)))
    for k, i in enumerate(block_rows):
        assert len(rung(found, k).poles) <= i // 2
        if i - i % 2 >= 2 * len(poles):
            assert_holds(rung(found, k), poles, shapes)


@settings(max_examples=40, deadline=None)
@given(
    sizes=st.tuples(st.integers(1, 3), st.integers(1, 3)),
    block_rows=st.integers(2, 6),
    first_lag=st.integers(0, 4),
    n_columns=st.integers(1, 5),
)
def test_block_matrices_hold_the_blocks_of_their_equations(sizes, block_rows, first_lag, n_columns) -> None:
    """F. Liu (2020), eq. 3-39 and 3-35."""
    n_lags = max(2 * block_rows, first_lag + block_rows + n_columns)
    values = np.random.default_rng(0).normal(size=(*sizes, n_lags))
    toeplitz = np.block([[values[:, :, block_rows + p - q] for q in range(block_rows)] for p in range(block_rows)])
    np.testing.assert_array_equal(block_toeplitz(values, block_rows), toeplitz)
    hankel = np.block([[values[:, :, first_lag + p + q] for q in range(n_columns)] for p in range(block_rows)])
    np.testing.assert_array_equal(block_hankel(values, block_rows, first_lag=first_lag, n_columns=n_columns), hankel)


def test_weighted_singular_values_are_canonical_correlations_of_past_and_future(known) -> None:
    """Against the generalised eigenvalue problem of the joint covariance of i past and i future samples.

    White noise in lag 0 keeps the covariance far from singular, so that no bound on its eigenvalues acts.
    """
    correlations, *_ = known("chain3", 125.0)
    values, i = correlations.values.copy(), 6
    values[:, :, 0] += np.eye(3)
    realised = realise(exact_correlations(values, sampling_rate=125.0), block_rows=i, max_order=6)
    lag = np.arange(2 * i)[:, None] - np.arange(2 * i)
    covariance = np.block([[values[:, :, m] if m >= 0 else values[:, :, -m].T for m in row] for row in lag])
    past, future = slice(0, 3 * i), slice(3 * i, None)
    zero = np.zeros((3 * i, 3 * i))
    cross = np.block([[zero, covariance[past, future]], [covariance[future, past], zero]])
    own = linalg.block_diag(covariance[past, past], covariance[future, future])
    canonical = np.sort(linalg.eigh(cross, own, eigvals_only=True))[::-1][: 3 * i]
    np.testing.assert_allclose(realised.singular_values, canonical, atol=1e-12)
    assert realised.singular_values[0] < 1


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"block_rows": 41, "max_order": 6}, "block_rows=41 needs 82 lags, .* 80: .* 0.656 s .* block_rows <= 40"),
        ({"block_rows": 27, "max_order": 6, "is_hankel": True}, "block_rows=27 needs 81 lags, .* block_rows <= 26"),
        ({"block_rows": 5, "max_order": 14}, "max_order=14 .* with 3 channels and 3 references: use max_order <= 12"),
        ({"block_rows": 1, "max_order": 2}, "block_rows=1 must be at least 2"),
        ({"block_rows": 5, "max_order": 0}, "max_order=0 must be at least 2"),
    ],
)
def test_a_matrix_that_cannot_be_built_is_refused(known, options, sentence) -> None:
    with pytest.raises(ParameterError, match=f"^{sentence}"):
        realise(known("chain3", 125.0)[0], **options)


def test_ladder_over_block_rows_of_one_channel() -> None:
    """One channel carries one order less than it has block rows."""
    decays = np.exp(-0.1 * np.arange(40)) * np.cos(0.5 * np.arange(40))
    correlations = exact_correlations(decays[None, None], sampling_rate=1.0, channels=("a",))
    poles = block_row_ladder(correlations, range(6, 12))
    assert poles.ladder == (6, 7, 8, 9, 10, 11)
    assert np.abs(poles.poles - (-0.1 + 0.5j)).min() < 1e-9


def test_deviations_of_chosen_poles_are_those_among_all(measured) -> None:
    """Computed for some poles alone they are the same; of the others they stay unknown."""
    realised = realise(measured(seed=5), block_rows=12, max_order=12)
    orders = range(2, 13, 2)
    every, alone = poles_of_orders(realised, orders), undetermined_poles(realised, orders)
    chosen = np.arange(len(every.poles)) % 3 == 1
    some = with_deviations(alone, chosen)
    np.testing.assert_array_equal(some.poles, every.poles)
    for name in ("natural_frequency_std", "damping_ratio_std"):
        np.testing.assert_allclose(getattr(some, name)[chosen], getattr(every, name)[chosen], rtol=1e-9)
        assert np.isnan(getattr(some, name)[~chosen]).all()
    np.testing.assert_allclose(some.changes[:, chosen], every.changes[:, chosen], rtol=1e-9)
    assert some.changes_of is None


def perturbed(correlations, change):
    """Correlations whose two blocks differ from exact ones by plus and minus a change."""
    blocks = np.stack([correlations.values + change, correlations.values - change])
    return replace(correlations, blocks=blocks, weights=np.array([0.5, 0.5]), n_segments=2)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("case", "steps"),
    [
        (("chain3", 125.0, "123"), (7e-7, 2e-6)),
        (("chain3", 125.0, "13"), (7e-7, 2e-6)),
        (("quarter", 250.0, "12"), (3e-7, 2e-6)),
        (("zafira", 100.0, "1234"), (1e-9, 5e-4)),
    ],
)
def test_standard_deviations_equal_a_finite_difference_of_the_poles(known, case, steps, form, conforms) -> None:
    """Two blocks that differ from the average by +-dLambda have the standard error abs(d pole).

    The weakest of the car's 14 states hangs on a singular value of 1e-4 of the largest: rounding, not the formula,
    sets its tolerance.
    """
    (name, rate, references), (step, tolerance) = case, steps
    correlations, poles, _ = known(name, rate)
    correlations = correlations.select(correlations.channels, tuple(references))
    change = step * np.random.default_rng(8).normal(size=correlations.values.shape)

    def realised(changed):
        n = 2 * len(poles)
        found = poles_of_orders(realise(changed, block_rows=BLOCK_ROWS, max_order=n, **FORMS[form]), [n])
        return found, np.argmin(np.abs(found.poles[:, None] - poles), axis=0)

    def frequency_and_damping(values):
        found, nearest = realised(exact_correlations(values, sampling_rate=rate, references=references))
        return found.natural_frequency[nearest], found.damping_ratio[nearest]

    upper = frequency_and_damping(correlations.values + change)
    lower = frequency_and_damping(correlations.values - change)
    reported, nearest = realised(perturbed(correlations, change))
    for high, low, std in zip(upper, lower, ("natural_frequency_std", "damping_ratio_std"), strict=True):
        what = f"{std} of {name} against differences of the poles"
        found, expected = getattr(reported, std)[nearest], np.abs(high - low) / 2
        source, clause = "Döhler and Mevel (2013)", "covariance of the poles"
        conforms(source, clause, what, found, expected, rel=tolerance, rounding=tolerance)
