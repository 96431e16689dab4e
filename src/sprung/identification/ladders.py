"""Ladders: over model orders, numbers of block rows as in the thesis, or orders of polynomials as in pLSCF."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np
from scipy import fft, linalg

from sprung._arrays import Complex, Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.identification.correlation import Correlations
from sprung.identification.subspace import (
    block_row_ladder,
    join_poles,
    realise,
    stack_rungs,
    undetermined_poles,
    with_deviations,
)
from sprung.modal import Poles

#: Lines above this share of the sampling rate are left out: decimation passes everything up to there.
_HIGHEST_LINE = 0.4
#: Relative size up to which directions of the normal equations count as undetermined.
_UNDETERMINED = 1e-13
#: A ladder of chosen size has this many times the lags of a realisation, one order for this number of lags, within
#: bounds of the largest order and of the number of poles.
_LAGS_OVER_REALISATION, _LAGS_PER_ORDER, _LARGEST_ORDERS, _MOST_POLES = 1.5, 5, (8, 30), 100


@dataclass(frozen=True, slots=True)
class PolynomialLadder:
    """Every order of the denominator of a right matrix fraction, fitted to half spectra (pLSCF).

    Parameters
    ----------
    block_rows
        Half the number of lags of the half spectra, at least 2: the lags are those of an `OrderLadder` of as many block
        rows.
    max_order
        Largest order p of the polynomials, at least 2; order p has p poles for each reference.

    Raises
    ------
    ParameterError
        If the block rows or the largest order are below 2, or the lags are too few for the order.
    """

    lags_per_row: ClassVar[int] = 2
    is_biased: ClassVar[bool] = False

    block_rows: int
    max_order: int

    def __post_init__(self) -> None:
        check_number("block_rows", self.block_rows, at_least=2)
        check_number("max_order", self.max_order, at_least=2)
        most = max(int(2 * _HIGHEST_LINE * self.block_rows), 2)
        if self.max_order > most:
            raise ParameterError(
                f"max_order={self.max_order} is more than the half spectra of block_rows={self.block_rows} can carry:"
                f" use max_order <= {most} or more block rows"
            )

    @property
    def n_lags(self) -> int:
        """Number of lags of the half spectra."""
        return self.lags_per_row * self.block_rows

    @property
    def span(self) -> int:
        """Number of lags that the ladder uses."""
        return self.n_lags

    def poles(self, correlations: Correlations) -> Poles:
        """Return the poles of all orders."""
        return polynomial_ladder(correlations, n_lags=self.n_lags, max_order=self.max_order)


def suitable_ladder(
    rows_of_realisation: int, n_references: int, *, block_rows: int | None = None, max_order: int | None = None
) -> PolynomialLadder:
    """Return a ladder that suits the lags of a realisation and the number of references.

    Parameters
    ----------
    rows_of_realisation
        Number of block rows that a realisation would have. Half spectra take 1.5 times its lags: their lines are to be
        as narrow as lightly damped modes.
    n_references
        Number of references, each of which brings as many poles as the order.
    block_rows, max_order
        Sizes that are given; None: chosen.

    Raises
    ------
    ParameterError
        As raised by `PolynomialLadder`.
    """
    rows = block_rows or round(_LAGS_OVER_REALISATION * rows_of_realisation)
    smallest, largest = _LARGEST_ORDERS
    order = min(largest, 2 * rows // _LAGS_PER_ORDER, max(_MOST_POLES // n_references, smallest))
    return PolynomialLadder(rows, max_order or max(order, 2))


def polynomial_ladder(correlations: Correlations, *, n_lags: int, max_order: int) -> Poles:
    """Return the poles of every order of a common denominator matrix, fitted to the half spectra.

    Parameters
    ----------
    correlations
        Correlations of at least `n_lags` lags.
    n_lags
        Number of lags in use, lag 0 included. Lag 0, which holds the noise of the sensors, does not count.
    max_order
        Largest order of the polynomials.

    Returns
    -------
    Poles
        Decaying poles of the orders 1 to `max_order`, which are the `ladder`, with standard deviations.

    Raises
    ------
    ParameterError
        If the correlations hold too few lags.

    Notes
    -----
    Half spectra H(z_k) = sum over m of Lambda_(m + 1) z_k^-m at the lines z_k = exp(2 pi i k / L) of the L lags, as a
    right fraction B(z) A(z)^-1 with A(z) = I + A_1 z + ... + A_p z^p. The equations H A - B = 0, each divided by
    the standard deviation of its output at its line (over blocks and references), are solved by linear least
    squares, B being eliminated for each output (reduced normal equations). No window is needed: on the lines of the L
    lags themselves, where z^L = 1, what is missing of the correlations after the last lag is a polynomial with the
    powers of B (1 to p), so that truncated correlations of a system of order p satisfy the equations exactly.

    A pole lambda (discrete) is a root of det A(lambda), its shape B(lambda) h with A(lambda) h = 0. With the lowest
    coefficient fixed to I, surplus poles grow and those of the system decay, so only the latter are returned: it
    keeps diagrams clear. Standard deviations are from the first-order change of each pole with each block.

    References
    ----------
    B. Peeters, H. Van der Auweraer, P. Guillaume and J. Leuridan (2004), The PolyMAX frequency-domain method: a new
    standard for modal parameter estimation?, Shock and Vibration 11, 395-409.

    B. Cauberghe, P. Guillaume, P. Verboven, S. Vanlanduit and E. Parloo (2005), On the influence of the parameter
    constraint on the stability of the poles and the discrimination capabilities of the stabilisation diagrams,
    Mechanical Systems and Signal Processing 19, 989-1014.

    R. Pintelon, J. Schoukens and G. Vandersteen (1997), Frequency domain system identification using arbitrary signals,
    IEEE Transactions on Automatic Control 42, 1717-1720 (truncation as a polynomial).
    """
    if correlations.n_lags < n_lags:
        raise ParameterError(
            f"n_lags={n_lags} is more than the correlations hold: estimate with {n_lags} lags or more, or use"
            f" block_rows <= {correlations.n_lags // 2}"
        )
    equations = _Equations.of(correlations, n_lags, max_order)
    rungs = [_poles_of_order(equations, order) for order in range(1, max_order + 1)]
    changes = np.concatenate([change for _, _, change in rungs], axis=1)
    found = [(poles, shapes) for poles, shapes, _ in rungs]
    changes_of = (lambda rows: changes[:, rows]) if len(changes) else None
    return with_deviations(stack_rungs(found, tuple(range(1, max_order + 1)), correlations.channels, changes_of))


@dataclass(frozen=True, eq=False, slots=True)
class _Equations:
    """Equations of all orders: those of a lower order are the first columns.

    Parameters
    ----------
    lines
        Points z_k on the unit circle, shape (lines,).
    changes
        Weighted half spectra of the blocks' changes, shape (blocks, channels, references, lines).
    left, triangle
        Orthonormal and triangular factor of the weighted powers 1 to p of z for each output, real over imaginary parts,
        shapes (channels, 2 lines, max_order) and (channels, max_order, max_order).
    right
        Weighted H(z) z^r for r = 0 to p, shape (channels, 2 lines, (max_order + 1) references).
    inner
        Sum over outputs of right^T right.
    eliminated
        left^T right for each output.
    sampling_rate
        Sampling rate [Hz].
    """

    lines: Complex
    changes: Complex
    left: Real
    triangle: Real
    right: Real
    inner: Real
    eliminated: Real
    sampling_rate: float

    @classmethod
    def of(cls, correlations: Correlations, n_lags: int, max_order: int) -> "_Equations":
        """Return the equations of correlations."""
        length = n_lags - 1
        chosen = np.arange(1, int(_HIGHEST_LINE * length) + 1)
        lines = np.exp(2j * np.pi * chosen / length)
        spectra = fft.fft(correlations.values[..., 1:n_lags])[..., chosen]
        changes = fft.fft(correlations.changes[..., 1:n_lags])[..., chosen]
        if len(changes):
            weights = 1 / np.sqrt(np.mean(np.sum(np.abs(changes) ** 2, axis=0), axis=1))
        else:
            weights = np.ones((len(spectra), len(lines)))
        powers = lines[:, None] ** np.arange(max_order + 1)
        left, triangle = np.linalg.qr(_real_over_imaginary(weights[..., None] * powers[:, 1:]))
        products = (weights[:, None] * spectra).transpose(0, 2, 1)[:, :, None] * powers[..., None]
        right = _real_over_imaginary(products.reshape(len(spectra), len(lines), -1))
        return cls(
            lines=lines,
            changes=weights[:, None] * changes,
            left=left,
            triangle=triangle,
            right=right,
            inner=np.einsum("oka,okb->ab", right, right, optimize=True),
            eliminated=left.swapaxes(1, 2) @ right,
            sampling_rate=correlations.sampling_rate,
        )


def _real_over_imaginary(values: Complex) -> Real:
    """Return complex equations (outputs, lines, unknowns) as twice as many real ones."""
    return np.concatenate([values.real, values.imag], axis=1)


def _poles_of_order(equations: _Equations, order: int) -> tuple[Complex, Complex, Complex]:
    """Return poles, shapes and standard deviations of frequency and damping of one order."""
    n_references = equations.changes.shape[2]
    n_unknowns = (order + 1) * n_references
    eliminated = equations.eliminated[:, :order, :n_unknowns]
    flat = eliminated.reshape(-1, n_unknowns)
    normal = equations.inner[:n_unknowns, :n_unknowns] - flat.T @ flat
    inverse = _inverse(normal[n_references:, n_references:])
    A = np.concatenate([np.eye(n_references), -inverse @ normal[n_references:, :n_references]])
    roots = _decaying_roots(A.reshape(order + 1, n_references, n_references))
    powers = roots[:, None] ** np.arange(order + 1)
    left_null, right_null, slopes = _null_vectors(A.reshape(order + 1, n_references, n_references), roots, powers)
    numerators = np.linalg.solve(equations.triangle[:, :order, :order], eliminated @ A)
    shapes: Complex = np.einsum("np,opr,nr->no", powers[:, 1:], numerators, right_null, optimize=True)
    poles = np.asarray(np.log(roots) * equations.sampling_rate, dtype=np.complex128)
    if not len(equations.changes) or not len(roots):
        return poles, shapes, np.zeros((len(equations.changes), len(roots)), dtype=np.complex128)
    outer = inverse @ (powers[:, 1:, None] * left_null[:, None]).reshape(len(roots), -1).T
    change = _root_changes(equations, order, A @ right_null.T, outer) / slopes
    return poles, shapes, change / roots * equations.sampling_rate


def _inverse(matrix: Real) -> Real:
    """Return the inverse of a symmetric matrix, without directions that are undetermined."""
    eigenvalues, vectors = linalg.eigh(matrix, check_finite=False, driver="evd")
    is_known = eigenvalues > _UNDETERMINED * eigenvalues[-1]
    kept = vectors[:, is_known]
    return np.asarray((kept / eigenvalues[is_known]) @ kept.T)


def _decaying_roots(A: Real) -> Complex:
    """Return the roots of det(I + A_1 z + ... + A_p z^p) inside the unit circle with positive imaginary part."""
    order, size = len(A) - 1, A.shape[1]
    companion = np.eye(order * size, k=-size)
    companion[:size] = -A[1:].transpose(1, 0, 2).reshape(size, -1)
    inverses = np.linalg.eigvals(companion)
    return np.asarray(1 / inverses[(inverses.imag < 0) & (np.abs(inverses) > 1)], dtype=np.complex128)


def _null_vectors(A: Real, roots: Complex, powers: Complex) -> tuple[Complex, Complex, Complex]:
    """Return g and h with g A(z) = 0 and A(z) h = 0 at each root, and the slopes g A'(z) h."""
    at_roots = np.einsum("np,prs->nrs", powers, A, optimize=True)
    slope = np.einsum("np,prs->nrs", powers[:, :-1] * np.arange(1, len(A)), A[1:], optimize=True)
    U, _, Vh = np.linalg.svd(at_roots)
    left, right = U[:, :, -1].conj(), Vh[:, -1].conj()
    return left, right, np.einsum("nr,nrs,ns->n", left, slope, right, optimize=True)


def _root_changes(equations: _Equations, order: int, solution: Complex, outer: Complex) -> Complex:
    """Return g A'(z) h times the change of each root with each block, shape (blocks, roots).

    With the equations Y (coefficients) = 0 projected off those of B by P, the normal equations are Y^T P Y (I; theta) =
    0. A change dY changes theta by -M^-1 (dY^T P Y + Y^T P dY)(I; theta) without the rows of I, and the root by
    -g dA(z) h / (g A'(z) h). `solution` is (I; theta) h, `outer` is M^-1 times the vector of g z^r.
    """
    n_references = equations.changes.shape[2]
    n_unknowns, n_roots = (order + 1) * n_references, outer.shape[1]
    padded = np.concatenate([np.zeros((n_references, n_roots)), outer])
    right, left = equations.right[..., :n_unknowns], equations.left[..., :order]

    def projected(vectors: Complex) -> Complex:
        moved = right @ vectors
        return np.asarray(moved - left @ (left.swapaxes(1, 2) @ moved))

    def at_lines(vectors: Complex, lines: Complex) -> Complex:
        powers = lines[:, None] ** np.arange(order + 1)
        return np.einsum("kp,prn->rkn", powers, vectors.reshape(order + 1, n_references, -1), optimize=True)

    total = np.zeros((len(equations.changes), n_roots), dtype=np.complex128)
    n_lines = len(equations.lines)
    for sign in (1, -1):
        lines = equations.lines if sign > 0 else equations.lines.conj()
        changes = equations.changes if sign > 0 else equations.changes.conj()
        weights = np.zeros((*changes.shape[1:], n_roots), dtype=np.complex128)
        for residuals, vectors in ((projected(solution), padded), (projected(padded), solution)):
            halves = (residuals[:, :n_lines] - sign * 1j * residuals[:, n_lines:]) / 2
            weights += halves[:, None] * at_lines(vectors, lines)
        total += changes.reshape(len(changes), -1) @ weights.reshape(-1, n_roots)
    return total


#: Edges of the low-pass as shares of the lower rate: what lies above the second folds to above the first.
PASSED, STOPPED = 0.35, 0.65
#: Attenuation above the stop edge, in power [dB].
_STOP_BAND = 60.0


def filter_half_width(factor: int) -> int:
    """Return the number of lags that the low-pass needs on each side of a lag."""
    if factor == 1:
        return 0
    width = (STOPPED - PASSED) / factor
    return int(np.ceil((_STOP_BAND - 7.95) / (2.285 * 2 * np.pi * width) / 2))


def decimate_correlations(correlations: Correlations, factor: int, *, n_lags: int) -> Correlations:
    """Return correlations with a low-pass, at every `factor`-th lag.

    Parameters
    ----------
    correlations
        Correlations whose references are all channels, or none of the channels.
    factor
        Ratio of the old to the new sampling rate, at least 1; 1 returns the correlations as they are.
    n_lags
        Largest number of lags of the result.

    Returns
    -------
    Correlations
        Lags 0, `factor`, 2 `factor`, ..., as many as the low-pass leaves, up to `n_lags`.

    Notes
    -----
    Lambda'_m = sum over k of c_k Lambda_(m D + k) with a symmetric low-pass c. A sum of exponentials keeps its poles
    and shapes; only the participations change, by the response of the low-pass. Negative lags are those of the
    exchanged channels, Lambda_(-m) = Lambda_m^T: not one sum of exponentials with the positive ones, so the first few
    lags deviate by the stop band (poles by 1e-5). Where no reference is a channel they are not known: all lags are then
    later by the half-width of the low-pass, which the participations absorb, and the poles are exact.
    """
    if factor == 1:
        return correlations
    half = filter_half_width(factor)
    taps = np.sinc((STOPPED + PASSED) / factor * np.arange(-half, half + 1)) * np.kaiser(
        2 * half + 1, 0.1102 * (_STOP_BAND - 8.7)
    )
    taps /= taps.sum()
    has_all = correlations.references == correlations.channels
    return replace(
        correlations,
        values=_filtered(correlations.values, taps, factor, n_lags, has_all),
        blocks=_filtered(correlations.blocks, taps, factor, n_lags, has_all),
        sampling_rate=correlations.sampling_rate / factor,
    )


def _filtered(values: Real, taps: Real, factor: int, n_lags: int, has_all: bool) -> Real:
    """Return values (..., channels, references, lags) after the low-pass, at every `factor`-th lag."""
    if has_all:
        earlier = values[..., len(taps) // 2 : 0 : -1].swapaxes(-3, -2)
        values = np.concatenate([earlier, values], axis=-1)
    windows = np.lib.stride_tricks.sliding_window_view(values, len(taps), axis=-1)[..., : n_lags * factor : factor, :]
    return np.asarray(windows @ taps)


#: Time constants within the lags after which a pole has decayed.
_DECAYED = 3.0


@dataclass(frozen=True, slots=True)
class OrderLadder:
    """Every even model order of one realisation, or of several at different rates.

    A realisation is that of a block Toeplitz matrix of correlations without bias, weighted for canonical variates.

    Parameters
    ----------
    block_rows
        Number i of block rows, at least 2.
    max_order
        Largest model order, at least 2.
    strides
        Lags from one block row to the next, rising from 1: one realisation for each, of correlations decimated by that
        factor. Where the matrix may not have enough block rows to span the ring-down of the slowest mode at the rate of
        the fastest, the slow modes are those of a larger stride.

    Raises
    ------
    ParameterError
        If the block rows or the largest order are below 2, or the strides do not rise from 1.

    Notes
    -----
    A rung holds the poles of its order from every realisation: below 0.35 of the rate of the next larger stride those
    of that stride, above it those of the smaller one.
    """

    #: Number of lags for each block row, and whether correlations are divided by the number of samples.
    lags_per_row: ClassVar[int] = 2
    is_biased: ClassVar[bool] = False

    block_rows: int
    max_order: int
    strides: Sequence[int] = (1,)

    def __post_init__(self) -> None:
        check_number("block_rows", self.block_rows, at_least=2)
        check_number("max_order", self.max_order, at_least=2)
        object.__setattr__(self, "strides", tuple(self.strides))
        if self.strides[:1] != (1,) or sorted(set(self.strides)) != list(self.strides):
            raise ParameterError(f"strides {self.strides} must rise from 1")

    @property
    def n_lags(self) -> int:
        """Number of lags of the block matrices, with those that the low-pass of the largest stride needs."""
        return self.span + 2 * filter_half_width(self.strides[-1])

    @property
    def span(self) -> int:
        """Number of lags that the block rows of the largest stride span."""
        return self.lags_per_row * self.block_rows * self.strides[-1]

    def poles(self, correlations: Correlations) -> Poles:
        """Return the poles of all orders, without their standard deviations (`with_deviations`).

        Below its edge a stride takes over the poles that outlast the lags of the one before: heavily damped ones decay
        within them, and longer lags would hold noise alone.
        """
        n_lags, rate, parts = self.lags_per_row * self.block_rows, correlations.sampling_rate, []
        for stride in self.strides:
            decimated = decimate_correlations(correlations, stride, n_lags=n_lags)
            realisation = realise(decimated, block_rows=self.block_rows, max_order=self.max_order)
            parts.append(undetermined_poles(realisation, range(2, self.max_order + 1, 2)))
        if len(parts) == 1:
            return parts[0]
        taken = [np.ones(len(part.poles), dtype=np.bool_) for part in parts]
        for k, (before, stride) in enumerate(pairwise(self.strides)):
            for number, part in enumerate(parts):
                has_decayed = -part.poles.real * n_lags * before / rate > _DECAYED
                is_later = (part.natural_frequency < PASSED * rate / stride) & ~has_decayed
                taken[number] &= is_later if number > k else ~is_later
        return join_poles(parts, taken)


@dataclass(frozen=True, slots=True)
class BlockRowLadder:
    """One realisation for each number of block rows, the model order following it: the ladder of the thesis.

    Each realisation is that of correlations as data in block Hankel matrices, without weights. The correlations are
    divided by the number of samples (1/N), not of products.

    Parameters
    ----------
    first, last
        Smallest and largest number of block rows, 2 <= first <= last.

    Raises
    ------
    ParameterError
        If the block rows do not rise from 2 or more.

    References
    ----------
    F. Liu (2020), eq. 3-35 to 3-45 and sections 4.3 and 7.3.
    """

    lags_per_row: ClassVar[int] = 3
    is_biased: ClassVar[bool] = True

    first: int
    last: int

    def __post_init__(self) -> None:
        if not 2 <= self.first <= self.last:
            raise ParameterError(f"block rows {self.first} to {self.last} must rise from 2 or more")

    @property
    def n_lags(self) -> int:
        """Number of lags of the largest block matrix."""
        return self.lags_per_row * self.last

    @property
    def span(self) -> int:
        """Number of lags that the block rows span."""
        return self.n_lags

    def poles(self, correlations: Correlations) -> Poles:
        """Return the poles of all realisations."""
        return block_row_ladder(correlations, range(self.first, self.last + 1), is_hankel=True)


Ladder = OrderLadder | BlockRowLadder | PolynomialLadder
