"""Hermitian matrices in real coordinates, against the matrices themselves."""

import numpy as np
import pytest

from sprung.likelihood.hermitian import coordinates_with_adjoint, hermitian, real_coordinates, real_form, transformed


def draw(seed, *shape):
    real, imaginary = np.random.default_rng(seed).standard_normal((2, *shape))
    return real + 1j * imaginary


def drawn(seed, size):
    root = draw(seed, 5, size, size)
    return root + root.conj().swapaxes(-1, -2)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_the_trace_of_a_product_is_the_product_of_the_coordinates(size) -> None:
    A, B = drawn(1, size), drawn(2, size)
    expected = np.einsum("fij,fji->f", A, B)
    assert np.sum(real_coordinates(A) * real_coordinates(B), axis=-1) == pytest.approx(expected.real)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_the_trace_of_a_product_is_the_product_in_real_form(size) -> None:
    A, B = drawn(1, size), drawn(2, size)
    expected = np.einsum("fij,fji->f", A, B)
    assert np.sum(real_form(A) * real_form(B), axis=(0, 1)) == pytest.approx(expected.real)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_coordinates_with_the_adjoint_are_those_of_the_sum(size) -> None:
    A = draw(4, 5, size, size)
    assert coordinates_with_adjoint(A) == pytest.approx(real_coordinates(A + A.conj().swapaxes(-1, -2)))


@pytest.mark.parametrize("size", [1, 3, 6, 7, 10])
def test_transformed_coordinates_are_those_of_the_transformed_matrices(size) -> None:
    several, K = np.stack([drawn(1, size), drawn(2, size)]), draw(3, 5, size, size)
    expected = K @ several @ K.conj().swapaxes(-1, -2)
    found = transformed(K, real_coordinates(several))
    assert found == pytest.approx(real_coordinates(expected))
    assert hermitian(found) == pytest.approx(expected)
