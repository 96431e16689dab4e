"""Roughness of the right track over that of the left one as a parameter."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Real
from sprung._checks import freeze
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer


@dataclass(frozen=True, eq=False, slots=True)
class TrackLevels(ParameterBlock):
    """Level of the right track over the left one: ln of the ratio of their amplitudes.

    Parameters
    ----------
    sides
        1 for a wheel on the left, -1 on the right, shape (inputs,).
    std
        Standard deviation of the level about 0 before any data: 2.6 dB.

    Notes
    -----
    The edge of a road is rougher than its middle, and potholes are on one side. With the level p the spectral matrix of
    the inputs is S_ij exp(-p (side_i + side_j) / 2): the roughness stays the geometric mean of both tracks. Without
    it, the rougher side appears as softer tyres and stronger dampers on that side.
    """

    sides: Real
    std: float = 0.3

    group: ClassVar[str] = "tracks"

    def __post_init__(self) -> None:
        freeze(self, sides=1)

    @property
    def names(self) -> tuple[str, ...]:
        """Right over left."""
        return ("right_over_left",)

    @property
    def prior_std(self) -> Real:
        """Standard deviation of the level."""
        return np.array([self.std])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the inputs of the tracks scaled."""
        return replace(terms, inputs=terms.inputs * np.exp(parameters[0] * self._log_derivative()))

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        by_wheels = gradients.log_inputs.real.sum(axis=(0, 1))
        return np.array([np.sum(by_wheels * self._log_derivative())])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        return [response.change_by_inputs(response.terms.inputs * self._log_derivative())]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the amplitude of the right track over that of the left one."""
        return {"right_over_left": float(np.exp(parameters[0]))}

    def _log_derivative(self) -> Real:
        """Derivative of ln S_ij with respect to the level, shape (inputs, inputs)."""
        return -np.add.outer(self.sides, self.sides) / 2
