"""Frequency responses of a structure."""

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Complex
from sprung._checks import frozen_array
from sprung.errors import ParameterError
from sprung.vehicles.structure import Structure


def frequency_response(structure: Structure, frequencies: ArrayLike) -> Complex:
    """Return the frequency responses of the sensors to the inputs.

    Parameters
    ----------
    structure
        Masses, elements and sensors of a vehicle.
    frequencies
        Frequencies [Hz], at least 0, shape (frequencies,).

    Returns
    -------
    ndarray
        Output over input, such as m/s^2 over m, shape (frequencies, channels, inputs).

    Raises
    ------
    ParameterError
        If a frequency is negative or not finite.

    Notes
    -----
    H(f) = C (i w I - A)^-1 B + D with w = 2 pi f.

    Examples
    --------
    >>> from sprung.vehicles import read_description, structure
    >>> quarter = structure(read_description("quarter"))
    >>> f = np.array([0.5, 13.21])
    >>> body = np.abs(frequency_response(quarter, f)[:, 0, 0]) / (2 * np.pi * f) ** 2  # over the height of the road
    >>> body.round(2).tolist()  # far below its mode, and at it
    [1.0, 4.2]
    """
    f = frozen_array("frequencies", frequencies, ndim=1)
    if not np.all(np.isfinite(f)) or np.any(f < 0):
        raise ParameterError("frequencies must be finite and at least 0: correct them")
    space = structure.state_space()
    resolvent = 2j * np.pi * f[:, None, None] * np.eye(len(space.state_matrix)) - space.state_matrix
    states = np.linalg.solve(resolvent, np.broadcast_to(space.input_matrix, (f.size, *space.input_matrix.shape)))
    return np.asarray(space.output_matrix @ states + space.feedthrough, dtype=np.complex128)
