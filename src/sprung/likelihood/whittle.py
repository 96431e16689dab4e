"""Whittle likelihood of a vehicle: spectral matrix = response x inputs x response^H + sensor noise."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.components import FreeComponents
from sprung.likelihood.coordinates import RigidLayout
from sprung.likelihood.hermitian import transformed
from sprung.likelihood.search import TOO_FAR
from sprung.likelihood.spectra import ClassSpectra, onto_grid, through_window
from sprung.likelihood.terms import Terms, nominal_terms
from sprung.likelihood.transfer import term_gradients, transfer
from sprung.vehicles import Component, Structure


@dataclass(frozen=True, eq=False, slots=True)
class Model:
    """A vehicle, its sensors and its inputs with free parameters, and the data.

    Parameters
    ----------
    structure
        Vehicle with nominal components.
    layout
        Coordinates of the data.
    spectra
        Mean spectral matrices of the data by speed class.
    blocks
        Blocks of parameters, applied in this order; their parameters follow each other.
    every
        Step between the frequencies by which the information is estimated.

    Notes
    -----
    Segments are independent complex Gaussian vectors at each frequency, of covariance S = H S_inputs H^H + noise, seen
    through the window (`through_window`); H is the response of the vehicle (`Terms`).

    References
    ----------
    N. R. Goodman, Statistical analysis based on a certain multivariate complex Gaussian distribution, Annals of
    Mathematical Statistics 34 (1963), 152-177. P. Whittle: see `minus_log_likelihood`.
    """

    structure: Structure
    layout: RigidLayout
    spectra: ClassSpectra
    blocks: tuple[ParameterBlock, ...]
    every: int = 1
    names: tuple[str, ...] = field(init=False)
    start: Real = field(init=False)
    prior_std: Real = field(init=False)
    _nominal: Terms = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(name for block in self.blocks for name in block.names))
        object.__setattr__(self, "start", np.concatenate([block.start for block in self.blocks]))
        object.__setattr__(self, "prior_std", np.concatenate([block.prior_std for block in self.blocks]))
        object.__setattr__(self, "_nominal", nominal_terms(self.structure, self.layout, self.spectra))
        freeze(self, start=1, prior_std=1)

    @property
    def searched(self) -> "Model":
        """The model with an information, the metric of a search, of every third frequency beyond six coordinates."""
        return replace(self, every=3) if len(self.layout.rows) > 6 else self

    @property
    def powers(self) -> Booleans:
        """Whether each parameter is ln of a power, such as roughness and noise."""
        return np.concatenate([block.is_log_power for block in self.blocks])

    @property
    def components(self) -> tuple[Component, ...]:
        """Springs, dampers and tyres that are fitted."""
        return tuple(part for block in self.blocks if isinstance(block, FreeComponents) for part in block.components)

    def by_block(self, parameters: Real) -> Iterator[tuple[ParameterBlock, Real]]:
        """Yield each block with its parameters."""
        ends = np.cumsum([len(block.names) for block in self.blocks])
        yield from zip(self.blocks, np.split(parameters, ends[:-1]), strict=True)

    def rows(self, *groups: str) -> Indices:
        """Return the numbers of the parameters whose block is of one of the groups, such as "components"."""
        return np.flatnonzero([block.group in groups for block in self.blocks for _ in block.names])

    def scaled_start(self, components: Real | None = None) -> Real:
        """Return `start`, or given components, with inputs and noise scaled so that the model has the data's power."""
        parameters = self.start.copy()
        if components is not None:
            parameters[self.rows("components")] = components
        power = np.average(self.relative_power(parameters), axis=0, weights=self.spectra.counts)
        return parameters + np.log(np.median(power)) * self.powers

    def relative_power(self, parameters: Real) -> Real:
        """Return tr(S^-1 S^) / coordinates: the power of the data over the model's, shape (classes, frequencies)."""
        ratio = np.einsum("cfij,cfji->cf", np.linalg.inv(self.matrix(parameters)), self.spectra.matrices).real
        return np.asarray(ratio / len(self.layout.rows), dtype=np.float64)

    def terms(self, parameters: Real) -> Terms:
        """Return the terms of the spectral matrix with the contributions of all blocks."""
        terms = self._nominal
        for block, own in self.by_block(parameters):
            terms = block.contribute(own, terms)
        return terms

    def matrix(self, parameters: Real) -> Complex:
        """Return the spectral matrix S of the model, shape of the data's."""
        return through_window(transfer(self.terms(parameters)).spectral_matrix)

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood, the prior included, and its gradient; `TOO_FAR` and 0 if they do not exist.

        Notes
        -----
        l(S) + sum (parameter - start)^2 / (2 prior_std^2), l as in `minus_log_likelihood`. The gradient goes back
        through the window (`onto_grid`) to the terms (`term_gradients`), and from these to each block.
        """
        try:
            with np.errstate(all="ignore"):
                value, gradient = self._objective(parameters)
        except np.linalg.LinAlgError:
            return TOO_FAR, np.zeros_like(parameters)
        is_finite = np.isfinite(value) and np.all(np.isfinite(gradient))
        return (value, gradient) if is_finite else (TOO_FAR, np.zeros_like(parameters))

    def _objective(self, parameters: Real) -> tuple[float, Real]:
        terms = self.terms(parameters)
        np.linalg.cholesky(terms.mass)  # raises where the mass matrix is not positive definite
        response = transfer(terms)
        value, weight = minus_log_likelihood(through_window(response.spectral_matrix), self.spectra)
        gradients = term_gradients(response, onto_grid(weight))
        gradient = np.concatenate([block.gradient(own, gradients) for block, own in self.by_block(parameters)])
        deviation = (parameters - self.start) / self.prior_std
        return value + float(deviation @ deviation) / 2, gradient + deviation / self.prior_std

    def whitened_derivatives(self, parameters: Real) -> Real:
        """Return sqrt(n) L^-1 (dS/dp) L^-H for each parameter p; S = L L^H, n the weights of the data.

        Returns
        -------
        ndarray
            In the real coordinates of Hermitian matrices (`real_coordinates`), shape (parameters, classes, frequencies,
            squared number of coordinates); with a larger step, `every`, fewer frequencies.
        """
        response = transfer(self.terms(parameters))
        S = through_window(response.spectral_matrix, every=self.every)
        factors = np.asarray(np.linalg.inv(np.linalg.cholesky(S)), dtype=np.complex128)
        factors *= self.spectra.weights[:, self.every // 2 :: self.every, None, None] ** 0.25
        shape = (len(S), response.terms.frequencies.size, S.shape[-1] ** 2, 1)
        derivatives = np.empty((parameters.size, *S.shape[:2], shape[2]))
        by_block = (block.derivatives(own, response) for block, own in self.by_block(parameters))
        for row, derivative in enumerate(chain.from_iterable(by_block)):
            derivatives[row] = through_window(np.broadcast_to(derivative[..., None], shape), every=self.every)[..., 0]
        return transformed(factors, derivatives)

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information without the prior: I_pq = sum n tr(S^-1 dS/dp S^-1 dS/dq)."""
        whitened = np.moveaxis(self.whitened_derivatives(parameters), 0, -1).reshape(-1, parameters.size)
        return self.every * (whitened.T @ whitened)


def minus_log_likelihood(matrices: Complex, spectra: ClassSpectra) -> tuple[float, Complex]:
    """Return minus the log likelihood of spectral matrices, and its derivative with respect to them.

    Parameters
    ----------
    matrices
        Spectral matrices S of a model, Hermitian, shape of `spectra.matrices`.
    spectra
        Mean spectral matrices S^ of the data and their weights n.

    Returns
    -------
    float, ndarray
        Value l, and W with dl = sum tr(W dS), Hermitian, shape of `matrices`, of three rows in Fortran order.

    Raises
    ------
    LinAlgError
        If a matrix is not positive definite.

    Notes
    -----
    l = sum over classes and frequencies n [ln det S + tr(S^-1 S^)] but for a constant, and
    W = n (S^-1 - S^-1 S^ S^-1).

    References
    ----------
    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953),
    125-139.
    J. R. Magnus and H. Neudecker, Matrix Differential Calculus with Applications in Statistics and Econometrics, Wiley,
    1988, chapter 8 (differentials of the determinant and of the inverse).
    """
    inverse, logdet = inverse_and_logdet(matrices)
    ratio = _products(inverse, spectra.matrices)
    traces = np.einsum("cfii->cf", ratio).real
    if np.any(traces < 0):  # S is singular to rounding, and its computed inverse not positive definite
        raise np.linalg.LinAlgError("a spectral matrix is not positive definite")
    value = float(np.sum(spectra.weights * (logdet + traces)))
    return value, spectra.weights[..., None, None] * (inverse - _products(ratio, inverse))


def inverse_and_logdet(matrices: Complex) -> tuple[Complex, Real]:
    """Return the inverse and the logarithm of the determinant of Hermitian positive definite matrices.

    Parameters
    ----------
    matrices
        Shape (..., n, n).

    Returns
    -------
    ndarray, ndarray
        Shapes (..., n, n) and (...), matrices of three rows in Fortran order.

    Raises
    ------
    LinAlgError
        If a matrix is not positive definite; those of three rows are not checked.

    Notes
    -----
    For 3 by 3 matrices, the usual case and the hottest code of a fit, by cofactors: several times faster than LAPACK on
    a stack of small matrices; in Fortran order one entry of the whole stack is contiguous in memory.

    References
    ----------
    R. A. Horn and C. R. Johnson, Matrix Analysis, Cambridge University Press, 1985, section 0.8.2 (adjugate).
    """
    if matrices.shape[-1] != 3:
        lower = np.linalg.cholesky(matrices)
        logdet = 2 * np.log(np.einsum("...ii->...i", lower).real).sum(axis=-1)
        return np.asarray(np.linalg.inv(matrices), dtype=np.complex128), np.asarray(logdet)
    S = np.asfortranarray(matrices)
    a, b, c = (S[..., k, k].real for k in range(3))
    x, y, z = S[..., 0, 1], S[..., 0, 2], S[..., 1, 2]
    cofactors = np.empty_like(S)
    cofactors[..., 0, 0] = b * c - _squared_size(z)
    cofactors[..., 1, 1] = a * c - _squared_size(y)
    cofactors[..., 2, 2] = a * b - _squared_size(x)
    cofactors[..., 0, 1] = y * z.conj() - x * c
    cofactors[..., 0, 2] = x * z - y * b
    cofactors[..., 1, 2] = y * x.conj() - z * a
    for row, column in ((1, 0), (2, 0), (2, 1)):
        cofactors[..., row, column] = cofactors[..., column, row].conj()
    determinant = (a * cofactors[..., 0, 0] + x * cofactors[..., 1, 0] + y * cofactors[..., 2, 0]).real
    cofactors /= determinant[..., None, None]
    return cofactors, np.log(determinant)


def _products(left: Complex, right: Complex) -> Complex:
    """Products of the matrices of two stacks; of three rows, in Fortran order, entry by entry of the whole stacks."""
    if left.shape[-1] != 3:
        return np.asarray(left @ right, dtype=np.complex128)
    return np.asarray(np.einsum("...ij,...jk->...ik", left, np.asfortranarray(right)), dtype=np.complex128)


def _squared_size(values: Complex) -> Real:
    """Squared absolute values."""
    return np.asarray(values.real**2 + values.imag**2, dtype=np.float64)
