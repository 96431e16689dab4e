"""Realisations of correlations: block matrices, state matrices of all orders, poles and their uncertainty."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft, linalg

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.identification.correlation import Correlations
from sprung.modal import Poles

#: Smallest eigenvalue of the outputs' covariance over the largest: without it, the little noise of nearly noise-free
#: records would dominate.
_WHITENING_FLOOR = 3e-3
#: Eigenvalue of the Gram matrix at the largest order over the largest, above which it stands for the matrix itself.
_SQUARED = 1e-4


def block_toeplitz(values: Real, block_rows: int) -> Real:
    """Return the block Toeplitz matrix of Lambda_1 ... Lambda_(2 i - 1).

    Parameters
    ----------
    values
        Correlations for at least 2 i lags from 0, shape (channels, references, lags).
    block_rows
        Number i of block rows, at least 2.

    Returns
    -------
    numpy.ndarray
        Block Toeplitz matrix, shape (i channels, i references); block (p, q) is Lambda_(i + p - q).

    References
    ----------
    F. Liu (2020), eq. 3-39.
    """
    falling = values[:, :, 2 * block_rows - 1 : 0 : -1]
    rows = _windows(falling, block_rows, block_rows)[::-1]
    return np.ascontiguousarray(rows.reshape(block_rows * len(values), -1))


def block_hankel(values: Real, block_rows: int, *, first_lag: int, n_columns: int) -> Real:
    """Return the block Hankel matrix of correlations taken as data.

    Parameters
    ----------
    values
        Correlations for lags from 0, shape (channels, references, lags).
    block_rows
        Number i of block rows.
    first_lag
        Lag of block (0, 0).
    n_columns
        Number j of block columns.

    Returns
    -------
    numpy.ndarray
        Block Hankel matrix, shape (i channels, j references); block (p, q) is Lambda_(first_lag + p + q).

    References
    ----------
    F. Liu (2020), eq. 3-35.
    """
    rising = values[:, :, first_lag : first_lag + block_rows + n_columns - 1]
    rows = _windows(rising, block_rows, n_columns)
    return np.ascontiguousarray(rows.reshape(block_rows * len(values), -1))


def _windows(values: Real, n_rows: int, n_columns: int) -> Real:
    """Return a view (rows, channels, columns references) whose block (p, q) is lag p + q: its rows are stored once."""
    n_channels, n_references, _ = values.shape
    rows = np.ascontiguousarray(values.transpose(0, 2, 1)).reshape(n_channels, -1)
    windows = np.lib.stride_tricks.sliding_window_view(rows, n_columns * n_references, axis=1)
    return windows[:, ::n_references].transpose(1, 0, 2)[:n_rows]


@dataclass(frozen=True, eq=False, slots=True)
class Realisation:
    """Decomposition of a block matrix, which holds the realisations of all model orders.

    Parameters
    ----------
    observability
        Observability matrix, shape (block_rows channels, max_order); its first n columns are that of order n.
    singular_values
        Singular values of the (weighted) block matrix, falling.
    right_factor
        Matrix Z of `observability` = H Z, shape (block columns, references, max_order), with the block Hankel matrix H
        whose block (p, q) is lag p + q of the correlations in use.
    changes
        Deviations of these correlations in each block, shape (blocks, channels, references, block_rows + block columns
        - 1), scaled so that the sum over blocks of the squares of any linear function is its variance.
    channels
        Names of the outputs.
    sampling_rate
        Sampling rate [Hz].
    """

    observability: Real
    singular_values: Real
    right_factor: Real
    changes: Real
    channels: tuple[str, ...]
    sampling_rate: float


def realise(
    correlations: Correlations, *, block_rows: int, max_order: int, is_weighted: bool = True, is_hankel: bool = False
) -> Realisation:
    """Decompose the block matrix of the correlations.

    Parameters
    ----------
    correlations
        Correlations of at least 2 `block_rows` lags (3 `block_rows` for the Hankel form).
    block_rows
        Number i of block rows, at least 2.
    max_order
        Largest model order, 2 to the smaller of (i - 1) channels and i references.
    is_weighted
        Whether the block matrix is whitened by the outputs' own covariance before the singular value decomposition
        (canonical variates), which brings out weak modes next to strong ones. Unless all outputs are references, only
        the side of the references is whitened. False: the unweighted form of the thesis.
    is_hankel
        Whether correlations are data in past and future block Hankel matrices (the form of the thesis; never weighted);
        False: they are the blocks of the Toeplitz matrix.

    Returns
    -------
    Realisation

    Raises
    ------
    ParameterError
        If the correlations hold too few lags, or the matrix is too small for `max_order`.

    Notes
    -----
    T = U S V^T and O = U S^(1/2), weighted: O = W U S^(1/2) with W the inverse of the whitening. As O = T Z with a
    known Z, a change dT of the correlations changes O by dT Z to first order (up to a change of basis, and
    neglecting the part of the discarded singular values).

    References
    ----------
    F. Liu (2020), eq. 3-35 to 3-45.

    B. Peeters and G. De Roeck (1999), Reference-based stochastic subspace identification for output-only modal
    analysis, Mechanical Systems and Signal Processing 13, 855-878.

    P. Van Overschee and B. De Moor (1996), Subspace identification for linear systems, chapter 3 (weights).

    M. Döhler and L. Mevel (2013), Efficient multi-order uncertainty computation for stochastic subspace identification,
    Mechanical Systems and Signal Processing 38, 346-366.
    """
    _check_size(correlations, block_rows, max_order, is_hankel)
    rows: Real | None = None
    left: Real | None = None
    right: Real | None = None
    if is_hankel:
        matrix, rows = _projected(correlations, block_rows)
    else:
        matrix = block_toeplitz(correlations.values, block_rows)
    if is_weighted and not is_hankel:
        left, right = _whitening(correlations, block_rows)
    weighted = matrix if left is None else left @ matrix
    weighted = weighted if right is None else weighted @ right
    S, V = _right_singular(weighted, max_order)
    Z = V / np.sqrt(S[:max_order])
    Z = Z if right is None else right @ Z
    first_lag = 1 if rows is None else 1 + block_rows
    rising = Z.reshape(block_rows, -1, max_order)[::-1] if rows is None else rows @ Z
    right_factor = rising.reshape(-1, len(correlations.references), max_order)
    n_lags = block_rows + len(right_factor) - 1
    return Realisation(
        observability=matrix @ Z,
        singular_values=S,
        right_factor=right_factor,
        changes=correlations.changes[..., first_lag : first_lag + n_lags],
        channels=correlations.channels,
        sampling_rate=correlations.sampling_rate,
    )


def _check_size(correlations: Correlations, block_rows: int, max_order: int, is_hankel: bool) -> None:
    """Check that the lags suffice for the block rows, and the block rows for the order."""
    check_number("block_rows", block_rows, at_least=2)
    check_number("max_order", max_order, at_least=2)
    n_needed = (3 if is_hankel else 2) * block_rows
    if correlations.n_lags < n_needed:
        raise ParameterError(
            f"block_rows={block_rows} needs {n_needed} lags, but the correlations hold {correlations.n_lags}:"
            f" estimate with at least {n_needed / correlations.sampling_rate:.3g} s of lags"
            f" or use block_rows <= {correlations.n_lags // (3 if is_hankel else 2)}"
        )
    n_references = len(correlations.references)
    largest = min((block_rows - 1) * len(correlations.channels), block_rows * n_references)
    if max_order > largest:
        raise ParameterError(
            f"max_order={max_order} is more than block_rows={block_rows} can carry with {len(correlations.channels)}"
            f" channels and {n_references} references: use max_order <= {largest} or more block rows"
        )


def _projected(correlations: Correlations, block_rows: int) -> tuple[Real, Real]:
    """Return the projection of the future of correlations as data on their past, and the rows of the past.

    Yf Q with the orthonormal rows Q of Yp spans the same columns as the thesis' T = Yf Yp^T, without squaring the
    condition number (poles of a 7-DOF vehicle: 1e-13 instead of 1e-7). A change of Yp only changes the basis.
    """
    n_columns = correlations.n_lags - 2 * block_rows
    past = block_hankel(correlations.values, block_rows, first_lag=1, n_columns=n_columns)
    rows = np.linalg.qr(past.T).Q
    future = block_hankel(correlations.values, block_rows, first_lag=1 + block_rows, n_columns=n_columns)
    return future @ rows, rows


def _whitening(correlations: Correlations, block_rows: int) -> tuple[Real | None, Real | None]:
    """Return the inverse square roots of the covariances of future outputs and past references; None where unknown."""
    lags = np.arange(block_rows)[:, None] - np.arange(block_rows)
    if not set(correlations.references) <= set(correlations.channels):
        return None, None
    rows = [correlations.channels.index(name) for name in correlations.references]
    own = correlations.values[rows]
    blocks = np.where(lags >= 0, own[:, :, np.abs(lags)], own.transpose(1, 0, 2)[:, :, np.abs(lags)])
    size = block_rows * len(rows)
    eigenvalues, vectors = np.linalg.eigh(blocks.transpose(2, 0, 3, 1).reshape(size, size))
    eigenvalues = np.maximum(eigenvalues, _WHITENING_FLOOR * eigenvalues[-1])
    root = (vectors / np.sqrt(eigenvalues)) @ vectors.T
    return (root if correlations.references == correlations.channels else None), root


def _right_singular(matrix: Real, rank: int) -> tuple[Real, Real]:
    """Return the singular values, falling, and the right singular vectors of the largest ones, (columns, rank).

    From the eigenvalues of the Gram matrix, in half the time, where squaring leaves the vectors exact to rounding:
    correlations of measurements, after whitening.
    """
    eigenvalues, vectors = np.linalg.eigh(matrix.T @ matrix)
    if len(matrix) >= len(vectors) and eigenvalues[-rank] > _SQUARED * eigenvalues[-1]:
        return np.sort(np.linalg.norm(matrix @ vectors, axis=0))[::-1], vectors[:, : -rank - 1 : -1]
    try:
        _, S, Vt = linalg.svd(matrix, full_matrices=False, check_finite=False)
    except linalg.LinAlgError:  # a slower method where the fast one does not converge
        _, S, Vt = linalg.svd(matrix, full_matrices=False, lapack_driver="gesvd")
    return S, Vt[:rank].T


def poles_of_orders(realisation: Realisation, orders: Sequence[int]) -> Poles:
    """Return the poles of every model order from one QR decomposition.

    Parameters
    ----------
    realisation
        Decomposition from `realise`.
    orders
        Model orders, rising, up to the `max_order` of the realisation.

    Returns
    -------
    Poles
        Poles of all orders with their standard deviations; `ladder` is `orders`.

    Notes
    -----
    With the observability matrix of the largest order without its last, and without its first block row,
    O_up = Q R and X = Q^T O_down, the state matrix of order n is R[:n, :n]^-1 X[:n, :n]. Frequency abs(ln lambda) fs
    / 2 pi, damping -Re(ln lambda) / abs(ln lambda), shape C psi. First-order change of an eigenvalue: chi^H
    O_up^+ (dO_down - lambda dO_up) psi / (chi^H psi).

    References
    ----------
    F. Liu (2020), eq. 3-46 to 3-52.

    M. Döhler and L. Mevel (2012), Fast multi-order computation of system matrices in subspace-based system
    identification, Control Engineering Practice 20, 882-894.

    E. Reynders, R. Pintelon and G. De Roeck (2008), Uncertainty bounds on modal parameters obtained from stochastic
    subspace identification, Mechanical Systems and Signal Processing 22, 948-969 (standard deviations).
    """
    return with_deviations(undetermined_poles(realisation, orders))


def undetermined_poles(realisation: Realisation, orders: Sequence[int]) -> Poles:
    """Return the poles of every model order, whose standard deviations `with_deviations` adds.

    Parameters
    ----------
    realisation, orders
        As for `poles_of_orders`.

    Returns
    -------
    Poles
        Poles of all orders without changes; `ladder` is `orders`.
    """
    n_channels = len(realisation.channels)
    O_up, O_down = realisation.observability[:-n_channels], realisation.observability[n_channels:]
    Q, R = np.linalg.qr(O_up)
    # The leading block of the inverse of a triangular matrix is the inverse of its leading block.
    S = linalg.solve_triangular(R, np.eye(len(R)), check_finite=False)
    X = Q.T @ O_down
    systems = [_system(S[:order, :order] @ X[:order, :order]) for order in orders]
    starts = np.cumsum([0, *(len(eigenvalues) for eigenvalues, _, _ in systems)])
    first = realisation.observability[:n_channels]
    n_blocks = len(realisation.changes)

    def changes_of(rows: Indices) -> Complex:
        if not len(rows):
            return np.zeros((n_blocks, 0), dtype=np.complex128)
        left = np.zeros((len(Q), len(rows)), dtype=np.complex128)
        right = np.zeros((len(R), len(rows)), dtype=np.complex128)
        for order, start, (eigenvalues, psi, chosen) in zip(orders, starts, systems, strict=False):
            columns = np.flatnonzero((rows >= start) & (rows < start + len(eigenvalues)))
            if len(columns):
                own = chosen[rows[columns] - start]
                left[:, columns] = Q[:, :order] @ (S[:order, :order].T @ np.linalg.inv(psi)[own].T)
                right[:order, columns] = psi[:, own]
        own_values = np.concatenate([eigenvalues for eigenvalues, _, _ in systems])[rows]
        return _eigenvalue_changes(realisation, own_values, left, right) / own_values * realisation.sampling_rate

    rungs: list[tuple[Complex, Complex]] = [
        (np.log(eigenvalues) * complex(realisation.sampling_rate), (first[:, : len(psi)] @ psi[:, chosen]).T)
        for eigenvalues, psi, chosen in systems
    ]
    return stack_rungs(rungs, tuple(orders), realisation.channels, changes_of if n_blocks else None)


def with_deviations(poles: Poles, chosen: Booleans | None = None) -> Poles:
    """Return poles with the changes of those that need them, and with their standard deviations.

    Parameters
    ----------
    poles
        Poles of a ladder; standard deviations that are not infinite stay as they are.
    chosen
        Which poles need them, shape (poles,); None: all.
    """
    if poles.changes_of is None:
        return poles
    rows = np.arange(len(poles.poles)) if chosen is None else np.flatnonzero(chosen)
    of_rows = poles.changes_of(rows)
    changes = np.full((len(of_rows), len(poles.poles)), np.nan + 1j * np.nan)
    changes[:, rows] = of_rows
    deviations = np.full((2, len(poles.poles)), np.nan)
    for deviation, change in zip(deviations, frequency_and_damping_changes(poles.poles[rows], of_rows), strict=True):
        deviation[rows] = np.sqrt(np.sum(change**2, axis=0))
    stated = (poles.natural_frequency_std, poles.damping_ratio_std)
    known = [np.where(np.isinf(old), new, old) for old, new in zip(stated, deviations, strict=True)]
    return replace(poles, natural_frequency_std=known[0], damping_ratio_std=known[1], changes=changes, changes_of=None)


def _system(state_matrix: Real) -> tuple[Complex, Complex, Indices]:
    """Return the eigenvalues with positive imaginary part, all eigenvectors, and the places of those eigenvalues."""
    eigenvalues, psi = np.linalg.eig(state_matrix)
    chosen = np.flatnonzero(eigenvalues.imag > 0)
    return eigenvalues[chosen].astype(np.complex128), psi, chosen


def _eigenvalue_changes(realisation: Realisation, eigenvalues: Complex, left: Complex, right: Complex) -> Complex:
    """Return left_k^T (dO_down - eigenvalue_k dO_up) right_k for every block and pole, shape (blocks, poles).

    A block Hankel matrix between two vectors is the sum over lags of the correlations times the convolution of both.
    """
    changes = realisation.changes
    n_channels, n_poles, n_lags = len(realisation.channels), len(eigenvalues), changes.shape[-1]
    n_fft = fft.next_fast_len(n_lags)
    before = np.zeros((n_poles, n_channels, len(left) // n_channels + 1), dtype=np.complex128)
    rows = left.T.reshape(n_poles, -1, n_channels).swapaxes(1, 2)
    before[..., 1:] = rows
    before[..., :-1] -= eigenvalues[:, None, None] * rows
    after = np.moveaxis(realisation.right_factor @ right, (0, 1), (2, 1))
    product = fft.fft(before, n_fft)[:, :, None] * fft.fft(after, n_fft)[:, None]
    weights = fft.ifft(product, overwrite_x=True)[..., :n_lags].reshape(n_poles, -1)
    flat = changes.reshape(len(changes), -1)
    return np.asarray(flat @ weights.real.T + 1j * (flat @ weights.imag.T))


def eigenvalue_weights(realisation: Realisation, order: int, eigenvalue: complex) -> tuple[Complex, Complex]:
    """Return the weights of the correlations in the eigenvalue of one model order.

    Parameters
    ----------
    realisation
        Decomposition of a block Toeplitz matrix.
    order
        Model order, up to the `max_order` of the realisation.
    eigenvalue
        Value near an eigenvalue of that order.

    Returns
    -------
    tuple of numpy.ndarray
        Weights W of the numerator and V of the denominator, shape (channels, references, lags from 1 on): the
        eigenvalue is sum(W Lambda) / sum(V Lambda).

    Notes
    -----
    chi^H O_up^+ T_down Z psi / chi^H O_up^+ T_up Z psi with the eigenvectors of that order. Correlations
    C A^(m - 1) G' of the same system with any other G' have the same quotient, the eigenvalue itself: it is a modal
    filter, which shows whether the poles of other correlations differ, without a realisation of them.
    """
    n_channels = len(realisation.channels)
    O_up, O_down = realisation.observability[:-n_channels, :order], realisation.observability[n_channels:, :order]
    Q, R = np.linalg.qr(O_up)
    eigenvalues, psi = np.linalg.eig(linalg.solve_triangular(R, Q.T @ O_down, check_finite=False))
    nearest = int(np.argmin(np.abs(eigenvalues - eigenvalue)))
    left = Q @ np.linalg.solve(R.T.astype(complex), np.linalg.inv(psi)[nearest])
    before = left.reshape(-1, n_channels).T
    after = (realisation.right_factor[..., :order] @ psi[:, nearest]).T
    n_lags = before.shape[1] + after.shape[1]
    n_fft = fft.next_fast_len(n_lags)
    product = fft.ifft(fft.fft(before, n_fft)[:, None] * fft.fft(after, n_fft))[..., : n_lags - 1]
    zero = np.zeros((*product.shape[:2], 1))
    return np.concatenate([zero, product], axis=-1), np.concatenate([product, zero], axis=-1)


def frequency_and_damping_changes(poles: Complex, changes: Complex) -> tuple[Real, Real]:
    """Return the changes of natural frequencies [Hz] and damping ratios with those of the poles, (blocks, poles)."""
    modulus = np.abs(poles)
    d_modulus = np.real(np.conj(poles) * changes) / modulus
    return d_modulus / (2 * np.pi), -changes.real / modulus + poles.real * d_modulus / modulus**2


def stack_rungs(
    rungs: Sequence[tuple[Complex, Complex]],
    ladder: tuple[int, ...],
    channels: tuple[str, ...],
    changes_of: Callable[[Indices], Complex] | None,
) -> Poles:
    """Return the poles and shapes of all rungs; their changes are computed when `with_deviations` asks for them."""
    poles, shapes = (np.concatenate([rung[k] for rung in rungs]) for k in range(2))
    deviation = np.full(len(poles), np.nan if changes_of is None else np.inf)
    numbers = np.repeat(np.arange(len(rungs)), [len(rung[0]) for rung in rungs])
    unknown = np.zeros((0, len(poles)), dtype=np.complex128)
    return Poles(poles, shapes, numbers, ladder, channels, deviation, deviation, unknown, changes_of)


def join_poles(parts: Sequence[Poles], taken: Sequence[Booleans]) -> Poles:
    """Return the taken poles of several ladders over the same rungs as one."""
    rungs = np.concatenate([part.rungs[rows] for part, rows in zip(parts, taken, strict=True)])
    order = np.argsort(rungs, kind="stable")
    owners = np.repeat(np.arange(len(parts)), [np.count_nonzero(rows) for rows in taken])[order]
    places = np.concatenate([np.flatnonzero(rows) for rows in taken])[order]
    functions = [part.changes_of for part in parts if part.changes_of is not None]

    def changes_of(rows: Indices) -> Complex:
        own = [owners[rows] == k for k in range(len(parts))]
        changes = [function(places[rows[is_own]]) for function, is_own in zip(functions, own, strict=True)]
        return np.concatenate(changes, axis=1)[:, np.argsort(np.argsort(owners[rows], kind="stable"))]

    names = ("poles", "mode_shapes", "natural_frequency_std", "damping_ratio_std")
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    starts = np.cumsum([0, *(len(part.poles) for part in parts)])[owners]
    return replace(
        parts[0],
        **{name: values[starts + places] for name, values in joined.items()},
        rungs=rungs[order],
        changes=np.zeros((0, len(order)), dtype=np.complex128),
        changes_of=changes_of if functions else None,
    )


def block_row_ladder(
    correlations: Correlations, block_rows: Sequence[int], *, is_weighted: bool = False, is_hankel: bool = False
) -> Poles:
    """Return the poles of one realisation for each number of block rows, the order following it.

    Parameters
    ----------
    correlations
        Correlations with lags for the largest number.
    block_rows
        Numbers of block rows, the rungs of the ladder, rising (the thesis: 12 to 45, 48 or 82). The model order is the
        largest even number up to the number of block rows; with one channel, which carries no more, up to one less.
    is_weighted, is_hankel
        As in `realise`.

    Returns
    -------
    Poles
        Poles of all realisations; `ladder` is `block_rows`.

    Raises
    ------
    ParameterError
        As raised by `realise`.

    References
    ----------
    F. Liu (2020), sections 4.3 and 7.3.
    """
    rungs = []
    for number, i in enumerate(block_rows):
        largest = min(i, (i - 1) * len(correlations.channels))
        order = largest - largest % 2
        realisation = realise(correlations, block_rows=i, max_order=order, is_weighted=is_weighted, is_hankel=is_hankel)
        rung = undetermined_poles(realisation, [order])
        rungs.append(replace(rung, rungs=rung.rungs + number, ladder=tuple(block_rows)))
    return with_deviations(join_poles(rungs, [np.ones(len(rung.poles), dtype=np.bool_) for rung in rungs]))
