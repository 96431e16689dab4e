"""Stacks of Hermitian matrices in real coordinates."""

from itertools import combinations
from math import isqrt

import numpy as np

from sprung._arrays import Complex, Real


def real_coordinates(matrices: Complex) -> Real:
    """Return the coordinates of Hermitian matrices in a basis that is orthonormal under tr(A B).

    Parameters
    ----------
    matrices
        Hermitian matrices, shape (..., m, m); only diagonal and upper triangle are read.

    Returns
    -------
    ndarray
        Diagonal, then sqrt(2) times the real and the imaginary parts of the upper triangle, shape (..., m^2).

    Notes
    -----
    tr(A B) = sum a b over the coordinates a of A and b of B.

    References
    ----------
    R. A. Horn and C. R. Johnson, Matrix Analysis, Cambridge University Press, 1985, section 4.1 (Hermitian matrices as
    a real vector space).

    Examples
    --------
    >>> real_coordinates(np.array([[2.0, 3 + 4j], [3 - 4j, 5.0]])).round(3).tolist()
    [2.0, 5.0, 4.243, 5.657]
    """
    size = matrices.shape[-1]
    upper = list(combinations(range(size), 2))
    coordinates = np.empty((*matrices.shape[:-2], size * size))
    for row in range(size):
        coordinates[..., row] = matrices[..., row, row].real
    for number, (i, j) in enumerate(upper):
        entry = matrices[..., i, j]
        coordinates[..., size + number] = entry.real
        coordinates[..., size + len(upper) + number] = entry.imag
    coordinates[..., size:] *= np.sqrt(2)
    return coordinates


def hermitian(coordinates: Real) -> Complex:
    """Return the Hermitian matrices of real coordinates, the inverse of `real_coordinates`.

    Parameters
    ----------
    coordinates
        Shape (..., m^2).

    Returns
    -------
    ndarray
        Shape (..., m, m).

    References
    ----------
    As for `real_coordinates`.

    Examples
    --------
    >>> hermitian(real_coordinates(np.array([[2.0, 3 + 4j], [3 - 4j, 5.0]]))).round(12).tolist()
    [[(2+0j), (3+4j)], [(3-4j), (5+0j)]]
    """
    size = isqrt(coordinates.shape[-1])
    matrices = np.empty((*coordinates.shape[:-1], size, size), dtype=np.complex128)
    real, imaginary = np.split(coordinates[..., size:] / np.sqrt(2), 2, axis=-1)
    for row in range(size):
        matrices[..., row, row] = coordinates[..., row]
    for number, (i, j) in enumerate(combinations(range(size), 2)):
        matrices[..., i, j] = real[..., number] + 1j * imaginary[..., number]
        matrices[..., j, i] = matrices[..., i, j].conj()
    return matrices


def coordinates_with_adjoint(matrices: Complex) -> Real:
    """Return the real coordinates of A + A^H.

    Parameters
    ----------
    matrices
        A, shape (..., m, m).

    Returns
    -------
    ndarray
        As by `real_coordinates`, shape (..., m^2), each coordinate contiguous in memory.

    References
    ----------
    As for `real_coordinates`.

    Examples
    --------
    >>> coordinates_with_adjoint(np.array([[1.0, 3 + 4j], [0.0, 2.5]])).round(3).tolist()
    [2.0, 5.0, 4.243, 5.657]
    """
    size = matrices.shape[-1]
    upper = list(combinations(range(size), 2))
    coordinates = np.empty((size * size, *matrices.shape[:-2]))
    for row in range(size):
        coordinates[row] = 2 * matrices[..., row, row].real
    for number, (i, j) in enumerate(upper, start=size):
        coordinates[number] = matrices[..., i, j].real + matrices[..., j, i].real
        coordinates[number + len(upper)] = matrices[..., i, j].imag - matrices[..., j, i].imag
    coordinates[size:] *= np.sqrt(2)
    return np.moveaxis(coordinates, 0, -1)


def real_form(matrices: Complex) -> Real:
    """Return the sums of the real and imaginary parts of Hermitian matrices, shape (m, m, ...).

    Parameters
    ----------
    matrices
        Hermitian matrices A, shape (..., m, m).

    Notes
    -----
    tr(A B) = sum a b over the entries a of A and b of B in this form: real parts are symmetric and imaginary parts
    antisymmetric, so that the sums of their products vanish.

    References
    ----------
    R. N. Bracewell, Discrete Hartley transform, Journal of the Optical Society of America 73 (1983), 1832-1835 (the
    same form of Fourier coefficients).
    """
    return np.moveaxis(matrices.real + matrices.imag, (-2, -1), (0, 1))


def transformed(factors: Complex, coordinates: Real) -> Real:
    """Return the real coordinates of K A K^H for several Hermitian matrices A.

    Parameters
    ----------
    factors
        K, shape (..., m, m).
    coordinates
        Real coordinates of matrices A, shape (matrices, ..., m^2).

    Returns
    -------
    ndarray
        Shape of `coordinates`.

    Notes
    -----
    Up to six rows by one product with the m^2 by m^2 matrices of the map: column by column, for the basis e_i e_i^T,
    (e_i e_j^T + e_j e_i^T) / sqrt(2) and i (e_i e_j^T - e_j e_i^T) / sqrt(2) of `real_coordinates`, from the outer
    products of the columns of K. The matrices A then come last in memory, as sums of products over all else need them.
    Larger matrices are multiplied one by one, which is faster and takes less memory.

    References
    ----------
    R. A. Horn and C. R. Johnson, Matrix Analysis, Cambridge University Press, 1985, section 4.5 (congruence).

    Examples
    --------
    >>> K, A = np.array([[1.0, 2j], [0.0, 3.0]]), np.array([[2.0, 1j], [-1j, 4.0]])
    >>> hermitian(transformed(K, real_coordinates(A)[None]))[0].round(12).tolist() == (K @ A @ K.conj().T).tolist()
    True
    """
    size = factors.shape[-1]
    if size > 6:
        adjoint, images = factors.conj().swapaxes(-1, -2), np.empty(coordinates.shape)
        for row, each in enumerate(coordinates):
            images[row] = real_coordinates(factors @ hermitian(each) @ adjoint)
        return images
    columns = [_outer(factors, i, i) for i in range(size)]
    crossed = [_outer(factors, i, j) / np.sqrt(2) for i, j in combinations(range(size), 2)]
    columns += [half + half.conj().swapaxes(-1, -2) for half in crossed]
    columns += [1j * (half - half.conj().swapaxes(-1, -2)) for half in crossed]
    whole = np.stack([real_coordinates(column) for column in columns], axis=-1)
    return np.moveaxis(whole @ np.moveaxis(coordinates, 0, -1), -1, 0)


def _outer(factors: Complex, i: int, j: int) -> Complex:
    """Outer products of columns i and j, the second one conjugate."""
    return np.asarray(factors[..., :, i, None] * factors[..., None, :, j].conj(), dtype=np.complex128)
