"""Frequency, damping, MAC, MPC and normalisation against closed forms and invariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sprung.errors import ParameterError
from sprung.modal import (
    Modes,
    Poles,
    PoleStatus,
    damping_ratio,
    join_modes,
    mac,
    mpc,
    natural_frequency,
    unit_shapes,
)

SIZES = st.floats(0.1, 1e3)
PHASES = st.floats(0, 2 * np.pi)


def complex_shapes(n_modes, n_channels):
    """Complex shapes of which every component has a modulus between 0.01 and 10."""
    shape = (n_modes, n_channels)
    moduli, angles = (hnp.arrays(float, shape, elements=st.floats(*range_)) for range_ in ((0.01, 10), (0, 6.3)))
    return st.builds(lambda modulus, angle: modulus * np.exp(1j * angle), moduli, angles)


def some_modes(n_modes, names=("a", "b")):
    numbers = np.arange(1.0, n_modes + 1)
    return Modes(
        poles=-0.1 * numbers + 1j * numbers,
        mode_shapes=np.ones((n_modes, len(names))) * numbers[:, None],
        channels=names,
        natural_frequency_std=0.01 * numbers,
        damping_ratio_std=0.02 * numbers,
        stable_rate=0.1 * numbers,
        labels=("bounce", None, "roll")[:n_modes],
    )


@settings(deadline=None)
@given(frequency=st.floats(0.01, 1e4), damping=st.floats(-0.9, 0.99))
def test_a_pole_gives_its_undamped_frequency_and_damping_ratio(frequency, damping) -> None:
    """s = 2 pi f (-xi + i sqrt(1 - xi^2))."""
    pole = 2 * np.pi * frequency * np.array([-damping + 1j * np.sqrt(1 - damping**2)])
    assert natural_frequency(pole) == pytest.approx([frequency], rel=1e-12)
    assert damping_ratio(pole) == pytest.approx([damping], rel=1e-9, abs=1e-14)


def test_mac_of_orthogonal_equal_and_inclined_shapes() -> None:
    shapes = np.array([[1, 0], [0, 1], [1, 1], [1, 1j]], dtype=complex)
    expected = [[1, 0, 0.5, 0.5], [0, 1, 0.5, 0.5], [0.5, 0.5, 1, 0.5], [0.5, 0.5, 0.5, 1]]
    np.testing.assert_allclose(mac(shapes, shapes), expected, atol=1e-15)


def test_mac_uses_the_hermitian_transpose() -> None:
    """With the plain transpose a^T a = 0 for a = [1, i]."""
    circle, back = np.array([[1, 1j]]), np.array([[1, -1j]])
    assert mac(circle, circle) == pytest.approx(1)
    assert mac(circle, back) == pytest.approx(0)


@settings(deadline=None)
@given(complex_shapes(2, 4), complex_shapes(3, 4), SIZES, PHASES)
def test_mac_does_not_depend_on_complex_scale(shapes, others, size, phase) -> None:
    reference = mac(shapes, others)
    assert reference.shape == (2, 3)
    np.testing.assert_allclose(mac(size * np.exp(1j * phase) * shapes, others), reference, atol=1e-12)
    np.testing.assert_allclose(mac(others, shapes), reference.T, atol=1e-12)
    assert np.all((reference >= 0) & (reference <= 1 + 1e-12))
    np.testing.assert_allclose(np.diag(mac(shapes, shapes)), 1, atol=1e-12)


@pytest.mark.slow
@settings(deadline=None)
@given(complex_shapes(1, 5), complex_shapes(1, 5))
def test_mac_is_the_squared_cosine_by_another_route(shapes, others) -> None:
    """1 - MAC is the share of one shape that the best complex multiple of the other leaves."""
    best = np.linalg.lstsq(others.T, shapes[0], rcond=None)[0]
    left = np.sum(np.abs(shapes[0] - others[0] * best) ** 2) / np.sum(np.abs(shapes) ** 2)
    assert mac(shapes, others)[0, 0] == pytest.approx(1 - left, abs=1e-10)


def test_mac_and_mpc_of_a_zero_shape_are_zero() -> None:
    zero = np.zeros((1, 3), dtype=complex)
    assert mac(zero, np.ones((1, 3)))[0, 0] == 0
    assert mpc(zero)[0] == 0


def test_mpc_of_a_line_an_ellipse_and_a_circle() -> None:
    """Components on an ellipse of half-axes 1 and b in the complex plane: ((1 - b^2) / (1 + b^2))^2."""
    assert mpc(np.array([[1, -2, 0.5]], dtype=complex)) == pytest.approx([1])
    for b in (0.0, 0.3, 1.0):
        assert mpc(np.array([[1, 1j * b]])) == pytest.approx([((1 - b**2) / (1 + b**2)) ** 2])
    third = np.exp(2j * np.pi * np.arange(3) / 3)
    assert mpc(third[None]) == pytest.approx([0], abs=1e-15)


@settings(deadline=None)
@given(complex_shapes(2, 4), SIZES, PHASES)
def test_mpc_does_not_depend_on_complex_scale_and_equals_the_eigenvalue_form(shapes, size, phase) -> None:
    """((l1 - l2) / (l1 + l2))^2 with the eigenvalues of the inner products of real and imaginary parts."""
    parts = np.stack([shapes.real, shapes.imag], axis=1)
    eigenvalues = np.linalg.eigvalsh(parts @ parts.transpose(0, 2, 1))
    expected = ((eigenvalues[:, 1] - eigenvalues[:, 0]) / eigenvalues.sum(axis=1)) ** 2
    np.testing.assert_allclose(mpc(shapes), expected, atol=1e-10)
    np.testing.assert_allclose(mpc(size * np.exp(1j * phase) * shapes), expected, atol=1e-10)


@settings(deadline=None)
@given(complex_shapes(3, 4), SIZES, PHASES)
def test_unit_shapes_are_1_at_the_largest_channel_whatever_the_scale(shapes, size, phase) -> None:
    unit = unit_shapes(shapes)
    largest = np.argmax(np.abs(shapes), axis=1)
    np.testing.assert_allclose(unit[np.arange(3), largest], 1, atol=1e-14)
    assert np.abs(unit).max() <= 1 + 1e-12
    np.testing.assert_allclose(np.diag(mac(unit, shapes)), 1, atol=1e-12)
    again = unit_shapes(size * np.exp(1j * phase) * unit)
    np.testing.assert_allclose(np.abs(again), np.abs(unit), atol=1e-12)


def test_unit_shapes_keeps_a_zero_shape() -> None:
    np.testing.assert_array_equal(unit_shapes(np.zeros((1, 3), dtype=complex)), np.zeros((1, 3)))


def test_every_status_says_in_words_what_became_of_a_pole() -> None:
    sentences = {status.sentence for status in PoleStatus}
    assert len(sentences) == len(PoleStatus)
    assert PoleStatus.SELECTED == 0
    assert PoleStatus.RARE.sentence == "stable at too few model orders"


def test_taken_modes_keep_everything_that_belongs_to_them() -> None:
    taken = some_modes(3).take(np.array([2, 0]))
    np.testing.assert_array_equal(taken.poles.imag, [3, 1])
    np.testing.assert_array_equal(taken.mode_shapes, [[3, 3], [1, 1]])
    np.testing.assert_array_equal(taken.natural_frequency_std, [0.03, 0.01])
    np.testing.assert_array_equal(taken.damping_ratio_std, [0.06, 0.02])
    np.testing.assert_allclose(taken.stable_rate, [0.3, 0.1])
    assert taken.labels == ("roll", "bounce")
    assert len(taken) == 2


def test_modes_are_taken_by_place() -> None:
    modes = some_modes(3)
    assert [one.labels for one in modes] == [(label,) for label in modes.labels]
    np.testing.assert_array_equal(modes[-1].poles, modes.poles[2:])
    np.testing.assert_array_equal(modes[:2].poles, modes.poles[:2])
    with pytest.raises(ParameterError, match=r"pass a number or a slice: modes\[0\]"):
        modes["bounce"]


def test_joined_modes_follow_one_another() -> None:
    joined = join_modes([some_modes(2), some_modes(1)])
    np.testing.assert_array_equal(joined.poles.imag, [1, 2, 1])
    np.testing.assert_array_equal(joined.mode_shapes[:, 0], [1, 2, 1])
    assert joined.labels == ("bounce", None, "bounce")


def test_modes_state_their_own_frequency_damping_and_collinearity() -> None:
    modes = some_modes(2)
    np.testing.assert_allclose(modes.natural_frequency, np.sqrt(1.01) * np.array([1, 2]) / (2 * np.pi))
    np.testing.assert_allclose(modes.damping_ratio, 0.1 / np.sqrt(1.01))
    np.testing.assert_allclose(modes.mpc, 1)


def test_shapes_that_do_not_fit_poles_or_channels_are_refused() -> None:
    nothing, pole, shape = np.zeros(1), np.ones(1, dtype=complex), np.ones((1, 3), dtype=complex)
    with pytest.raises(ParameterError, match=r"^mode_shapes \(1, 3\) must be 1 modes by 2 channels$"):
        Modes(pole, shape, ("a", "b"), nothing, nothing, nothing, (None,))
    with pytest.raises(
        ParameterError,
        match=r"^mode_shapes \(1, 3\) must have one row for each of 1 poles and one column for each of 2 channels$",
    ):
        Poles(pole, shape, np.zeros(1, dtype=np.intp), (2,), ("a", "b"), nothing, nothing)
