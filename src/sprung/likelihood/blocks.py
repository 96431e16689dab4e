"""Blocks of parameters: names, priors and contributions of the parts of a model."""

from collections.abc import Iterable
from typing import ClassVar, Protocol

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Structure

#: Logarithm at which a power is cut off, as good as infinite.
_LARGEST = 100.0


def powers(logarithms: Real) -> Real:
    """Return powers for their logarithms, none of them beyond what numbers hold."""
    return np.exp(np.minimum(logarithms, _LARGEST))


class ParameterBlock(Protocol):
    """Parameters of one kind, and what they contribute to the spectral matrix of a vehicle.

    Notes
    -----
    A block is a frozen value that subclasses this protocol. `contribute` adds to or multiplies terms of the model; the
    blocks of a `Model` are applied in their order, each to the result of the blocks before it. `gradient` and
    `derivatives` differentiate this in the two directions: the objective with respect to the parameters, given its
    gradient with respect to every term (`TermGradients`: g with d objective = Re sum(g dT), so that a parameter p has
    Re sum(g dT/dp)); and the spectral matrix, by the methods of `Transfer`.

    A block that multiplies a term, such as an input spectrum, takes the final term, which holds the factors of all
    blocks, from `TermGradients.log_inputs` or `Transfer.terms`.
    """

    #: Name of the kind in results, such as "components", "payload", "sensors", "inputs", "noise".
    group: ClassVar[str]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, unique in a model."""

    @property
    def start(self) -> Real:
        """Centre of the prior, shape (parameters,); 0 unless the block states another one."""
        return np.zeros(len(self.names))

    @property
    def prior_std(self) -> Real:
        """Standard deviation of the prior, shape (parameters,)."""

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms of the model with what the block contributes."""

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective, shape (parameters,)."""

    def derivatives(self, parameters: Real, response: Transfer) -> Iterable[Real]:
        """Return the derivative of the spectral matrix before the window with respect to each parameter.

        Each is in the real coordinates of Hermitian matrices (`real_coordinates`), shape (classes, grid, squared number
        of coordinates) or one that broadcasts to it.
        """

    @property
    def is_log_power(self) -> Booleans:
        """Whether a parameter is the logarithm of a spectral density: ln a added to all scales the model's spectra."""
        return np.zeros(len(self.names), dtype=np.bool_)

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the physical values by name."""
        return dict(zip(self.names, parameters.tolist(), strict=True))

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the parameters; the same object if the block does not change it."""
        return structure
