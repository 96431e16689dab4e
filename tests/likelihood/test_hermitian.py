"""Hermitian matrices in real coordinates, against the matrices themselves."""

import numpy as np
import pytest

from sprung.likelihood.hermitian import congruence, coordinates_with_adjoint, real_coordinates, real_form


def draw(seed, *shape):
    real, imaginary = np.random.default_rng(seed).standard_normal((2, *shape))
    return real + 1j * imaginary


def hermitian(seed, size):
    root = draw(seed, 5, size, size)
    return root + root.conj().swapaxes(-1, -2)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_the_trace_of_a_product_is_the_product_of_the_coordinates(size) -> None:
    A, B = hermitian(1, size), hermitian(2, size)
    expected = np.einsum("fij,fji->f", A, B)
    assert np.sum(real_coordinates(A) * real_coordinates(B), axis=-1) == pytest.approx(expected.real)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_the_trace_of_a_product_is_the_product_in_real_form(size) -> None:
    A, B = hermitian(1, size), hermitian(2, size)
    expected = np.einsum("fij,fji->f", A, B)
    assert np.sum(real_form(A) * real_form(B), axis=(0, 1)) == pytest.approx(expected.real)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_coordinates_with_the_adjoint_are_those_of_the_sum(size) -> None:
    A = draw(4, 5, size, size)
    assert coordinates_with_adjoint(A) == pytest.approx(real_coordinates(A + A.conj().swapaxes(-1, -2)))


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_a_congruence_of_the_coordinates_is_that_of_the_matrix(size) -> None:
    A, K = hermitian(1, size), draw(3, 5, size, size)
    mapped = np.einsum("fij,fj->fi", congruence(K), real_coordinates(A))
    assert mapped == pytest.approx(real_coordinates(K @ A @ K.conj().swapaxes(-1, -2)))
