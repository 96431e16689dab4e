"""Response of a vehicle to its inputs at every frequency, and derivatives through it in both directions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.hermitian import coordinates_with_adjoint, real_coordinates
from sprung.likelihood.terms import Terms


@dataclass(frozen=True, eq=False, slots=True)
class Transfer:
    """Response of the vehicle, solved at every frequency; derivatives of the spectral matrix with respect to a term.

    Parameters
    ----------
    terms
        Terms of the spectral matrix.
    displacements
        X = D^-1 B, displacement of each coordinate of the structure for each input, shape (grid, n, inputs).
    force_response
        L = -w^2 R D^-1, coordinates of the data for a force on each coordinate, shape (grid, coordinates, n).
    matrix
        H, coordinates of the data for each input, shape (grid, coordinates, inputs).
    driven
        S_inputs H^H, shape (classes, grid, inputs, coordinates).

    Notes
    -----
    R = reduction diag(channel response) motion; the other symbols are those of `Terms`. A change dD of the dynamic
    stiffness, dB of the drive and dR of the sensors changes the response by

        dH = L (dB - dD X) - w^2 dR X,    dS = dH S_inputs H^H + (dH S_inputs H^H)^H.

    The methods return dS before the window for a change of one term, in the real coordinates of Hermitian matrices
    (`real_coordinates`), shape (classes, grid, squared number of coordinates).
    """

    terms: Terms
    displacements: Complex
    force_response: Complex
    matrix: Complex
    driven: Complex

    @property
    def spectral_matrix(self) -> Complex:
        """S = H S_inputs H^H + noise, shape (classes, grid, coordinates, coordinates)."""
        return times_classes(self.matrix, self.driven) + self.terms.noise

    def change_by_element(self, element: int, stiffness: Complex) -> Real:
        """Return dS for a change of an element's dynamic stiffness, shape (grid,): dH = dz L d (foot^T - d^T X)."""
        d, foot = self.terms.elongations[element], self.terms.feet[element]
        response = (self.force_response @ d)[:, :, None] * (foot - d @ self.displacements)[:, None, :]
        return self.change_by_transfer(stiffness[:, None, None] * response)

    def change_by_mass(self, mass: Real) -> Real:
        """Return dS for a change of the mass matrix: dH = w^2 L dM X."""
        squared = self.terms.squared[:, None, None]
        return self.change_by_transfer(squared * (self.force_response @ mass @ self.displacements))

    def change_by_motion(self, motion: Real) -> Real:
        """Return dS for a change of the channels' readings of motion: dH = -w^2 reduction diag(.) dmotion X."""
        read = -self.terms.squared[:, None, None] * (motion @ self.displacements)
        return self.change_by_transfer(_reduced(self.terms) @ read)

    def change_by_channel(self, channel: int, response: Complex) -> Real:
        """Return dS for a change of the frequency response of a channel, shape (grid,)."""
        terms = self.terms
        read = -terms.squared[:, None] * (terms.motion[channel] @ self.displacements) + terms.feedthrough[channel]
        return self.change_by_transfer(terms.reduction[:, channel][:, None] * (response[:, None] * read)[:, None, :])

    def change_by_inputs(self, inputs: Real | Complex) -> Real:
        """Return dS for a change of the spectral matrix of the wheels' inputs: H dS_inputs H^H."""
        H = self.matrix[..., : inputs.shape[-1]]
        if inputs.ndim < 4:
            return real_coordinates(H @ inputs @ _adjoint(H))
        return real_coordinates(times_classes(H, classes_times(inputs, _adjoint(H))))

    def change_by_transfer(self, response: Complex) -> Real:
        """Return dS for a change of the response H."""
        return coordinates_with_adjoint(times_classes(response, self.driven))


@dataclass(frozen=True, eq=False, slots=True)
class TermGradients:
    """Gradient of an objective with respect to every term of the spectral matrix.

    Parameters
    ----------
    transfer
        Response at which the gradient is taken.
    noise
        Gradient with respect to `Terms.noise`, of that shape.
    log_inputs
        Gradient with respect to the logarithm of every entry of `Terms.inputs`, of that shape.
    inputs
        Gradient with respect to `Terms.inputs`, of that shape.
    driven
        Q = sum over classes S_inputs H^H W, shape (grid, inputs, coordinates).
    forced
        E = Q L, shape (grid, inputs, n).

    Notes
    -----
    With W such that d objective = sum over classes and frequencies tr(W dS), the gradient g of every term T has its
    name and shape, and d objective = Re sum(g dT). With the dH and dS of `Transfer`, and Q, E as above:

        stiffness           2 (foot^T - d^T X) E d
        mass                2 w^2 (X E)^T, summed over the frequencies
        forces              2 E^T, summed over the frequencies
        motion              -2 w^2 (X Q reduction diag(channel response))^T, summed over the frequencies
        feedthrough         2 (Q reduction diag(channel response))^T, summed over the frequencies
        channel_response    2 diag((-w^2 motion X + feedthrough) Q reduction)
        inputs              (H^H W H)^T
        noise               W^T, summed over the classes

    It costs as much as the model itself, for any number of parameters (the adjoint method).

    References
    ----------
    J. R. Magnus and H. Neudecker, Matrix Differential Calculus with Applications in Statistics and Econometrics, Wiley,
    1988, chapter 8 (differentials of the inverse and of the determinant).
    """

    transfer: Transfer
    noise: Complex
    log_inputs: Complex
    inputs: Complex
    driven: Complex
    forced: Complex

    def stiffness(self, elements: Sequence[int]) -> Complex:
        """Return the gradient with respect to the dynamic stiffness of some elements, shape (elements, grid)."""
        chosen = np.array(elements, dtype=np.intp)
        d, feet = self.transfer.terms.elongations[chosen], self.transfer.terms.feet[chosen]
        forced = (self.forced @ d.T).swapaxes(-1, -2)
        return 2 * np.sum((feet - d @ self.transfer.displacements) * forced, axis=-1).T

    @property
    def mass(self) -> Complex:
        """Gradient with respect to the mass matrix, shape (n, n)."""
        scaled = self.transfer.terms.squared[:, None, None] * self.transfer.displacements
        return 2 * np.tensordot(self.forced, scaled, axes=((0, 1), (0, 2)))

    @property
    def forces(self) -> Complex:
        """Gradient with respect to the forces of the inputs, shape (n, inputs)."""
        return 2 * self.forced.sum(axis=0).T

    @property
    def motion(self) -> Complex:
        """Gradient with respect to the channels' readings of motion, shape (channels, n)."""
        terms = self.transfer.terms
        sensed = self.transfer.displacements @ self.driven @ _reduced(terms)
        return -2 * np.einsum("f,fnk->kn", terms.squared, sensed)

    @property
    def feedthrough(self) -> Complex:
        """Gradient with respect to the channels' readings of inputs, shape (channels, inputs)."""
        return 2 * np.einsum("fuk->ku", self.driven @ _reduced(self.transfer.terms))

    @property
    def channel_response(self) -> Complex:
        """Gradient with respect to the frequency response of the channels, shape (grid, channels)."""
        terms = self.transfer.terms
        read = -terms.squared[:, None, None] * (terms.motion @ self.transfer.displacements) + terms.feedthrough
        return 2 * np.einsum("fku,fuk->fk", read, self.driven @ terms.reduction)


def transfer(terms: Terms) -> Transfer:
    """Return the response of a vehicle to its inputs.

    Parameters
    ----------
    terms
        Terms of the spectral matrix.

    Raises
    ------
    LinAlgError
        If the dynamic stiffness is singular at a frequency.

    References
    ----------
    D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd edition, Research Studies Press, 2000 (frequency
    response functions).
    """
    squared = terms.squared[:, None, None]
    dynamic = dynamic_stiffness(terms)
    drive = _summed(terms.stiffness, terms.elongations, terms.feet) + terms.forces
    reduced = _reduced(terms)
    rows = reduced @ terms.motion
    flexibility = np.asarray(np.linalg.inv(dynamic), dtype=np.complex128)
    displacements = np.asarray(flexibility @ drive, dtype=np.complex128)
    H = -squared * (rows @ displacements) + reduced @ terms.feedthrough
    return Transfer(
        terms=terms,
        displacements=displacements,
        force_response=-squared * (rows @ flexibility),
        matrix=H,
        driven=_driven(terms, _adjoint(H)),
    )


def dynamic_stiffness(terms: Terms) -> Complex:
    """Return the forces on the coordinates for their motion [N/m], shape (grid, n, n)."""
    elastic = _summed(terms.stiffness, terms.elongations, terms.elongations)
    return np.asarray(elastic - terms.squared[:, None, None] * terms.mass + terms.rolling, dtype=np.complex128)


def term_gradients(response: Transfer, weight: Complex) -> TermGradients:
    """Return the gradient of an objective with respect to every term of the spectral matrix.

    Parameters
    ----------
    response
        Response of the vehicle to its inputs.
    weight
        W with d objective = sum tr(W dS), Hermitian, shape (classes, grid, coordinates, coordinates).

    References
    ----------
    J. R. Magnus and H. Neudecker, Matrix Differential Calculus with Applications in Statistics and Econometrics, Wiley,
    1988, chapter 8 (differentials of the inverse and of the determinant).
    """
    H = response.matrix[..., : response.terms.inputs.shape[-1]]
    inputs = np.asfortranarray(classes_times(times_classes(_adjoint(H), weight), H).swapaxes(-1, -2))
    driven = sum_of_products(response.driven, weight)
    return TermGradients(
        transfer=response,
        noise=weight.sum(axis=0).swapaxes(-1, -2),
        log_inputs=inputs * response.terms.inputs,
        inputs=inputs,
        driven=driven,
        forced=driven @ response.force_response,
    )


def _summed(stiffness: Complex, left: Real, right: Real) -> Complex:
    """Sum over the elements of stiffness times left right^T, shape (grid, columns of `left`, columns of `right`)."""
    products = (left[:, :, None] * right[:, None, :]).reshape(len(left), -1)
    summed = stiffness.real.T @ products + 1j * (stiffness.imag.T @ products)  # twice as fast as complex products
    return summed.reshape(-1, left.shape[1], right.shape[1])


def _driven(terms: Terms, adjoint: Complex) -> Complex:
    """S_inputs H^H for the Hermitian transpose of H."""
    n_wheels = terms.inputs.shape[-1]
    driven = classes_times(terms.inputs, adjoint[..., :n_wheels, :])
    if not terms.measured_inputs.size:
        return driven
    return np.concatenate([driven, classes_times(terms.measured_inputs, adjoint[..., n_wheels:, :])], axis=-2)


def _reduced(terms: Terms) -> Complex:
    """Coordinates of the data for one unit of each perfect channel, shape (grid, coordinates, channels)."""
    return np.asarray(terms.channel_response[:, None, :] * terms.reduction, dtype=np.complex128)


def _adjoint(matrices: Complex) -> Complex:
    """Hermitian transpose of matrices in a stack."""
    return matrices.conj().swapaxes(-1, -2)


def times_classes(common: Complex | Real, by_class: Complex | Real) -> Complex:
    """Return the products of matrices that all classes have in common with those of each class.

    Parameters
    ----------
    common
        Shape (grid, i, j).
    by_class
        Shape (classes, grid, j, k).

    Returns
    -------
    ndarray
        Shape (classes, grid, i, k).

    Notes
    -----
    The matrices of all classes stand side by side, so that one product of usual size replaces many tiny ones. They stay
    so in memory (grid, i, classes, k), and the next product needs no copy.
    """
    classes, grid, rows, columns = by_class.shape
    side_by_side = by_class.transpose(1, 2, 0, 3).reshape(grid, rows, classes * columns)
    products = np.asarray(common @ side_by_side, dtype=np.complex128)
    return products.reshape(*products.shape[:2], classes, columns).transpose(2, 0, 1, 3)


def classes_times(by_class: Complex | Real, common: Complex | Real) -> Complex:
    """Return the products of matrices of each class, (classes, grid, i, j), with common ones, (grid, j, k).

    Returns
    -------
    ndarray
        Shape (classes, grid, i, k), in memory as in `times_classes`.
    """
    classes, grid, rows, columns = by_class.shape
    stacked = by_class.transpose(1, 2, 0, 3).reshape(grid, rows * classes, columns)
    products = np.asarray(stacked @ common, dtype=np.complex128)
    return products.reshape(products.shape[0], rows, classes, -1).transpose(2, 0, 1, 3)


def sum_of_products(left: Complex, right: Complex) -> Complex:
    """Return the sum over the classes of products of matrices of each, shape (grid, i, k)."""
    classes, grid, rows, columns = left.shape
    side_by_side = left.transpose(1, 2, 0, 3).reshape(grid, rows, classes * columns)
    stacked = right.transpose(1, 0, 2, 3).reshape(grid, classes * columns, -1)
    return side_by_side @ stacked
